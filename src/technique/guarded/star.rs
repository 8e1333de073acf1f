//! The star of a collapsing edge: what all tests of its candidates read, gathered once into flat arrays.
//!
//! The vertices round the edge, their positions, and the faces that survive as pairs of neighbours on that ring. What
//! does not depend on the candidate (sides on the ring, normals of the faces as they are) is computed once; a
//! candidate then costs two square roots and one cross product a face. Nothing here allocates once the arrays have
//! grown.

use glam::DVec3;

use super::normals::{HAS_NORMAL, LEAST_TURN_COSINE, agree};
use super::refused::Refused;
use super::tally::Tally;
use crate::mesh::edit::CollapsePlan;
use crate::mesh::geometry::area_vector;
use crate::mesh::halfedge::{HalfedgeMesh, twin};
use crate::mesh::{FaceId, HalfedgeId, VertexId};

/// Stretch is computed here with other roundings than when a result is recounted.
const ROUNDING: f64 = 1.0 + 1e-12;

/// Stretch and size of a face.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Shape {
    pub(super) stretch: f32,
    pub(super) size: f32,
}

/// A face that survives: the merged vertex and two neighbours on the ring.
#[derive(Clone, Copy, Debug)]
struct Survivor {
    face: FaceId,
    /// Places on the ring.
    side: [u32; 2],
    /// The length of that side.
    length: f64,
    /// The normal as it is, as long as twice the area, and that length.
    normal: DVec3,
    area: f64,
    has_normal: bool,
}

/// A neighbour of the edge.
#[derive(Clone, Copy, Debug)]
struct Neighbour {
    vertex: VertexId,
    point: DVec3,
    /// From the candidate to it.
    spoke: DVec3,
    length: f64,
}

/// What a candidate must keep.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) floor: f64,
    pub(super) ceiling: f64,
}

/// The star of one edge.
#[derive(Debug, Default)]
pub(super) struct Star {
    ring: Vec<Neighbour>,
    survivors: Vec<Survivor>,
    /// The faces of the edge itself.
    gone: [Option<FaceId>; 2],
    gone_has_normal: [bool; 2],
    /// How many of the survivors hang on the vanishing vertex; the others hang on the kept one.
    of_removed: usize,
    pub(super) before: Tally,
    /// How often a star was walked, to tell plans that are out of date.
    pub(super) age: u64,
}

impl Star {
    /// Walks round both ends. Returns the valence of the merged vertex.
    pub(super) fn walk(&mut self, mesh: &HalfedgeMesh, plan: &CollapsePlan) -> usize {
        self.age += 1;
        self.ring.clear();
        self.survivors.clear();
        let (h, t) = (plan.halfedge, twin(plan.halfedge));
        let [left, right] = [mesh.face(h), mesh.face(t)];
        self.gone = [left, right];
        self.gone_has_normal = [false; 2];
        self.walk_end(mesh, h, right, None, None);
        self.of_removed = self.survivors.len();
        let last = self.ring.len().wrapping_sub(1) as u32;
        let shared = [left.map(|_| last), right.map(|_| 0)];
        self.walk_end(mesh, t, left, shared[0], shared[1]);
        self.ring.len()
    }

    /// Walks round the origin of `from`, without `from` itself. `first` and `last` are the places on the ring that the
    /// first and the last neighbour have already.
    fn walk_end(
        &mut self,
        mesh: &HalfedgeMesh,
        from: HalfedgeId,
        skip: Option<FaceId>,
        first: Option<u32>,
        last: Option<u32>,
    ) {
        let mut out = mesh.next(twin(from));
        let mut previous = 0;
        let mut known = first;
        while out != from {
            let following = mesh.next(twin(out));
            if following == from && last.is_some() {
                known = last;
            }
            let at = known.take().unwrap_or(self.ring.len() as u32);
            if at as usize == self.ring.len() {
                let vertex = mesh.target(out);
                self.ring.push(Neighbour { vertex, point: DVec3::ZERO, spoke: DVec3::ZERO, length: 0.0 });
            }
            if let Some(face) = mesh.face(out).filter(|&f| Some(f) != skip) {
                let (normal, area) = (DVec3::ZERO, 0.0);
                self.survivors.push(Survivor {
                    face,
                    side: [at, previous],
                    length: 0.0,
                    normal,
                    area,
                    has_normal: true,
                });
            }
            previous = at;
            out = following;
        }
    }

