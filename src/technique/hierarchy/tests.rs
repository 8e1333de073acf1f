//! Recorded collapses on tori and bordered grids; every front is validated as a mesh.

use super::*;
use crate::mesh::edit::collapse::{check_collapse, collapse};
use crate::mesh::halfedge::HalfedgeMesh;
use crate::mesh::hierarchy::{Hierarchy, NodeId};
use crate::mesh::id::VertexId;
use crate::mesh::surface::Surface;
use crate::mesh::topology::{EdgeTable, boundary_loops, euler_characteristic};
use crate::mesh::validate::validate_surface;
use crate::mesh::{Carried, EdgeMark, Freedom, LockRules, MarkCause, edge_key, resolve_freedom};
use crate::watch::Watch;
use glam::DVec3;

/// A grid of `m × n` squares, each cut once; closed to a torus where asked.
fn sheet(m: u32, n: u32, torus: bool) -> Surface {
    let (columns, rows) = if torus { (m, n) } else { (m + 1, n + 1) };
    let at = |i: u32, j: u32| VertexId::from_raw((i % columns) + columns * (j % rows));
    let place = |i: u32, j: u32| {
        let (u, v) = (f64::from(i) / f64::from(m) * 6.0, f64::from(j) / f64::from(n) * 6.0);
        let bump = f64::from((i * 7 + j * 13) % 5) * 0.02;
        if torus {
            let (su, cu) = libm::sincos(u * std::f64::consts::PI / 3.0);
            let (sv, cv) = libm::sincos(v * std::f64::consts::PI / 3.0);
            DVec3::new((3.0 + cv) * cu, (3.0 + cv) * su, sv + bump)
        } else {
            DVec3::new(u, v, bump)
        }
    };
    let points = (0..rows).flat_map(|j| (0..columns).map(move |i| place(i, j))).collect();
    let mut faces = Vec::new();
    for j in 0..n {
        for i in 0..m {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    Surface { points, faces: faces.into(), carried: Carried::default() }
}

/// A small generator of repeatable numbers.
struct Dice(u64);

impl Dice {
    fn roll(&mut self, below: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % below as u64) as usize
    }
}

fn recorded(surface: &Surface, seed: u64) -> Hierarchy {
    let freedom = resolve_freedom(surface, &LockRules::default()).expect("no groups are named");
    let mut mesh = HalfedgeMesh::new(surface, &freedom).expect("a surface");
    let mut recorder = Recorder::new(surface.clone(), vec![1.0; surface.points.len()]);
    let mut dice = Dice(seed);
    let mut refused = 0;
    while refused < 400 {
        let edges: Vec<_> = mesh.edges().collect();
        let edge = edges[dice.roll(edges.len())];
        let Ok(plan) = check_collapse(&mesh, edge) else {
            refused += 1;
            continue;
        };
        let wish = 0.5 * (mesh.point(plan.kept) + mesh.point(plan.removed));
        let point = plan.placement.nearest(wish);
        recorder.collapse(&mesh, &plan, point);
        collapse(&mut mesh, &plan, point);
    }
    recorder.finish()
}

fn assert_is_mesh(front: &Front<'_>) -> Surface {
    let mesh = extract(front);
    let finest = &front.hierarchy().finest;
    let defects = validate_surface(&mesh);
    assert!(defects.is_empty(), "{defects:?}");
    assert_eq!(mesh.faces.len(), front.face_count());
    let (now, before) = (EdgeTable::new(&mesh), EdgeTable::new(finest));
    assert_eq!(euler_characteristic(&mesh, &now), euler_characteristic(finest, &before));
    assert_eq!(boundary_loops(&now).len(), boundary_loops(&before).len());
    mesh
}

fn marked_sheet() -> Surface {
    let mut surface = sheet(8, 6, false);
    for i in 0..8_u32 {
        let key = edge_key(VertexId::from_raw(9 * 3 + i), VertexId::from_raw(9 * 3 + i + 1));
        surface.carried.mark(key, EdgeMark { freedom: Freedom::OnCurve, cause: MarkCause::Feature });
    }
    surface
}

#[test]
fn the_finest_front_is_the_input_bit_for_bit() {
    for surface in [sheet(9, 7, true), marked_sheet()] {
        let hierarchy = recorded(&surface, 3);
        assert!(hierarchy.merges.len() > 20 && hierarchy.defect().is_none());
        assert_eq!(extract(&Front::finest(&hierarchy)), surface);
        let mut front = Front::coarsest(&hierarchy);
        for node in hierarchy.nodes().rev() {
            front.force_split(node);
        }
        assert_eq!(extract(&front), surface);
    }
}

#[test]
fn every_prefix_is_a_mesh() {
    let hierarchy = recorded(&sheet(9, 7, true), 5);
    for faces in (0..126).step_by(10) {
        let front = Front::with_faces(&hierarchy, faces);
        assert!(front.face_count() >= faces);
        assert_is_mesh(&front);
    }
}

#[test]
fn random_legal_and_forced_operations_stay_a_mesh() {
    for (surface, seed) in [(sheet(9, 7, true), 11), (marked_sheet(), 12), (sheet(6, 6, false), 13)] {
        let hierarchy = recorded(&surface, seed);
        let mut dice = Dice(seed);
        let mut front = Front::coarsest(&hierarchy);
        for round in 0..600 {
            let node = NodeId::new(dice.roll(hierarchy.node_count()));
            match dice.roll(4) {
                0 => drop(front.force_split(node)),
                1 => drop(front.force_merge(node)),
                2 => drop(front.split(node)),
                _ => drop(front.merge(node)),
            }
            if round % 5 == 0 {
                assert_is_mesh(&front);
            }
        }
    }
}

#[test]
fn a_legal_split_and_merge_undo_each_other() {
    let hierarchy = recorded(&sheet(9, 7, true), 17);
    let mut front = Front::coarsest(&hierarchy);
    let before = extract(&front);
    let node = front.nodes().find(|&n| front.can_split(n)).expect("a node to split");
    assert!(front.split(node) && front.merge(node));
    assert_eq!(extract(&front), before);
}

#[test]
fn refinement_meets_the_thresholds_where_leaves_allow() {
    let hierarchy = recorded(&sheet(12, 10, true), 23);
    let wish = |v: VertexId| if hierarchy.finest.points[v].x > 2.0 { 0.0 } else { f64::INFINITY };
    let thresholds = region_thresholds(&hierarchy, wish);
    let mut front = Front::coarsest(&hierarchy);
    front.refine_to(&thresholds, &Watch::silent()).expect("not cancelled");
    let mesh = assert_is_mesh(&front);
    for v in hierarchy.finest.points.ids().filter(|&v| wish(v) == 0.0) {
        assert!(front.contains(NodeId::from_raw(v.raw())), "{v:?} lies in the region and is not refined");
    }
    assert!(mesh.faces.len() < hierarchy.finest.faces.len());
}

#[test]
fn density_moves_reach_the_face_count_and_back() {
    let hierarchy = recorded(&sheet(12, 10, true), 29);
    let start = Front::with_faces(&hierarchy, 120);
    let density = Density::of(&start);
    for target in [60, 200] {
        let mut front = start.clone();
        density.move_to(&mut front, target, &Watch::silent()).expect("not cancelled");
        assert_is_mesh(&front);
        assert!(front.face_count().abs_diff(target) <= 40, "{} for {target}", front.face_count());
    }
}
