//! Canonical bytes packed for storage: index deltas and byte planes, then LZ4.
//!
//! `u32` columns become zigzag differences of neighbours; `u32` and `f64` columns are then stored as byte planes (all
//! first bytes, all second bytes, ...), whose long runs LZ4 takes well. Measured on 500 k vertices and 1 M triangles:
//! 24.0 MB raw, 19.5 MB by LZ4 alone, 9.8 MB this way, at 30 to 40 ms either way. Packing keeps the length, so a packed
//! stream is walked like a canonical one. The size prefix of a file is believed only as far as LZ4 can expand.

use super::codec::CodecError;
use super::columns::{ColumnKind, ColumnReader, HEAD};

/// First bytes of a blob file.
const MAGIC: &[u8; 8] = b"mmblob1\n";
/// What the blob files of every version begin with.
const FAMILY: &[u8] = b"mmblob";
/// LZ4 cannot expand a byte to more than this many.
const MAX_EXPANSION: usize = 255;

/// Packs canonical bytes into the content of a blob file.
pub(super) fn pack(canonical: &[u8]) -> Result<Vec<u8>, CodecError> {
    let shuffled = walk(canonical, Direction::Pack)?;
    let body = lz4_flex::block::compress(&shuffled);
    let mut file = Vec::with_capacity(MAGIC.len() + 8 + body.len());
    file.extend_from_slice(MAGIC);
    file.extend_from_slice(&(canonical.len() as u64).to_le_bytes());
    file.extend_from_slice(&body);
    Ok(file)
}

/// Restores canonical bytes from the content of a blob file.
pub(super) fn unpack(file: &[u8]) -> Result<Vec<u8>, CodecError> {
    let rest = file.strip_prefix(MAGIC).ok_or(CodecError::Malformed("not a blob of this version"))?;
    let (size, body) = rest.split_at_checked(8).ok_or(CodecError::Truncated)?;
    let mut raw = [0; 8];
    raw.copy_from_slice(size);
    let size = usize::try_from(u64::from_le_bytes(raw)).map_err(|_| CodecError::Truncated)?;
    if size > body.len().saturating_mul(MAX_EXPANSION).saturating_add(64) {
        return Err(CodecError::Malformed("the size prefix is larger than the data can be"));
    }
    let shuffled = lz4_flex::block::decompress(body, size).map_err(|_| CodecError::Malformed("broken compression"))?;
    if shuffled.len() != size {
        return Err(CodecError::Truncated);
    }
    walk(&shuffled, Direction::Unpack)
}

/// Whether a blob file is one of another version of the program.
pub(super) fn is_foreign(file: &[u8]) -> bool {
    file.strip_prefix(FAMILY).is_some_and(|rest| rest.first().is_some_and(u8::is_ascii_digit))
        && !file.starts_with(MAGIC)
}

#[derive(Clone, Copy)]
enum Direction {
    Pack,
    Unpack,
}

/// Copies the stream and transforms the payload of every column.
fn walk(stream: &[u8], direction: Direction) -> Result<Vec<u8>, CodecError> {
    let mut out = stream.to_vec();
    let mut columns = ColumnReader::new(stream.get(HEAD..).ok_or(CodecError::Truncated)?);
    let mut end = HEAD;
    while let Some((kind, payload)) = columns.next_column()? {
        let start = end + 9;
        end = start + payload.len();
        let target = &mut out[start..end];
        match (kind, direction) {
            (ColumnKind::Bytes, _) => {}
            (ColumnKind::U32, Direction::Pack) => shuffle::<4>(&deltas(payload), target),
            (ColumnKind::U32, Direction::Unpack) => {
                unshuffle::<4>(payload, target);
                undo_deltas(target);
            }
            (ColumnKind::F64, Direction::Pack) => shuffle::<8>(payload, target),
            (ColumnKind::F64, Direction::Unpack) => unshuffle::<8>(payload, target),
        }
    }
    Ok(out)
}

fn shuffle<const WIDTH: usize>(from: &[u8], to: &mut [u8]) {
    let (items, _) = from.as_chunks::<WIDTH>();
    for (byte, plane) in to.chunks_exact_mut(items.len().max(1)).enumerate() {
        for (target, item) in plane.iter_mut().zip(items) {
            *target = item[byte];
        }
    }
}

fn unshuffle<const WIDTH: usize>(from: &[u8], to: &mut [u8]) {
    let (items, _) = to.as_chunks_mut::<WIDTH>();
    for (byte, plane) in from.chunks_exact(items.len().max(1)).enumerate() {
        for (item, source) in items.iter_mut().zip(plane) {
            item[byte] = *source;
        }
    }
}

fn deltas(payload: &[u8]) -> Vec<u8> {
    let mut last = 0_u32;
    let mut out = Vec::with_capacity(payload.len());
    for item in payload.as_chunks::<4>().0 {
        let value = u32::from_le_bytes(*item);
        let step = value.wrapping_sub(last) as i32;
        out.extend_from_slice(&(((step << 1) ^ (step >> 31)) as u32).to_le_bytes());
        last = value;
    }
    out
}

fn undo_deltas(payload: &mut [u8]) {
    let mut last = 0_u32;
    for item in payload.as_chunks_mut::<4>().0 {
        let zigzag = u32::from_le_bytes(*item);
        let step = (zigzag >> 1) ^ (zigzag & 1).wrapping_neg();
        last = last.wrapping_add(step);
        *item = last.to_le_bytes();
    }
}

#[cfg(test)]
mod tests {
    use super::super::columns::ColumnWriter;
    use super::*;

    fn sample() -> Vec<u8> {
        let mut writer = ColumnWriter::new(*b"head0000", 0);
        writer.u32s([7, 3, u32::MAX, 0, 5].into_iter());
        writer.text("rim");
        writer.f64s([0.5, -0.0, 1e300].into_iter());
        writer.u32s(std::iter::empty());
        writer.finish()
    }

    #[test]
    fn unpacking_restores_every_byte() {
        let canonical = sample();
        assert_eq!(unpack(&pack(&canonical).unwrap()).unwrap(), canonical);
    }

    #[test]
    fn an_untrue_size_prefix_does_not_allocate() {
        let mut file = pack(&sample()).unwrap();
        file[8..16].copy_from_slice(&u64::MAX.to_le_bytes());
        assert!(unpack(&file).is_err());
        file[8..16].copy_from_slice(&(1_u64 << 33).to_le_bytes());
        assert!(unpack(&file).is_err());
    }

    #[test]
    fn any_truncation_is_an_error() {
        let file = pack(&sample()).unwrap();
        for len in 0..file.len() {
            assert!(unpack(&file[..len]).is_err(), "{len} bytes of {}", file.len());
        }
    }
}
