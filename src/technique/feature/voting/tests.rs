//! Known answers: a noisy cube has its twelve creases and nothing else, a noisy sphere nothing.

use std::collections::BTreeMap;

use glam::DVec3;

use crate::mesh::halfedge::tests::surface;
use crate::mesh::{MarkCause, Surface};
use crate::technique::feature::{FeatureRules, mark_features};
use crate::watch::Watch;

/// Squares along an edge of the cube.
const N: u32 = 20;

/// Numbers in ±1 with the distribution of a sum of three: near enough to a normal one.
fn noise(state: &mut u64) -> f64 {
    let mut sum = 0.0;
    for _ in 0..3 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        sum += (*state >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0;
    }
    // Three uniform numbers in ±1 have a variance of one.
    sum
}

/// A cube of `N` squares an edge with sides of length 1, every vertex moved by noise of `sigma`.
fn cube(sigma: f64, place: impl Fn(DVec3) -> DVec3) -> Surface {
    let mut numbers: BTreeMap<[u32; 3], u32> = BTreeMap::new();
    let mut points: Vec<[f64; 3]> = Vec::new();
    let mut faces = Vec::new();
    let mut state = 7;
    for axis in 0..3 {
        for top in [0, N] {
            for (i, j) in (0..N).flat_map(|i| (0..N).map(move |j| (i, j))) {
                let corner = |di: u32, dj: u32| {
                    let mut at = [0; 3];
                    at[axis] = top;
                    at[(axis + 1) % 3] = i + di;
                    at[(axis + 2) % 3] = j + dj;
                    at
                };
                let quad = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)].map(|at| {
                    *numbers.entry(at).or_insert_with(|| {
                        let exact = place(DVec3::from_array(at.map(f64::from)));
                        points.push(exact.to_array().map(|x| x + sigma * noise(&mut state)));
                        points.len() as u32 - 1
                    })
                });
                let [a, b, c, d] = quad;
                let (first, second) = if (i + j) % 2 == 0 { ([a, b, c], [a, c, d]) } else { ([a, b, d], [b, c, d]) };
                let turned = |[a, b, c]: [u32; 3]| if top == N { [a, b, c] } else { [a, c, b] };
                faces.extend([turned(first), turned(second)]);
            }
        }
    }
    surface(&points, &faces)
}

fn sharp(mesh: &Surface) -> Vec<[DVec3; 2]> {
    let rules = FeatureRules {
        gap: 0.0,
        angle: 30.0,
        seed_angle: 40.0,
        corner_angle: 45.0,
        region_borders: true,
        voting_radius: Some(5.0),
    };
    let (marked, _) = mark_features(mesh, &rules, &Watch::silent()).expect("nobody interrupts");
    let ours = marked.carried.marks.iter().filter(|(_, mark)| mark.cause == MarkCause::Feature);
    ours.map(|(edge, _)| edge.map(|v| mesh.points[v])).collect()
}

/// The distance of a point to the nearest edge of the cube.
fn from_crease(p: DVec3) -> f64 {
    let side = |x: f64| x.abs().min((x - f64::from(N)).abs());
    let [x, y, z] = p.to_array().map(side);
    libm::hypot(x, y).min(libm::hypot(y, z)).min(libm::hypot(z, x))
}

#[test]
fn a_noisy_cube_has_its_creases_and_no_more() {
    for sigma in [0.0, 0.05, 0.08] {
        let edges = sharp(&cube(sigma, |p| p));
        let total: f64 = edges.iter().map(|[a, b]| a.distance(*b)).sum();
        let wrong = edges.iter().filter(|edge| edge.iter().any(|&p| from_crease(p) > 1.0));
        let wrong: f64 = wrong.map(|[a, b]| a.distance(*b)).sum();
        // The crease is cut into units; one is found where a marked edge passes its middle within an edge.
        let mut found = 0;
        for axis in 0..3 {
            for (i, corner) in (0..N).flat_map(|i| [(0, 0), (0, N), (N, 0), (N, N)].map(|c| (i, c))) {
                let mut middle = [0.0; 3];
                middle[axis] = f64::from(i) + 0.5;
                middle[(axis + 1) % 3] = f64::from(corner.0);
                middle[(axis + 2) % 3] = f64::from(corner.1);
                let middle = DVec3::from_array(middle);
                let near = |[a, b]: &[DVec3; 2]| (0.5 * (*a + *b)).distance(middle) <= 1.0;
                found += usize::from(edges.iter().any(near));
            }
        }
        let all = 12 * N as usize;
        assert!(found * 100 >= 98 * all, "sigma {sigma}: {found} of {all}");
        assert!(wrong <= 0.02 * total, "sigma {sigma}: {wrong} of {total} is false");
    }
}

#[test]
fn a_noisy_sphere_has_none() {
    for sigma in [0.0, 0.05] {
        let ball = cube(sigma, |p| {
            let half = f64::from(N) / 2.0;
            1.2 * half * (p - half).normalize()
        });
        assert_eq!(sharp(&ball).len(), 0, "sigma {sigma}");
    }
}
