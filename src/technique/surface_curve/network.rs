//! The arcs being straightened, and who is where.

use glam::DVec3;
use rustc_hash::FxHashMap;
use smallvec::SmallVec;

use crate::mesh::halfedge::{halfedge_of, twin};
use crate::mesh::id::{Edge, Vertex};
use crate::mesh::{Curve, EdgeId, FaceId, HalfedgeMesh, IdVec, SurfacePoint, VertexId, edge_key};
use crate::technique::arcs::Arc;

/// Stands for "no node".
pub(super) const NONE: u32 = u32::MAX;

/// A place on the workshop's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// On a vertex.
    Vertex(VertexId),
    /// Inside an edge, from the first of its ends to the second.
    Edge(EdgeId, f64),
}

/// A point of an arc; arcs are doubly linked lists.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) place: Place,
    pub(super) prev: u32,
    pub(super) next: u32,
    pub(super) is_live: bool,
    /// Not to be moved in this round.
    pub(super) is_held: bool,
}

/// One arc of a network.
#[derive(Clone, Debug)]
pub(super) struct Strand {
    pub(super) first: u32,
    pub(super) is_closed: bool,
    sides: [u32; 2],
}

/// A network of arcs on a surface.
#[derive(Clone, Debug)]
pub struct Network<'a> {
    pub(super) mesh: &'a HalfedgeMesh,
    pub(super) nodes: Vec<Node>,
    pub(super) strands: Vec<Strand>,
    /// Vertices that no arc may touch but those that did from the beginning.
    pub(super) is_fixed: &'a IdVec<Vertex, bool>,
    /// Whether an arc is on the vertex.
    occupied: IdVec<Vertex, bool>,
    on_edge: FxHashMap<EdgeId, SmallVec<[u32; 2]>>,
}

/// Vertices that arcs keep: on rims, on marked edges, pinned, on seams, and where arcs end.
pub fn fixed_vertices(
    mesh: &HalfedgeMesh,
    marked: impl Iterator<Item = VertexId>,
    arcs: &[Arc],
) -> IdVec<Vertex, bool> {
    let mut fixed: IdVec<Vertex, bool> =
        (0..mesh.vertex_slots()).map(VertexId::new).map(|v| mesh.is_boundary_vertex(v)).collect();
    for v in marked {
        fixed[v] = true;
    }
    for arc in arcs.iter().filter(|arc| !arc.is_closed) {
        for v in arc.vertices.first().into_iter().chain(arc.vertices.last()) {
            fixed[*v] = true;
        }
    }
    fixed
}

impl<'a> Network<'a> {
    /// A network of these arcs.
    pub fn new(mesh: &'a HalfedgeMesh, is_fixed: &'a IdVec<Vertex, bool>) -> Self {
        let occupied = IdVec::filled(false, mesh.vertex_slots());
        Self { mesh, nodes: Vec::new(), strands: Vec::new(), is_fixed, occupied, on_edge: FxHashMap::default() }
    }

    /// Adds an arc that meets no other but at its ends.
    pub fn add(&mut self, places: &[Place], is_closed: bool, sides: [u32; 2]) {
        let first = self.nodes.len() as u32;
        let count = places.len() as u32;
        for (k, &place) in (0_u32..).zip(places) {
            let (before, after) = (first + (k + count - 1) % count, first + (k + 1) % count);
            let prev = if k == 0 && !is_closed { NONE } else { before };
            let next = if k + 1 == count && !is_closed { NONE } else { after };
            self.nodes.push(Node { place, prev, next, is_live: true, is_held: false });
            self.settle(first + k);
        }
        self.strands.push(Strand { first, is_closed, sides });
    }

    /// Adds an arc along mesh edges.
    pub fn add_arc(&mut self, arc: &Arc) {
        let places: Vec<Place> = arc.vertices.iter().map(|&v| Place::Vertex(v)).collect();
        self.add(&places, arc.is_closed, arc.sides);
    }

    /// Where a place is.
    pub fn point(&self, place: Place) -> DVec3 {
        match place {
            Place::Vertex(v) => self.mesh.point(v),
            Place::Edge(e, t) => {
                let [a, b] = self.mesh.ends(e).map(|v| self.mesh.point(v));
                a * (1.0 - t) + b * t
            }
        }
    }

    /// The nodes of an arc in order.
    pub(super) fn nodes_of(&self, strand: &Strand) -> Vec<u32> {
        let mut nodes = vec![strand.first];
        let mut at = self.nodes[strand.first as usize].next;
        while at != NONE && at != strand.first {
            nodes.push(at);
            at = self.nodes[at as usize].next;
        }
        nodes
    }