    /// Measures what was walked over. `ends` are the positions of the vanishing and of the kept vertex.
    pub(super) fn measure(&mut self, mesh: &HalfedgeMesh, shapes: &[Shape], ends: [DVec3; 2], threshold: f64) {
        for neighbour in &mut self.ring {
            neighbour.point = mesh.point(neighbour.vertex);
        }
        let mut before = Tally::short_of(threshold);
        for (at, face) in self.gone.into_iter().enumerate() {
            let Some(face) = face else { continue };
            let Shape { stretch, size } = shapes[face.index()];
            before.add(f64::from(stretch), f64::from(size));
            self.gone_has_normal[at] = f64::from(stretch) >= HAS_NORMAL;
        }
        for (place, survivor) in self.survivors.iter_mut().enumerate() {
            let Shape { stretch, size } = shapes[survivor.face.index()];
            before.add(f64::from(stretch), f64::from(size));
            survivor.has_normal = f64::from(stretch) >= HAS_NORMAL;
            let [a, b] = survivor.side.map(|at| self.ring[at as usize].point);
            survivor.length = (b - a).length();
            let end = ends[usize::from(place >= self.of_removed)];
            survivor.normal = (a - end).cross(b - end);
            survivor.area = survivor.normal.length();
        }
        self.before = before;
    }

    /// The centroid of the ring; `None` for an empty one.
    pub(super) fn centroid(&self) -> Option<DVec3> {
        let count = self.ring.len();
        (count > 0).then(|| self.ring.iter().map(|n| n.point).sum::<DVec3>() / count as f64)
    }

    /// Whether nothing lies round the edge.
    pub(super) fn is_empty(&self) -> bool {
        self.ring.is_empty()
    }

    /// The tally of the survivors with the merged vertex at `p`, where they keep the bounds and none folds over.
    pub(super) fn assess(&mut self, mesh: &HalfedgeMesh, p: DVec3, bounds: Bounds) -> Result<Tally, Refused> {
        for neighbour in &mut self.ring {
            neighbour.spoke = neighbour.point - p;
            neighbour.length = neighbour.spoke.length();
        }
        let mut after = Tally::short_of(self.before.threshold);
        let mut has_slivers = false;
        let floor = bounds.floor * ROUNDING;
        for survivor in &self.survivors {
            let [a, b] = survivor.side.map(|at| &self.ring[at as usize]);
            let normal = a.spoke.cross(b.spoke);
            if survivor.has_normal && normal.dot(survivor.normal) <= 0.0 {
                return Err(Refused::FoldOver);
            }
            let area = normal.length();
            let size = a.length.max(b.length).max(survivor.length);
            let round = a.length + b.length + survivor.length;
            // √12 · inradius / longest side; the inradius is twice the area over the circumference.
            let stretch = 12.0_f64.sqrt() * area / (round * size);
            // The comparison refuses what is not a number.
            let is_good = stretch >= floor && stretch > 0.0 && size <= bounds.ceiling;
            let has_turned =
                survivor.has_normal && normal.dot(survivor.normal) < LEAST_TURN_COSINE * area * survivor.area;
            if !is_good || has_turned {
                return Err(if is_good { Refused::FoldOver } else { Refused::Shape });
            }
            has_slivers |= !survivor.has_normal;
            after.add_stretch(stretch);
        }
        if !has_slivers || self.slivers_agree(mesh) { Ok(after) } else { Err(Refused::FoldOver) }
    }

