//! A half-edge mesh of triangles and quads with one editing operation and undo: the workshop of the quad steps.
//!
//! Half-edge `h` has the twin `h ^ 1`; a border half-edge has no face. The only edit of connectivity is
//! [`Mixed::replace`], which puts new faces in the place of old ones; what was written since [`Mixed::begin`] is undone
//! by [`Mixed::rollback`], so that an edit can be done first and judged afterwards.
//!
//! # Invariants
//! - Outside an open transaction every face is a triangle or a quad with distinct corners, every edge joins two
//!   distinct vertices and has one or two faces, and no two edges have the same ends within one star.
//! - Slots are never used twice between [`Mixed::compact`]s, so that an id that died stays dead.
//!
//! # Cost
//! An edit costs O(faces involved); undo costs what was written.

mod build;
mod disk;
mod journal;
mod replace;
mod shape;
#[cfg(test)]
mod tests;

use glam::DVec3;

pub use disk::Disk;
use journal::Journal;
pub use shape::{corner_sine, quad_quality, triangle_quality, warp};

/// No element.
pub const NONE: u32 = u32::MAX;

/// Corners of a new face: three or four.
pub type Corners = smallvec::SmallVec<[u32; 4]>;

/// What a vertex is bound to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// A corner of the network of curves: stays where it is.
    Node,
    /// A point of a curve, by its length from the curve's start.
    Arc {
        /// The curve.
        arc: u32,
        /// Length from its start.
        at: f64,
    },
    /// A point of a region's inside.
    Region(u32),
}

impl Place {
    /// Whether the vertex is inside a region and so free.
    #[inline]
    pub fn is_free(self) -> bool {
        matches!(self, Self::Region(_))
    }
}

/// The mesh. Vertices, half-edges and faces are plain numbers.
#[derive(Clone, Debug, Default)]
pub struct Mixed {
    next: Vec<u32>,
    prev: Vec<u32>,
    origin: Vec<u32>,
    face: Vec<u32>,
    arc: Vec<u32>,
    out: Vec<u32>,
    first: Vec<u32>,
    region: Vec<u32>,
    points: Vec<DVec3>,
    normals: Vec<DVec3>,
    places: Vec<Place>,
    sizes: Vec<f64>,
    journal: Journal,
    stamps: Vec<u32>,
    epoch: u32,
}

impl Mixed {
    /// Vertex slots, dead ones among them.
    pub fn vertex_slots(&self) -> u32 {
        self.out.len() as u32
    }

    /// Face slots, dead ones among them.
    pub fn face_slots(&self) -> u32 {
        self.first.len() as u32
    }

    /// Half-edge slots, dead ones among them.
    pub fn halfedge_slots(&self) -> u32 {
        self.next.len() as u32
    }

