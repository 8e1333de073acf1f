//! Artifacts as canonical bytes: equal values have equal bytes on every machine, and the content hash is over these.
//!
//! Little endian, versioned, columns of plain numbers. Maps are sorted by construction, floats are kept bit for bit.
//! Decoding trusts nothing: counts are bounded by the bytes that are there, corners by the number of points. It is
//! O(bytes) in time and memory both ways.

use std::collections::BTreeMap;
use std::sync::Arc;

use blake3::Hash;
use glam::DVec3;

pub use super::columns::{CODEC_VERSION, CodecError};
use super::columns::{ColumnReader, ColumnWriter, HEAD};
use crate::mesh::{
    Carried, EdgeKey, EdgeMark, Facet, Field, Freedom, Groups, Id, IdVec, MarkCause, Quads, Regions, SeamId, Soup,
    Support, Surface, VertexId,
};
use crate::metric::Measurement;
use crate::step::{Artifact, FileBytes, Port};

mod cover;
mod curves;
mod forest;
mod patches;

const MAGIC: [u8; 4] = *b"mmca";

/// The content hash of an artifact's canonical bytes; for a file, of its bytes.
pub fn content_hash(canonical: &[u8]) -> Hash {
    blake3::hash(canonical)
}

/// The canonical bytes of an artifact.
pub fn encode(artifact: &Artifact) -> Vec<u8> {
    match artifact {
        Artifact::File(file) => {
            let mut writer = start(Port::File, file.bytes.len());
            writer.text(&file.name);
            writer.bytes(&file.bytes);
            writer.finish()
        }
        Artifact::Soup(soup) => {
            let mut writer = start(Port::Soup, soup.points.len() * 24 + soup.faces.len() * 17);
            encode_soup(&mut writer, soup);
            writer.finish()
        }
        Artifact::Surface(surface) => {
            let mut writer = start(Port::Surface, surface.points.len() * 24 + surface.faces.len() * 12);
            encode_surface(&mut writer, surface);
            writer.finish()
        }
        Artifact::Hierarchy(hierarchy) => {
            let mut writer = start(Port::Hierarchy, 100 * hierarchy.node_count());
            encode_surface(&mut writer, &hierarchy.finest);
            forest::encode(&mut writer, hierarchy);
            writer.finish()
        }
        Artifact::Quads(quads) => {
            let mut writer = start(Port::Quads, quads.mesh.points.len() * 24 + quads.mesh.faces.len() * 17);
            encode_soup(&mut writer, &quads.mesh);
            cover::encode(&mut writer, quads.cover.as_ref());
            writer.finish()
        }
        Artifact::Patches(patches) => {
            let mut writer = start(Port::Patches, patches.tessellation.points.len() * 40);
            patches::encode(&mut writer, patches);
            writer.finish()
        }
        Artifact::Metrics(metrics) => {
            let mut writer = start(Port::Metrics, 4096);
            writer.bytes(&serde_json::to_vec(&**metrics).unwrap_or_default());
            writer.finish()
        }
    }
}

/// The artifact of these canonical bytes.
pub fn decode(bytes: &[u8]) -> Result<Artifact, CodecError> {
    let (head, rest) = bytes.split_at_checked(HEAD).ok_or(CodecError::Truncated)?;
    if head[..4] != MAGIC {
        return Err(CodecError::Malformed("not an artifact"));
    }
    let version = u16::from_le_bytes([head[4], head[5]]);
    if version != CODEC_VERSION {
        return Err(CodecError::Version(version));
    }
    let mut reader = ColumnReader::new(rest);
    let artifact = match head[6] {
        0 => Artifact::File(Arc::new(FileBytes { name: reader.text()?, bytes: reader.bytes()?.to_vec() })),
        1 => Artifact::Soup(Arc::new(decode_soup(&mut reader)?)),
        2 => Artifact::Surface(Arc::new(decode_surface(&mut reader)?)),
        3 => Artifact::Metrics(Arc::new(decode_metrics(&mut reader)?)),
        4 => {
            let finest = decode_surface(&mut reader)?;
            Artifact::Hierarchy(Arc::new(forest::decode(&mut reader, finest)?))
        }
        5 => {
            let mesh = decode_soup(&mut reader)?;
            let cover = cover::decode(&mut reader, mesh.faces.len())?;
            Artifact::Quads(Arc::new(Quads { mesh, cover }))
        }
        6 => Artifact::Patches(Arc::new(patches::decode(&mut reader)?)),
        _ => return Err(CodecError::Malformed("unknown kind of artifact")),
    };
    reader.end()?;
    Ok(artifact)
}

fn start(port: Port, capacity: usize) -> ColumnWriter {
    let [low, high] = CODEC_VERSION.to_le_bytes();
    let [a, b, c, d] = MAGIC;
    let tag = match port {
        Port::File => 0,
        Port::Soup => 1,
        Port::Surface => 2,
        Port::Metrics => 3,
        Port::Hierarchy => 4,
        Port::Quads => 5,
        Port::Patches => 6,
    };
    ColumnWriter::new([a, b, c, d, low, high, tag, 0], capacity + 1024)
}