    /// Whether the faces that take the place of slivers look the way an old face looks that has a normal, or all old
    /// faces together where none has.
    fn slivers_agree(&self, mesh: &HalfedgeMesh) -> bool {
        let edge = |at: usize| self.gone[at].map(|f| area_vector(mesh.corner_points(f)));
        let steady_edges = (0..2).filter(|&at| self.gone_has_normal[at]).filter_map(edge);
        let steady = steady_edges.chain(self.survivors.iter().filter(|s| s.has_normal).map(|s| s.normal));
        let has_steady = steady.clone().next().is_some();
        let all: DVec3 = (0..2).filter_map(edge).chain(self.survivors.iter().map(|s| s.normal)).sum();
        self.survivors.iter().filter(|s| !s.has_normal).all(|survivor| {
            let [a, b] = survivor.side.map(|at| self.ring[at as usize].spoke);
            let normal = a.cross(b);
            if has_steady { steady.clone().any(|n| agree(normal, n)) } else { normal.dot(all) > 0.0 }
        })
    }

    /// The faces before the collapse, those of the edge first.
    pub(super) fn old_faces(&self) -> impl Iterator<Item = FaceId> + '_ {
        self.gone.into_iter().flatten().chain(self.survivors.iter().map(|s| s.face))
    }

    /// The faces after it, with their corners; the merged vertex at `p` comes first.
    pub(super) fn new_faces(&self, p: DVec3) -> impl Iterator<Item = (FaceId, [DVec3; 3])> + '_ {
        self.survivors.iter().map(move |s| {
            let [a, b] = s.side.map(|at| self.ring[at as usize].point);
            (s.face, [p, a, b])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::edit::check_collapse;
    use crate::mesh::geometry::{stretch, triangle_size};
    use crate::mesh::halfedge::tests::{enter, surface};

    /// A grid of right-angled triangles with a little relief.
    fn relief() -> HalfedgeMesh {
        let at = |i: u32, j: u32| [f64::from(i), f64::from(j), 0.1 * f64::from((i * 7 + j * 5) % 4)];
        let points: Vec<[f64; 3]> = (0..5).flat_map(|j| (0..5).map(move |i| at(i, j))).collect();
        let squares = (0..4).flat_map(|j| (0..4).map(move |i| 5 * j + i));
        let faces: Vec<[u32; 3]> = squares.flat_map(|k| [[k, k + 1, k + 6], [k, k + 6, k + 5]]).collect();
        enter(&surface(&points, &faces))
    }

    #[test]
    fn agrees_with_the_plan_and_with_plain_geometry() {
        let mesh = relief();
        let shapes: Vec<Shape> = mesh
            .faces()
            .map(|f| mesh.corner_points(f))
            .map(|t| Shape { stretch: stretch(t) as f32, size: triangle_size(t) as f32 })
            .collect();
        let mut star = Star::default();
        let plans: Vec<CollapsePlan> = mesh.edges().filter_map(|e| check_collapse(&mesh, e).ok()).collect();
        assert!(plans.len() > 30);
        for plan in plans {
            let valence = star.walk(&mesh, &plan);
            assert_eq!(valence, plan.new_valence(&mesh));
            let ends = [plan.removed, plan.kept].map(|v| mesh.point(v));
            star.measure(&mesh, &shapes, ends, 0.0);
            let p = 0.5 * (ends[0] + ends[1]);
            let expected: Vec<[DVec3; 3]> = plan
                .new_star(&mesh)
                .map(|(_, corners)| corners.map(|v| if v == plan.kept { p } else { mesh.point(v) }))
                .collect();
            let faces: Vec<[DVec3; 3]> = star.new_faces(p).map(|(_, points)| points).collect();
            assert_eq!(faces, expected);
            let tally = star.assess(&mesh, p, Bounds { floor: 0.0, ceiling: f64::INFINITY });
            let Ok(tally) = tally else { continue };
            let least = expected.iter().map(|&t| stretch(t)).fold(1.0, f64::min);
            assert!((tally.stretch_min - least).abs() < 1e-12);
            assert!(star.assess(&mesh, p, Bounds { floor: least * 1.001, ceiling: f64::INFINITY }).is_err());
        }
    }
}
