//! Canonical bytes as a sequence of typed columns, so that storage can shuffle them without knowing the artifact.
//!
//! A stream is an 8-byte head (magic, codec version, artifact tag) and columns; a column is one kind byte, its number
//! of elements as `u64`, and the elements, all little endian. Reading never allocates more than the stream holds.

/// Raised whenever the canonical bytes of equal artifacts change; part of every key.
pub const CODEC_VERSION: u16 = 2;

/// Why bytes are not an artifact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CodecError {
    /// The bytes end too early.
    #[error("the data end too early")]
    Truncated,
    /// The bytes contradict themselves.
    #[error("the data are malformed: {0}")]
    Malformed(&'static str),
    /// Written by another version of the codec.
    #[error("the data have codec version {0}, this program reads {CODEC_VERSION}")]
    Version(u16),
}

/// What a column's elements are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ColumnKind {
    Bytes,
    U32,
    F64,
}

impl ColumnKind {
    pub(super) const fn width(self) -> usize {
        match self {
            Self::Bytes => 1,
            Self::U32 => 4,
            Self::F64 => 8,
        }
    }

    const fn tag(self) -> u8 {
        match self {
            Self::Bytes => 0,
            Self::U32 => 1,
            Self::F64 => 2,
        }
    }

    fn from_tag(tag: u8) -> Option<Self> {
        match tag {
            0 => Some(Self::Bytes),
            1 => Some(Self::U32),
            2 => Some(Self::F64),
            _ => None,
        }
    }
}

/// Length of the head of a stream.
pub(super) const HEAD: usize = 8;
/// Length of the head of a column.
const COLUMN_HEAD: usize = 9;

/// Appends columns.
pub(super) struct ColumnWriter {
    bytes: Vec<u8>,
}

impl ColumnWriter {
    pub(super) fn new(head: [u8; HEAD], capacity: usize) -> Self {
        let mut bytes = Vec::with_capacity(HEAD + capacity);
        bytes.extend_from_slice(&head);
        Self { bytes }
    }

    pub(super) fn finish(self) -> Vec<u8> {
        self.bytes
    }

    fn head(&mut self, kind: ColumnKind, len: usize) {
        self.bytes.push(kind.tag());
        self.bytes.extend_from_slice(&(len as u64).to_le_bytes());
    }

    pub(super) fn bytes(&mut self, items: &[u8]) {
        self.head(ColumnKind::Bytes, items.len());
        self.bytes.extend_from_slice(items);
    }

    pub(super) fn u32s(&mut self, items: impl Iterator<Item = u32>) {
        self.patched(ColumnKind::U32, |bytes| items.for_each(|item| bytes.extend_from_slice(&item.to_le_bytes())));
    }

    pub(super) fn f64s(&mut self, items: impl Iterator<Item = f64>) {
        self.patched(ColumnKind::F64, |bytes| items.for_each(|item| bytes.extend_from_slice(&item.to_le_bytes())));
    }

    pub(super) fn text(&mut self, text: &str) {
        self.bytes(text.as_bytes());
    }

    /// A single count or tag.
    pub(super) fn number(&mut self, number: u64) {
        self.bytes(&number.to_le_bytes());
    }

    /// Writes a column whose length is known only after its elements.
    fn patched(&mut self, kind: ColumnKind, write: impl FnOnce(&mut Vec<u8>)) {
        self.head(kind, 0);
        let start = self.bytes.len();
        write(&mut self.bytes);
        let len = ((self.bytes.len() - start) / kind.width()) as u64;
        self.bytes[start - 8..start].copy_from_slice(&len.to_le_bytes());
    }
}

/// Reads columns in the order they were written.
pub(super) struct ColumnReader<'a> {
    rest: &'a [u8],
}

impl<'a> ColumnReader<'a> {
    /// A reader of what follows the stream's head.
    pub(super) fn new(rest: &'a [u8]) -> Self {
        Self { rest }
    }

    /// The next column of any kind, or `None` at the end.
    pub(super) fn next_column(&mut self) -> Result<Option<(ColumnKind, &'a [u8])>, CodecError> {
        if self.rest.is_empty() {
            return Ok(None);
        }
        let (head, rest) = self.rest.split_at_checked(COLUMN_HEAD).ok_or(CodecError::Truncated)?;
        let kind = ColumnKind::from_tag(head[0]).ok_or(CodecError::Malformed("unknown column kind"))?;
        let mut len = [0; 8];
        len.copy_from_slice(&head[1..]);
        let bytes = usize::try_from(u64::from_le_bytes(len))
            .ok()
            .and_then(|len| len.checked_mul(kind.width()))
            .ok_or(CodecError::Truncated)?;
        let (payload, rest) = rest.split_at_checked(bytes).ok_or(CodecError::Truncated)?;
        self.rest = rest;
        Ok(Some((kind, payload)))
    }

    fn expect(&mut self, expected: ColumnKind) -> Result<&'a [u8], CodecError> {
        match self.next_column()? {
            Some((kind, payload)) if kind == expected => Ok(payload),
            Some(_) => Err(CodecError::Malformed("a column of another kind was expected")),
            None => Err(CodecError::Truncated),
        }
    }

    pub(super) fn bytes(&mut self) -> Result<&'a [u8], CodecError> {
        self.expect(ColumnKind::Bytes)
    }

    pub(super) fn u32s(&mut self) -> Result<impl ExactSizeIterator<Item = u32> + use<'a>, CodecError> {
        let (items, _) = self.expect(ColumnKind::U32)?.as_chunks::<4>();
        Ok(items.iter().map(|item| u32::from_le_bytes(*item)))
    }

    pub(super) fn f64s(&mut self) -> Result<impl ExactSizeIterator<Item = f64> + use<'a>, CodecError> {
        let (items, _) = self.expect(ColumnKind::F64)?.as_chunks::<8>();
        Ok(items.iter().map(|item| f64::from_le_bytes(*item)))
    }

    pub(super) fn text(&mut self) -> Result<String, CodecError> {
        let bytes = self.bytes()?;
        String::from_utf8(bytes.to_vec()).map_err(|_| CodecError::Malformed("a name is not UTF-8"))
    }

    pub(super) fn number(&mut self) -> Result<u64, CodecError> {
        let bytes: [u8; 8] = self.bytes()?.try_into().map_err(|_| CodecError::Malformed("a number has 8 bytes"))?;
        Ok(u64::from_le_bytes(bytes))
    }

    /// Fails when something follows the last column read.
    pub(super) fn end(&self) -> Result<(), CodecError> {
        if self.rest.is_empty() { Ok(()) } else { Err(CodecError::Malformed("bytes follow the last column")) }
    }
}
