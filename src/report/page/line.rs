//! Lines on a mesh: marked edges by cause, rims, non-manifold edges, named edge groups.

use crate::mesh::topology::EdgeTable;
use crate::mesh::{EdgeKey, MarkCause, Soup};

/// More edge groups than these are not drawn one by one.
const MOST_GROUPS: usize = 12;

/// Lines of one kind.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Lines {
    /// Unique within a mesh; also chooses the colour.
    pub(super) key: String,
    /// What people call them.
    pub(super) title: String,
    /// The ends of each edge, smaller first, in order.
    pub(super) edges: Vec<[u32; 2]>,
}

/// The lines of a mesh, kinds in a fixed order, without empty ones.
pub(super) fn lines(mesh: &Soup) -> Vec<Lines> {
    let marked = |cause: MarkCause| -> Vec<[u32; 2]> {
        let marks = mesh.carried.marks.iter().filter(|(_, mark)| mark.cause == cause);
        marks.map(|(edge, _)| raw(*edge)).collect()
    };
    let table = EdgeTable::new(mesh);
    let with_sides = |wanted: fn(usize) -> bool| -> Vec<[u32; 2]> {
        table.iter().filter(|(_, _, sides)| wanted(sides.len())).map(|(_, edge, _)| raw(edge)).collect()
    };
    let mut all = vec![
        kind("feature", "Features", marked(MarkCause::Feature)),
        kind("region-border", "Region borders", marked(MarkCause::RegionBorder)),
        kind("boundary", "Open boundary", with_sides(|sides| sides == 1)),
        kind("seam", "Seams", marked(MarkCause::Seam)),
        kind("locked", "Locked", marked(MarkCause::Locked)),
        kind("non-manifold", "Non-manifold", with_sides(|sides| sides > 2)),
    ];
    let groups = mesh.carried.groups.edges.iter().take(MOST_GROUPS);
    all.extend(
        groups.map(|(name, edges)| kind(&format!("group-{name}"), name, edges.iter().copied().map(raw).collect())),
    );
    all.retain(|lines| !lines.edges.is_empty());
    all
}

fn raw(edge: EdgeKey) -> [u32; 2] {
    edge.map(crate::mesh::VertexId::raw)
}

fn kind(key: &str, title: &str, edges: Vec<[u32; 2]>) -> Lines {
    Lines { key: key.to_owned(), title: title.to_owned(), edges }
}
