//! Straighten: shorter and smoother borders that meet as before, locks, random partitions.

use std::collections::BTreeSet;

use meshmill::mesh::topology::EdgeTable;
use meshmill::mesh::{Soup, Surface, SurfacePoint};
use meshmill::step::Artifact;
use meshmill::technique::arcs::arcs;
use proptest::prelude::*;

use super::golden::golden;
use crate::shapes;
use crate::step::{run, run_locked, surface};

fn of(mesh: &Soup) -> Artifact {
    surface(shapes::surface(mesh))
}

fn marked(mesh: &Soup) -> Artifact {
    run("features", "angle = 30", &of(mesh)).artifact
}

/// Pairs of regions that share a border, and the corners where borders end.
fn meetings(surface: &Surface) -> (BTreeSet<[u32; 2]>, usize) {
    let labels = &surface.carried.regions.as_ref().unwrap().labels;
    let network = arcs(surface, &EdgeTable::new(surface), labels);
    let pairs = network.arcs.iter().map(|arc| [arc.sides[0].min(arc.sides[1]), arc.sides[0].max(arc.sides[1])]);
    (pairs.collect(), network.arcs.len())
}

#[test]
fn borders_on_a_sphere_get_shorter_both_ways() {
    let parts = run("partition", "regions = 8", &of(&shapes::sphere(4))).artifact;
    for method in ["unfold", "flip-geodesic"] {
        let made = golden("straighten", method, &format!("method = \"{method}\""), &parts);
        let [before, after] = ["length-before", "length"].map(|key| made.stats[key].as_f64().unwrap());
        assert!(after < 0.97 * before, "{method}: {after} of {before}");
        assert_eq!(made.stats["restored"], 0, "{method}");
        let [plain, made] = [&parts, &made.artifact].map(|a| a.as_surface().unwrap());
        assert_eq!((&plain.points, &plain.faces), (&made.points, &made.faces));
        assert_eq!(plain.carried.regions, made.carried.regions);
    }
}

#[test]
fn creases_and_rims_stay() {
    for (name, shape) in
        [("washer", shapes::washer(24)), ("cylinder", shapes::cylinder(24, 6)), ("grid", shapes::grid(8))]
    {
        let parts = run("partition", "regions = 9, disk = true", &marked(&shape)).artifact;
        for method in ["unfold", "flip-geodesic"] {
            let made = run("straighten", &format!("method = \"{method}\", rounds = 20"), &parts).artifact;
            let made = made.as_surface().unwrap();
            for (number, curve) in made.carried.curves.iter().enumerate() {
                for point in &curve.points {
                    if let SurfacePoint::Edge { edge, .. } = point {
                        assert!(
                            !made.carried.marks.contains_key(edge),
                            "{name} {method}: curve {number} crosses a crease"
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn no_point_goes_farther_than_asked() {
    let parts = run("partition", "regions = 6", &of(&shapes::sphere(3))).artifact;
    for method in ["unfold", "flip-geodesic"] {
        let made = run("straighten", &format!("method = \"{method}\", max-deviation = 0.02, rounds = 50"), &parts);
        assert!(made.stats["deviation"].as_f64().unwrap() <= 0.02, "{:?}", made.stats);
        let still = run("straighten", &format!("method = \"{method}\", max-deviation = 0"), &parts);
        assert_eq!(still.stats["deviation"], 0.0);
    }
}

#[test]
fn a_surface_without_regions_is_refused() {
    let failure = run_locked("straighten", "main", "", "", &[("from", of(&shapes::grid(3)))]).unwrap_err();
    assert!(failure.help.is_some() && failure.message.contains("no regions"), "{failure}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn random_partitions_keep_their_shape(shape in 0_usize..6, seed in any::<u32>(), count in 1_usize..14, way in 0_usize..2) {
        let mesh = match shape {
            0 => shapes::sphere(3),
            1 => shapes::torus(24, 12),
            2 => shapes::grid(9),
            3 => shapes::cylinder(18, 6),
            4 => shapes::subdivided(&shapes::tetrahedron(), 3),
            _ => shapes::hole(shapes::grid(8), 60),
        };
        let input = if seed % 2 == 0 { of(&mesh) } else { marked(&mesh) };
        let parts = run("partition", &format!("regions = {count}, seed = {seed}"), &input).artifact;
        let method = ["unfold", "flip-geodesic"][way];
        let curves = run("straighten", &format!("method = \"{method}\""), &parts);
        let [before, after] = ["length-before", "length"].map(|key| curves.stats[key].as_f64().unwrap());
        prop_assert!(after <= before * (1.0 + 1e-9), "{} of {}", after, before);
        // Cutting fails where curves cross or regions beside them contradict each other.
        let cut = run("split", "", &curves.artifact);
        prop_assert!(cut.stats["area-change"].as_f64().unwrap().abs() < 1e-12);
        let [old, new] = [&parts, &cut.artifact].map(|a| meetings(a.as_surface().unwrap()));
        prop_assert_eq!(old, new);
    }
}