fn encode_points<K>(writer: &mut ColumnWriter, points: &IdVec<K, DVec3>) {
    writer.f64s(points.iter().flat_map(DVec3::to_array));
}

fn decode_points<K>(reader: &mut ColumnReader<'_>) -> Result<IdVec<K, DVec3>, CodecError> {
    let numbers: Vec<f64> = reader.f64s()?.collect();
    let (points, rest) = numbers.as_chunks::<3>();
    if !rest.is_empty() || !numbers.iter().all(|x| x.is_finite()) {
        return Err(CodecError::Malformed("points are triples of finite numbers"));
    }
    Ok(points.iter().map(|p| DVec3::from_array(*p)).collect())
}

fn encode_soup(writer: &mut ColumnWriter, soup: &Soup) {
    encode_points(writer, &soup.points);
    let has_quads = soup.faces.iter().any(|f| matches!(f, Facet::Quad(_)));
    let arity: Vec<u8> =
        if has_quads { soup.faces.iter().map(|f| f.corners().len() as u8).collect() } else { Vec::new() };
    writer.bytes(&arity);
    writer.u32s(soup.faces.iter().flat_map(|f| f.corners().iter().map(|v| v.raw())));
    encode_carried(writer, &soup.carried);
}

fn decode_soup(reader: &mut ColumnReader<'_>) -> Result<Soup, CodecError> {
    let points = decode_points(reader)?;
    let arity = reader.bytes()?;
    let corners = decode_corners(reader, points.len())?;
    let faces = if arity.is_empty() {
        triangles(&corners)?.into_iter().map(Facet::Tri).collect()
    } else {
        mixed(arity, &corners)?
    };
    let carried = decode_carried(reader)?;
    Ok(Soup { points, faces, carried })
}

fn encode_surface(writer: &mut ColumnWriter, surface: &Surface) {
    encode_points(writer, &surface.points);
    writer.u32s(surface.faces.iter().flatten().map(|v| v.raw()));
    encode_carried(writer, &surface.carried);
}

fn decode_surface(reader: &mut ColumnReader<'_>) -> Result<Surface, CodecError> {
    let points = decode_points(reader)?;
    let faces = triangles(&decode_corners(reader, points.len())?)?.into();
    let carried = decode_carried(reader)?;
    Ok(Surface { points, faces, carried })
}

fn decode_metrics(reader: &mut ColumnReader<'_>) -> Result<Measurement, CodecError> {
    serde_json::from_slice(reader.bytes()?).map_err(|_| CodecError::Malformed("a table of metrics does not parse"))
}

fn decode_corners(reader: &mut ColumnReader<'_>, points: usize) -> Result<Vec<VertexId>, CodecError> {
    let corners: Vec<VertexId> = reader.u32s()?.map(Id::from_raw).collect();
    if corners.iter().all(|v| v.index() < points) {
        Ok(corners)
    } else {
        Err(CodecError::Malformed("a corner names a point that does not exist"))
    }
}

fn triangles(corners: &[VertexId]) -> Result<Vec<[VertexId; 3]>, CodecError> {
    let (faces, rest) = corners.as_chunks::<3>();
    if rest.is_empty() { Ok(faces.to_vec()) } else { Err(CodecError::Malformed("a triangle has three corners")) }
}

fn mixed<K>(arity: &[u8], corners: &[VertexId]) -> Result<IdVec<K, Facet>, CodecError> {
    let mut rest = corners;
    let mut faces = Vec::with_capacity(arity.len());
    for &count in arity {
        let (face, tail) = rest.split_at_checked(count as usize).ok_or(CodecError::Truncated)?;
        faces.push(match *face {
            [a, b, c] => Facet::Tri([a, b, c]),
            [a, b, c, d] => Facet::Quad([a, b, c, d]),
            _ => return Err(CodecError::Malformed("a face has three or four corners")),
        });
        rest = tail;
    }
    if rest.is_empty() { Ok(faces.into()) } else { Err(CodecError::Malformed("corners are left over")) }
}

