//! How far valences are from their ideals.

use std::f64::consts::{FRAC_PI_2, TAU};

use smallvec::SmallVec;

use super::Cleaner;
use crate::technique::mixed::{Mixed, NONE, Place};

/// Irregular vertices of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Census {
    /// Vertices inside regions or on curves, not on rims.
    pub inner: usize,
    /// Of those, the ones with another valence than 4.
    pub irregular: usize,
}

/// Counts the inner vertices whose valence is not 4.
pub fn census(mesh: &Mixed) -> Census {
    let mut census = Census::default();
    for v in mesh.vertices() {
        if mesh.star(v).all(|h| mesh.face(h) != NONE) {
            census.inner += 1;
            census.irregular += usize::from(mesh.valence(v) != 4);
        }
    }
    census
}

/// The least angle between two curves next to each other at a node, in radians: no corner there can be wider.
pub fn sharpest_sector(mesh: &Mixed) -> Option<f64> {
    let nodes = mesh.vertices().filter(|&v| mesh.place(v) == Place::Node);
    nodes.flat_map(|v| sectors(mesh, v)).map(|(_, angle)| angle).min_by(f64::total_cmp)
}

/// The least angle between the curves on both sides of a face at one of its nodes, in radians: its corner there lies
/// between them.
pub fn sharpest_sector_of(mesh: &Mixed, f: u32) -> Option<f64> {
    let at_nodes = mesh.sides(f).filter(|&h| mesh.place(mesh.origin(h)) == Place::Node);
    at_nodes.filter_map(|h| sector_of(mesh, h)).map(|(_, angle)| angle).min_by(f64::total_cmp)
}

/// The sector that the corner at the origin of `h` belongs to, its quads and its angle; `None` at a vertex without
/// curves.
pub(super) fn sector_of(mesh: &Mixed, h: u32) -> Option<(f64, f64)> {
    let mut found = None;
    walk_sectors(mesh, mesh.origin(h), |corners, angle| {
        if corners.contains(&h) {
            found = Some((corners.len() as f64, angle));
        }
    });
    found
}

/// The sectors between the curves and rims at a vertex, each with its quads and its angle; none where there is no
/// curve.
pub(super) fn sectors(mesh: &Mixed, v: u32) -> SmallVec<[(f64, f64); 8]> {
    let mut found = SmallVec::new();
    walk_sectors(mesh, v, |corners, angle| found.push((corners.len() as f64, angle)));
    found
}

/// Visits each sector at a vertex with its corners, as the sides that leave the vertex, and its angle. Round the end of
/// a curve that is there alone it is a full turn: two quads, folded upon each other, show less.
pub(super) fn walk_sectors(mesh: &Mixed, v: u32, mut visit: impl FnMut(&[u32], f64)) {
    let star: SmallVec<[u32; 16]> = mesh.star(v).collect();
    let bound = |h: u32| mesh.arc(h) != NONE || mesh.face(h) == NONE || mesh.face(h ^ 1) == NONE;
    let Some(start) = star.iter().position(|&h| bound(h)) else { return };
    let is_end = star.iter().filter(|&&h| bound(h)).count() == 1;
    let (mut corners, mut angle) = (SmallVec::<[u32; 16]>::new(), 0.0);
    for i in 0..=star.len() {
        let h = star[(start + i) % star.len()];
        if i > 0 && bound(h) {
            if !corners.is_empty() {
                visit(&corners, if is_end { TAU } else { angle });
            }
            corners.clear();
            angle = 0.0;
        }
        if i < star.len() && mesh.face(h) != NONE {
            corners.push(h);
            angle += mesh.corner_angle(h);
        }
    }
}

/// The quads that fit into an angle, in radians.
pub(super) fn ideal(angle: f64) -> f64 {
    (angle / FRAC_PI_2).round().max(1.0)
}

/// What a number of quads in an angle costs: the square of the difference from the ideal, and much where one of them
/// would be nearly flat.
pub(super) fn cost(quads: f64, angle: f64) -> f64 {
    let difference = quads - ideal(angle);
    let flat = if angle / quads > 2.6 { 20.0 } else { 0.0 };
    difference * difference * 1.5 + flat
}

impl Cleaner<'_, '_> {
    /// The misfit of a vertex: 0 where its valence is ideal.
    pub(super) fn misfit(&self, v: u32) -> f64 {
        if self.is_free(v) {
            let difference = self.mesh.valence(v) as f64 - 4.0;
            return difference * difference;
        }
        let sectors = sectors(self.mesh, v);
        if sectors.is_empty() {
            let difference = self.mesh.valence(v) as f64 - 4.0;
            return difference * difference;
        }
        sectors.into_iter().map(|(quads, angle)| cost(quads, angle)).sum()
    }
}
