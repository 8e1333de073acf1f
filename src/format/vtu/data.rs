//! The numbers of a `DataArray` element: text, base64 or raw, plain or in zlib or LZ4 blocks, in the file's byte order.
//!
//! A binary array begins with a head of 32- or 64-bit numbers: its size in bytes, or for compressed data the number of
//! blocks, the size of a block, the size of the last block (0: it is whole), and the compressed size of each. In
//! base64 the head may be padded on its own or run into the data; the reader takes both.
//!
//! What an array may hold is bounded before anything is allocated: by the bytes that are there, and where packed by a
//! budget of 256 times the file (at least 64 MB) over all its arrays, block by block.

use std::io::Read;

use flate2::read::ZlibDecoder;
use roxmltree::Node;

use super::super::binary::{ByteOrder, ByteReader, Scalar};
use super::super::error::{FormatError, Place, Reason};
use super::super::vtk::model::{Array, Values};

/// Data after the XML tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Appended {
    /// Where it begins, after the underscore.
    pub(super) start: usize,
    /// Whether it is base64; else it is raw.
    pub(super) base64: bool,
}

/// How this file encodes its arrays.
#[derive(Debug)]
pub(super) struct Encoding<'a> {
    /// Order of the bytes in a number.
    pub(super) order: ByteOrder,
    /// Whether numbers in heads have 64 bits.
    pub(super) wide_heads: bool,
    /// How the blocks of binary data are packed, where they are.
    pub(super) packing: Option<Packing>,
    /// The whole file.
    pub(super) bytes: &'a [u8],
    /// Appended data, where there is some.
    pub(super) appended: Option<Appended>,
    /// How many bytes decompression may still give.
    pub(super) budget: u64,
}

/// The compressors whose blocks can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Packing {
    Zlib,
    Lz4,
}

impl Packing {
    /// Appends the unpacked block, if it is whole and has exactly `unpacked` bytes.
    fn unpack(self, packed: &[u8], unpacked: u64, all: &mut Vec<u8>) -> Option<()> {
        let before = all.len();
        match self {
            Self::Zlib => {
                ZlibDecoder::new(packed).take(unpacked).read_to_end(all).ok()?;
            }
            Self::Lz4 => all.extend(lz4_flex::block::decompress(packed, usize::try_from(unpacked).ok()?).ok()?),
        }
        ((all.len() - before) as u64 == unpacked).then_some(())
    }
}

/// The type that an attribute calls `name`.
fn scalar_named(name: &str) -> Option<Scalar> {
    Some(match name {
        "Int8" => Scalar::I8,
        "UInt8" => Scalar::U8,
        "Int16" => Scalar::I16,
        "UInt16" => Scalar::U16,
        "Int32" => Scalar::I32,
        "UInt32" => Scalar::U32,
        "Int64" => Scalar::I64,
        "UInt64" => Scalar::U64,
        "Float32" => Scalar::F32,
        "Float64" => Scalar::F64,
        _ => return None,
    })
}

/// Binary data, which ends at `end` bytes of the file.
enum Source<'a> {
    Raw(ByteReader<'a>),
    Base64(Base64<'a>),
}

impl Source<'_> {
    fn take(&mut self, count: u64) -> Result<Vec<u8>, FormatError> {
        match self {
            Self::Raw(reader) => {
                let count = reader.claim(count, 1, "bytes of an array")?;
                Ok(reader.take(count, "an array")?.to_vec())
            }
            Self::Base64(reader) => reader.take(count),
        }
    }

    fn place(&self) -> Place {
        match self {
            Self::Raw(reader) => reader.place(),
            Self::Base64(reader) => Place::Byte(reader.at as u64),
        }
    }
}

impl<'a> Encoding<'a> {
    /// The array that `node` describes; `None` when its type is text or unknown.
    pub(super) fn array(&mut self, node: Node<'_, '_>) -> Result<Option<Array>, FormatError> {
        let Some(number) = node.attribute("type").and_then(scalar_named) else { return Ok(None) };
        let place = Place::Byte(node.range().start as u64);
        let components = match node.attribute("NumberOfComponents") {
            None | Some("") => 1,
            Some(text) => match text.trim().parse::<usize>() {
                // Older writers say 0 for a plain array.
                Ok(count) if count <= 1 << 16 => count.max(1),
                _ => return Err(FormatError::unexpected(place, "a number of components", text.as_bytes())),
            },
        };
        let name = node.attribute("Name").unwrap_or("").to_owned();
        let values = match node.attribute("format").unwrap_or("ascii") {
            "ascii" => self.text(node, number)?,
            "binary" => {
                let (at, text) = node
                    .children()
                    .find(Node::is_text)
                    .map_or((node.range().end, ""), |t| (t.range().start, t.text().unwrap_or("")));
                self.binary(Source::Base64(Base64::new(text.as_bytes(), 0, at)), number)?
            }
            "appended" => {
                let source = self.appended_source(node, place)?;
                self.binary(source, number)?
            }
            other => return Err(FormatError::unexpected(place, "ascii, binary or appended", other.as_bytes())),
        };
        Ok(Some(Array { name, components, values }))
    }

