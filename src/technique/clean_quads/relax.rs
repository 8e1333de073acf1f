//! Moving vertices: quick smoothing while the topology changes, and the search for better shapes at the end.

use glam::DVec3;
use smallvec::SmallVec;

use super::Cleaner;
use crate::technique::mixed::{NONE, Place, triangle_quality};
use crate::watch::{Cancelled, Watch};

/// Vertices whose faces cost less each are not worth a search.
const FINE: f64 = 5e-4;

/// Steps of one search; a few dozen do, and a cost that is no number would never be low enough.
const STEPS: usize = 1000;

/// The other corners of a face at a vertex, counter-clockwise, and what of its shape a move of the vertex leaves.
struct Corner {
    next: DVec3,
    before: DVec3,
    across: DVec3,
    /// The sides away from the vertex, of unit length.
    far: [DVec3; 2],
    /// The vector product of these.
    bend: DVec3,
    is_quad: bool,
}

impl Corner {
    fn new(next: DVec3, across: DVec3, before: DVec3, is_quad: bool) -> Self {
        let far = [(across - next).normalize_or_zero(), (before - across).normalize_or_zero()];
        Self { next, before, across, far, bend: far[0].cross(far[1]), is_quad }
    }

    /// The quality of the face with the vertex at `p`, and the cosine of its normal with `normal`.
    fn judge(&self, p: DVec3, normal: DVec3) -> (f64, f64) {
        if !self.is_quad {
            return (triangle_quality([p, self.next, self.before]), 1.0);
        }
        let face = (self.across - p).cross(self.before - self.next);
        let length = face.length();
        if length <= 0.0 {
            return (0.0, 0.0);
        }
        let out = (self.next - p).normalize_or_zero();
        let back = (p - self.before).normalize_or_zero();
        let near = face.dot(back.cross(out)).min(face.dot(out.cross(self.far[0])));
        let least = near.min(face.dot(self.far[1].cross(back))).min(face.dot(self.bend));
        (least / length, face.dot(normal) / length)
    }
}

/// The faces at a vertex: what a move changes.
struct Star {
    faces: SmallVec<[Corner; 8]>,
    normal: DVec3,
}

impl Star {
    /// The cost of the faces with the vertex at `p`: 0 where all are squares; steep below useful shapes.
    fn cost(&self, p: DVec3) -> f64 {
        let has_side = self.normal != DVec3::ZERO;
        let mut sum = 0.0;
        for face in &self.faces {
            let (q, cosine) = face.judge(p, self.normal);
            let lack = 1.0 - q;
            let poor = (0.7 - q).max(0.0);
            let bad = (0.3 - q).max(0.0);
            sum += lack * lack + 8.0 * poor * poor + 60.0 * bad * bad;
            if has_side && cosine < 0.2 {
                sum += 20.0;
            }
        }
        sum
    }
}

impl Cleaner<'_, '_> {
    fn star(&self, v: u32, normal: DVec3) -> Star {
        let mut star = Star { faces: SmallVec::new(), normal };
        for h in self.mesh.star(v) {
            let f = self.mesh.face(h);
            if f != NONE {
                let next = self.mesh.next(h);
                let corners = [next, self.mesh.next(next), self.mesh.prev(h)];
                let [a, b, c] = corners.map(|k| self.mesh.point(self.mesh.origin(k)));
                star.faces.push(Corner::new(a, b, c, !self.mesh.is_triangle(f)));
            }
        }
        star
    }

    /// The quality of a face; one that is turned against the surface counts as inverted.
    pub(super) fn sound_quality(&self, f: u32) -> f64 {
        let mut reference = DVec3::ZERO;
        for h in self.mesh.sides(f) {
            let w = self.mesh.origin(h);
            if self.mesh.place(w).is_free() {
                reference += self.mesh.normal(w);
            }
        }
        let turned = reference != DVec3::ZERO && self.mesh.face_normal(f).dot(reference.normalize_or_zero()) < 0.2;
        if turned { -1.0 } else { self.mesh.quality(f) }
    }

