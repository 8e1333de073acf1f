//! Makes folded quads flatter by moving single vertices along the surface.
//!
//! Where a soft edge fades out, or a small step is no curve of its own, a quad may lie across a fold with good corners:
//! its scaled Jacobian says nothing of it. Most such quads need only one corner on the other side of the fold.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use rustc_hash::FxHashSet;
use smallvec::SmallVec;

use super::check::{Check, Flaws};
use super::settle::Settler;
use crate::technique::ground::Ground;
use crate::technique::mixed::{Mixed, Place, warp};
use crate::watch::{Cancelled, Watch};

/// Quads that turn by no more than this between opposite corners count as flat, in radians: 25 degrees.
const FLAT: f64 = 0.4363;
/// Shapes that moves may fall to, or what they were before where that is less.
const SOUND: f64 = 0.75;
/// Rounds over the folded quads.
const ROUNDS: usize = 6;
/// A move must take away this part of what the faces round a vertex are folded by.
const GAIN: f64 = 0.02;
/// How far vertices are moved, as parts of the longest side.
const STEPS: [f64; 4] = [0.06, 0.14, 0.28, 0.5];
/// How often moves that brought new flaws are taken back.
const REPAIRS: usize = 4;

/// Moves vertices of folded quads as long as that makes them flatter; shapes stay sound, and distances within the
/// tolerance. Returns what is wrong with the mesh beside its shapes, which is no more than the `flaws` before.
pub(super) fn flatten(
    mesh: &mut Mixed,
    ground: &Ground<'_>,
    check: &Check,
    tolerance: f64,
    flaws: &Flaws,
    watch: &Watch,
) -> Result<Flaws, Cancelled> {
    let before = unfold(&mut Settler { mesh, ground, check, tolerance }, watch)?;
    take_back(mesh, before, check, tolerance, flaws, watch)
}

/// Where vertices and their normals were before they were moved.
pub(super) type Before = BTreeMap<u32, (DVec3, DVec3)>;

/// Moves vertices of folded quads as long as that makes them flatter.
pub(super) fn unfold(work: &mut Settler<'_, '_>, watch: &Watch) -> Result<Before, Cancelled> {
    let mut before = Before::new();
    for _ in 0..ROUNDS {
        let mut folded: Vec<(f64, u32)> =
            work.mesh.faces().map(|f| (fold(work.mesh, f, FLAT), f)).filter(|&(fold, _)| fold > 0.0).collect();
        folded.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
        let mut moved = false;
        for (_, f) in folded {
            watch.check()?;
            for v in work.mesh.corners(f) {
                moved |= move_vertex(work, v, &mut before);
            }
        }
        if !moved {
            break;
        }
    }
    Ok(before)
}

/// Undoes the moves about faces that have flaws which they had not.
fn take_back(
    mesh: &mut Mixed,
    mut before: Before,
    check: &Check,
    tolerance: f64,
    flaws: &Flaws,
    watch: &Watch,
) -> Result<Flaws, Cancelled> {
    let had: FxHashSet<u32> = faces_of(flaws).collect();
    for _ in 0..REPAIRS {
        let now = check.flaws(mesh, tolerance, watch)?;
        let new: Vec<u32> = faces_of(&now).filter(|f| !had.contains(f)).collect();
        if new.is_empty() && now.crossing.len() <= flaws.crossing.len() {
            return Ok(now);
        }
        let guilty: BTreeSet<u32> =
            new.iter().flat_map(|&f| mesh.corners(f)).flat_map(|v| mesh.faces_at(v).collect::<Vec<_>>()).collect();
        for v in guilty.iter().flat_map(|&f| mesh.corners(f)).collect::<BTreeSet<u32>>() {
            if let Some((point, normal)) = before.remove(&v) {
                mesh.set_point(v, point, normal);
            }
        }
    }
    for (v, (point, normal)) in before {
        mesh.set_point(v, point, normal);
    }
    Ok(flaws.clone())
}

fn faces_of(flaws: &Flaws) -> impl Iterator<Item = u32> {
    flaws.faults.iter().map(|fault| fault.face).chain(flaws.crossing.iter().copied())
}

/// By how much a quad is folded beyond an angle.
pub(super) fn fold(mesh: &Mixed, f: u32, beyond: f64) -> f64 {
    let corners = mesh.corners(f);
    let &[a, b, c, d] = corners.as_slice() else { return 0.0 };
    (warp([a, b, c, d].map(|v| mesh.point(v))) - beyond).max(0.0)
}

/// The sum of the squares of what the faces at a vertex are folded by.
fn folds(mesh: &Mixed, v: u32) -> f64 {
    mesh.faces_at(v).map(|f| fold(mesh, f, FLAT).powi(2)).sum()
}

