//! Words and numbers of text formats: a scanner over bytes that knows its line, and the way floats are written.
//!
//! Files are bytes, not UTF-8: only words that are numbers or names are ever decoded. A line ends with LF, CR LF or
//! a lone CR. Numbers are correctly rounded on reading and shortest round trip on writing, so that text loses nothing.

use super::error::{FormatError, Place, Reason};

/// Walks over a text file word by word.
#[derive(Clone, Debug)]
pub(super) struct Scanner<'a> {
    bytes: &'a [u8],
    at: usize,
    line: u64,
    comment: Option<u8>,
    continuation: bool,
}

impl<'a> Scanner<'a> {
    /// A scanner at the first line of `bytes`.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, line: 1, comment: None, continuation: false }
    }

    /// Takes everything from `mark` to the end of its line as a comment.
    pub(super) fn with_comments(mut self, mark: u8) -> Self {
        self.comment = Some(mark);
        self
    }

    /// Takes comments as text from here on.
    pub(super) fn without_comments(mut self) -> Self {
        self.comment = None;
        self
    }

    /// Takes a backslash before the end of a line as a blank.
    pub(super) fn with_continuation(mut self) -> Self {
        self.continuation = true;
        self
    }

    /// The place of the last word.
    pub(super) fn place(&self) -> Place {
        Place::Line(self.line)
    }

    /// How many bytes were read.
    pub(super) fn offset(&self) -> usize {
        self.at
    }

    /// How many bytes are left.
    pub(super) fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// The next word on this line.
    #[inline]
    pub(super) fn word_on_line(&mut self) -> Option<&'a [u8]> {
        self.skip_blanks();
        let start = self.at;
        while self.at < self.bytes.len() && !self.bytes[self.at].is_ascii_whitespace() {
            if self.continuation && self.at > start && self.continues() {
                break;
            }
            self.at += 1;
        }
        (self.at > start).then(|| &self.bytes[start..self.at])
    }

    /// The next word, on this line or a later one.
    #[inline]
    pub(super) fn word(&mut self) -> Option<&'a [u8]> {
        loop {
            if let Some(word) = self.word_on_line() {
                return Some(word);
            }
            if !self.next_line() {
                return None;
            }
        }
    }

    /// Goes before the next word, on this line or a later one; `false` when there is none.
    pub(super) fn go_to_word(&mut self) -> bool {
        loop {
            self.skip_blanks();
            match self.bytes.get(self.at) {
                None => return false,
                Some(b'\n' | b'\r') => self.line_end(),
                Some(_) => return true,
            }
        }
    }

    /// The rest of this line without blanks round it; the scanner stays before the line's end.
    pub(super) fn rest_of_line(&mut self) -> &'a [u8] {
        let start = self.at;
        while self.at < self.bytes.len() && !matches!(self.bytes[self.at], b'\n' | b'\r') {
            self.at += 1;
        }
        self.bytes[start..self.at].trim_ascii()
    }

    /// The rest of this line as it stands, for formats where columns count.
    pub(super) fn raw_rest_of_line(&mut self) -> &'a [u8] {
        let start = self.at;
        self.rest_of_line();
        &self.bytes[start..self.at]
    }

    /// Whether nothing is left.
    pub(super) fn is_at_end(&self) -> bool {
        self.at == self.bytes.len()
    }

    /// Goes to the next line; `false` when there is none.
    #[inline]
    pub(super) fn next_line(&mut self) -> bool {
        while self.at < self.bytes.len() {
            if self.continuation && self.continues() {
                self.skip_continuation();
            } else if matches!(self.bytes[self.at], b'\n' | b'\r') {
                self.line_end();
                return true;
            } else {
                self.at += 1;
            }
        }
        false
    }

    /// An integer on this line or a later one.
    #[inline]
    pub(super) fn integer(&mut self, what: &'static str) -> Result<i64, FormatError> {
        match self.word() {
            Some(word) => parse_integer(word, what, self.place()),
            None => Err(FormatError::new(self.place(), Reason::Truncated { within: what })),
        }
    }

    /// A finite number on this line; `within` is what a line without one ends in.
    pub(super) fn number_on_line(&mut self, what: &'static str, within: &'static str) -> Result<f64, FormatError> {
        let word = self.word_on_line().ok_or_else(|| FormatError::new(self.place(), Reason::TooFew { within }))?;
        parse_number(word, what, self.place())
    }

    /// A count on this line or a later one, each of which takes at least `bytes_each` bytes of what is left.
    pub(super) fn count(&mut self, what: &'static str, bytes_each: usize) -> Result<usize, FormatError> {
        let count = self.integer(what)?;
        let room = (self.left() + 1) / bytes_each.max(1);
        claim(count, room, what, self.place())
    }

    fn skip_blanks(&mut self) {
        while self.at < self.bytes.len() {
            match self.bytes[self.at] {
                b' ' | b'\t' | 0x0b | 0x0c => self.at += 1,
                b'\\' if self.continuation && self.continues() => self.skip_continuation(),
                byte if Some(byte) == self.comment => {
                    self.rest_of_line();
                }
                _ => return,
            }
        }
    }

    fn continues(&self) -> bool {
        self.bytes[self.at] == b'\\' && matches!(self.bytes.get(self.at + 1), Some(b'\n' | b'\r'))
    }

    fn skip_continuation(&mut self) {
        self.at += 1;
        self.line_end();
    }

    fn line_end(&mut self) {
        let crlf = self.bytes[self.at] == b'\r' && self.bytes.get(self.at + 1) == Some(&b'\n');
        self.at += if crlf { 2 } else { 1 };
        self.line += 1;
    }
}