    /// Whether a normal is one of the same side of the body as the vertex is on.
    pub(super) fn is_near(&self, v: u32, normal: DVec3) -> bool {
        let now = self.mesh.normal(v);
        now == DVec3::ZERO || normal.dot(now) >= 0.5
    }

    /// Puts a vertex that another one was drawn into between its neighbours.
    pub(super) fn centre_between(&mut self, v: u32) {
        if let Place::Region(region) = self.mesh.place(v) {
            let (mut sum, mut n) = (DVec3::ZERO, 0.0);
            for w in self.mesh.neighbours(v) {
                sum += self.mesh.point(w);
                n += 1.0;
            }
            let foot = self.ground.project_from(region, sum / n, self.mesh.point(v));
            if self.is_near(v, foot.normal) {
                self.mesh.set_point(v, foot.point, foot.normal);
            }
        }
    }

    /// Rounds of plain smoothing of the free ones of these vertices; moves are kept if the faces get no worse.
    pub(super) fn relax(&mut self, vertices: &[u32], rounds: usize) {
        for _ in 0..rounds {
            for &v in vertices {
                if let Place::Region(region) = self.mesh.place(v) {
                    let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
                    for h in self.mesh.star(v) {
                        let far = self.mesh.target(self.mesh.next(h));
                        sum += self.mesh.point(self.mesh.target(h)) + 0.25 * self.mesh.point(far);
                        weight += 1.25;
                    }
                    let now = self.mesh.point(v);
                    let star = self.star(v, self.mesh.normal(v));
                    let foot = self.ground.project_from(region, sum / weight, now);
                    if self.is_near(v, foot.normal) && star.cost(foot.point) < star.cost(now) {
                        self.mesh.set_point(v, foot.point, foot.normal);
                    }
                }
            }
        }
    }

    /// Better places for these vertices, two rounds.
    pub(super) fn search_at(&mut self, vertices: &[u32]) {
        for _ in 0..2 {
            for &v in vertices {
                self.better_place(v, 0.12);
            }
        }
    }

    /// Whether a vertex found a better place; the first steps are this part of the edges there.
    fn better_place(&mut self, v: u32, first: f64) -> bool {
        match self.mesh.place(v) {
            Place::Node => false,
            Place::Arc { arc, at } => self.slide(v, arc, at),
            Place::Region(region) => self.search(v, region, first),
        }
    }

    /// Smoothing of all vertices that take part.
    pub(super) fn relax_all(&mut self, rounds: usize) {
        let all: Vec<u32> = self.mesh.vertices().filter(|&v| self.is_awake(v)).collect();
        self.relax(&all, rounds);
    }

    /// Moves every vertex where its faces are better, until the moves are small. Returns the rounds.
    pub(super) fn optimise(&mut self, rounds: usize, watch: &Watch) -> Result<usize, Cancelled> {
        let all: Vec<u32> = self.mesh.vertices().collect();
        let mut active: Vec<bool> =
            (0..self.mesh.vertex_slots()).map(|v| self.mesh.is_vertex(v) && self.is_awake(v)).collect();
        let awake = active.iter().filter(|&&is| is).count();
        for round in 0..rounds {
            let first = if round < 2 { 0.12 } else { 0.05 };
            watch.check()?;
            let mut moved = 0;
            for &v in &all {
                if !std::mem::replace(&mut active[v as usize], false) {
                    continue;
                }
                if self.better_place(v, first) {
                    moved += 1;
                    active[v as usize] = true;
                    for f in self.mesh.faces_at(v) {
                        for h in self.mesh.sides(f) {
                            active[self.mesh.origin(h) as usize] = true;
                        }
                    }
                }
            }
            if moved * 200 < awake {
                return Ok(round + 1);
            }
        }
        Ok(rounds)
    }

