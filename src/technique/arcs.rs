//! The arcs and junctions of a surface whose faces have labels.
//!
//! A border edge lies between faces of different labels. A junction is a vertex where the number of border edges is
//! neither 0 nor 2, or where a border passes from one pair of labels to another or ends on a rim. An arc is a maximal
//! chain of border edges between junctions, or a closed one without a junction; it has one label on each side
//! throughout. Rims are no arcs.
//!
//! Invariants: each border edge is on exactly one arc; arcs are sorted by their lowest border edge, an open arc begins
//! at its lower end, a closed one at its lowest vertex towards the lower neighbour. Cost: O(F log F).

use std::collections::BTreeMap;

use crate::mesh::id::{Edge, Face};
use crate::mesh::topology::EdgeTable;
use crate::mesh::{EdgeId, IdVec, Surface, VertexId, edge_key};

/// A chain of edges between two regions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Arc {
    /// The vertices in order; the first is not repeated at the end of a closed arc.
    pub vertices: Vec<VertexId>,
    /// Whether the last vertex joins the first.
    pub is_closed: bool,
    /// The labels on the left and on the right, looking along the arc from outside.
    pub sides: [u32; 2],
}

impl Arc {
    /// The ends of the edges, in order and along the arc.
    pub fn edges(&self) -> impl Iterator<Item = [VertexId; 2]> + '_ {
        let closing = self.is_closed.then(|| [self.vertices[self.vertices.len() - 1], self.vertices[0]]);
        self.vertices.windows(2).map(|pair| [pair[0], pair[1]]).chain(closing)
    }
}

/// The border network of a labelled surface.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Arcs {
    /// All arcs.
    pub arcs: Vec<Arc>,
    /// Where arcs end, sorted.
    pub junctions: Vec<VertexId>,
}

/// A border edge as seen from one end: the other end and the labels on the left and right, looking away.
type Spoke = (VertexId, [u32; 2]);

/// The border edges, at each vertex and in order, and the vertices on rims.
struct Borders {
    spokes: BTreeMap<VertexId, Vec<Spoke>>,
    edges: Vec<EdgeId>,
    on_rim: Vec<bool>,
}

impl Borders {
    fn new(surface: &Surface, edges: &EdgeTable, labels: &IdVec<Face, u32>) -> Self {
        let mut borders =
            Self { spokes: BTreeMap::new(), edges: Vec::new(), on_rim: vec![false; surface.points.len()] };
        for (edge, [a, b], sides) in edges.iter() {
            match sides {
                [s, t] if labels[s.face] != labels[t.face] => {
                    // The face whose side runs from `a` to `b` lies on the left.
                    let (left, right) = if s.is_forward { (s, t) } else { (t, s) };
                    let [left, right] = [labels[left.face], labels[right.face]];
                    borders.spokes.entry(a).or_default().push((b, [left, right]));
                    borders.spokes.entry(b).or_default().push((a, [right, left]));
                    borders.edges.push(edge);
                }
                [_] => {
                    borders.on_rim[a.index()] = true;
                    borders.on_rim[b.index()] = true;
                }
                _ => {}
            }
        }
        borders
    }

    /// Whether borders end or branch here.
    fn is_junction(&self, v: VertexId) -> bool {
        let passes = matches!(self.spokes[&v][..], [(_, [l, r]), (_, [m, s])] if (l, r) == (s, m));
        self.on_rim[v.index()] || !passes
    }
}

/// The arcs and junctions of these labels.
pub fn arcs(surface: &Surface, edges: &EdgeTable, labels: &IdVec<Face, u32>) -> Arcs {
    let borders = Borders::new(surface, edges, labels);
    let junctions: Vec<VertexId> = borders.spokes.keys().copied().filter(|&v| borders.is_junction(v)).collect();
    let mut is_used: IdVec<Edge, bool> = IdVec::filled(false, edges.len());
    let mut found = Vec::new();
    let mut walk = Walk { edges, borders: &borders, is_used: &mut is_used };
    for &start in &junctions {
        for &(first, sides) in &borders.spokes[&start] {
            found.extend(walk.from(start, first, sides));
        }
    }
    for &edge in &borders.edges {
        let [a, b] = edges.key(edge);
        let sides = borders.spokes[&a].iter().find(|spoke| spoke.0 == b).map_or([0; 2], |spoke| spoke.1);
        found.extend(walk.from(a, b, sides));
    }
    found.sort_by_key(|arc| arc.edges().map(|[a, b]| edge_key(a, b)).min());
    Arcs { arcs: found, junctions }
}

struct Walk<'a> {
    edges: &'a EdgeTable,
    borders: &'a Borders,
    is_used: &'a mut IdVec<Edge, bool>,
}

impl Walk<'_> {
    /// The arc that leaves `start` towards `first`, unless it is known.
    fn from(&mut self, start: VertexId, first: VertexId, sides: [u32; 2]) -> Option<Arc> {
        let mut vertices = vec![start];
        let (mut from, mut to) = (start, first);
        loop {
            let edge = self.edges.find(edge_key(from, to))?;
            if std::mem::replace(&mut self.is_used[edge], true) {
                return None;
            }
            if to == start && !self.borders.is_junction(start) {
                return Some(Arc { vertices, is_closed: true, sides });
            }
            vertices.push(to);
            if self.borders.is_junction(to) {
                return Some(oriented(vertices, sides));
            }
            let next = self.borders.spokes[&to].iter().find(|spoke| spoke.0 != from)?.0;
            (from, to) = (to, next);
        }
    }
}

/// An open arc beginning at its lower end; one that returns to its junction, towards its lower neighbour.
fn oriented(mut vertices: Vec<VertexId>, [left, right]: [u32; 2]) -> Arc {
    let last = vertices.len() - 1;
    let forward = (vertices[0], vertices[1]) <= (vertices[last], vertices[last - 1]);
    if !forward {
        vertices.reverse();
    }
    Arc { vertices, is_closed: false, sides: if forward { [left, right] } else { [right, left] } }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::halfedge::tests::surface;

    fn id(k: usize) -> VertexId {
        VertexId::new(k)
    }

    #[test]
    fn three_regions_meet_at_a_junction() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]];
        let mesh = surface(&points, &[[0, 1, 2], [0, 2, 3], [0, 3, 1]]);
        let found = arcs(&mesh, &EdgeTable::new(&mesh), &vec![0, 1, 2].into());
        assert_eq!(found.junctions, [0, 1, 2, 3].map(id));
        assert_eq!(found.arcs.len(), 3);
        assert_eq!(found.arcs[0], Arc { vertices: vec![id(0), id(1)], is_closed: false, sides: [0, 2] });
    }

    #[test]
    fn a_closed_border_is_one_arc_without_junction() {
        let points = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [0.0, 0.0, -1.0]];
        let faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [4, 2, 1], [4, 3, 2], [4, 1, 3]];
        let mesh = surface(&points, &faces);
        let found = arcs(&mesh, &EdgeTable::new(&mesh), &vec![7, 7, 7, 2, 2, 2].into());
        assert!(found.junctions.is_empty());
        assert_eq!(found.arcs, [Arc { vertices: [1, 2, 3].map(id).to_vec(), is_closed: true, sides: [7, 2] }]);
        assert_eq!(found.arcs[0].edges().count(), 3);
    }

    #[test]
    fn one_label_has_no_arc() {
        let mesh = surface(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]]);
        assert_eq!(arcs(&mesh, &EdgeTable::new(&mesh), &vec![0].into()), Arcs::default());
    }
}