    /// The points of each arc.
    pub fn polylines(&self) -> Vec<Vec<DVec3>> {
        let points =
            |strand| self.nodes_of(strand).into_iter().map(|i| self.point(self.nodes[i as usize].place)).collect();
        self.strands.iter().map(points).collect()
    }

    /// The lengths of all arcs together.
    pub fn length(&self) -> f64 {
        let closing = |points: &[DVec3], strand: &Strand| match points {
            [first, .., last] if strand.is_closed => first.distance(*last),
            _ => 0.0,
        };
        let of = |(points, strand): (Vec<DVec3>, &Strand)| {
            points.windows(2).map(|pair| pair[0].distance(pair[1])).sum::<f64>() + closing(&points, strand)
        };
        self.polylines().into_iter().zip(&self.strands).map(of).sum()
    }

    /// The arcs as curves on the surface that the workshop was entered with.
    pub fn curves(&self) -> Vec<Curve> {
        let place = |i: u32| match self.nodes[i as usize].place {
            Place::Vertex(v) => SurfacePoint::Vertex(v),
            Place::Edge(e, t) => {
                let [a, b] = self.mesh.ends(e);
                SurfacePoint::Edge { edge: edge_key(a, b), t: if a < b { t } else { 1.0 - t } }
            }
        };
        let curve = |strand: &Strand| Curve {
            points: self.nodes_of(strand).into_iter().map(place).collect(),
            is_closed: strand.is_closed,
            sides: strand.sides,
        };
        self.strands.iter().map(curve).collect()
    }

    /// Whether an arc may come to this vertex.
    pub(super) fn is_free(&self, v: VertexId) -> bool {
        !self.is_fixed[v] && !self.occupied[v]
    }

    /// The places of the nodes inside an edge but `but`, from its first end.
    pub(super) fn others(&self, e: EdgeId, but: u32) -> impl Iterator<Item = f64> + '_ {
        let nodes = self.on_edge.get(&e).map_or(&[][..], |nodes| nodes.as_slice());
        nodes.iter().filter(move |&&i| i != but).map(|&i| match self.nodes[i as usize].place {
            Place::Edge(_, t) => t,
            Place::Vertex(_) => 0.0,
        })
    }

    /// Whether a place lies on a face, its corners and sides counted in.
    pub(super) fn lies_in(&self, place: Place, face: FaceId) -> bool {
        match place {
            Place::Vertex(v) => self.mesh.corners(face).contains(&v),
            Place::Edge(e, _) => {
                [halfedge_of(e), twin(halfedge_of(e))].into_iter().any(|h| self.mesh.face(h) == Some(face))
            }
        }
    }

    fn settle(&mut self, node: u32) {
        match self.nodes[node as usize].place {
            Place::Vertex(v) => self.occupied[v] = true,
            Place::Edge(e, _) => self.on_edge.entry(e).or_default().push(node),
        }
    }

    fn unsettle(&mut self, node: u32) {
        match self.nodes[node as usize].place {
            // Where arcs end they are many, and such vertices are fixed.
            Place::Vertex(v) => self.occupied[v] = false,
            Place::Edge(e, _) => {
                if let Some(nodes) = self.on_edge.get_mut(&e) {
                    nodes.retain(|i| *i != node);
                }
            }
        }
    }

    /// Moves a node.
    pub(super) fn relocate(&mut self, node: u32, place: Place) {
        self.unsettle(node);
        self.nodes[node as usize].place = place;
        self.settle(node);
    }

    /// Puts nodes at these places, perhaps none, instead of a node that has neighbours on both sides.
    pub(super) fn replace(&mut self, node: u32, places: &[Place]) {
        self.unsettle(node);
        let Node { prev, next, .. } = self.nodes[node as usize];
        self.nodes[node as usize].is_live = false;
        let mut before = prev;
        let mut first = next;
        for (k, &place) in places.iter().enumerate() {
            let new = self.nodes.len() as u32;
            self.nodes.push(Node { place, prev: before, next: NONE, is_live: true, is_held: false });
            self.nodes[before as usize].next = new;
            self.settle(new);
            before = new;
            first = if k == 0 { new } else { first };
        }
        self.nodes[before as usize].next = next;
        self.nodes[next as usize].prev = before;
        for strand in self.strands.iter_mut().filter(|strand| strand.first == node) {
            strand.first = first;
        }
    }
}

/// The number of edges is that of the workshop, tombstones counted in.
pub(super) fn per_edge<T: Clone>(mesh: &HalfedgeMesh, value: T) -> IdVec<Edge, T> {
    IdVec::filled(value, mesh.edge_slots())
}
