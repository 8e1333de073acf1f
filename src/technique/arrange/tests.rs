//! Bodies against volumes computed another way, and soups against their area; touching, scaled, mirrored, far away.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DMat3, DVec3, dvec3};
use proptest::prelude::*;

use super::*;
use crate::mesh::geometry::{area_vector, triangle_area};
use crate::mesh::{Facet, Soup, VertexId};
use crate::metric::intersection::{faces_of, self_intersections};

type Triangle = [DVec3; 3];

/// Bodies apart from each other: each with vertices of its own.
fn surface_of(bodies: &[Vec<Triangle>]) -> Surface {
    let mut surface = Surface::default();
    for body in bodies {
        let mut known: BTreeMap<[u64; 3], VertexId> = BTreeMap::new();
        for triangle in body {
            let corners = triangle.map(|p| {
                let key = p.to_array().map(|x| (x + 0.0).to_bits());
                *known.entry(key).or_insert_with(|| surface.points.push(p))
            });
            surface.faces.push(corners);
        }
    }
    surface
}

fn resolved(surface: &Surface) -> Resolved {
    resolved_as(surface, Shared::United)
}

fn resolved_as(surface: &Surface, shared: Shared) -> Resolved {
    let found = self_intersections(&surface.to_soup(), &Watch::silent()).expect("nobody interrupts");
    let meeting: Vec<u32> = faces_of(&found.pairs).into_iter().map(crate::mesh::Id::raw).collect();
    resolve(surface, &meeting, shared, 0, &Watch::silent()).expect("a result")
}

/// What stays, without what it carries.
fn soup(result: &Resolved) -> Soup {
    let faces = result.kept.faces.iter().map(|face| Facet::Tri(face.map(VertexId::from_raw))).collect();
    Soup { points: result.kept.points.clone().into(), faces, ..Soup::default() }
}

fn corners(result: &Resolved) -> Vec<Triangle> {
    let kept = &result.kept;
    kept.faces.iter().map(|face| face.map(|v| kept.points[v as usize])).collect()
}

fn volume(triangles: &[Triangle]) -> f64 {
    let middle = triangles.as_flattened().iter().sum::<DVec3>() / (3 * triangles.len().max(1)) as f64;
    triangles.iter().map(|t| t.map(|p| p - middle)).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

fn pairs(soup: &Soup) -> usize {
    self_intersections(soup, &Watch::silent()).expect("nobody interrupts").pairs.len()
}

/// Whether every edge is run along as often in one direction as in the other.
fn is_closed(soup: &Soup) -> bool {
    let mut balance: BTreeMap<(VertexId, VertexId), i32> = BTreeMap::new();
    for facet in &soup.faces {
        let corners = facet.corners();
        for (i, &a) in corners.iter().enumerate() {
            let b = corners[(i + 1) % corners.len()];
            *balance.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
        }
    }
    balance.values().all(|&b| b == 0)
}

/// A convex body with triangles as faces: a box or an octahedron, turned and skewed by a matrix.
fn body(is_box: bool, map: DMat3, at: DVec3) -> Vec<Triangle> {
    let signs = || [-1.0, 1.0];
    let mut triangles = Vec::new();
    for [i, j, k] in [[0, 1, 2], [1, 2, 0], [2, 0, 1]] {
        for s in signs() {
            let place = |a: f64, b: f64, c: f64| {
                let mut p = DVec3::ZERO;
                (p[i], p[j], p[k]) = (a, b, c);
                p
            };
            if is_box {
                let [p, q, r, t] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[b, c]| place(s, b, c));
                triangles.extend([[p, q, r], [p, r, t]]);
            } else if i == 0 {
                for (y, z) in signs().into_iter().flat_map(|y| signs().map(|z| (y, z))) {
                    triangles.push([place(s, 0.0, 0.0), place(0.0, y, 0.0), place(0.0, 0.0, z)]);
                }
            }
        }
    }
    let outward = |t: Triangle| if area_vector(t).dot(t[0]) < 0.0 { [t[0], t[2], t[1]] } else { t };
    let moved = triangles.into_iter().map(|t| outward(t).map(|p| at + map * p));
    moved.map(|t| if map.determinant() < 0.0 { [t[0], t[2], t[1]] } else { t }).collect()
}

