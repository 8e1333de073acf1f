//! Words and numbers of files that are text with sections that may be binary: Gmsh and legacy VTK.

use super::binary::{ByteOrder, ByteReader, finite};
use super::error::{FormatError, Place, Reason};
use super::text::{claim, parse_integer, parse_number};

/// Walks over the file.
#[derive(Clone, Debug)]
pub(super) struct Input<'a> {
    bytes: &'a [u8],
    at: usize,
    line: u64,
    /// The byte order of a binary file, `None` of a text file.
    pub(super) order: Option<ByteOrder>,
}

impl<'a> Input<'a> {
    /// At the beginning of `bytes`, as text.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, line: 1, order: None }
    }

    /// The place of the next word or number.
    pub(super) fn place(&self) -> Place {
        match self.order {
            None => Place::Line(self.line),
            Some(_) => Place::Byte(self.at as u64),
        }
    }

    /// The next word of text.
    pub(super) fn word(&mut self) -> Option<&'a [u8]> {
        while let Some(byte) = self.bytes.get(self.at).filter(|b| b.is_ascii_whitespace()) {
            self.line += u64::from(*byte == b'\n');
            self.at += 1;
        }
        let start = self.at;
        self.at += self.bytes[start..].iter().take_while(|b| !b.is_ascii_whitespace()).count();
        (self.at > start).then(|| &self.bytes[start..self.at])
    }

    /// The next word, or an error that the file ends.
    pub(super) fn need_word(&mut self, within: &'static str) -> Result<&'a [u8], FormatError> {
        self.word().ok_or_else(|| FormatError::new(self.place(), Reason::Truncated { within }))
    }

    /// An integer in text, also in a binary file.
    pub(super) fn text_integer(&mut self, what: &'static str) -> Result<i64, FormatError> {
        let word = self.need_word(what)?;
        parse_integer(word, what, self.place())
    }

    /// A number in text, also in a binary file.
    pub(super) fn text_number(&mut self, what: &'static str) -> Result<f64, FormatError> {
        let word = self.need_word(what)?;
        parse_number(word, what, self.place())
    }

    /// A name in quotes; text without quotes is taken to the end of the line.
    pub(super) fn quoted(&mut self) -> String {
        let name = self.rest_of_line();
        let inner = name.strip_prefix(b"\"").map(|n| n.strip_suffix(b"\"").unwrap_or(n));
        String::from_utf8_lossy(inner.unwrap_or(name)).into_owned()
    }

    /// Ends a line of text, so that binary data may follow: blanks belong to the line only when it ends after them.
    pub(super) fn end_line(&mut self) {
        let blanks = self.bytes[self.at..].iter().take_while(|&&b| matches!(b, b' ' | b'\t')).count();
        if !matches!(self.bytes.get(self.at + blanks), Some(b'\r' | b'\n')) {
            return;
        }
        self.at += blanks;
        for end in [b'\r', b'\n'] {
            if self.bytes.get(self.at) == Some(&end) {
                self.at += 1;
                self.line += u64::from(end == b'\n');
            }
        }
    }

    /// The rest of the line without blanks round it.
    pub(super) fn rest_of_line(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        let line = &rest[..rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len())];
        self.at += line.len();
        line.trim_ascii()
    }

    /// The next `count` bytes of binary data.
    pub(super) fn take(&mut self, count: usize, within: &'static str) -> Result<&'a [u8], FormatError> {
        self.binary(ByteOrder::Big, |r| r.take(count, within))
    }

    /// Goes behind `mark`; `false` when it does not come.
    pub(super) fn skip_behind(&mut self, mark: &[u8]) -> bool {
        let rest = &self.bytes[self.at..];
        let Some(found) = rest.windows(mark.len()).position(|w| w == mark) else { return false };
        self.line += rest[..found].iter().map(|&b| u64::from(b == b'\n')).sum::<u64>();
        self.at += found + mark.len();
        true
    }

    fn binary<T>(
        &mut self,
        order: ByteOrder,
        take: impl FnOnce(&mut ByteReader<'a>) -> Result<T, FormatError>,
    ) -> Result<T, FormatError> {
        let mut reader = ByteReader::new(self.bytes, self.at, order);
        let taken = take(&mut reader)?;
        self.at = reader.offset();
        Ok(taken)
    }

    /// An integer of 32 bits.
    pub(super) fn int(&mut self, what: &'static str) -> Result<i64, FormatError> {
        match self.order {
            None => self.text_integer(what),
            Some(order) => self.binary(order, |r| r.i32(what).map(i64::from)),
        }
    }

    /// An unsigned integer of 64 bits.
    pub(super) fn size(&mut self, what: &'static str) -> Result<i64, FormatError> {
        let place = self.place();
        let value = match self.order {
            None => self.text_integer(what)?,
            Some(order) => self.binary(order, |r| r.i64(what))?,
        };
        if value < 0 {
            return Err(FormatError::unexpected(place, what, value.to_string().as_bytes()));
        }
        Ok(value)
    }

    /// A finite number.
    pub(super) fn float(&mut self, what: &'static str) -> Result<f64, FormatError> {
        let place = self.place();
        match self.order {
            None => self.text_number(what),
            Some(order) => finite(self.binary(order, |r| r.f64(what))?, what, place),
        }
    }

    /// A number that may be infinite or NaN and is not used.
    pub(super) fn any_float(&mut self, what: &'static str) -> Result<(), FormatError> {
        match self.order {
            None => self.need_word(what).map(|_| ()),
            Some(order) => self.binary(order, |r| r.f64(what)).map(|_| ()),
        }
    }

    /// `count` as a size: each item takes at least `text` or `binary` bytes of what is left.
    pub(super) fn claim(
        &self,
        count: i64,
        text: usize,
        binary: usize,
        what: &'static str,
    ) -> Result<usize, FormatError> {
        let each = if self.order.is_some() { binary } else { text };
        claim(count, (self.bytes.len() - self.at + 1) / each, what, self.place())
    }
}
