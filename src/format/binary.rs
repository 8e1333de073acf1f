//! Numbers of binary formats: a bounds-checked reader in either byte order.

use glam::DVec3;

use super::error::{FormatError, Place, Reason};

/// The order of the bytes in a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ByteOrder {
    /// Least significant byte first.
    Little,
    /// Most significant byte first.
    Big,
}

/// The type of a number in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    /// Bytes in a binary file.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// Whether it is a floating-point number.
    pub(super) fn is_float(self) -> bool {
        matches!(self, Self::F32 | Self::F64)
    }
}

/// Walks over binary data; every read is checked.
#[derive(Clone, Debug)]
pub(super) struct ByteReader<'a> {
    bytes: &'a [u8],
    at: usize,
    order: ByteOrder,
}

macro_rules! read_numbers {
    ($($name:ident: $type:ty),*) => {$(
        #[doc = concat!("The next `", stringify!($type), "`; `within` says what the file ends in when it does.")]
        #[inline]
        pub(super) fn $name(&mut self, within: &'static str) -> Result<$type, FormatError> {
            let raw = self.array(within)?;
            Ok(match self.order {
                ByteOrder::Little => <$type>::from_le_bytes(raw),
                ByteOrder::Big => <$type>::from_be_bytes(raw),
            })
        }
    )*};
}

impl<'a> ByteReader<'a> {
    /// A reader of `bytes` that begins at offset `at`.
    pub(super) fn new(bytes: &'a [u8], at: usize, order: ByteOrder) -> Self {
        Self { bytes, at: at.min(bytes.len()), order }
    }

    /// The offset of the next byte.
    pub(super) fn offset(&self) -> usize {
        self.at
    }

    /// The place of the next byte.
    pub(super) fn place(&self) -> Place {
        Place::Byte(self.at as u64)
    }

    /// How many bytes are left.
    pub(super) fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// The next `count` bytes.
    #[inline]
    pub(super) fn take(&mut self, count: usize, within: &'static str) -> Result<&'a [u8], FormatError> {
        if count > self.left() {
            return Err(FormatError::new(Place::Byte(self.bytes.len() as u64), Reason::Truncated { within }));
        }
        let taken = &self.bytes[self.at..self.at + count];
        self.at += count;
        Ok(taken)
    }

    /// `count` when that many items of at least `bytes_each` bytes fit into what is left.
    pub(super) fn claim(&self, count: u64, bytes_each: usize, what: &'static str) -> Result<usize, FormatError> {
        let count = i64::try_from(count).unwrap_or(i64::MAX);
        super::text::claim(count, self.left() / bytes_each.max(1), what, self.place())
    }

    #[inline]
    fn array<const N: usize>(&mut self, within: &'static str) -> Result<[u8; N], FormatError> {
        let taken = self.take(N, within)?;
        let mut raw = [0; N];
        raw.copy_from_slice(taken);
        Ok(raw)
    }

    read_numbers!(u8: u8, i8: i8, u16: u16, i16: i16, u32: u32, i32: i32, u64: u64, i64: i64, f32: f32, f64: f64);
}

/// Refuses NaN and infinity.
#[inline]
pub(super) fn finite(value: f64, what: &'static str, place: Place) -> Result<f64, FormatError> {
    if value.is_finite() {
        return Ok(value);
    }
    Err(FormatError::new(place, Reason::NotFinite { what, found: value.to_string() })
        .with_remedy("the file is damaged, or the program that wrote it computed a wrong number: export it again"))
}
/// Whether corners that differ still do so in 32 bits; a part far from the origin collapses there.
pub(super) fn check_single(corners: [DVec3; 3]) -> Result<(), FormatError> {
    let narrow = corners.map(DVec3::as_vec3);
    let collapses = |i: usize, j: usize| narrow[i] == narrow[j] && corners[i] != corners[j];
    if !(collapses(0, 1) || collapses(1, 2) || collapses(2, 0)) {
        return Ok(());
    }
    let reason = Reason::Collapses { at: corners[0].to_string() };
    Err(FormatError::new(Place::File, reason)
        .with_remedy("move the part to the origin, or write text or another format"))
}
