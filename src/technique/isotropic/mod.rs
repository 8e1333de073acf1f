//! Isotropic remeshing between curves: nearly equilateral triangles of the size asked for, curves kept as curves.
//!
//! # Algorithm
//! Rounds of split, collapse, flip and tangential smoothing with the way back onto the region a vertex belongs to.
//! Curves are sampled anew first: vertices are put where the samples are and the others drawn into them. Then it is
//! measured where chords leave the surface and where two curves are closer than the size, the size is lowered there,
//! graded over the mesh, and the rounds go on.
//!
//! Based on: M. Botsch, L. Kobbelt. A remeshing approach to multiresolution modeling. SGP 2004.
//!
//! # Invariants
//! - Curves stay connected chains of edges with all nodes; free vertices lie on their own region.
//! - No edit turns a face against the faces that it replaces.
//!
//! # Cost
//! O(F + result) edits, each a few projections.

mod adapt;
mod curves;
mod edit;
mod parity;

use glam::DVec3;
use smallvec::SmallVec;

pub use curves::{chains, curve_distance, cut_in_three};
pub use parity::{odd_regions, pair_up};

use super::ground::Ground;
use super::mixed::{Mixed, NONE, Place, triangle_quality};
use crate::mesh::bvh::SegmentBvh;
use crate::mesh::geometry::{Aabb, triangle_area};
use crate::watch::{Cancelled, Watch};

/// What to hold to.
#[derive(Clone, Copy, Debug)]
pub struct Rules {
    /// Largest distance of chords from the surface.
    pub tolerance: f64,
    /// Largest distance of chords from the curves.
    pub curve_tolerance: f64,
    /// No edge on a curve is made shorter than this for the sake of that.
    pub shortest: f64,
    /// Sizes are not lowered below this beforehand.
    pub least_size: f64,
    /// Nor below this where the distance proves too large afterwards.
    pub floor: f64,
    /// How much the size may grow over a unit of length.
    pub gradation: f64,
    /// Sizes are not lowered any more where there are more triangles; the caller is to look at their number.
    pub most_faces: usize,
}

/// How often sizes are lowered where they prove too large.
const ADAPTATIONS: usize = 4;
/// Most rounds of edits between two such measurements.
const ROUNDS: usize = 5;
/// Splits end where there are so many times the faces that the sizes ask for: a mesh that has folded up grows by them
/// without end.
const GROWTH: f64 = 8.0;
/// The area of a triangle of sides of length 1.
const EQUILATERAL: f64 = 0.433;
/// Rounds end where fewer than one edge in so many collapses.
const QUIET: usize = 1000;
/// Passes of collapses in a round; all but the first look only next to what the one before did.
const COLLAPSES: usize = 24;
/// The same for flips.
const FLIPS: usize = 12;

/// A vertex on the surface is not worth faces whose shape is below this part of what it would be beside it.
const SPOILT: f64 = 0.1;

/// Sizes that are lowered by less than this do not count as changed: grading lowers many a little.
const CHANGE: f64 = 0.97;

/// The remesher at work.
struct Remesher<'a, 'g> {
    mesh: &'a mut Mixed,
    ground: &'a Ground<'g>,
    rules: Rules,
    /// Curve vertices that are not wanted any more.
    surplus: Vec<bool>,
    /// Vertices far from all that changed: they are neither moved nor are edges between them flipped.
    asleep: Vec<bool>,
}

/// Remeshes the workshop of `ground`; each vertex's size says how long edges should be there.
pub fn remesh(mesh: &mut Mixed, ground: &Ground<'_>, rules: Rules, watch: &Watch) -> Result<(), Cancelled> {
    let mut work = Remesher { surplus: Vec::new(), asleep: Vec::new(), mesh, ground, rules };
    work.note_normals();
    work.adapt(ADAPTATIONS, &[], watch)
}

/// Lowers the size about some places (a point, how far about it, the size) and remeshes again.
pub fn tighten(
    mesh: &mut Mixed,
    ground: &Ground<'_>,
    rules: Rules,
    places: &[(DVec3, f64, f64)],
    watch: &Watch,
) -> Result<(), Cancelled> {
    let before: Vec<f64> = (0..mesh.vertex_slots()).map(|v| mesh.size(v)).collect();
    lower_sizes(mesh, places, rules.floor);
    Remesher { surplus: Vec::new(), asleep: Vec::new(), mesh, ground, rules }.adapt(0, &before, watch)
}

