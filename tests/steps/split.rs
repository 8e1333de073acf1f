//! Split: curves become edges, regions meet at marked edges only, and nothing else changes.

use meshmill::mesh::topology::EdgeTable;
use meshmill::mesh::{Curve, Freedom, MarkCause, Soup, SurfacePoint, VertexId, edge_key};
use meshmill::step::Artifact;

use super::golden::golden;
use crate::shapes;
use crate::step::{run, run_locked, surface};

fn of(mesh: &Soup) -> Artifact {
    surface(shapes::surface(mesh))
}

fn curves(mesh: &Soup, regions: usize) -> Artifact {
    let marked = run("features", "angle = 30", &of(mesh)).artifact;
    let parts = run("partition", &format!("regions = {regions}"), &marked).artifact;
    run("straighten", "", &parts).artifact
}

/// Regions meet at marked edges and nowhere else.
fn assert_marked(artifact: &Artifact, what: &str) {
    let surface = artifact.as_surface().unwrap();
    let labels = &surface.carried.regions.as_ref().unwrap().labels;
    for (_, key, sides) in EdgeTable::new(&**surface).iter() {
        if let [a, b] = sides
            && labels[a.face] != labels[b.face]
        {
            let mark = surface.carried.marks.get(&key).unwrap_or_else(|| panic!("{what}: {key:?} is not marked"));
            assert_eq!(mark.freedom, Freedom::OnCurve, "{what}");
            assert!([MarkCause::RegionBorder, MarkCause::Feature].contains(&mark.cause), "{what}");
        }
    }
}

#[test]
fn curves_become_marked_edges() {
    for (name, shape) in
        [("sphere", shapes::sphere(4)), ("torus", shapes::torus(32, 16)), ("washer", shapes::washer(24))]
    {
        let from = curves(&shape, 8);
        let made = golden("split", name, "", &from);
        assert_marked(&made.artifact, name);
        let [before, after] = [&from, &made.artifact].map(|a| a.as_surface().unwrap());
        assert!(after.carried.curves.is_empty());
        assert!(before.points.as_slice() == &after.points.as_slice()[..before.points.len()], "{name}: vertices moved");
        assert!(made.stats["area-change"].as_f64().unwrap().abs() < 1e-12, "{name}: {:?}", made.stats);
    }
}

#[test]
fn snapping_and_flips_spare_slivers() {
    let from = curves(&shapes::sphere(4), 8);
    let least = |parameters: &str| run("split", parameters, &from).stats["min-stretch"].as_f64().unwrap();
    let (raw, snapped) = (least("snap = 0, flips = false"), least(""));
    assert!(snapped > raw && snapped > 0.05, "{raw} without, {snapped} with");
}

#[test]
fn without_curves_the_borders_are_marked() {
    let parts = run("partition", "regions = 7", &of(&shapes::sphere(3))).artifact;
    let made = run("split", "", &parts);
    assert_marked(&made.artifact, "sphere");
    assert_eq!((&made.stats["curves"], &made.stats["new-vertices"]), (&0.into(), &0.into()));
    let [before, after] = [&parts, &made.artifact].map(|a| a.as_surface().unwrap());
    assert_eq!((&before.points, &before.faces), (&after.points, &after.faces));
}

#[test]
fn everything_carried_goes_along() {
    let named = run("select", "name = \"up\", normal = { direction = [0, 0, 1], angle = 60 }", &of(&shapes::sphere(3)));
    let curved = run("features", "curvature = true", &named.artifact).artifact;
    let parts = run("partition", "regions = 6", &curved).artifact;
    let straight = run("straighten", "", &parts).artifact;
    let made = run("split", "", &straight).artifact;
    let made = made.as_surface().unwrap();
    let members = &made.carried.groups.faces["up"];
    assert!(members.len() > straight.as_surface().unwrap().carried.groups.faces["up"].len());
    let names: Vec<&str> = made.carried.fields.iter().map(|f| f.name.as_str()).collect();
    assert_eq!(names, ["curvature-max", "curvature-min", "region-normal"]);
}

#[test]
fn faults_are_told() {
    let plain = of(&shapes::grid(4));
    let refused = |parameters: &str, from: &Artifact| {
        run_locked("split", "main", parameters, "", &[("from", from.clone())]).unwrap_err()
    };
    assert!(refused("", &plain).message.contains("nothing to cut"));
    let mut crossing = (**plain.as_surface().unwrap()).clone();
    let edge = |a: usize, b: usize, t| SurfacePoint::Edge { edge: edge_key(VertexId::new(a), VertexId::new(b)), t };
    let curve = |points: [SurfacePoint; 2]| Curve { points: points.to_vec(), is_closed: false, sides: [0, 1] };
    crossing.carried.curves =
        vec![curve([edge(0, 1, 0.5), edge(1, 6, 0.5)]), curve([edge(0, 1, 0.8), edge(0, 6, 0.5)])];
    let failure = refused("", &surface(crossing));
    assert!(failure.message.contains("cross in face"), "{failure}");
    assert_eq!(failure.elements.len(), 2);
    assert!(refused("snap = 0.7", &curves(&shapes::sphere(2), 4)).message.contains("`snap`"));
}