/// The volume that convex bodies have in common: each face cut by the half-spaces of the other body, and the cones over
/// what is left of it.
fn common_volume(a: &[Triangle], b: &[Triangle]) -> f64 {
    let middle = a[0][0];
    let share = |faces: &[Triangle], others: &[Triangle]| -> f64 {
        let cone = |face: &Triangle| {
            let mut polygon = face.to_vec();
            for other in others {
                let height = |p: DVec3| area_vector(*other).dot(p - other[0]);
                let mut left = Vec::new();
                for (i, &p) in polygon.iter().enumerate() {
                    let q = polygon[(i + 1) % polygon.len()];
                    let (s, t) = (height(p), height(q));
                    left.extend((s <= 0.0).then_some(p));
                    left.extend(((s < 0.0) != (t < 0.0) && s != t).then(|| p.lerp(q, s / (s - t))));
                }
                polygon = left;
            }
            let fan = (1..polygon.len().saturating_sub(1)).map(|i| [polygon[0], polygon[i], polygon[i + 1]]);
            fan.map(|t| t.map(|p| p - middle)).map(|[x, y, z]| x.dot(y.cross(z)) / 6.0).sum::<f64>()
        };
        faces.iter().map(cone).sum()
    };
    share(a, b) + share(b, a)
}

/// What must hold of any result of closed bodies: closed, nothing meets, and the volume is that of the union.
fn check_union(a: &[Triangle], b: &[Triangle], common: f64) -> Resolved {
    let result = resolved(&surface_of(&[a.to_vec(), b.to_vec()]));
    assert_eq!(pairs(&soup(&result)), 0);
    assert!(is_closed(&soup(&result)));
    let expected = volume(a) + volume(b) - common;
    let found = volume(&corners(&result));
    assert!((found - expected).abs() <= 1e-6 * expected, "{found} is not {expected}");
    result
}

fn numbers(count: usize) -> impl Strategy<Value = Vec<f64>> {
    proptest::collection::vec(-1.0_f64..1.0, count)
}

