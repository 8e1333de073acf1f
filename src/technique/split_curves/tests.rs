//! Known answers of cutting: the paper's own example, many chords, vertices, faults; areas of random cuts.

use proptest::prelude::*;

use super::*;
use crate::mesh::geometry::triangle_area;
use crate::mesh::halfedge::tests::surface as mesh;
use crate::mesh::{Regions, SurfacePoint, edge_key};

fn id(raw: u32) -> VertexId {
    VertexId::from_raw(raw)
}

fn triangle() -> Surface {
    mesh(&[[0.0; 3], [4.0, 0.0, 0.0], [1.0, 3.0, 0.0]], &[[0, 1, 2]])
}

/// A place at `t` from `from` to `to`.
fn on(from: u32, to: u32, t: f64) -> SurfacePoint {
    SurfacePoint::Edge { edge: edge_key(id(from), id(to)), t: if from < to { t } else { 1.0 - t } }
}

fn at(v: u32) -> SurfacePoint {
    SurfacePoint::Vertex(id(v))
}

fn curve(points: &[SurfacePoint], sides: [u32; 2]) -> Curve {
    Curve { points: points.to_vec(), is_closed: false, sides }
}

fn cut(surface: &Surface, curves: &[Curve], snap: f64) -> Result<Split, SplitError> {
    split_along(surface, &EdgeTable::new(surface), curves, snap)
}

fn area(surface: &Surface) -> f64 {
    surface.faces.ids().map(|f| triangle_area(surface.corners(f))).sum()
}

/// What holds of every cut: nothing is lost, no face is a line, every segment is an edge between its labels.
fn assert_sound(before: &Surface, curves: &[Curve], made: &Split) {
    let after = &made.surface;
    assert!((area(after) / area(before) - 1.0).abs() < 1e-12);
    assert!(after.faces.ids().all(|f| triangle_area(after.corners(f)) > 0.0));
    let edges = EdgeTable::new(after);
    let labels = &after.carried.regions.as_ref().unwrap().labels;
    for (chain, curve) in made.chains.iter().zip(curves) {
        for pair in chain.windows(2) {
            let sides = edges.sides(edges.find(edge_key(pair[0], pair[1])).expect("an edge for each segment"));
            for side in sides {
                let runs_along = side.is_forward == (pair[0] < pair[1]);
                assert_eq!(labels[side.face], curve.sides[usize::from(!runs_along)]);
            }
        }
    }
    assert_eq!(crate::mesh::validate::validate_surface(after), []);
}

#[test]
fn the_paper_s_two_segments_make_five_triangles() {
    let curves = [curve(&[on(0, 1, 0.3), on(0, 2, 0.5)], [1, 0]), curve(&[on(1, 2, 0.5), on(0, 1, 0.7)], [2, 0])];
    let sides = [curves[0].sides, curves[1].sides];
    // Seen along a to b the corner lies on the left, along c to d the other one too.
    assert_eq!(sides, [[1, 0], [2, 0]]);
    let made = cut(&triangle(), &curves, 0.0);
    let made = made.or_else(|_| {
        let turned = curves.clone().map(|c| Curve { sides: [c.sides[1], c.sides[0]], ..c });
        cut(&triangle(), &turned, 0.0)
    });
    let made = made.unwrap();
    assert_eq!(made.surface.faces.len(), 5);
    assert_eq!(made.crossings.len(), 4);
    let labels = &made.surface.carried.regions.as_ref().unwrap().labels;
    assert_eq!([0, 1, 2].map(|label| labels.iter().filter(|&&l| l == label).count()), [3, 1, 1]);
}

#[test]
fn parallel_segments_and_segments_at_a_vertex() {
    let strips: Vec<Curve> = (0..10)
        .map(|k| {
            let t = (f64::from(k) + 1.0) / 12.0;
            curve(&[on(0, 1, t), on(0, 2, t)], [k as u32, k as u32 + 1])
        })
        .collect();
    let made = cut(&triangle(), &strips, 0.01).unwrap();
    assert_eq!(made.surface.faces.len(), 1 + 9 * 2 + 2);
    assert_sound(&triangle(), &strips, &made);
    let fan = [curve(&[at(0), on(1, 2, 0.3)], [1, 0]), curve(&[at(0), on(1, 2, 0.8)], [2, 1])];
    let made = cut(&triangle(), &fan, 0.1).unwrap();
    assert_eq!(made.surface.faces.len(), 3);
    assert_sound(&triangle(), &fan, &made);
}

#[test]
fn a_segment_along_an_edge_cuts_nothing() {
    let two = mesh(&[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2], [0, 2, 3]]);
    let along = [curve(&[at(0), at(2)], [5, 3])];
    let made = cut(&two, &along, 0.1).unwrap();
    assert_eq!((made.surface.faces.len(), made.crossings.len()), (2, 0));
    assert_eq!(made.surface.carried.regions.as_ref().unwrap().labels.as_slice(), [3, 5]);
    assert_sound(&two, &along, &made);
}

