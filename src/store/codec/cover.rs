//! Which faces of a surface the elements of a quad mesh cover, as columns.

use super::super::columns::{ColumnReader, ColumnWriter};
use super::CodecError;
use crate::mesh::{Cover, FaceId, Id};

/// No element says what it covers.
const NONE: u64 = 0;
/// Faces of the surface are covered as they are.
const PLAIN: u64 = 1;
/// Some faces of the surface were cut first.
const CUT: u64 = 2;

pub(super) fn encode(writer: &mut ColumnWriter, cover: Option<&Cover>) {
    writer.number(cover.map_or(NONE, |cover| if cover.cuts.is_empty() { PLAIN } else { CUT }));
    let Some(cover) = cover else { return };
    writer.bytes(&cover.surface);
    if !cover.cuts.is_empty() {
        lists(writer, &cover.cuts);
    }
    lists(writer, cover.faces.as_slice());
}

fn lists(writer: &mut ColumnWriter, lists: &[Vec<FaceId>]) {
    writer.u32s(lists.iter().map(|faces| faces.len() as u32));
    writer.u32s(lists.iter().flatten().map(|f| f.raw()));
}

pub(super) fn decode(reader: &mut ColumnReader<'_>, elements: usize) -> Result<Option<Cover>, CodecError> {
    let kind = reader.number()?;
    if kind == NONE {
        return Ok(None);
    }
    if kind > CUT {
        return Err(CodecError::Malformed("no such kind of cover"));
    }
    let surface = reader.bytes()?.try_into().map_err(|_| CodecError::Malformed("a surface's hash has 32 bytes"))?;
    let cuts = if kind == CUT { read_lists(reader)? } else { Vec::new() };
    let faces = read_lists(reader)?;
    if faces.len() != elements {
        return Err(CodecError::Malformed("covered faces and elements differ in number"));
    }
    Ok(Some(Cover { surface, cuts, faces: faces.into() }))
}

fn read_lists(reader: &mut ColumnReader<'_>) -> Result<Vec<Vec<FaceId>>, CodecError> {
    let counts: Vec<u32> = reader.u32s()?.collect();
    let members: Vec<FaceId> = reader.u32s()?.map(Id::from_raw).collect();
    let total: u64 = counts.iter().map(|&n| u64::from(n)).sum();
    if total != members.len() as u64 {
        return Err(CodecError::Malformed("lists of faces do not hold what they say"));
    }
    let mut rest = members.as_slice();
    let take = |&n: &u32| {
        let (head, tail) = rest.split_at(n as usize);
        rest = tail;
        head.to_vec()
    };
    Ok(counts.iter().map(take).collect())
}
