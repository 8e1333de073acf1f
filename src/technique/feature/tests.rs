//! Known answers: cube, cylinders, sphere, flat grid.

use glam::DVec3;

use super::*;
use crate::mesh::halfedge::tests::surface;
use crate::mesh::{MarkCause, Regions};

const RULES: FeatureRules = FeatureRules {
    angle: 30.0,
    seed_angle: 40.0,
    corner_angle: 45.0,
    region_borders: true,
    voting_radius: None,
    gap: 0.0,
};

fn find(surface: &Surface, rules: &FeatureRules) -> (Surface, Report) {
    mark_features(surface, rules, &Watch::silent()).expect("nobody interrupts")
}

fn cube() -> Surface {
    let points: Vec<[f64; 3]> =
        (0..8_u8).map(|k| [f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)]).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let faces: Vec<[u32; 3]> = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    surface(&points, &faces)
}

/// A closed cylinder of `n` facets with caps fanned from their centres.
fn cylinder(n: u32) -> Surface {
    let at = |k: u32, z: f64| {
        let (sin, cos) = libm::sincos(std::f64::consts::TAU * f64::from(k) / f64::from(n));
        [cos, sin, z]
    };
    let mut points: Vec<[f64; 3]> = (0..n).map(|k| at(k, 0.0)).chain((0..n).map(|k| at(k, 3.0))).collect();
    points.extend([[0.0; 3], [0.0, 0.0, 3.0]]);
    let mut faces = Vec::new();
    for k in 0..n {
        let next = (k + 1) % n;
        faces.extend([[k, next, n + next], [k, n + next, n + k], [2 * n, next, k], [2 * n + 1, n + k, n + next]]);
    }
    surface(&points, &faces)
}

#[test]
fn a_cube_has_twelve_edges_and_eight_corners() {
    let (marked, report) = find(&cube(), &RULES);
    assert_eq!((report.sharp_edges, report.curves, report.corners), (12, 12, 8));
    assert_eq!(report.length, 12.0);
    assert_eq!((marked.carried.marks.len(), marked.carried.pins.len()), (12, 8));
    assert_eq!(report.facet_angle, None);
}

#[test]
fn a_second_run_changes_nothing() {
    for mesh in [cube(), cylinder(16), cylinder(10)] {
        let (once, first) = find(&mesh, &RULES);
        let (twice, second) = find(&once, &RULES);
        assert_eq!((&once, &first), (&twice, &second));
    }
}

#[test]
fn a_cylinder_has_two_rims_only() {
    for n in [16, 32, 64, 256] {
        let (_, report) = find(&cylinder(n), &RULES);
        assert_eq!((report.sharp_edges, report.curves, report.corners), (2 * n as usize, 2, 0), "n = {n}");
    }
    let (_, report) = find(&cylinder(16), &RULES);
    assert_eq!(report.facet_angle, Some(22.5));
}

#[test]
fn rims_and_region_borders_are_curves() {
    let points = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let mut square = surface(&points, &[[0, 1, 2], [0, 2, 3]]);
    square.carried.regions = Some(Regions { labels: vec![0, 1].into(), names: vec!["a".into(), "b".into()] });
    let (marked, report) = find(&square, &RULES);
    assert_eq!((report.rim_edges, report.border_edges, report.sharp_edges, report.corners), (4, 1, 0, 4));
    let diagonal = marked.carried.marks[&[VertexId::new(0), VertexId::new(2)]];
    assert_eq!((diagonal.cause, diagonal.freedom), (MarkCause::RegionBorder, Freedom::OnCurve));
    let (_, report) = find(&square, &FeatureRules { region_borders: false, ..RULES });
    assert_eq!((report.border_edges, report.curves), (0, 4));
}

#[test]
fn a_short_loose_chain_is_dropped() {
    // A square with one slightly lifted vertex near its middle: four weak creases, all below the seed angle.
    let points = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.5, 0.22]];
    let mesh = surface(&points, &[[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]);
    let (_, report) = find(&mesh, &RULES);
    assert_eq!((report.sharp_edges, report.rim_edges), (0, 4));
}

/// Strips along y over a profile in the plane y = 0, each of `columns` cells of length 1.
fn extruded(profile: &[(f64, f64)], columns: u32) -> Surface {
    let strips = profile.len() as u32;
    let point = |i: u32, &(x, z): &(f64, f64)| DVec3::new(x, f64::from(i), z);
    let points = (0..=columns).flat_map(|i| profile.iter().map(move |at| point(i, at))).collect();
    let mut faces = Vec::new();
    for (i, k) in (0..columns).flat_map(|i| (0..strips - 1).map(move |k| (i, k))) {
        let corner = |i: u32, k: u32| VertexId::from_raw(strips * i + k);
        let [a, b, c, d] = [corner(i, k), corner(i, k + 1), corner(i + 1, k + 1), corner(i + 1, k)];
        faces.extend([[a, b, c], [a, c, d]]);
    }
    Surface { points, faces: faces.into(), carried: crate::mesh::Carried::default() }
}