/// Moves a vertex to where the faces round it are folded least, of some places about it. Whether there is one.
fn move_vertex(work: &mut Settler<'_, '_>, v: u32, before: &mut Before) -> bool {
    let Place::Region(region) = work.mesh.place(v) else { return false };
    let (start, normal) = (work.mesh.point(v), work.mesh.normal(v));
    let least = work.mesh.star_quality(v).min(SOUND);
    let enough = (1.0 - GAIN) * folds(work.mesh, v);
    let mut better: SmallVec<[(f64, DVec3, DVec3); 8]> = SmallVec::new();
    for wish in wishes(work.mesh, v) {
        let foot = work.ground.project_from(region, wish, start);
        if normal != DVec3::ZERO && foot.normal.dot(normal) < 0.2 {
            continue;
        }
        work.mesh.set_point(v, foot.point, foot.normal);
        let folds = folds(work.mesh, v);
        if folds < enough && work.mesh.star_quality(v) >= least - 1e-12 {
            better.push((folds, foot.point, foot.normal));
        }
    }
    work.mesh.set_point(v, start, normal);
    if better.is_empty() {
        return false;
    }
    better.sort_by(|x, y| x.0.total_cmp(&y.0));
    let points = work.points_near(v);
    let allowed = work.excess(v, &points, f64::INFINITY);
    for (_, point, normal) in better {
        work.mesh.set_point(v, point, normal);
        if work.excess(v, &points, f64::INFINITY) <= allowed {
            before.entry(v).or_insert((start, normal));
            return true;
        }
    }
    work.mesh.set_point(v, start, normal);
    false
}

/// Places in eight directions about a vertex.
fn wishes(mesh: &Mixed, v: u32) -> impl Iterator<Item = DVec3> + use<> {
    let (start, normal) = (mesh.point(v), mesh.normal(v));
    let reach = mesh.star(v).map(|h| mesh.length(h)).fold(0.0, f64::max);
    let axis = if normal == DVec3::ZERO { DVec3::Z } else { normal };
    let x = axis.any_orthonormal_vector();
    let y = axis.cross(x);
    let directions =
        [(1.0, 0.0), (0.7, 0.7), (0.0, 1.0), (-0.7, 0.7), (-1.0, 0.0), (-0.7, -0.7), (0.0, -1.0), (0.7, -0.7)];
    STEPS.into_iter().flat_map(move |step| directions.map(|(a, b)| start + step * reach * (a * x + b * y)))
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::super::testing::{id, quads, rules, square};
    use super::*;

    const TOLERANCE: f64 = 0.3;

    /// Two slopes that meet in a ridge, which is no curve, and quads of which one has a corner beyond the ridge.
    fn folded(ground: &Ground<'_>) -> Mixed {
        quads(ground, &[(id(5, 5), dvec3(5.7, 5.2, -0.7))])
    }

    fn roof() -> crate::mesh::Surface {
        let mut surface = square();
        surface.points.iter_mut().for_each(|p| p.z = -(p.x - 5.0).abs());
        surface
    }

    fn most_folded(mesh: &Mixed) -> f64 {
        mesh.faces().map(|f| fold(mesh, f, 0.0)).fold(0.0, f64::max)
    }

    #[test]
    fn a_corner_beyond_a_ridge_comes_back_along_the_surface() {
        let surface = roof();
        let ground = Ground::new(&surface);
        let (watch, mut mesh) = (Watch::silent(), folded(&ground));
        let check = Check::new(&ground, &watch).unwrap();
        let flaws = check.flaws(&mesh, TOLERANCE, &watch).unwrap();
        let before = most_folded(&mesh);
        assert!(before > 1.4 * FLAT, "{before}");
        let after = flatten(&mut mesh, &ground, &check, TOLERANCE, &flaws, &watch).unwrap();
        assert!(most_folded(&mesh) < 1.2 * FLAT, "{}", most_folded(&mesh));
        assert!(after.faults.len() <= flaws.faults.len() && after.crossing.is_empty());
        for v in mesh.vertices() {
            let p = mesh.point(v);
            assert!((p.z + (p.x - 5.0).abs()).abs() < 1e-9, "a vertex left the surface");
        }
    }

    #[test]
    fn flat_quads_stay_as_they_are() {
        let surface = roof();
        let ground = Ground::new(&surface);
        let mut mesh = quads(&ground, &[]);
        let watch = Watch::silent();
        let check = Check::new(&ground, &watch).unwrap();
        let work = &mut Settler { mesh: &mut mesh, ground: &ground, check: &check, tolerance: rules().tolerance };
        assert!(unfold(work, &watch).unwrap().is_empty());
    }

    #[test]
    fn moves_that_brought_flaws_are_taken_back() {
        let surface = roof();
        let ground = Ground::new(&surface);
        let (watch, mut mesh) = (Watch::silent(), quads(&ground, &[]));
        let check = Check::new(&ground, &watch).unwrap();
        let v = id(5, 5).raw();
        let before = Before::from([(v, (mesh.point(v), mesh.normal(v)))]);
        mesh.set_point(v, dvec3(5.0, 5.0, 3.0), glam::DVec3::Z);
        let flaws = take_back(&mut mesh, before, &check, rules().tolerance, &Flaws::default(), &watch).unwrap();
        assert!(flaws.faults.is_empty() && flaws.crossing.is_empty());
        assert_eq!(mesh.point(v), dvec3(5.0, 5.0, 0.0));
    }
}