    /// The live vertices in order.
    pub fn vertices(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.vertex_slots()).filter(|&v| self.is_vertex(v))
    }

    /// The live faces in order.
    pub fn faces(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.face_slots()).filter(|&f| self.is_face(f))
    }

    /// One half-edge of each live edge, in order.
    pub fn edges(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.halfedge_slots()).step_by(2).filter(|&h| self.is_halfedge(h))
    }

    /// Whether the vertex is live.
    #[inline]
    pub fn is_vertex(&self, v: u32) -> bool {
        self.out[v as usize] != NONE
    }

    /// Whether the face is live.
    #[inline]
    pub fn is_face(&self, f: u32) -> bool {
        self.first[f as usize] != NONE
    }

    /// Whether the half-edge is live.
    #[inline]
    pub fn is_halfedge(&self, h: u32) -> bool {
        self.origin[h as usize] != NONE
    }

    /// The half-edge after `h` round its face.
    #[inline]
    pub fn next(&self, h: u32) -> u32 {
        self.next[h as usize]
    }

    /// The half-edge before `h` round its face.
    #[inline]
    pub fn prev(&self, h: u32) -> u32 {
        self.prev[h as usize]
    }

    /// Where `h` starts.
    #[inline]
    pub fn origin(&self, h: u32) -> u32 {
        self.origin[h as usize]
    }

    /// Where `h` ends.
    #[inline]
    pub fn target(&self, h: u32) -> u32 {
        self.origin[(h ^ 1) as usize]
    }

    /// The face on the left of `h`, or [`NONE`].
    #[inline]
    pub fn face(&self, h: u32) -> u32 {
        self.face[h as usize]
    }

    /// The first half-edge of a face.
    #[inline]
    pub fn first(&self, f: u32) -> u32 {
        self.first[f as usize]
    }

    /// A half-edge that starts at `v`, or [`NONE`] for a dead vertex.
    #[inline]
    pub fn out(&self, v: u32) -> u32 {
        self.out[v as usize]
    }

    /// The curve that the edge of `h` lies on, or [`NONE`].
    #[inline]
    pub fn arc(&self, h: u32) -> u32 {
        self.arc[(h >> 1) as usize]
    }

    /// The region of a face.
    #[inline]
    pub fn region(&self, f: u32) -> u32 {
        self.region[f as usize]
    }

    /// Where a vertex is.
    #[inline]
    pub fn point(&self, v: u32) -> DVec3 {
        self.points[v as usize]
    }

    /// The surface normal at a free vertex when it was last put onto the surface.
    #[inline]
    pub fn normal(&self, v: u32) -> DVec3 {
        self.normals[v as usize]
    }

    /// The edge length asked for at a vertex.
    #[inline]
    pub fn size(&self, v: u32) -> f64 {
        self.sizes[v as usize]
    }

    /// Asks for another edge length at a vertex; no part of a transaction.
    pub fn set_size(&mut self, v: u32, size: f64) {
        self.sizes[v as usize] = size;
    }

    /// What a vertex is bound to.
    #[inline]
    pub fn place(&self, v: u32) -> Place {
        self.places[v as usize]
    }

    /// Whether a face is a triangle.
    #[inline]
    pub fn is_triangle(&self, f: u32) -> bool {
        let h = self.first(f);
        self.next(self.next(self.next(h))) == h
    }

    /// The half-edges round a face.
    pub fn sides(&self, f: u32) -> impl Iterator<Item = u32> + '_ {
        let first = self.first(f);
        let mut at = first;
        let mut done = false;
        std::iter::from_fn(move || {
            if done {
                return None;
            }
            let h = at;
            at = self.next(h);
            done = at == first;
            Some(h)
        })
    }

    /// The corners of a face.
    pub fn corners(&self, f: u32) -> Corners {
        self.sides(f).map(|h| self.origin(h)).collect()
    }

    /// The half-edges that start at `v`, counter-clockwise.
    pub fn star(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        let first = self.out(v);
        let mut at = first;
        std::iter::from_fn(move || {
            if at == NONE {
                return None;
            }
            let h = at;
            let turned = self.prev(h) ^ 1;
            at = if turned == first { NONE } else { turned };
            Some(h)
        })
    }

    /// The faces at `v`, counter-clockwise.
    pub fn faces_at(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        self.star(v).map(|h| self.face(h)).filter(|&f| f != NONE)
    }

    /// The neighbours of `v`, counter-clockwise.
    pub fn neighbours(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        self.star(v).map(|h| self.target(h))
    }

    /// The number of edges at `v`.
    pub fn valence(&self, v: u32) -> usize {
        self.star(v).count()
    }

    /// The half-edge from `a` to `b`.
    pub fn find(&self, a: u32, b: u32) -> Option<u32> {
        self.star(a).find(|&h| self.target(h) == b)
    }

    /// The length of an edge.
    #[inline]
    pub fn length(&self, h: u32) -> f64 {
        (self.point(self.target(h)) - self.point(self.origin(h))).length()
    }

    /// The coordinates of a triangle's corners.
    pub fn triangle(&self, f: u32) -> [DVec3; 3] {
        let h = self.first(f);
        [h, self.next(h), self.prev(h)].map(|k| self.point(self.origin(k)))
    }

    /// The faces at any of these vertices, each once.
    pub fn faces_around(&self, vertices: &[u32]) -> Vec<u32> {
        let mut found = Vec::new();
        for &v in vertices {
            let at: smallvec::SmallVec<[u32; 12]> = self.faces_at(v).collect();
            for f in at {
                if !found.contains(&f) {
                    found.push(f);
                }
            }
        }
        found
    }

    /// Whether the star of `v` is one of a proper mesh: distinct neighbours and, inside, at least `least` of them.
    pub fn is_proper(&self, v: u32, least: usize) -> bool {
        /// Rings longer than this are sorted to find a vertex twice.
        const LONG: usize = 32;
        let mut ring: smallvec::SmallVec<[u32; 16]> = self.neighbours(v).collect();
        let border = self.star(v).any(|h| self.face(h) == NONE);
        if ring.len() < if border { 2 } else { least } {
            return false;
        }
        if ring.len() > LONG {
            ring.sort_unstable();
            return !ring.contains(&v) && ring.windows(2).all(|pair| pair[0] != pair[1]);
        }
        ring.iter().enumerate().all(|(i, a)| *a != v && !ring[..i].contains(a))
    }

    /// Number of live triangles and quads.
    pub fn census(&self) -> (usize, usize) {
        let triangles = self.faces().filter(|&f| self.is_triangle(f)).count();
        (triangles, self.faces().count() - triangles)
    }
}
