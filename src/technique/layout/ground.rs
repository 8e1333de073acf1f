//! The triangle mesh that a layout lies on: what is beside each side, and which faces belong together.

use glam::DVec3;

use crate::mesh::id::{Face, Vertex};
use crate::mesh::topology::{EdgeTable, VertexFaces};
use crate::mesh::{FaceId, IdVec, Surface, VertexId};

/// A directed side of a face: from corner `side` to the next one, the face on its left.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Side {
    /// The face.
    pub face: FaceId,
    /// The corner that it begins at.
    pub corner: u8,
}

/// A surface with its adjacency, cut into domains that no element of a layout crosses.
#[derive(Clone, Debug)]
pub struct Ground<'a> {
    /// The surface.
    pub surface: &'a Surface,
    /// The face beyond each side.
    pub across: IdVec<Face, [Option<FaceId>; 3]>,
    /// The faces at each vertex.
    pub faces_at: VertexFaces,
    /// Whether a vertex lies on the rim of the surface.
    pub on_rim: IdVec<Vertex, bool>,
    /// Whether a vertex lies on the border of a domain, which the rim of the surface is too.
    pub on_border: IdVec<Vertex, bool>,
    /// The domain of each face: faces of one region that hang together over edges.
    pub domain: IdVec<Face, u32>,
    /// How many domains there are.
    pub domains: usize,
    /// Twice the area of each face along its normal.
    pub areas: IdVec<Face, DVec3>,
}

impl<'a> Ground<'a> {
    /// The adjacency of `surface`; its domains are the connected parts of its regions.
    pub fn new(surface: &'a Surface) -> Self {
        let edges = EdgeTable::new(surface);
        let mut across = IdVec::filled([None; 3], surface.faces.len());
        let mut on_rim = IdVec::filled(false, surface.points.len());
        for (_, key, sides) in edges.iter() {
            if let [a, b] = sides {
                across[a.face][usize::from(a.side)] = Some(b.face);
                across[b.face][usize::from(b.side)] = Some(a.face);
            } else {
                for &v in &key {
                    on_rim[v] = true;
                }
            }
        }
        let labels = surface.carried.regions.as_ref().map(|regions| &regions.labels);
        let label = |f: FaceId| labels.and_then(|labels| labels.get(f)).copied().unwrap_or(0);
        let (domain, domains) = components(&across, |a, b| label(a) == label(b));
        let faces_at = VertexFaces::new(surface);
        let differ = |v: VertexId| faces_at.of(v).iter().any(|&f| domain[f] != domain[faces_at.of(v)[0]]);
        let on_border = surface.points.ids().map(|v| on_rim[v] || differ(v)).collect();
        let area = |f| crate::mesh::geometry::area_vector(surface.corners(f));
        let areas = surface.faces.ids().map(area).collect();
        Self { surface, across, faces_at, on_rim, on_border, domain, domains, areas }
    }

    /// The coordinates of a vertex.
    #[inline]
    pub fn point(&self, v: VertexId) -> DVec3 {
        self.surface.points[v]
    }

    /// Where a side begins.
    #[inline]
    pub fn origin(&self, side: Side) -> VertexId {
        self.surface.faces[side.face][usize::from(side.corner)]
    }

    /// Where a side ends.
    #[inline]
    pub fn target(&self, side: Side) -> VertexId {
        self.surface.faces[side.face][usize::from((side.corner + 1) % 3)]
    }

    /// The face beyond a side.
    #[inline]
    pub fn beyond(&self, side: Side) -> Option<FaceId> {
        self.across[side.face][usize::from(side.corner)]
    }

    /// The same edge seen from the face beyond.
    pub fn twin(&self, side: Side) -> Option<Side> {
        let (face, end) = (self.beyond(side)?, self.target(side));
        self.corner_of(face, end).map(|corner| Side { face, corner })
    }

    /// Which corner of a face a vertex is.
    #[inline]
    pub fn corner_of(&self, face: FaceId, v: VertexId) -> Option<u8> {
        self.surface.faces[face].iter().position(|&w| w == v).map(|k| k as u8)
    }

    /// The side from `a` to `b`, where a face has it.
    pub fn side_between(&self, a: VertexId, b: VertexId) -> Option<Side> {
        let sides =
            self.faces_at.of(a).iter().filter_map(|&face| Some(Side { face, corner: self.corner_of(face, a)? }));
        sides.into_iter().find(|&side| self.target(side) == b)
    }

    /// The edges that leave a vertex with a face on both sides: where they lead, the left face, the right face.
    pub fn leaving(&self, v: VertexId) -> impl Iterator<Item = (VertexId, FaceId, FaceId)> {
        self.faces_at.of(v).iter().filter_map(move |&face| {
            let side = Side { face, corner: self.corner_of(face, v)? };
            Some((self.target(side), face, self.beyond(side)?))
        })
    }

    /// Of a side on the border of the faces `inside`: the next side of that border.
    pub fn next_on_border(&self, side: Side, inside: impl Fn(FaceId) -> bool) -> Side {
        let pivot = self.target(side);
        let mut at = Side { face: side.face, corner: (side.corner + 1) % 3 };
        // A fan has no more faces than there are at the pivot.
        for _ in 0..self.faces_at.of(pivot).len() {
            let Some(next) = self.beyond(at).filter(|&f| inside(f)) else { break };
            let Some(corner) = self.corner_of(next, pivot) else { break };
            at = Side { face: next, corner };
        }
        at
    }

    /// The unit normal of a face; zero without area.
    pub fn normal(&self, face: FaceId) -> DVec3 {
        crate::mesh::geometry::triangle_normal(self.surface.corners(face)).unwrap_or(DVec3::ZERO)
    }

    /// The normal at a vertex, of those of its faces that are `inside`, weighted by area.
    pub fn normal_at(&self, v: VertexId, inside: impl Fn(FaceId) -> bool) -> DVec3 {
        let faces = self.faces_at.of(v).iter().filter(|&&f| inside(f));
        let sum: DVec3 = faces.map(|&f| crate::mesh::geometry::area_vector(self.surface.corners(f))).sum();
        sum.normalize_or_zero()
    }
}

/// Numbers the sets of faces that hang together over sides where `joined`, by their lowest face.
pub fn components(
    across: &IdVec<Face, [Option<FaceId>; 3]>,
    joined: impl Fn(FaceId, FaceId) -> bool,
) -> (IdVec<Face, u32>, usize) {
    let mut of = IdVec::filled(u32::MAX, across.len());
    let (mut count, mut open) = (0, Vec::new());
    for start in across.ids() {
        if of[start] != u32::MAX {
            continue;
        }
        of[start] = count as u32;
        open.push(start);
        while let Some(f) = open.pop() {
            for next in across[f].into_iter().flatten() {
                if of[next] == u32::MAX && joined(f, next) {
                    of[next] = count as u32;
                    open.push(next);
                }
            }
        }
        count += 1;
    }
    (of, count)
}