/// Whether a file is text of 16 bits a letter: by its mark, or since every second byte of its beginning is zero.
pub(super) fn is_utf16(bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(64)];
    let zero_at = |odd: usize| {
        start.len() > 8
            && start.iter().enumerate().all(|(i, &b)| (b == 0) == (i % 2 == odd))
            && start.len().is_multiple_of(2)
    };
    bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") || zero_at(0) || zero_at(1)
}

/// The bytes after a mark of UTF-8 at their beginning, which some editors write.
pub(super) fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// `count` as a size, when it is not negative and at most `room`.
pub(super) fn claim(count: i64, room: usize, what: &'static str, place: Place) -> Result<usize, FormatError> {
    match usize::try_from(count) {
        Ok(size) if size <= room => Ok(size),
        Ok(_) => Err(FormatError::new(place, Reason::Untrue { what, count: count.unsigned_abs(), room: room as u64 })
            .with_remedy("the file is cut off or damaged: export it again")),
        Err(_) => Err(FormatError::unexpected(place, "a count of at least 0", count.to_string().as_bytes())),
    }
}

/// A finite number; `what` names it in messages. Fortran's `D` exponents are understood.
#[inline]
pub(super) fn parse_number(word: &[u8], what: &'static str, place: Place) -> Result<f64, FormatError> {
    let parsed = std::str::from_utf8(word).ok().and_then(|text| {
        let direct = text.parse::<f64>();
        direct
            .or_else(|error| {
                if text.bytes().any(|b| matches!(b, b'd' | b'D')) {
                    text.replace(['d', 'D'], "e").parse()
                } else {
                    Err(error)
                }
            })
            .ok()
    });
    match parsed {
        Some(value) if value.is_finite() => Ok(value),
        Some(_) => Err(not_finite(what, word, place)),
        None if looks_not_finite(word) => Err(not_finite(what, word, place)),
        None if has_comma(word) => Err(FormatError::unexpected(place, what, word)
            .with_remedy("this is a decimal comma: export the file with decimal points")),
        None => Err(FormatError::unexpected(place, what, word)),
    }
}

/// An integer; one written as a float (`3.0`) is taken too, as some exporters do.
#[inline]
pub(super) fn parse_integer(word: &[u8], what: &'static str, place: Place) -> Result<i64, FormatError> {
    let text = std::str::from_utf8(word).ok();
    if let Some(value) = text.and_then(|t| t.parse::<i64>().ok()) {
        return Ok(value);
    }
    match text.and_then(|t| t.parse::<f64>().ok()) {
        Some(value) if value.fract() == 0.0 && value.abs() < 9e15 => Ok(value as i64),
        _ => Err(FormatError::unexpected(place, what, word)),
    }
}

/// Whether it is a number but for a decimal comma.
fn has_comma(word: &[u8]) -> bool {
    let text = std::str::from_utf8(word).unwrap_or_default();
    text.matches(',').count() == 1 && text.replace(',', ".").parse::<f64>().is_ok()
}

/// Microsoft's runtime writes `-1.#IND` and the like.
fn looks_not_finite(word: &[u8]) -> bool {
    word.windows(2).any(|pair| pair == b".#") || word.to_ascii_lowercase().starts_with(b"-nan")
}

fn not_finite(what: &'static str, word: &[u8], place: Place) -> FormatError {
    FormatError::new(place, Reason::NotFinite { what, found: super::error::excerpt(word) })
        .with_remedy("the program that wrote the file computed a wrong number: export it again")
}

/// Appends `value`: the shortest text that reads back as the same number, or rounded to `precision` significant digits.
pub(super) fn push_number(out: &mut Vec<u8>, value: f64, precision: Option<usize>) {
    use std::io::Write;
    let value = match precision {
        Some(digits) => format!("{:.*e}", digits.clamp(1, 17) - 1, value).parse().unwrap_or(value),
        None => value,
    };
    let size = value.abs();
    let written =
        if size != 0.0 && !(1e-5..1e16).contains(&size) { write!(out, "{value:e}") } else { write!(out, "{value}") };
    debug_assert!(written.is_ok(), "writing to memory does not fail");
}

/// Appends an integer.
pub(super) fn push_integer(out: &mut Vec<u8>, value: u64) {
    use std::io::Write;
    let written = write!(out, "{value}");
    debug_assert!(written.is_ok(), "writing to memory does not fail");
}

/// Appends a group name. Control characters, and blanks where a blank would end the name, become `_`.
pub(super) fn push_name(out: &mut Vec<u8>, name: &str, one_word: bool) {
    let mut buffer = [0; 4];
    for letter in name.chars() {
        let breaks = letter.is_control() || (one_word && letter.is_whitespace());
        out.extend_from_slice(if breaks { '_' } else { letter }.encode_utf8(&mut buffer).as_bytes());
    }
}