    fn appended_source(&self, node: Node<'_, '_>, place: Place) -> Result<Source<'a>, FormatError> {
        let text = node.attribute("offset").unwrap_or("");
        let offset: usize =
            text.trim().parse().map_err(|_| FormatError::unexpected(place, "an offset", text.as_bytes()))?;
        let Some(Appended { start, base64 }) = self.appended else {
            return Err(FormatError::new(place, Reason::Nothing("appended data")));
        };
        let at = start.saturating_add(offset);
        if at > self.bytes.len() {
            let (index, count) = (offset as i64, (self.bytes.len() - start) as u64);
            return Err(FormatError::new(place, Reason::OutOfRange { what: "offset", index, count }));
        }
        Ok(if base64 {
            Source::Base64(Base64::new(self.bytes, at, 0))
        } else {
            Source::Raw(ByteReader::new(self.bytes, at, self.order))
        })
    }

    fn text(&self, node: Node<'_, '_>, number: Scalar) -> Result<Values, FormatError> {
        let (mut ints, mut floats) = (Vec::new(), Vec::new());
        for child in node.children().filter(Node::is_text) {
            let text = child.text().unwrap_or("");
            for word in text.split_ascii_whitespace() {
                let read = if number.is_float() {
                    word.parse().map(|v| floats.push(v)).is_ok()
                } else {
                    word.parse().map(|v| ints.push(v)).is_ok()
                };
                if !read {
                    let at = child.range().start + (word.as_ptr() as usize - text.as_ptr() as usize);
                    let lines = self.bytes[..at.min(self.bytes.len())].split(|&b| b == b'\n').count();
                    return Err(FormatError::unexpected(Place::Line(lines as u64), "a number", word.as_bytes()));
                }
            }
        }
        Ok(if number.is_float() { Values::Float(floats) } else { Values::Int(ints) })
    }

    fn binary(&mut self, mut source: Source<'_>, number: Scalar) -> Result<Values, FormatError> {
        let place = source.place();
        if source.is_blank() {
            return decode(&[], number, self.order, place);
        }
        let bytes = if let Some(packing) = self.packing {
            self.inflate(packing, &mut source)?
        } else {
            let size = self.heads(&mut source, 1)?[0];
            source.take(size)?
        };
        decode(&bytes, number, self.order, place)
    }

    fn heads(&self, source: &mut Source<'_>, count: u64) -> Result<Vec<u64>, FormatError> {
        let width = if self.wide_heads { 8 } else { 4 };
        let bytes = source.take(count.saturating_mul(width))?;
        let mut reader = ByteReader::new(&bytes, 0, self.order);
        let mut next = || if width == 8 { reader.u64("a head") } else { reader.u32("a head").map(u64::from) };
        (0..count).map(|_| next()).collect()
    }

    fn inflate(&mut self, packing: Packing, source: &mut Source<'_>) -> Result<Vec<u8>, FormatError> {
        let place = source.place();
        let fixed = self.heads(source, 3)?;
        let [blocks, size, last] = [fixed[0], fixed[1], fixed[2]];
        let sizes = self.heads(source, blocks)?;
        let mut all = Vec::new();
        for (i, &packed) in sizes.iter().enumerate() {
            let unpacked = if i + 1 == sizes.len() && last != 0 { last } else { size };
            if unpacked > self.budget {
                let (what, room) = ("bytes of a compressed block", self.budget);
                return Err(FormatError::new(place, Reason::Untrue { what, count: unpacked, room })
                    .with_remedy("the file is damaged, or packed more tightly than any mesh: write it uncompressed"));
            }
            self.budget -= unpacked;
            let at = source.place();
            let packed = source.take(packed)?;
            let whole = packing.unpack(&packed, unpacked, &mut all);
            whole.ok_or_else(|| FormatError::new(at, Reason::Truncated { within: "a compressed block" }))?;
        }
        Ok(all)
    }
}