/// Lowers the size about some places (a point, how far about it, the size), not below the `floor`.
pub fn lower_sizes(mesh: &mut Mixed, places: &[(DVec3, f64, f64)], floor: f64) {
    if places.is_empty() {
        return;
    }
    let all: Vec<u32> = mesh.vertices().collect();
    let tree = SegmentBvh::new(all.iter().map(|&v| [mesh.point(v); 2]).collect());
    for &(at, reach, size) in places {
        for i in tree.in_box(&Aabb::of([at]).grown(reach)) {
            let v = all[i as usize];
            mesh.set_size(v, mesh.size(v).min(size.max(floor)));
        }
    }
}

/// Remeshes a piece of a surface inside its rim, which stays as it is.
pub fn refill(mesh: &mut Mixed, ground: &Ground<'_>, rules: Rules, watch: &Watch) -> Result<(), Cancelled> {
    let mut work = Remesher { surplus: Vec::new(), asleep: Vec::new(), mesh, ground, rules };
    work.grade();
    work.rounds(watch)?;
    mesh.compact();
    Ok(())
}

/// Rounds of flips and smoothing only, curve vertices evenly spread, in regions that are `awake`.
pub fn polish(mesh: &mut Mixed, ground: &Ground<'_>, rules: Rules, rounds: usize, awake: &[bool]) {
    let sleeps = |v| mesh.faces_at(v).any(|f| !awake[mesh.region(f) as usize]);
    let asleep = (0..mesh.vertex_slots()).map(|v| mesh.is_vertex(v) && sleeps(v)).collect();
    let mut work = Remesher { surplus: Vec::new(), asleep, mesh, ground, rules };
    work.even_curves(awake);
    for _ in 0..rounds {
        work.flip();
        work.smooth();
    }
    // From here on every free vertex knows its side of the body.
    for v in 0..work.mesh.vertex_slots() {
        if work.mesh.is_vertex(v)
            && !work.is_asleep(v)
            && let Place::Region(region) = work.mesh.place(v)
        {
            let foot = ground.project_from(region, work.mesh.point(v), work.mesh.point(v));
            work.mesh.set_point(v, foot.point, foot.normal);
        }
    }
}

impl Remesher<'_, '_> {
    /// Rounds of edits, and so many times lower sizes where they prove too large. Where the sizes `before` are given,
    /// only near those that are others now.
    fn adapt(&mut self, times: usize, before: &[f64], watch: &Watch) -> Result<(), Cancelled> {
        self.grade();
        let touched = self.resample_curves(before);
        self.grade();
        self.send_to_sleep(before, &touched);
        for adaptation in 0..=times {
            self.rounds(watch)?;
            if self.mesh.compact() {
                self.asleep.clear();
            }
            self.surplus.clear();
            let is_full = self.mesh.faces().count() > self.rules.most_faces;
            if adaptation == times || is_full || !self.lower_sizes() {
                break;
            }
            self.grade();
            self.resample_curves(&[]);
            self.grade();
        }
        Ok(())
    }

    /// Rounds of edits until they are few.
    fn rounds(&mut self, watch: &Watch) -> Result<(), Cancelled> {
        for round in 0..ROUNDS {
            watch.check()?;
            self.split_long();
            let collapsed = self.collapse_short();
            self.flip();
            self.smooth();
            let is_full = self.mesh.faces().count() > self.rules.most_faces;
            if is_full || (round >= 2 && collapsed <= self.mesh.edges().count() / QUIET) {
                break;
            }
        }
        Ok(())
    }

    /// Lets only those vertices take part whose size is another than before, or a neighbour's, and those of curves that
    /// were touched.
    fn send_to_sleep(&mut self, before: &[f64], touched: &[bool]) {
        self.asleep = vec![true; before.len()];
        for v in self.mesh.vertices() {
            let is_touched = matches!(self.mesh.place(v), Place::Arc { arc, .. } if touched[arc as usize]);
            if is_touched || self.is_changed(v, before) {
                for w in std::iter::once(v).chain(self.mesh.neighbours(v)) {
                    if let Some(asleep) = self.asleep.get_mut(w as usize) {
                        *asleep = false;
                    }
                }
            }
        }
    }