fn vector(x: &[f64]) -> DVec3 {
    DVec3::from_slice(x)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn convex_bodies_unite(x in numbers(24), shapes in any::<[bool; 2]>()) {
        let map = |x: &[f64]| DMat3::from_cols(vector(x), vector(&x[3..]), vector(&x[6..])) + DMat3::IDENTITY;
        let (left, right) = (map(&x), map(&x[9..]));
        prop_assume!(left.determinant().abs() > 0.05 && right.determinant().abs() > 0.05);
        let (a, b) = (body(shapes[0], left, vector(&x[18..])), body(shapes[1], right, vector(&x[21..])));
        let common = common_volume(&a, &b);
        let result = check_union(&a, &b, common);
        if common > 1e-3 {
            // Seen from a point of both all of it is in sight: no handle, no cavity.
            let corners: BTreeSet<u32> = result.kept.faces.iter().flatten().copied().collect();
            let faces = result.kept.faces.len();
            prop_assert_eq!(corners.len() as i64 - faces as i64 / 2, 2);
        }
    }

    #[test]
    fn convex_bodies_come_apart(x in numbers(24), shapes in any::<[bool; 2]>()) {
        let map = |x: &[f64]| DMat3::from_cols(vector(x), vector(&x[3..]), vector(&x[6..])) + DMat3::IDENTITY;
        let (left, right) = (map(&x), map(&x[9..]));
        prop_assume!(left.determinant().abs() > 0.05 && right.determinant().abs() > 0.05);
        let (a, b) = (body(shapes[0], left, vector(&x[18..])), body(shapes[1], right, vector(&x[21..])));
        let common = common_volume(&a, &b);
        let result = resolved_as(&surface_of(&[a.clone(), b.clone()]), Shared::First);
        prop_assert!(is_closed(&soup(&result)));
        let found = self_intersections(&soup(&result), &Watch::silent()).expect("nobody interrupts");
        prop_assert_eq!(found.crossing().count(), 0);
        // All faces of the first body, which is whole, come before those of the other one.
        let faces = corners(&result);
        let whole = volume(&a);
        prop_assert!((1..=faces.len()).any(|count| (volume(&faces[..count]) - whole).abs() < 1e-6 * whole));
        let all = volume(&faces);
        prop_assert!((all - (volume(&a) + volume(&b) - common)).abs() < 1e-6 * all, "{} {}", all, common);
    }

    #[test]
    fn triangles_are_covered_by_their_pieces(x in numbers(9 * 200), size in 0.05_f64..0.6) {
        // On a grid, so that corners stay where they are.
        let exact = |p: DVec3| (p * 1_048_576.0).round() / 1_048_576.0;
        let corners_of = |x: &[f64]| [vector(x), vector(x) + size * vector(&x[3..]), vector(x) + size * vector(&x[6..])];
        let triangle = |x: &[f64]| corners_of(x).map(exact);
        let triangles: Vec<Vec<Triangle>> = x.chunks(9).map(|x| vec![triangle(x)]).collect();
        let surface = surface_of(&triangles);
        let result = resolved(&surface);
        let kept = &result.kept;
        prop_assert_eq!(pairs(&soup(&result)), 0);
        prop_assert_eq!(result.moved, 0.0);
        prop_assert!(result.removed.origin.is_empty());
        let mut area = vec![0.0; triangles.len()];
        for (&face, piece) in kept.origin.iter().zip(corners(&result)) {
            let whole = surface.corners(face);
            // Each piece looks as its face does.
            prop_assert!(area_vector(piece).dot(area_vector(whole)) >= 0.0);
            area[face.index()] += triangle_area(piece);
        }
        for (face, area) in surface.faces.ids().zip(area) {
            let whole = triangle_area(surface.corners(face));
            prop_assert!((area - whole).abs() <= 1e-12, "{} of {}", area, whole);
        }
    }

    #[test]
    fn a_scale_changes_nothing_else(x in numbers(24), power in -40..40) {
        let map = |x: &[f64]| DMat3::from_cols(vector(x), vector(&x[3..]), vector(&x[6..])) + DMat3::IDENTITY;
        let bodies = [body(true, map(&x), vector(&x[18..])), body(false, map(&x[9..]), vector(&x[21..]))];
        let one = resolved(&surface_of(&bodies));
        let factor = libm::ldexp(1.0, power);
        let scaled = bodies.map(|body| body.into_iter().map(|t| t.map(|p| factor * p)).collect());
        let other = resolved(&surface_of(&scaled));
        prop_assert_eq!(&one.kept.faces, &other.kept.faces);
        prop_assert_eq!(&one.kept.origin, &other.kept.origin);
        for (p, q) in one.kept.points.iter().zip(&other.kept.points) {
            prop_assert_eq!(*p * factor, *q);
        }
    }
}

fn cube(at: DVec3) -> Vec<Triangle> {
    body(true, DMat3::IDENTITY, at)
}

#[test]
fn boxes_that_touch_in_any_way_unite() {
    let touching =
        [dvec3(2.0, 0.0, 0.0), dvec3(2.0, 0.5, 0.25), dvec3(2.0, 2.0, 0.0), dvec3(2.0, 2.0, 2.0), dvec3(2.0, 1.0, 2.0)];
    for at in touching {
        check_union(&cube(DVec3::ZERO), &cube(at), 0.0);
    }
    let overlapping = [dvec3(1.0, 0.0, 0.0), dvec3(1.0, 1.0, 0.0), dvec3(0.5, 1.0, 1.5), dvec3(0.0, 0.0, 1e-12)];
    for at in overlapping {
        let common = (DVec3::splat(2.0) - at).element_product();
        check_union(&cube(DVec3::ZERO), &cube(at), common);
    }
}

