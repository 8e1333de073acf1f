//! Tangent planes that smooth seams have in common: at each node, and along each seam.
//!
//! At a node the curves between two creases, or all of them, must leave in one plane. Along a seam the plane holds the
//! curve's tangent and lies midway between the planes of both patches. Patches are then fitted to have it.

use std::collections::BTreeMap;

use glam::DVec3;

use super::frame::Frame;
use super::solve::Curve;
use crate::mesh::VertexId;

/// The normals of the planes that the curve of an arc must leave in at both ends, where there is one.
pub(super) type EndPlanes = [Option<DVec3>; 2];

/// A corner of an element: its element and number.
type Corner = (usize, usize);

/// For each arc the planes at its ends.
pub(super) fn end_planes(frame: &Frame<'_>, curves: &[Curve]) -> Vec<EndPlanes> {
    let mut planes = vec![[None; 2]; frame.arcs.len()];
    for (node, corners) in corners_at(frame) {
        for sector in sectors(frame, &corners) {
            let arcs = arcs_of(frame, &sector);
            if !arcs.iter().any(|&arc| is_inside(frame, arc)) {
                continue;
            }
            let Some(normal) = plane(frame, curves, node, &sector, &arcs) else { continue };
            for arc in arcs {
                let is_free = is_inside(frame, arc) || frame.arcs[arc].beside.len() == 1;
                if is_free {
                    planes[arc][usize::from(frame.arcs[arc].path[0] != node)] = Some(normal);
                }
            }
        }
    }
    planes
}

/// Whether patches on both sides of an arc shall have one tangent plane.
pub(super) fn is_inside(frame: &Frame<'_>, arc: usize) -> bool {
    frame.arcs[arc].is_smooth && frame.arcs[arc].beside.len() == 2
}

fn corners_at(frame: &Frame<'_>) -> BTreeMap<VertexId, Vec<Corner>> {
    let mut at: BTreeMap<VertexId, Vec<Corner>> = BTreeMap::new();
    for (element, sides) in frame.sides.iter().enumerate() {
        for (k, &(arc, is_along)) in sides.iter().enumerate() {
            let path = &frame.arcs[arc].path;
            let node = if is_along { path[0] } else { path[path.len() - 1] };
            at.entry(node).or_default().push((element, k));
        }
    }
    at
}

/// The arc that leaves a corner and the one that arrives there.
fn arms(frame: &Frame<'_>, (element, k): Corner) -> [usize; 2] {
    let sides = &frame.sides[element];
    [sides[k].0, sides[(k + sides.len() - 1) % sides.len()].0]
}

/// Corners at a node in sets that hang together over smooth seams.
fn sectors(frame: &Frame<'_>, corners: &[Corner]) -> Vec<Vec<Corner>> {
    let mut left = corners.to_vec();
    let mut sectors = Vec::new();
    while let Some(start) = left.first().copied() {
        left.remove(0);
        let (mut sector, mut next) = (vec![start], 0);
        while next < sector.len() {
            let own = arms(frame, sector[next]).map(|arc| is_inside(frame, arc).then_some(arc));
            next += 1;
            let (near, far) = left.into_iter().partition(|&other| {
                let arms = arms(frame, other);
                own.iter().flatten().any(|arc| arms.contains(arc))
            });
            left = far;
            let near: Vec<Corner> = near;
            sector.extend(near);
        }
        sectors.push(sector);
    }
    sectors
}

fn arcs_of(frame: &Frame<'_>, sector: &[Corner]) -> Vec<usize> {
    let mut arcs: Vec<usize> = sector.iter().flat_map(|&corner| arms(frame, corner)).collect();
    arcs.sort_unstable();
    arcs.dedup();
    arcs
}

/// The direction in which an arc leaves a node.
fn leaving(frame: &Frame<'_>, curves: &[Curve], arc: usize, node: VertexId) -> DVec3 {
    let controls = &curves[arc].controls;
    let n = controls.len();
    let along = if frame.arcs[arc].path[0] == node { [0, 1] } else { [n - 1, n - 2] };
    (controls[along[1]] - controls[along[0]]).normalize_or_zero()
}

/// The normal of the plane of a sector. Creases beside it stay as they are, so the plane holds them.
fn plane(frame: &Frame<'_>, curves: &[Curve], node: VertexId, sector: &[Corner], arcs: &[usize]) -> Option<DVec3> {
    /// Sine of the angle at which two creases span a plane well.
    const APART: f64 = 0.35;
    /// How far, as a cosine, a plane may turn from that of the curves together.
    const NEAR: f64 = 0.8;
    let at = |arc: usize| leaving(frame, curves, arc, node);
    let together: DVec3 = sector
        .iter()
        .map(|&corner| {
            let [ahead, behind] = arms(frame, corner).map(at);
            ahead.cross(behind)
        })
        .sum();
    let mean = together.try_normalize()?;
    let creases: Vec<DVec3> = arcs.iter().filter(|&&arc| !is_inside(frame, arc)).map(|&arc| at(arc)).collect();
    let flat = |along: DVec3| (mean - along * mean.dot(along)).try_normalize();
    match creases[..] {
        [a, b] => {
            let spanned = a.cross(b);
            if spanned.length() >= APART
                && let Some(normal) = spanned.try_normalize()
                && normal.dot(mean).abs() >= NEAR
            {
                return Some(normal * normal.dot(mean).signum());
            }
            let along = if a.dot(b) < 0.0 { a - b } else { a + b };
            along.try_normalize().map_or(Some(mean), flat)
        }
        [a] => flat(a),
        _ => Some(mean),
    }
}
