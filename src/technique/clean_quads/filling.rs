//! What a cavity is filled with, and the filling put into the mesh, smoothed and judged.

use rustc_hash::FxHashMap;

use super::{Cleaner, POOR};
use crate::mesh::VertexId;
use crate::technique::fill::{Cut, Flat, Outline, Pattern};
use crate::technique::mixed::{Corners, Disk, Mixed, Place, quad_quality};

/// A change must lower the cost by more than rounding.
pub(super) const LESS: f64 = 1e-9;
/// A straight loop cut in two keeps up to two irregular vertices: only what costs more is worth a row.
pub(super) const COSTLY: f64 = 2.0 + LESS;
/// The part of the tolerance that middles of new faces and edges may be away from the surface.
const NEAR: f64 = 0.8;

/// Rows that leave fillings in two that cost less than `cost`: some of those that leave least, and are as long as they
/// should be.
pub(super) fn cuts(mesh: &Mixed, outline: &Outline, cost: f64) -> Vec<Cut> {
    /// How many edges a row may have less or more than its length tells.
    const SLACK: usize = 1;
    /// Fillings whose shape is looked at.
    const LOOKS: usize = 8;
    if outline.reflex.is_empty() && cost <= COSTLY {
        return Vec::new();
    }
    let point = |v: VertexId| mesh.point(v.raw());
    let nodes = &outline.nodes;
    let total: f64 = (0..nodes.len()).map(|k| point(nodes[k]).distance(point(nodes[(k + 1) % nodes.len()]))).sum();
    let mean = (total / nodes.len().max(1) as f64).max(f64::MIN_POSITIVE);
    let aimed =
        |a: VertexId, b: VertexId| ((point(a).distance(point(b)) / mean).round() as usize).clamp(1, nodes.len());
    let mut cuts = outline.cuts(|a, b| [aimed(a, b).saturating_sub(SLACK), aimed(a, b) + SLACK]);
    cuts.retain(|cut| (cut.irregular as f64) < cost - LESS);
    let off = |cut: &Cut| aimed(nodes[cut.from], nodes[cut.to]).abs_diff(cut.edges);
    cuts.sort_by_key(|cut| (cut.irregular, off(cut), cut.from, cut.to));
    // Of many equally good ones some from everywhere.
    let first = cuts.first().map(|cut| (cut.irregular, off(cut)));
    let equal = cuts.iter().take_while(|cut| Some((cut.irregular, off(cut))) == first).count();
    let step = equal.div_ceil(LOOKS).max(1);
    cuts.into_iter().step_by(step).take(LOOKS).collect()
}

/// The faces of a disk laid flat.
pub(super) fn lay_flat(mesh: &Mixed, disk: &Disk, rim: &[u32]) -> Flat {
    let mut index: FxHashMap<u32, usize> = rim.iter().enumerate().map(|(k, &v)| (v, k)).collect();
    let mut points: Vec<_> = rim.iter().map(|&v| mesh.point(v)).collect();
    let mut faces = Vec::with_capacity(disk.faces.len());
    for &f in &disk.faces {
        let corner = |h: u32| {
            let v = mesh.origin(h);
            *index.entry(v).or_insert_with(|| {
                points.push(mesh.point(v));
                points.len() - 1
            })
        };
        faces.push(mesh.sides(f).map(corner).collect::<Vec<_>>());
    }
    Flat::new(&points, rim.len(), faces)
}

/// How badly shaped a filling is likely to be, 0 for squares: the mean and the worst of the squares of what its
/// qualities lack.
pub(super) fn misshape(mesh: &Mixed, rim: &[u32], pattern: &Pattern) -> f64 {
    let point = |n: usize| if n < rim.len() { mesh.point(rim[n]) } else { pattern.inner[n - rim.len()] };
    let (mut sum, mut worst) = (0.0, 0.0_f64);
    for face in &pattern.faces {
        let lack = 1.0 - quad_quality([0, 1, 2, 3].map(|k| point(face[k])));
        sum += lack * lack;
        worst = worst.max(lack * lack);
    }
    sum / pattern.faces.len().max(1) as f64 + worst
}

impl Cleaner<'_, '_> {
    /// Fills a cavity, smooths, and keeps that if it is shaped well enough.
    pub(super) fn fill_anew(&mut self, old: &[u32], rim: &[u32], pattern: &Pattern) -> bool {
        let ring = self.corners_of(old);
        let (before, far, poor) = (self.judge(&ring), self.farthest(&ring), self.poor_faces(&ring));
        self.mesh.begin();
        let touched = self.put(old, rim, pattern);
        let done = touched.is_some_and(|touched| {
            let least = before.1.min(POOR);
            self.relax(&touched, 3);
            if self.judge(&touched).1 < least {
                self.search_at(&touched);
            }
            let after = self.judge(&touched);
            let is_better = after.1 >= least && after.0 < before.0 - LESS && self.poor_faces(&touched) <= poor;
            let is_kept = is_better && self.farthest(&touched) <= far.max(NEAR * self.tolerance);
            if is_kept {
                self.mesh.commit();
                self.note_change(&touched);
            }
            is_kept
        });
        if !done {
            self.mesh.rollback();
        }
        done
    }

    /// How many faces at these vertices are poor.
    fn poor_faces(&self, vertices: &[u32]) -> usize {
        self.faces_at_any(vertices).into_iter().filter(|&f| self.sound_quality(f) < POOR).count()
    }

    /// The largest distance of the middles of faces and edges at these vertices from the surface.
    pub(super) fn farthest(&self, vertices: &[u32]) -> f64 {
        let mut farthest = 0.0_f64;
        for f in self.faces_at_any(vertices) {
            let (region, start) = (self.mesh.region(f), self.mesh.point(self.mesh.origin(self.mesh.first(f))));
            let middle = |h: u32| 0.5 * (self.mesh.point(self.mesh.origin(h)) + self.mesh.point(self.mesh.target(h)));
            for p in self.mesh.sides(f).map(middle).chain([self.mesh.centre(f)]) {
                farthest = farthest.max(self.ground.project_from(region, p, start).distance_squared);
            }
        }
        farthest.sqrt()
    }

    /// Puts a pattern into the place of faces. Returns its vertices; `None` where it does not fit, and the transaction
    /// must be rolled back.
    fn put(&mut self, old: &[u32], rim: &[u32], pattern: &Pattern) -> Option<Vec<u32>> {
        let region = self.mesh.region(old[0]);
        let size = rim.iter().map(|&v| self.mesh.size(v)).sum::<f64>() / rim.len() as f64;
        let mut vertices = rim.to_vec();
        for &p in &pattern.inner {
            let foot = self.ground.project(region, p);
            vertices.push(self.mesh.add_vertex(foot.point, foot.normal, Place::Region(region), size));
        }
        let new: Vec<Corners> = pattern.faces.iter().map(|face| face.iter().map(|&k| vertices[k]).collect()).collect();
        self.mesh.replace(old, &new, None)?;
        vertices.iter().all(|&v| self.mesh.is_proper(v, 3)).then_some(vertices)
    }
}