    fn is_asleep(&self, v: u32) -> bool {
        self.asleep.get(v as usize).copied().unwrap_or(false)
    }

    /// Whether a vertex is new or its size much less than before.
    fn is_changed(&self, v: u32, before: &[f64]) -> bool {
        before.get(v as usize).is_none_or(|size| self.mesh.size(v) < CHANGE * size)
    }

    /// Whether both ends of an edge are asleep.
    fn sleeps(&self, h: u32) -> bool {
        self.is_asleep(self.mesh.origin(h)) && self.is_asleep(self.mesh.target(h))
    }

    fn size_of(&self, h: u32) -> f64 {
        0.5 * (self.mesh.size(self.mesh.origin(h)) + self.mesh.size(self.mesh.target(h)))
    }

    fn is_inner(&self, h: u32) -> bool {
        self.mesh.is_halfedge(h)
            && self.mesh.arc(h) == NONE
            && self.mesh.face(h) != NONE
            && self.mesh.face(h ^ 1) != NONE
    }

    /// Tells every free vertex the mean normal of its faces.
    fn note_normals(&mut self) {
        for v in 0..self.mesh.vertex_slots() {
            if self.mesh.is_vertex(v) && self.mesh.place(v).is_free() {
                let faces = self.mesh.faces_at(v);
                let sum: DVec3 = faces.map(|f| crate::mesh::geometry::area_vector(self.mesh.triangle(f))).sum();
                self.mesh.set_point(v, self.mesh.point(v), sum.normalize_or_zero());
            }
        }
    }

    /// How many faces the sizes ask for.
    fn wanted_faces(&self) -> f64 {
        let wanted = |f: u32| {
            let size = self.mesh.corners(f).iter().map(|&v| self.mesh.size(v)).sum::<f64>() / 3.0;
            triangle_area(self.mesh.triangle(f)) / (EQUILATERAL * size * size)
        };
        self.mesh.faces().map(wanted).sum()
    }

    fn split_long(&mut self) {
        let most = GROWTH * self.wanted_faces() + 2.0 * self.mesh.faces().count() as f64;
        for _ in 0..12 {
            let count = self.mesh.faces().count();
            if count as f64 > most || count > self.rules.most_faces {
                break;
            }
            let mut long: Vec<(f64, u32)> = Vec::new();
            for h in self.mesh.edges() {
                if self.sleeps(h) {
                    continue;
                }
                let length = self.mesh.length(h);
                if length > 4.0 / 3.0 * self.size_of(h) && self.is_inner(h) {
                    long.push((length, h));
                }
            }
            if long.is_empty() {
                break;
            }
            long.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
            let before = self.mesh.face_slots();
            for (_, h) in long {
                if self.is_inner(h) {
                    self.split_inner(h);
                }
            }
            let made = before..self.mesh.face_slots();
            self.flip_from(made.filter(|&f| self.mesh.is_face(f)).flat_map(|f| self.edges_of(f)).collect());
        }
    }

    /// The edges of a face, by their even half-edges.
    fn edges_of(&self, f: u32) -> SmallVec<[u32; 4]> {
        self.mesh.sides(f).map(|h| h & !1).collect()
    }

    /// Halves an edge inside a region, on the surface.
    fn split_inner(&mut self, h: u32) {
        let region = self.mesh.region(self.mesh.face(h));
        let middle = 0.5 * (self.mesh.point(self.mesh.origin(h)) + self.mesh.point(self.mesh.target(h)));
        let foot = self.ground.project_from(region, middle, self.mesh.point(self.mesh.origin(h)));
        let size = self.size_of(h);
        let beside = [h, h ^ 1].map(|k| self.mesh.face_normal(self.mesh.face(k)));
        let across = foot.normal.dot(beside[0] + beside[1]) < 0.3;
        if across {
            // The foot is on another side of the body.
            let normal = (beside[0] + beside[1]).normalize_or_zero();
            self.split(h, middle, normal, Place::Region(region), size);
            return;
        }
        // On coarse facets the foot may leave the faces beside the edge, and beside a curve it may land on that: then
        // the middle of the edge itself serves.
        let spoils = self.poorest_half(h, foot.point) < SPOILT * self.poorest_half(h, middle);
        let points = if spoils { [middle, foot.point] } else { [foot.point, middle] };
        for point in points {
            if self.split(h, point, foot.normal, Place::Region(region), size).is_some() {
                return;
            }
        }
    }