#[test]
fn hardly_any_distance_is_no_obstacle() {
    for tiny in [1e-12, -1e-12, 1e-9, -1e-9, 3e-8] {
        let at = dvec3(2.0 + tiny, 0.3, 0.1);
        let common = (-tiny).max(0.0) * 1.7 * 1.9;
        let surface = surface_of(&[cube(DVec3::ZERO), cube(at)]);
        if pairs(&surface.to_soup()) > 0 {
            check_union(&cube(DVec3::ZERO), &cube(at), common);
        }
    }
}

#[test]
fn a_body_that_lies_on_its_copy_is_one() {
    let map = DMat3::from_rotation_z(0.3) * DMat3::from_rotation_x(0.7);
    let body = body(true, map, DVec3::ZERO);
    // Two pieces of each: one goes.
    let mut turned: Vec<Triangle> = body.iter().map(|&[a, b, c]| [b, c, a]).collect();
    turned.rotate_left(5);
    let third = self::body(false, map, dvec3(0.1, 0.9, 0.3));
    let result = resolved(&surface_of(&[body.clone(), turned, third.clone()]));
    assert_eq!(pairs(&soup(&result)), 0);
    assert!(is_closed(&soup(&result)));
    let expected = volume(&body) + volume(&third) - common_volume(&body, &third);
    assert!((volume(&corners(&result)) - expected).abs() < 1e-6);
}

#[test]
fn a_sheet_through_a_body_is_cut_and_stays() {
    let sheet = vec![[dvec3(-3.0, -3.0, 0.1), dvec3(3.0, -3.0, 0.2), dvec3(0.0, 4.0, 0.3)]];
    let surface = surface_of(&[cube(DVec3::ZERO), sheet.clone()]);
    let result = resolved(&surface);
    let of_sheet = |(face, piece): (&crate::mesh::FaceId, Triangle)| (face.raw() == 12).then(|| triangle_area(piece));
    let area: f64 = result.kept.origin.iter().zip(corners(&result)).filter_map(of_sheet).sum();
    assert!((area - triangle_area(sheet[0])).abs() < 1e-6);
    assert_eq!(pairs(&soup(&result)), 0);
    assert!(result.removed.origin.is_empty() && result.kept.origin.len() > 13);
}

#[test]
fn mirrored_and_far_away_it_is_the_same() {
    let map = DMat3::from_rotation_y(0.4) * DMat3::from_rotation_x(1.1);
    let bodies = [cube(DVec3::ZERO), body(true, map, dvec3(0.7, 0.4, 0.2))];
    let one = resolved(&surface_of(&bodies));
    let far = dvec3(4096.0, -8192.0, 1024.0);
    let moved = bodies.clone().map(|body| body.into_iter().map(|t| t.map(|p| p + far)).collect());
    let mirrored =
        bodies.map(|body| body.into_iter().map(|[a, b, c]| [a, c, b].map(|p| p * dvec3(-1.0, 1.0, 1.0))).collect());
    for other in [resolved(&surface_of(&moved)), resolved(&surface_of(&mirrored))] {
        assert_eq!(one.kept.origin.len(), other.kept.origin.len());
        assert_eq!(pairs(&soup(&other)), 0);
        let [ours, theirs] = [&one, &other].map(|result| volume(&corners(result)));
        assert!((ours - theirs).abs() < 1e-6 * ours);
    }
}

#[test]
fn faces_that_meet_none_keep_their_bits() {
    let third = 1.0 / 3.0;
    let away = cube(dvec3(10.0 + third, third, third));
    let surface = surface_of(&[cube(DVec3::splat(third)), cube(dvec3(1.1, 0.7, 0.9)), away.clone()]);
    let result = resolved(&surface);
    let kept = &result.kept;
    let found: Vec<Triangle> =
        kept.origin.iter().zip(corners(&result)).filter(|(face, _)| face.raw() >= 24).map(|(_, t)| t).collect();
    assert_eq!(found, away);
}
