//! The columns of a hierarchy after those of its finest mesh.
//!
//! Ring nodes are stored as their distance back from the node of their merge, which is small for neighbours in time;
//! of the curvatures only those of the leaves are stored, since a node's is the larger one of its children.

use glam::DVec3;

use super::{CodecError, ColumnReader, ColumnWriter};
use crate::mesh::hierarchy::{Hierarchy, Merge, NodeId};
use crate::mesh::{IdVec, Surface};

pub(super) fn encode(writer: &mut ColumnWriter, hierarchy: &Hierarchy) {
    let merges = &hierarchy.merges;
    let leaves = hierarchy.leaf_count();
    writer.u32s(merges.iter().map(|merge| merge.kept.raw()));
    writer.u32s(merges.iter().map(|merge| merge.removed.raw()));
    writer.f64s(merges.iter().flat_map(|merge| merge.point.to_array()));
    writer.bytes(&merges.iter().map(|merge| merge.faces).collect::<Vec<u8>>());
    writer.u32s(merges.iter().map(|merge| merge.ring_end));
    let nodes = hierarchy.nodes().skip(leaves);
    writer.u32s(nodes.flat_map(|node| hierarchy.ring(node).iter().map(move |r| node.raw().wrapping_sub(r.raw()))));
    writer.f64s(hierarchy.element_size.iter().copied());
    writer.f64s(hierarchy.curvature.iter().take(leaves).copied());
}

pub(super) fn decode(reader: &mut ColumnReader<'_>, finest: Surface) -> Result<Hierarchy, CodecError> {
    let leaves = finest.points.len();
    let kept = reader.u32s()?;
    let removed = reader.u32s()?;
    let numbers: Vec<f64> = reader.f64s()?.collect();
    let (points, rest) = numbers.as_chunks::<3>();
    let faces = reader.bytes()?;
    let ends = reader.u32s()?;
    let count = kept.len();
    if [removed.len(), points.len(), faces.len(), ends.len()] != [count; 4] || !rest.is_empty() {
        return Err(CodecError::Malformed("the columns of a hierarchy differ in length"));
    }
    let columns = kept.zip(removed).zip(points).zip(faces).zip(ends);
    let merges: Vec<Merge> = columns
        .map(|((((kept, removed), point), &faces), ring_end)| Merge {
            kept: NodeId::from_raw(kept),
            removed: NodeId::from_raw(removed),
            point: DVec3::from_array(*point),
            faces,
            ring_end,
        })
        .collect();
    let rings = decode_rings(reader, &merges, leaves)?;
    let element_size = reader.f64s()?.collect();
    let curvature = reader.f64s()?.collect();
    let mut hierarchy = Hierarchy { finest, merges, rings, element_size, curvature };
    hierarchy.curvature = inherited(&hierarchy)?;
    match hierarchy.defect() {
        None => Ok(hierarchy),
        Some(_) => Err(CodecError::Malformed("the forest of a hierarchy contradicts itself")),
    }
}

fn decode_rings(reader: &mut ColumnReader<'_>, merges: &[Merge], leaves: usize) -> Result<Vec<NodeId>, CodecError> {
    let mut distances = reader.u32s()?;
    let mut rings = Vec::with_capacity(distances.len());
    for (index, merge) in merges.iter().enumerate() {
        let node = u32::try_from(leaves + index).map_err(|_| CodecError::Malformed("too many nodes"))?;
        while rings.len() < merge.ring_end as usize {
            let distance = distances.next().ok_or(CodecError::Malformed("rings end too early"))?;
            rings.push(NodeId::from_raw(node.wrapping_sub(distance)));
        }
    }
    if distances.next().is_some() {
        return Err(CodecError::Malformed("rings are left over"));
    }
    Ok(rings)
}

/// The curvatures of all nodes from those of the leaves.
fn inherited(hierarchy: &Hierarchy) -> Result<IdVec<crate::mesh::hierarchy::Node, f64>, CodecError> {
    let mut all = hierarchy.curvature.clone();
    if all.is_empty() {
        return Ok(all);
    }
    if all.len() != hierarchy.leaf_count() {
        return Err(CodecError::Malformed("leaves and curvatures differ in number"));
    }
    for merge in &hierarchy.merges {
        let (Some(kept), Some(removed)) = (all.get(merge.kept).copied(), all.get(merge.removed).copied()) else {
            return Err(CodecError::Malformed("a merge names a node that comes later"));
        };
        all.push(kept.max(removed));
    }
    Ok(all)
}