    /// The poorest of the faces that an edge's faces would become with a vertex in it.
    fn poorest_half(&self, h: u32, point: DVec3) -> f64 {
        let halves = [h, h ^ 1].into_iter().map(|k| {
            let [a, b, apex] = [k, self.mesh.next(k), self.mesh.prev(k)].map(|k| self.mesh.point(self.mesh.origin(k)));
            triangle_quality([a, point, apex]).min(triangle_quality([point, b, apex]))
        });
        halves.fold(f64::INFINITY, f64::min)
    }

    fn collapse_short(&mut self) -> usize {
        let mut collapsed = 0;
        let mut waiting: Vec<u32> = self.mesh.edges().filter(|&h| !self.sleeps(h)).collect();
        for _ in 0..COLLAPSES {
            let mut kept = Vec::new();
            for h in waiting {
                if self.mesh.is_halfedge(h)
                    && let Some(v) = self.collapse_edge(h)
                {
                    kept.push(v);
                }
            }
            if kept.is_empty() {
                break;
            }
            collapsed += kept.len();
            // What a collapse makes possible lies next to it.
            let near = kept.into_iter().filter(|&v| self.mesh.is_vertex(v)).flat_map(|v| self.mesh.faces_at(v));
            waiting = near.flat_map(|f| self.edges_of(f)).collect();
            waiting.sort_unstable();
            waiting.dedup();
        }
        collapsed
    }

    /// Collapses an edge that is too short, or at a curve's vertex that is not wanted. Returns the vertex that stays.
    fn collapse_edge(&mut self, h: u32) -> Option<u32> {
        let ways = [h, h ^ 1];
        let wanted = |work: &Self, k: u32| {
            if work.mesh.arc(h) == NONE {
                work.mesh.length(h) < 0.8 * work.size_of(h)
            } else {
                work.is_surplus(work.mesh.target(k))
            }
        };
        ways.into_iter().find_map(|k| {
            let kept = self.mesh.origin(k);
            (wanted(self, k) && self.collapse(k)).then_some(kept)
        })
    }

    fn is_surplus(&self, v: u32) -> bool {
        self.surplus.get(v as usize).copied().unwrap_or(false)
    }

    fn flip(&mut self) {
        self.flip_from(self.mesh.edges().filter(|&h| !self.sleeps(h)).collect());
    }

    /// Flips these edges where that makes triangles better, and then what lies next to the flips.
    fn flip_from(&mut self, mut waiting: Vec<u32>) {
        for _ in 0..FLIPS {
            waiting.sort_unstable();
            waiting.dedup();
            let before = self.mesh.face_slots();
            for &h in &waiting {
                if self.is_inner(h) {
                    self.try_flip(h);
                }
            }
            let made = before..self.mesh.face_slots();
            waiting = made.filter(|&f| self.mesh.is_face(f)).flat_map(|f| self.edges_of(f)).collect();
            if waiting.is_empty() {
                break;
            }
        }
    }

    fn smooth(&mut self) {
        for v in 0..self.mesh.vertex_slots() {
            if !self.mesh.is_vertex(v) || self.is_asleep(v) {
                continue;
            }
            if let Place::Region(region) = self.mesh.place(v) {
                let at = self.mesh.point(v);
                let (mut centre, mut weight, mut normal) = (DVec3::ZERO, 0.0, DVec3::ZERO);
                for f in self.mesh.faces_at(v) {
                    let corners = self.mesh.triangle(f);
                    let vector = crate::mesh::geometry::area_vector(corners);
                    let area = vector.length();
                    centre += area * (corners[0] + corners[1] + corners[2]) / 3.0;
                    weight += area;
                    normal += vector;
                }
                if weight <= 0.0 {
                    continue;
                }
                let normal = normal.normalize_or_zero();
                let step = centre / weight - at;
                let wish = at + step - normal * normal.dot(step);
                let foot = self.ground.project_from(region, wish, at);
                self.try_move(v, foot.point, foot.normal, Place::Region(region));
            }
        }
    }
}