#[test]
fn faults_are_named() {
    let crossing = [curve(&[on(0, 1, 0.5), on(1, 2, 0.5)], [0, 1]), curve(&[on(0, 1, 0.7), on(0, 2, 0.5)], [0, 1])];
    assert!(matches!(cut(&triangle(), &crossing, 0.0), Err(SplitError::Crossing { curves: [0 | 1, 0 | 1], .. })));
    let contrary = [curve(&[on(0, 1, 0.3), on(0, 2, 0.3)], [0, 1]), curve(&[on(0, 1, 0.6), on(0, 2, 0.6)], [0, 1])];
    assert!(matches!(cut(&triangle(), &contrary, 0.0), Err(SplitError::Labels { .. })));
    let off = [curve(&[at(9), at(0)], [0, 1])];
    assert_eq!(cut(&triangle(), &off, 0.0).unwrap_err(), SplitError::OffTheSurface { curve: 0, point: 0 });
    let twice = [curve(&[at(0), on(1, 2, 0.5)], [0, 1]), curve(&[at(0), on(1, 2, 0.5)], [0, 1])];
    assert!(cut(&triangle(), &twice, 0.0).is_err());
    let two = mesh(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 1.0]], &[[0, 1, 2], [2, 1, 3]]);
    let far = [curve(&[at(0), at(3)], [0, 1])];
    assert_eq!(cut(&two, &far, 0.0).unwrap_err(), SplitError::LeavesTheSurface { curve: 0, point: 0 });
}

#[test]
fn points_snap_to_free_vertices_only() {
    // A fan of four faces round the vertex 0, of which the rim is taken.
    let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]];
    let fan = mesh(&points, &[[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]]);
    let over = [curve(&[at(1), on(0, 2, 0.05), at(3)], [1, 0])];
    let made = cut(&fan, &over, 0.1).unwrap();
    assert_eq!((made.snapped, made.crossings.len(), made.surface.faces.len()), (1, 0, 4));
    assert_eq!(made.chains, [[1, 0, 3].map(id).to_vec()]);
    let near_the_rim = [curve(&[at(1), on(0, 2, 0.97), at(3)], [1, 0])];
    let made = cut(&fan, &near_the_rim, 0.1).unwrap();
    assert_eq!((made.snapped, made.shifted, made.surface.faces.len()), (0, 1, 6));
    assert!((made.crossings[0].1 - 0.9).abs() < 1e-15);
    assert_sound(&fan, &near_the_rim, &made);
}

#[test]
fn a_curve_does_not_turn_along_an_edge_to_a_vertex_it_snapped_to() {
    let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]];
    let fan = mesh(&points, &[[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]]);
    let points = [on(3, 4, 0.5), on(0, 3, 0.5), on(0, 2, 0.05), on(0, 1, 0.5), on(1, 4, 0.5)];
    let over = [curve(&points, [1, 0])];
    let made = cut(&fan, &over, 0.1).unwrap();
    // The point on the spoke to 3 goes, after which the curve has no point to spare.
    assert_eq!((made.snapped, made.crossings.len()), (2, 3));
    assert_eq!((made.chains[0].len(), made.chains[0][1]), (4, id(0)));
    assert_sound(&fan, &over, &made);
}

#[test]
fn faces_beyond_any_curve_keep_their_regions() {
    let mut two = mesh(
        &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [5.0, 1.0, 0.0]],
        &[[0, 1, 2], [3, 4, 5]],
    );
    two.carried.regions = Some(Regions { labels: vec![0, 1].into(), names: vec!["a".into(), "b".into()] });
    let made = cut(&two, &[curve(&[at(0), on(1, 2, 0.5)], [0, 2])], 0.1).unwrap();
    let regions = made.surface.carried.regions.unwrap();
    assert_eq!((regions.labels.as_slice(), regions.names.len()), (&[2, 0, 1][..], 3));
}

proptest! {
    #[test]
    fn random_cuts_keep_the_area(places in prop::collection::btree_set(1_u32..10_000, 1..40), snap in 0.0..0.3) {
        let curves: Vec<Curve> = (0..)
            .zip(&places)
            .map(|(k, &place)| {
                let t = f64::from(place) / 10_000.0;
                curve(&[on(0, 1, t), on(0, 2, 1.0 - (1.0 - t) * (1.0 - t))], [k, k + 1])
            })
            .collect();
        let made = cut(&triangle(), &curves, snap).unwrap();
        prop_assert!((area(&made.surface) / area(&triangle()) - 1.0).abs() < 1e-12);
        prop_assert_eq!(made.surface.faces.len(), 1 + 2 * curves.len());
    }
}