fn encode_carried(writer: &mut ColumnWriter, carried: &Carried) {
    let Carried { groups, regions, marks, pins, seams, fields, curves: on_surface } = carried;
    encode_groups(writer, groups);
    writer.number(u64::from(regions.is_some()));
    if let Some(Regions { labels, names }) = regions {
        writer.u32s(labels.iter().copied());
        writer.number(names.len() as u64);
        for name in names {
            writer.text(name);
        }
    }
    writer.u32s(marks.keys().flatten().map(|v| v.raw()));
    writer.bytes(&marks.values().flat_map(|m| [m.freedom as u8, m.cause as u8]).collect::<Vec<_>>());
    writer.u32s(pins.keys().map(|v| v.raw()));
    writer.bytes(&pins.values().map(|f| *f as u8).collect::<Vec<_>>());
    writer.u32s(seams.keys().map(|v| v.raw()));
    writer.u32s(seams.values().map(|s| s.0));
    writer.number(fields.len() as u64);
    for Field { name, support, components, values } in fields {
        writer.text(name);
        writer.number(u64::from(*support == Support::Face));
        writer.number(*components as u64);
        writer.f64s(values.iter().copied());
    }
    curves::encode(writer, on_surface);
}

fn decode_carried(reader: &mut ColumnReader<'_>) -> Result<Carried, CodecError> {
    let groups = decode_groups(reader)?;
    let regions = if reader.number()? == 1 {
        let labels = reader.u32s()?.collect();
        let mut names = Vec::new();
        for _ in 0..reader.number()? {
            names.push(reader.text()?);
        }
        Some(Regions { labels, names })
    } else {
        None
    };
    let marks = decode_marks(reader)?;
    let pins = reader.u32s()?.map(Id::from_raw);
    let pins = pins.zip(reader.bytes()?).map(|(v, f)| Ok((v, freedom(*f)?))).collect::<Result<_, CodecError>>()?;
    let seams = reader.u32s()?.map(Id::from_raw);
    let seams = seams.zip(reader.u32s()?.map(SeamId)).collect();
    let mut fields = Vec::new();
    for _ in 0..reader.number()? {
        let name = reader.text()?;
        let support = if reader.number()? == 1 { Support::Face } else { Support::Vertex };
        let components = usize::try_from(reader.number()?).map_err(|_| CodecError::Truncated)?;
        fields.push(Field { name, support, components, values: reader.f64s()?.collect() });
    }
    let curves = curves::decode(reader)?;
    Ok(Carried { groups, regions, marks, pins, seams, fields, curves })
}

fn encode_groups(writer: &mut ColumnWriter, groups: &Groups) {
    let Groups { faces, edges, vertices } = groups;
    writer.number(faces.len() as u64);
    for (name, members) in faces {
        writer.text(name);
        writer.u32s(members.iter().map(|f| f.raw()));
    }
    writer.number(edges.len() as u64);
    for (name, members) in edges {
        writer.text(name);
        writer.u32s(members.iter().flatten().map(|v| v.raw()));
    }
    writer.number(vertices.len() as u64);
    for (name, members) in vertices {
        writer.text(name);
        writer.u32s(members.iter().map(|v| v.raw()));
    }
}

fn decode_groups(reader: &mut ColumnReader<'_>) -> Result<Groups, CodecError> {
    let mut groups = Groups::default();
    for _ in 0..reader.number()? {
        groups.faces.insert(reader.text()?, reader.u32s()?.map(Id::from_raw).collect());
    }
    for _ in 0..reader.number()? {
        groups.edges.insert(reader.text()?, decode_edges(reader)?);
    }
    for _ in 0..reader.number()? {
        groups.vertices.insert(reader.text()?, reader.u32s()?.map(Id::from_raw).collect());
    }
    Ok(groups)
}

fn decode_edges(reader: &mut ColumnReader<'_>) -> Result<Vec<EdgeKey>, CodecError> {
    let ends: Vec<VertexId> = reader.u32s()?.map(Id::from_raw).collect();
    let (edges, rest) = ends.as_chunks::<2>();
    if rest.is_empty() { Ok(edges.to_vec()) } else { Err(CodecError::Malformed("an edge has two ends")) }
}

fn decode_marks(reader: &mut ColumnReader<'_>) -> Result<BTreeMap<EdgeKey, EdgeMark>, CodecError> {
    let edges = decode_edges(reader)?;
    let (marks, _) = reader.bytes()?.as_chunks::<2>();
    if edges.len() != marks.len() {
        return Err(CodecError::Malformed("marks and marked edges differ in number"));
    }
    let marks = edges.into_iter().zip(marks);
    marks.map(|(edge, [f, c])| Ok((edge, EdgeMark { freedom: freedom(*f)?, cause: cause(*c)? }))).collect()
}

fn freedom(tag: u8) -> Result<Freedom, CodecError> {
    [Freedom::Free, Freedom::OnCurve, Freedom::Keep]
        .into_iter()
        .find(|f| *f as u8 == tag)
        .ok_or(CodecError::Malformed("unknown freedom"))
}

fn cause(tag: u8) -> Result<MarkCause, CodecError> {
    [MarkCause::Seam, MarkCause::Boundary, MarkCause::Feature, MarkCause::RegionBorder, MarkCause::Locked]
        .into_iter()
        .find(|c| *c as u8 == tag)
        .ok_or(CodecError::Malformed("unknown cause of a mark"))
}

#[cfg(test)]
mod tests;
