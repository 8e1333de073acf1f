//! Subdivides a surface: every face in four, or only edges longer than a limit.
//!
//! H. Date, S. Kanai, T. Kishinami, I. Nishigaki and T. Dohi, *High-quality and property controlled finite element mesh
//! generation from triangular meshes using the multiresolution technique*, Journal of Computing and Information
//! Science in Engineering, 2005: sections 5.1 (each face into four similar ones) and 4.1 (selective midpoints until no
//! edge is too long).
//!
//! Invariants: see [`halve_edges`](super::halve_edges); [`refine`] leaves no edge longer than its limit, except kept
//! edges and the few that they force: a triangle on a stuck edge of length `k` always has another side of at least
//! `k / 2`, so its other sides are only asked to be at most `3 k / 4`, and those that stay longer than their limit are
//! stuck for the next triangle. Sizes so fall by a quarter a layer around a kept edge. Without that rule the halving
//! would never end; with it the triangle on a stuck edge is final once its third corner is low over the middle half.
//! Cost: linear in the faces made, times the logarithm of the longest edge over the limit.
//!
//! Departure: edges between faces of one plane may be flipped before and between rounds, see [`Flips`]. The flat faces
//! of CAD programs are fans of needles, each of which would be halved to pieces of its own.

mod count;
mod flips;

use crate::mesh::freedom::ResolvedFreedom;
use crate::mesh::id::{Edge, Face};
use crate::mesh::topology::EdgeTable;
use crate::mesh::{EdgeId, FaceId, FreedomError, IdVec, LockRules, Surface, resolve_freedom};
use crate::technique::flat_flips::FlipError;
use crate::technique::halve_edges::{Halved, agree_on_seams, halve_edges, predict_faces, seam_copies};
use crate::watch::{Cancelled, Watch};
use count::least_faces;
use flips::Flattener;

/// The usual limit of faces: about 3 GB of memory.
pub const MAX_FACES: usize = 20_000_000;

/// Rounds after which edges are only halved, which ends.
const FLIP_ROUNDS: usize = 64;

/// How long edges may be.
#[derive(Clone, Debug, PartialEq)]
pub enum MaxEdge {
    /// The same everywhere.
    Uniform(f64),
    /// Lengths at the corners of each face, linear between them.
    Corners(IdVec<Face, [f64; 3]>),
}

/// Whether edges between faces of one plane are flipped where that makes the least angle larger.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Flips {
    /// Every face of the result lies in one face of the surface.
    #[default]
    None,
    /// Where the surface moves by no more than coordinates in single precision are rounded.
    Flat,
}

/// What was done.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Refinement {
    /// Rounds of halving.
    pub rounds: usize,
    /// Edges halved in all rounds.
    pub halved: usize,
    /// Edges longer than the limit at the end: kept ones, and those that kept ones force.
    pub long_edges: usize,
    /// The longest edge at the end.
    pub longest: f64,
    /// Edges flipped in all rounds.
    pub flips: usize,
    /// The largest distance between the diagonals of a pair of faces that was flipped.
    pub largest_shift: f64,
}

