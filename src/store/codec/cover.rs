//! Which faces of a surface the elements of a quad mesh cover, as columns.

use super::super::columns::{ColumnReader, ColumnWriter};
use super::CodecError;
use crate::mesh::{Cover, FaceId, Id};

pub(super) fn encode(writer: &mut ColumnWriter, cover: Option<&Cover>) {
    writer.number(u64::from(cover.is_some()));
    let Some(cover) = cover else { return };
    writer.bytes(&cover.surface);
    writer.u32s(cover.faces.iter().map(|faces| faces.len() as u32));
    writer.u32s(cover.faces.iter().flatten().map(|f| f.raw()));
}

pub(super) fn decode(reader: &mut ColumnReader<'_>, elements: usize) -> Result<Option<Cover>, CodecError> {
    if reader.number()? != 1 {
        return Ok(None);
    }
    let surface = reader.bytes()?.try_into().map_err(|_| CodecError::Malformed("a surface's hash has 32 bytes"))?;
    let counts: Vec<u32> = reader.u32s()?.collect();
    let members: Vec<FaceId> = reader.u32s()?.map(Id::from_raw).collect();
    let total: u64 = counts.iter().map(|&n| u64::from(n)).sum();
    if counts.len() != elements || total != members.len() as u64 {
        return Err(CodecError::Malformed("covered faces and elements differ in number"));
    }
    let mut rest = members.as_slice();
    let take = |&n: &u32| {
        let (head, tail) = rest.split_at(n as usize);
        rest = tail;
        head.to_vec()
    };
    Ok(Some(Cover { surface, faces: counts.iter().map(take).collect::<Vec<_>>().into() }))
}
