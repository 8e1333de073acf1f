//! Patches as columns.

use super::super::columns::{ColumnReader, ColumnWriter};
use super::{CodecError, decode_points, decode_soup, encode_points, encode_soup};
use crate::mesh::id::Vertex;
use crate::mesh::{IdVec, Patch, Patches, Seam};

pub(super) fn encode(writer: &mut ColumnWriter, patches: &Patches) {
    let all = &patches.patches;
    writer.u32s(all.iter().flat_map(|p| [p.spans[0] as u32, p.spans[1] as u32, u32::from(p.is_triangle)]));
    writer.f64s(all.iter().flat_map(|p| [p.max_error, p.rms_error]));
    let controls: IdVec<Vertex, _> = all.iter().flat_map(|p| p.controls.iter().copied()).collect();
    encode_points(writer, &controls);
    writer.u32s(patches.seams.iter().flat_map(|s| [s.patches[0], s.patches[1], u32::from(s.is_smooth)]));
    writer.f64s(patches.seams.iter().map(|s| s.angle));
    encode_soup(writer, &patches.tessellation);
}

pub(super) fn decode(reader: &mut ColumnReader<'_>) -> Result<Patches, CodecError> {
    /// Far more spans than any step makes.
    const MOST_SPANS: u32 = 1 << 12;
    let malformed = CodecError::Malformed;
    let heads: Vec<u32> = reader.u32s()?.collect();
    let errors: Vec<f64> = reader.f64s()?.collect();
    let controls: IdVec<Vertex, _> = decode_points(reader)?;
    let mut rest = controls.as_slice();
    let (heads, left) = heads.as_chunks::<3>();
    let (errors, odd) = errors.as_chunks::<2>();
    if !left.is_empty() || !odd.is_empty() || heads.len() != errors.len() {
        return Err(malformed("patches and their errors differ in number"));
    }
    let mut patches = Patches::default();
    for (&[u, v, triangle], &[max_error, rms_error]) in heads.iter().zip(errors) {
        if !(1..=MOST_SPANS).contains(&u) || !(1..=MOST_SPANS).contains(&v) {
            return Err(malformed("a patch has from one to 4096 spans"));
        }
        let spans = [u as usize, v as usize];
        let (own, tail) = rest.split_at_checked((spans[0] + 3) * (spans[1] + 3)).ok_or(CodecError::Truncated)?;
        rest = tail;
        patches.patches.push(Patch { spans, controls: own.to_vec(), is_triangle: triangle == 1, max_error, rms_error });
    }
    let seams: Vec<u32> = reader.u32s()?.collect();
    let angles: Vec<f64> = reader.f64s()?.collect();
    let (seams, left) = seams.as_chunks::<3>();
    let count = patches.patches.len();
    let in_range = seams.iter().all(|s| (s[0] as usize) < count && (s[1] as usize) < count);
    if !rest.is_empty() || !left.is_empty() || seams.len() != angles.len() || !in_range {
        return Err(malformed("seams name patches that do not exist"));
    }
    let seam = |(s, &angle): (&[u32; 3], &f64)| Seam { patches: [s[0], s[1]], angle, is_smooth: s[2] == 1 };
    patches.seams = seams.iter().zip(&angles).map(seam).collect();
    patches.tessellation = decode_soup(reader)?;
    Ok(patches)
}