    /// The mean length of the edges at a vertex.
    fn reach(&self, v: u32) -> f64 {
        let (mut sum, mut n) = (0.0, 0.0);
        for h in self.mesh.star(v) {
            sum += self.mesh.length(h);
            n += 1.0;
        }
        sum / n
    }

    /// A pattern search in the tangent plane, back onto the region.
    fn search(&mut self, v: u32, region: u32, first_step: f64) -> bool {
        let normal = self.mesh.normal(v);
        let star = self.star(v, normal);
        let start = self.mesh.point(v);
        let first = star.cost(start);
        if first < FINE * star.faces.len() as f64 {
            return false;
        }
        let axis = if normal == DVec3::ZERO { DVec3::Z } else { normal };
        let x = axis.any_orthonormal_vector();
        let y = axis.cross(x);
        let (mut best, mut cost) = (start, first);
        let reach = self.reach(v);
        let mut step = first_step * reach;
        for _ in 0..STEPS {
            if step <= 0.01 * reach {
                break;
            }
            let before = cost;
            for (a, b) in [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)] {
                let p = best + step * (a * x + b * y);
                let c = star.cost(p);
                if c < cost {
                    (best, cost) = (p, c);
                }
            }
            if cost >= before - 1e-3 * before {
                step *= 0.5;
            }
        }
        if first - cost < 1e-4 * first.max(1e-3) {
            return false;
        }
        let foot = self.ground.project_from(region, best, start);
        let sound = star.cost(foot.point) < first && self.is_near(v, foot.normal);
        if sound {
            self.mesh.set_point(v, foot.point, foot.normal);
        }
        sound
    }

    /// A search along the curve, between the neighbours there.
    fn slide(&mut self, v: u32, arc: u32, at: f64) -> bool {
        let curve = &self.ground.curves[arc as usize];
        let star = self.star(v, DVec3::ZERO);
        let first = star.cost(self.mesh.point(v));
        let reach = self.reach(v);
        let beside: SmallVec<[f64; 2]> = self.beside_on(v, arc, at);
        let sag = |p: f64| beside.iter().map(|&q| curve.sag(p.min(q), p.max(q))).fold(0.0, f64::max);
        let most = sag(at).max(self.curve_tolerance);
        let (mut best, mut cost) = (at, first);
        let mut step = 0.1 * reach;
        for _ in 0..STEPS {
            if step <= 0.01 * reach {
                break;
            }
            let before = cost;
            for p in [best - step, best + step] {
                let c = star.cost(curve.at(p));
                if c < cost && p > 0.0 && p < curve.length() && (p - at).abs() < 0.3 * reach && sag(p) <= most {
                    (best, cost) = (p, c);
                }
            }
            if cost >= before {
                step *= 0.5;
            }
        }
        if first - cost < 1e-3 * first.max(1e-3) {
            return false;
        }
        self.mesh.set_point(v, curve.at(best), DVec3::ZERO);
        self.mesh.set_place(v, Place::Arc { arc, at: best });
        true
    }

    /// Where the neighbours of a curve's vertex are on it.
    fn beside_on(&self, v: u32, arc: u32, at: f64) -> SmallVec<[f64; 2]> {
        let length = self.ground.curves[arc as usize].length();
        let on_arc = self.mesh.star(v).filter(|&h| self.mesh.arc(h) == arc);
        on_arc
            .map(|h| match self.mesh.place(self.mesh.target(h)) {
                Place::Arc { arc: other, at } if other == arc => at,
                // The node at the nearer end; of two, the one on the other side.
                _ => {
                    let to = self.mesh.point(self.mesh.target(h));
                    let ends = [0.0, length];
                    let off =
                        |end: f64| (self.ground.curves[arc as usize].at(end) - to).length() + 1e-3 * (end - at).abs();
                    if off(ends[0]) <= off(ends[1]) { 0.0 } else { length }
                }
            })
            .collect()
    }
}