#[test]
fn both_edges_of_a_thin_rim_stay() {
    // A wall with a top 0.01 wide, and a slot as narrow.
    let wall = [(0.0, 0.0), (0.0, 1.0), (0.01, 1.0), (0.01, 0.0)];
    let slot = [(-1.0, 0.0), (0.0, 0.0), (0.0, -1.0), (0.01, -1.0), (0.01, 0.0), (1.0, 0.0)];
    // A step as low has one edge, and so has a wall with a bevel.
    let step = [(-1.0, 0.0), (0.0, 0.0), (0.0, 0.01), (1.0, 0.01)];
    let bevel = [(-1.0, 0.0), (0.0, 0.0), (0.01, -0.01), (0.01, -1.0)];
    let sheet = wall.map(|(x, z)| (0.1 * x, z));
    for (profile, sharp) in [(&wall[..], 2), (&slot, 4), (&step, 1), (&bevel, 1), (&sheet, 1)] {
        let (_, report) = find(&extruded(profile, 6), &FeatureRules { gap: 0.05, ..RULES });
        assert_eq!(report.sharp_edges, 6 * sharp, "{profile:?}");
    }
}

#[test]
fn of_two_curves_that_run_alongside_only_the_sharper_stays() {
    // A trough of three strips over a long floor: two creases 0.01 apart, the left one sharper.
    let profile = [(-1.0, 1.5), (0.0, 0.0), (0.01, 0.002), (1.0, 2.0)];
    let columns = 6;
    let trough = extruded(&profile, columns);
    let (_, all) = find(&trough, &RULES);
    let (marked, thinned) = find(&trough, &FeatureRules { gap: 0.05, ..RULES });
    assert_eq!(all.sharp_edges, 2 * columns as usize);
    assert_eq!((thinned.sharp_edges, thinned.alongside_edges), (columns as usize, columns as usize));
    let left = |[a, b]: &[VertexId; 2]| marked.points[*a].x == 0.0 && marked.points[*b].x == 0.0;
    let features = marked.carried.marks.iter().filter(|(_, mark)| mark.cause == MarkCause::Feature);
    assert!(features.map(|(edge, _)| edge).all(left));
}

/// A cube whose edge from 0 to 1 has these points beside it on one side only, and these faces between them, numbered
/// from 8. `under` fans the bottom from corner 3 over the points from 0 to 1.
fn cube_with(beside: &[[f64; 3]], under: &[u32], between: &[[u32; 3]]) -> Surface {
    let mut mesh = cube();
    for &p in beside {
        mesh.points.push(DVec3::from(p));
    }
    let is_bottom = |corners: &[VertexId; 3]| corners.map(VertexId::raw) == [0, 3, 1];
    let others = mesh.faces.iter().filter(|corners| !is_bottom(corners)).copied();
    let fan = under.windows(2).map(|pair| [pair[0], 3, pair[1]]).chain(between.iter().copied());
    let faces: Vec<[VertexId; 3]> = others.chain(fan.map(|corners| corners.map(VertexId::from_raw))).collect();
    Surface { points: mesh.points, faces: faces.into(), carried: crate::mesh::Carried::default() }
}

/// The other ends of curve edges at a vertex.
fn along_curves(marked: &Surface, v: u32) -> Vec<u32> {
    let edges = marked.carried.marks.keys().map(|edge| edge.map(VertexId::raw)).filter(|edge| edge.contains(&v));
    edges.map(|[a, b]| if a == v { b } else { a }).collect()
}

#[test]
fn a_curve_takes_the_way_through_a_corner_that_hardly_lies_beside_it() {
    // The bottom ends at a point 4e-6 of the diagonal beside the edge, and a sliver closes the gap.
    let mesh = cube_with(&[[0.5, 7e-6, 0.0]], &[0, 8, 1], &[[0, 8, 1]]);
    let (marked, report) = find(&mesh, &RULES);
    assert_eq!((report.sharp_edges, report.corners), (13, 8));
    assert_eq!(along_curves(&marked, 8), [0, 1]);
}

#[test]
fn slivers_folded_over_each_other_are_one() {
    // The gap between the edge and a point on it is closed by three faces without area, about a point beyond its end.
    let mesh = cube_with(&[[0.6, 0.0, 0.0], [-0.3, 0.0, 0.0]], &[0, 8, 1], &[[0, 9, 1], [0, 8, 9], [8, 1, 9]]);
    let (marked, report) = find(&mesh, &RULES);
    assert_eq!((report.sharp_edges, report.corners), (13, 8));
    assert_eq!((along_curves(&marked, 8), along_curves(&marked, 9)), (vec![0, 1], vec![]));
}
