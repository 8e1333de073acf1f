//! What a cut surface takes over: groups, marks, pins, seams and fields.

use super::sites::Layout;
use crate::mesh::id::Face;
use crate::mesh::topology::EdgeTable;
use crate::mesh::{Carried, EdgeKey, FaceId, Field, Groups, IdVec, Regions, Support, Surface, VertexId, edge_key};

/// Everything but curves. The regions keep their names; labels beyond them get new ones.
pub(super) fn inherit(
    old: &Surface,
    edges: &EdgeTable,
    layout: &Layout,
    parents: &IdVec<Face, FaceId>,
    labels: IdVec<Face, u32>,
    vertices: usize,
) -> Carried {
    let from = &old.carried;
    let parts = |key: &EdgeKey| -> Vec<EdgeKey> {
        let Some(e) = edges.find(*key) else { return vec![*key] };
        layout.along(edges, e).windows(2).map(|pair| edge_key(pair[0], pair[1])).collect()
    };
    let mut names = from.regions.as_ref().map_or_else(Vec::new, |regions| regions.names.clone());
    let needed = labels.iter().max().map_or(0, |&label| label as usize + 1);
    names.extend((names.len() + 1..=needed).map(|number| format!("region-{number}")));
    let keep = from.regions.is_some() || layout.chains.iter().any(|chain| !chain.is_empty());
    Carried {
        groups: groups(&from.groups, layout, parents, &parts),
        regions: keep.then_some(Regions { labels, names }),
        marks: from
            .marks
            .iter()
            .flat_map(|(key, &mark)| parts(key).into_iter().map(move |part| (part, mark)))
            .collect(),
        pins: from.pins.clone(),
        seams: from.seams.clone(),
        fields: from.fields.iter().map(|field| map_field(field, layout, parents, vertices)).collect(),
        curves: Vec::new(),
    }
}

fn groups(
    from: &Groups,
    layout: &Layout,
    parents: &IdVec<Face, FaceId>,
    parts: &impl Fn(&EdgeKey) -> Vec<EdgeKey>,
) -> Groups {
    let faces = from.faces.iter().map(|(name, members)| {
        let children = parents.enumerate().filter(|(_, parent)| members.binary_search(parent).is_ok());
        (name.clone(), children.map(|(f, _)| f).collect())
    });
    let edges = from.edges.iter().map(|(name, members)| {
        let mut all: Vec<EdgeKey> = members.iter().flat_map(parts).collect();
        all.sort_unstable();
        (name.clone(), all)
    });
    let vertices = from.vertices.iter().map(|(name, members)| {
        let inside = |v: &VertexId| members.binary_search(v).is_ok();
        let between = layout.crossings.iter().enumerate().filter(|(_, (ends, _))| ends.iter().all(inside));
        let joined = between.map(|(k, _)| VertexId::new(layout.first + k));
        (name.clone(), members.iter().copied().chain(joined).collect())
    });
    Groups { faces: faces.collect(), edges: edges.collect(), vertices: vertices.collect() }
}

fn map_field(field: &Field, layout: &Layout, parents: &IdVec<Face, FaceId>, vertices: usize) -> Field {
    let n = field.components;
    let mut values = Vec::new();
    match field.support {
        Support::Face => {
            for parent in parents {
                values.extend_from_slice(&field.values[n * parent.index()..n * (parent.index() + 1)]);
            }
        }
        Support::Vertex => {
            values.reserve(n * vertices);
            values.extend_from_slice(&field.values);
            for ([a, b], t) in &layout.crossings {
                let at = |v: &VertexId, k: usize| field.values[n * v.index() + k];
                values.extend((0..n).map(|k| at(a, k) * (1.0 - t) + at(b, k) * t));
            }
        }
    }
    Field { values, ..field.clone() }
}