impl Source<'_> {
    fn is_blank(&self) -> bool {
        match self {
            Self::Raw(_) => false,
            Self::Base64(reader) => reader.text[reader.at - reader.shift..].trim_ascii().is_empty(),
        }
    }
}

fn decode(bytes: &[u8], number: Scalar, order: ByteOrder, place: Place) -> Result<Values, FormatError> {
    macro_rules! numbers {
        ($kind:ty, $value:ty) => {
            bytes
                .chunks_exact(size_of::<$kind>())
                .map(|chunk| {
                    let mut raw = [0; size_of::<$kind>()];
                    raw.copy_from_slice(chunk);
                    <$value>::from(match order {
                        ByteOrder::Little => <$kind>::from_le_bytes(raw),
                        ByteOrder::Big => <$kind>::from_be_bytes(raw),
                    })
                })
                .collect()
        };
    }
    Ok(match number {
        Scalar::U8 => Values::Bytes(bytes.to_vec()),
        Scalar::I8 => Values::Int(numbers!(i8, i64)),
        Scalar::I16 => Values::Int(numbers!(i16, i64)),
        Scalar::U16 => Values::Int(numbers!(u16, i64)),
        Scalar::I32 => Values::Int(numbers!(i32, i64)),
        Scalar::U32 => Values::Int(numbers!(u32, i64)),
        Scalar::I64 => Values::Int(numbers!(i64, i64)),
        Scalar::F32 => Values::Float(numbers!(f32, f64)),
        Scalar::F64 => Values::Float(numbers!(f64, f64)),
        Scalar::U64 => {
            let wide: Vec<u64> = numbers!(u64, u64);
            let fit: Result<Vec<i64>, _> = wide.into_iter().map(i64::try_from).collect();
            let large = |_| FormatError::unexpected(place, "an integer below 2^63", b"a larger one");
            Values::Int(fit.map_err(large)?)
        }
    })
}

/// Decodes base64 as far as asked. Padding may come in the middle, where pieces were encoded one by one.
#[derive(Debug)]
struct Base64<'a> {
    text: &'a [u8],
    /// The place of the next character: in `text`, plus `shift`.
    at: usize,
    shift: usize,
    /// Decoded, not yet taken; at most two bytes.
    rest: Vec<u8>,
}

impl<'a> Base64<'a> {
    /// Of `text` from `from` on, where `text` begins `shift` bytes after the file does.
    fn new(text: &'a [u8], from: usize, shift: usize) -> Self {
        Self { text, at: from + shift, shift, rest: Vec::new() }
    }

    fn take(&mut self, count: u64) -> Result<Vec<u8>, FormatError> {
        let left = (self.text.len() + self.shift - self.at) / 4 * 3 + 3;
        if count > left as u64 {
            return Err(FormatError::new(
                Place::Byte(self.at as u64),
                Reason::Untrue { what: "bytes of an array", count, room: left as u64 },
            ));
        }
        let count = count as usize;
        let mut taken = Vec::with_capacity(count + 3);
        taken.append(&mut self.rest);
        while taken.len() < count {
            self.quantum(&mut taken)?;
        }
        self.rest = taken.split_off(count);
        Ok(taken)
    }

    fn quantum(&mut self, out: &mut Vec<u8>) -> Result<(), FormatError> {
        let (mut bits, mut digits, mut padding) = (0_u32, 0, 0);
        while digits + padding < 4 {
            let place = Place::Byte(self.at as u64);
            let truncated = || FormatError::new(place, Reason::Truncated { within: "base64 data" });
            let byte = *self.text.get(self.at - self.shift).ok_or_else(truncated)?;
            self.at += 1;
            let digit = DIGITS[byte as usize];
            if digit < 64 && padding == 0 {
                bits = bits << 6 | u32::from(digit);
                digits += 1;
            } else if byte == b'=' && digits >= 2 {
                padding += 1;
            } else if !byte.is_ascii_whitespace() {
                return Err(FormatError::unexpected(place, "base64 data", &[byte]));
            }
        }
        bits <<= 6 * padding;
        out.extend_from_slice(&bits.to_be_bytes()[1..4 - padding]);
        Ok(())
    }
}

const NO_DIGIT: u8 = u8::MAX;

/// The value of each base64 character.
const DIGITS: [u8; 256] = {
    let alphabet = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut digits = [NO_DIGIT; 256];
    let mut i = 0;
    while i < alphabet.len() {
        digits[alphabet[i] as usize] = i as u8;
        i += 1;
    }
    digits
};