/// Why a surface was not subdivided.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RefineError {
    /// The result would have too many faces.
    #[error("the result would have at least {predicted} faces, more than the {max_faces} allowed")]
    TooManyFaces {
        /// A lower bound of the faces it would have.
        predicted: usize,
        /// The limit.
        max_faces: usize,
    },
    /// A limit for edges is not a positive number.
    #[error("the largest edge length must be positive and finite, got {0}")]
    BadLimit(f64),
    /// The locks name a group that the surface does not have.
    #[error(transparent)]
    Locks(#[from] FreedomError),
    /// There is no surface to flip edges of.
    #[error(transparent)]
    Flips(#[from] FlipError),
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Cuts every face into four similar ones, `times` times; faces at kept edges into fewer.
///
/// # Errors
/// See [`RefineError`].
pub fn subdivide(
    surface: &Surface,
    times: u32,
    max_faces: usize,
    locks: &LockRules<'_>,
    watch: &Watch,
) -> Result<(Surface, Refinement), RefineError> {
    let mut current = Round::new(surface.clone(), locks)?;
    if current.may.iter().all(|&may| may) {
        let factor = 4_usize.checked_pow(times).unwrap_or(usize::MAX);
        check_count(current.surface.faces.len().saturating_mul(factor), max_faces)?;
    }
    let mut report = Refinement::default();
    watch.phase("subdividing", Some(u64::from(times)));
    for round in 0..times {
        watch.check()?;
        let mut halve = current.may.clone();
        agree_on_seams(&current.copies, &current.may, &mut halve);
        let halved = current.halve(&halve, max_faces)?;
        report.halved += halved.midpoints.len();
        report.rounds += usize::from(!halved.midpoints.is_empty());
        current = Round::new(halved.surface, locks)?;
        let faces = current.surface.faces.len();
        watch.advance(u64::from(round) + 1, || format!("{faces} faces"));
    }
    report.longest = current.longest();
    Ok((current.surface, report))
}

/// Cuts some faces in four, and those beside them to match; also the face that each was cut from. Kept edges stay.
///
/// # Errors
/// See [`RefineError`].
pub fn quarter(
    surface: &Surface,
    faces: &[FaceId],
    max_faces: usize,
) -> Result<(Surface, IdVec<Face, FaceId>), RefineError> {
    let round = Round::new(surface.clone(), &LockRules::default())?;
    let sides = round.edges.edges_of_triangles(surface.faces.len());
    let mut halve: IdVec<Edge, bool> = IdVec::filled(false, round.edges.len());
    for &e in faces.iter().filter_map(|&f| sides.get(f)).flatten() {
        halve[e] = round.may[e];
    }
    agree_on_seams(&round.copies, &round.may, &mut halve);
    let halved = round.halve(&halve, max_faces)?;
    Ok((halved.surface, halved.parents))
}

/// Halves edges longer than their limit until there is none.
///
/// # Errors
/// See [`RefineError`].
pub fn refine(
    surface: &Surface,
    max_edge: &MaxEdge,
    max_faces: usize,
    flips: Flips,
    locks: &LockRules<'_>,
    watch: &Watch,
) -> Result<(Surface, Refinement), RefineError> {
    check_limits(max_edge)?;
    let mut report = Refinement::default();
    let (mut start, mut limit) = (surface.clone(), max_edge.clone());
    let flattener = (flips == Flips::Flat).then(|| Flattener::new(surface, locks));
    watch.phase("refining", None);
    if let Some(flattener) = &flattener {
        flattener.flip(&mut start, &mut limit, 0, &mut report)?;
    }
    let mut current = Round::new(start, locks)?;
    check_count(least_faces(&current, &limit, flips, max_faces), max_faces)?;
    loop {
        watch.check()?;
        let limits = current.limits(&limit);
        let halve = current.too_long(&limits);
        if !halve.iter().any(|&h| h) {
            report.long_edges = current.edges.keys().ids().filter(|&e| current.length(e) > limits[e]).count();
            report.longest = current.longest();
            return Ok((current.surface, report));
        }
        let mut halved = current.halve(&halve, max_faces)?;
        report.rounds += 1;
        report.halved += halved.midpoints.len();
        limit = inherit_limits(&limit, &current.surface, &halved);
        if let Some(flattener) = flattener.as_ref().filter(|_| report.rounds < FLIP_ROUNDS) {
            flattener.flip(&mut halved.surface, &mut limit, halved.first_midpoint, &mut report)?;
        }
        current = Round::new(halved.surface, locks)?;
        let faces = current.surface.faces.len();
        watch.advance(faces as u64, || format!("{faces} faces"));
    }
}

fn check_limits(max_edge: &MaxEdge) -> Result<(), RefineError> {
    let bad = |length: &f64| !(length.is_finite() && *length > 0.0);
    let found = match max_edge {
        MaxEdge::Uniform(length) => Some(*length).filter(bad),
        MaxEdge::Corners(corners) => corners.iter().flatten().copied().find(bad),
    };
    found.map_or(Ok(()), |length| Err(RefineError::BadLimit(length)))
}

fn check_count(predicted: usize, max_faces: usize) -> Result<(), RefineError> {
    if predicted > max_faces { Err(RefineError::TooManyFaces { predicted, max_faces }) } else { Ok(()) }
}

/// A surface between two rounds of halving.
struct Round {
    surface: Surface,
    edges: EdgeTable,
    may: IdVec<Edge, bool>,
    copies: Vec<Vec<EdgeId>>,
}

impl Round {
    fn new(surface: Surface, locks: &LockRules<'_>) -> Result<Self, RefineError> {
        let freedom: ResolvedFreedom = resolve_freedom(&surface, locks)?;
        let edges = EdgeTable::new(&surface);
        let may = edges.keys().iter().map(|&key| freedom.may_halve(key)).collect();
        let copies = seam_copies(&surface, &edges);
        Ok(Self { surface, edges, may, copies })
    }

    fn length(&self, edge: EdgeId) -> f64 {
        let [a, b] = self.edges.key(edge);
        self.surface.points[a].distance(self.surface.points[b])
    }

    fn longest(&self) -> f64 {
        self.edges.keys().ids().map(|e| self.length(e)).fold(0.0, f64::max)
    }

    /// The edges to halve: those above what can be reached, and their copies.
    fn too_long(&self, limits: &IdVec<Edge, f64>) -> IdVec<Edge, bool> {
        let asked = self.relaxed(limits);
        let mut halve: IdVec<Edge, bool> =
            self.edges.keys().ids().map(|e| self.may[e] && self.length(e) > asked[e]).collect();
        agree_on_seams(&self.copies, &self.may, &mut halve);
        halve
    }

    fn halve(&self, halve: &IdVec<Edge, bool>, max_faces: usize) -> Result<Halved, RefineError> {
        check_count(predict_faces(&self.edges, self.surface.faces.len(), halve), max_faces)?;
        Ok(halve_edges(&self.surface, &self.edges, halve))
    }

    /// The limit of each edge: the smaller one of its faces, at its middle.
    fn limits(&self, max_edge: &MaxEdge) -> IdVec<Edge, f64> {
        match max_edge {
            MaxEdge::Uniform(length) => IdVec::filled(*length, self.edges.len()),
            MaxEdge::Corners(corners) => {
                let at = |side: &crate::mesh::topology::SideRef| {
                    let lengths = corners[side.face];
                    let k = usize::from(side.side);
                    0.5 * (lengths[k] + lengths[(k + 1) % 3])
                };
                let of = |e| self.edges.sides(e).iter().map(at).fold(f64::INFINITY, f64::min);
                self.edges.keys().ids().map(of).collect()
            }
        }
    }

    /// The limits that can be reached: beside an edge that stays long, three quarters of its length.
    fn relaxed(&self, limits: &IdVec<Edge, f64>) -> IdVec<Edge, f64> {
        let mut asked = limits.clone();
        let mut is_stuck = IdVec::filled(false, self.edges.len());
        for e in self.edges.keys().ids() {
            is_stuck[e] = !self.may[e];
        }
        for group in self.copies.iter().filter(|group| group.iter().any(|&e| !self.may[e])) {
            for &e in group {
                is_stuck[e] = true;
            }
        }
        let mut waiting: Vec<EdgeId> =
            self.edges.keys().ids().filter(|&e| is_stuck[e] && self.length(e) > limits[e]).collect();
        if waiting.is_empty() {
            return asked;
        }
        let sides = self.edges.edges_of_triangles(self.surface.faces.len());
        while let Some(stuck) = waiting.pop() {
            let reachable = 0.75 * self.length(stuck);
            let faces = self.edges.sides(stuck).iter().map(|side| side.face);
            for e in faces.flat_map(|f| sides[f]).filter(|&e| e != stuck) {
                asked[e] = asked[e].max(reachable);
                let length = self.length(e);
                if !is_stuck[e] && length > limits[e] && length <= asked[e] {
                    is_stuck[e] = true;
                    waiting.push(e);
                }
            }
        }
        asked
    }
}

/// The corner lengths of the new faces, linear in their parents.
fn inherit_limits(old: &MaxEdge, surface: &Surface, halved: &Halved) -> MaxEdge {
    let MaxEdge::Corners(lengths) = old else { return old.clone() };
    let new = halved.surface.faces.enumerate().map(|(f, corners)| {
        let parent = halved.parents[f];
        let of_old = |v| surface.faces[parent].iter().position(|&c| c == v).map_or(0.0, |k| lengths[parent][k]);
        corners.map(|v| match v.index().checked_sub(halved.first_midpoint) {
            None => of_old(v),
            Some(k) => halved.midpoints[k].iter().map(|&end| 0.5 * of_old(end)).sum(),
        })
    });
    MaxEdge::Corners(new.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::geometry::triangle_area;
    use crate::mesh::halfedge::tests::surface;
    use crate::mesh::validate::validate_surface;
    use crate::mesh::{EdgeMark, Field, Freedom, MarkCause, SeamId, Support, VertexId, edge_key};

    fn triangle(points: &[[f64; 3]]) -> Surface {
        surface(points, &[[0, 1, 2]])
    }

    fn refined(mesh: &Surface, limit: f64) -> (Surface, Refinement) {
        let result = refine(mesh, &MaxEdge::Uniform(limit), 1000, Flips::None, &LockRules::default(), &Watch::silent());
        let (out, report) = result.expect("refined");
        assert_eq!(validate_surface(&out), []);
        (out, report)
    }

    #[test]
    fn an_equilateral_triangle_becomes_four() {
        let mesh = triangle(&[[0.0; 3], [1.0, 0.0, 0.0], [0.5, 0.75_f64.sqrt(), 0.0]]);
        assert_eq!(refined(&mesh, 0.6).0.faces.len(), 4);
        assert_eq!(refined(&mesh, 1.1).0, mesh);
    }

    #[test]
    fn two_long_sides_make_three_faces() {
        let mesh = triangle(&[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 0.3, 0.0]]);
        let (out, report) = refined(&mesh, 0.6);
        assert_eq!((out.faces.len(), report.halved, report.long_edges), (3, 2, 0));
        assert!(report.longest <= 0.6);
    }

    #[test]
    fn kept_edges_stay_and_the_halving_ends() {
        let mut mesh = triangle(&[[0.0; 3], [1.0, 0.0, 0.0], [0.5, 0.9, 0.0]]);
        let kept = edge_key(VertexId::new(0), VertexId::new(1));
        mesh.carried.mark(kept, EdgeMark { freedom: Freedom::Keep, cause: MarkCause::Locked });
        let (out, report) = refined(&mesh, 0.2);
        assert!(EdgeTable::new(&out).find(kept).is_some());
        assert!(report.long_edges > 0 && out.faces.len() > 10);
    }

    #[test]
    fn subdividing_makes_four_faces_of_each_and_refuses_beforehand() {
        let mesh = triangle(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let (out, _) = subdivide(&mesh, 3, 64, &LockRules::default(), &Watch::silent()).expect("64 fit");
        assert_eq!(out.faces.len(), 64);
        let area: f64 = out.faces.ids().map(|f| triangle_area(out.corners(f))).sum();
        assert_eq!(area, 0.5);
        let error = subdivide(&mesh, 40, 64, &LockRules::default(), &Watch::silent()).unwrap_err();
        assert!(matches!(error, RefineError::TooManyFaces { max_faces: 64, .. }));
        let error = refine(&mesh, &MaxEdge::Uniform(1e-9), 64, Flips::None, &LockRules::default(), &Watch::silent())
            .unwrap_err();
        assert!(matches!(error, RefineError::TooManyFaces { .. }));
    }

    #[test]
    fn one_face_in_four_cuts_the_face_beside_it_in_two() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let mesh = surface(&points, &[[0, 1, 2], [0, 2, 3]]);
        let (out, parents) = quarter(&mesh, &[FaceId::new(0)], 100).expect("cut");
        assert_eq!(validate_surface(&out), []);
        let parts = |f: usize| parents.iter().filter(|&&p| p == FaceId::new(f)).count();
        assert_eq!((out.faces.len(), parts(0), parts(1)), (6, 4, 2));
        assert!(matches!(quarter(&mesh, &[FaceId::new(0)], 5), Err(RefineError::TooManyFaces { .. })));
    }

    #[test]
    fn copies_of_a_seam_are_halved_alike() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.5, 0.1, 0.0], [0.0; 3], [1.0, 0.0, 0.0], [0.5, 9.0, 0.0]];
        let mut mesh = surface(&points, &[[0, 1, 2], [4, 3, 5]]);
        for (v, seam) in [(0, 0), (3, 0), (1, 1), (4, 1)] {
            mesh.carried.seams.insert(VertexId::new(v), SeamId(seam));
        }
        for [a, b] in [[0, 1], [3, 4]] {
            let seam = EdgeMark { freedom: Freedom::Keep, cause: MarkCause::Seam };
            mesh.carried.mark(edge_key(VertexId::new(a), VertexId::new(b)), seam);
        }
        let values = vec![0.0, 1.0, 2.0, 0.0, 1.0, 2.0];
        mesh.carried.set_field(Field { name: "x".into(), support: Support::Vertex, components: 1, values });
        // Only the second sheet asks for short edges.
        let limit = MaxEdge::Corners(vec![[2.0; 3], [0.3; 3]].into());
        let (out, _) =
            refine(&mesh, &limit, 10_000, Flips::None, &LockRules::default(), &Watch::silent()).expect("refined");
        assert_eq!(validate_surface(&out), []);
        let seams = &out.carried.seams;
        assert_eq!(seams.len(), 10);
        for (v, seam) in seams {
            let partners = seams.iter().filter(|(w, s)| *s == seam && out.points[**w] == out.points[*v]);
            assert_eq!(partners.count(), 2);
        }
        assert_eq!(out.carried.marks.values().filter(|m| m.cause == MarkCause::Seam).count(), 8);
        assert_eq!(out.carried.field(Support::Vertex, "x").map(|f| f.values.len()), Some(out.points.len()));
    }
}
