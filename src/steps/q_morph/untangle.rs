//! A start from triangles that do not fold up at the ends of thin limbs.
//!
//! Triangles as large as a limb is thick span it: vertices put into their edges have no side of the body to go to, and
//! the limb's end turns into itself. Smaller triangles made of these stay folded, so all begins again from the surface.

use glam::DVec3;

use super::QMorphError;
use super::check::{Check, Wish, mean_side, mean_size};
use crate::technique::ground::Ground;
use crate::technique::isotropic::Rules;
use crate::technique::mixed::{Mixed, Place};
use crate::watch::{Cancelled, Watch};

/// How often all begins with smaller sizes where triangles pass through each other.
const UNTANGLINGS: usize = 5;
/// How far about such a place sizes are lowered, as a multiple of those there, and to which part of them.
const ABOUT: f64 = 1.5;
const FINER: f64 = 0.6;
/// The part of the tolerance from which on a free vertex was left inside the body.
const STRAY: f64 = 0.5;

/// Triangles that do not fold up, of those that `make` gives where sizes are lowered at some places; the least folded
/// ones where all do.
///
/// # Errors
/// Those of `make`, and where the run was interrupted.
pub(super) fn untangled(
    ground: &Ground<'_>,
    check: &Check,
    rules: Rules,
    watch: &Watch,
    make: &dyn Fn(&[Wish]) -> Result<Mixed, QMorphError>,
) -> Result<Mixed, QMorphError> {
    let mut best = make(&[])?;
    let mut places = folds(&best, ground, check, rules, watch)?;
    let mut least = places.len();
    for _ in 1..UNTANGLINGS {
        if least == 0 {
            break;
        }
        let mesh = make(&places)?;
        let found = folds(&mesh, ground, check, rules, watch)?;
        if found.len() < least {
            (least, best) = (found.len(), mesh);
        }
        places.extend(found);
    }
    Ok(best)
}

/// Where triangles pass through each other, or a vertex was left inside the body: places that need smaller ones.
fn folds(
    mesh: &Mixed,
    ground: &Ground<'_>,
    check: &Check,
    rules: Rules,
    watch: &Watch,
) -> Result<Vec<Wish>, Cancelled> {
    let wish = |at: DVec3, side: f64| (at, ABOUT * side, FINER * side);
    let crossing = check.crossing_all(mesh, watch)?;
    let crossing = crossing.into_iter().map(|f| wish(mesh.centre(f), mean_side(mesh, f).min(mean_size(mesh, f))));
    let strays = mesh.vertices().filter(|&v| {
        let Place::Region(region) = mesh.place(v) else { return false };
        let foot = ground.project_from(region, mesh.point(v), mesh.point(v));
        foot.distance_squared > (STRAY * rules.tolerance).powi(2)
    });
    Ok(crossing.chain(strays.map(|v| wish(mesh.point(v), mesh.size(v)))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Surface;
    use crate::mesh::halfedge::tests::surface;
    use crate::technique::isotropic::{lower_sizes, remesh};

    /// A closed rod of `rings` rings of twelve vertices, 10 long and 0.5 thick.
    fn rod(rings: u32) -> Surface {
        let at = |ring: u32, k: u32| {
            let x = f64::from(ring) / f64::from(rings + 1);
            let (sin, cos) = libm::sincos(std::f64::consts::TAU * f64::from(k) / 12.0);
            let r = 0.25 * (1.0 - (2.0 * x - 1.0).powi(8)).sqrt();
            [r * cos, r * sin, 10.0 * x]
        };
        let mut points: Vec<[f64; 3]> = (1..=rings).flat_map(|ring| (0..12).map(move |k| at(ring, k))).collect();
        points.extend([[0.0; 3], [0.0, 0.0, 10.0]]);
        let (id, [low, high]) = (|ring: u32, k: u32| ring * 12 + k % 12, [12 * rings, 12 * rings + 1]);
        let mut faces = Vec::new();
        for k in 0..12 {
            faces.extend([[low, id(0, k + 1), id(0, k)], [high, id(rings - 1, k), id(rings - 1, k + 1)]]);
            for ring in 0..rings - 1 {
                let [a, b, c, d] = [id(ring, k), id(ring, k + 1), id(ring + 1, k + 1), id(ring + 1, k)];
                faces.extend([[a, b, c], [a, c, d]]);
            }
        }
        surface(&points, &faces)
    }

    #[test]
    fn triangles_as_large_as_a_limb_is_thick_give_way_to_smaller_ones() {
        let surface = rod(60);
        let (ground, watch) = (Ground::new(&surface), Watch::silent());
        let check = Check::new(&ground, &watch).unwrap();
        let rules = Rules {
            tolerance: 0.03,
            curve_tolerance: 0.01,
            shortest: 0.0,
            least_size: 0.1,
            floor: 0.002,
            gradation: 0.3,
            most_faces: usize::MAX,
        };
        let make = |places: &[Wish]| {
            let mut mesh = ground.workshop().unwrap();
            (0..mesh.vertex_slots()).for_each(|v| mesh.set_size(v, 1.0));
            lower_sizes(&mut mesh, places, rules.floor);
            remesh(&mut mesh, &ground, rules, &watch)?;
            Ok(mesh)
        };
        let coarse = folds(&make(&[]).unwrap(), &ground, &check, rules, &watch).unwrap();
        let made = untangled(&ground, &check, rules, &watch, &make).unwrap();
        let fine = folds(&made, &ground, &check, rules, &watch).unwrap();
        assert!(fine.is_empty() && coarse.len() > 4, "{} and {}", fine.len(), coarse.len());
        assert_eq!(made.faults(), [] as [String; 0]);
    }
}
