//! Repair on real parts and on files with known defects, from the folder that `MESHMILL_CORPUS` names.

#![expect(clippy::print_stderr, reason = "a skipped test says so")]

#[path = "common/corpus.rs"]
mod corpus;

use meshmill::format::{Format, read};
use meshmill::mesh::Surface;
use meshmill::mesh::validate::validate_surface;
use meshmill::step::Length;
use meshmill::steps::repair::{FillHoles, RepairParams, RepairStats, repair};
use meshmill::watch::Watch;

/// Repairs a file and checks that the result is valid and stays as it is; `None`, said so, without a corpus.
fn repaired(name: &str, params: &RepairParams) -> Option<(Surface, RepairStats)> {
    let bytes = std::fs::read(corpus::corpus(name)?).expect("a file of the corpus");
    let format = Format::detect(name, &bytes).expect("a known format");
    let soup = read(format, &bytes, &Watch::silent()).expect("a good file").0;
    drop(bytes);
    let start = std::time::Instant::now();
    let (surface, stats) = repair(&soup, params, &Watch::silent()).expect("repairs");
    if std::env::var_os("MESHMILL_VERBOSE").is_some() {
        let text = format!("{stats:?}").replace(", ", "\n");
        let changed: Vec<&str> = text.lines().filter(|l| !l.ends_with(": 0") && !l.ends_with(": []")).collect();
        eprintln!("{name} {:?} {:?}: {}", start.elapsed(), euler(&surface), changed.join(" "));
    }
    let defects = validate_surface(&surface);
    assert!(defects.is_empty(), "{name}: {:?}", &defects[..defects.len().min(5)]);
    assert!(stats.self_intersections <= stats.self_intersections_before, "{name}: new self-intersections");
    if surface.faces.len() < 300_000 {
        let (again, _) = repair(&surface.to_soup(), params, &Watch::silent()).expect("repairs again");
        assert!(again == surface, "{name}: repairing again changes something");
    }
    Some((surface, stats))
}

fn with(name: &str, weld: Option<f64>, fill: FillHoles) -> Option<(Surface, RepairStats)> {
    let default = RepairParams::default();
    let weld = weld.map_or(default.weld, Length::Absolute);
    repaired(name, &RepairParams { weld, fill_holes: fill, ..default })
}

/// Euler characteristic and number of border edges.
fn euler(surface: &Surface) -> (i64, usize) {
    let mut edges: Vec<[u32; 2]> = Vec::new();
    for &[a, b, c] in &surface.faces {
        edges.extend([[a, b], [b, c], [c, a]].map(|e| [e[0].min(e[1]).raw(), e[0].max(e[1]).raw()]));
    }
    edges.sort_unstable();
    let border = edges.chunk_by(|a, b| a == b).filter(|c| c.len() == 1).count();
    edges.dedup();
    (surface.points.len() as i64 - edges.len() as i64 + surface.faces.len() as i64, border)
}

#[test]
fn parts_keep_their_topology_and_lose_collapsed_faces() {
    let parts = [
        ("bent_strip_open", (-3, 190)),
        ("casting_part", (-36, 0)),
        ("crankshaft", (-16, 0)),
        ("gap_fillet_open", (1, 39)),
        ("gap_three_planes_open", (1, 39)),
        ("hdd_cover", (-36, 0)),
        ("l_bracket", (-6, 0)),
        ("phone_panel", (-46, 0)),
        ("pipe_tee", (-50, 0)),
        ("plate_holes_open", (-6, 270)),
        ("relay_shell", (-8, 0)),
        ("simple_part", (-14, 0)),
        ("textured_mouse", (2, 0)),
        ("valve_cover", (-34, 0)),
    ];
    for (part, topology) in parts {
        if let Some((surface, stats)) = with(&format!("cad/{part}.stl"), None, FillHoles::None) {
            assert_eq!((euler(&surface), stats.degenerate_faces_left), (topology, 0), "{part}");
        }
    }
}

#[test]
fn scan_of_a_million_triangles_comes_through() {
    if let Some((surface, _)) = with("cad/crankshaft_scan.stl", None, FillHoles::None) {
        assert_eq!((surface.faces.len(), euler(&surface)), (992_340, (-16, 0)));
    }
}

#[test]
fn known_defects_are_mended() {
    let none = FillHoles::None;
    if let Some((surface, _)) = with("dirty/crankshaft_soup_jitter.stl", Some(3e-4), none) {
        assert_eq!(euler(&surface), (-16, 0));
    }
    if let Some((surface, stats)) = with("dirty/bracket_tjunctions.stl", None, none) {
        assert_eq!((euler(&surface), stats.t_junctions), ((-6, 0), 120));
    }
    if let Some((surface, stats)) = with("dirty/hdd_cover_flipped.off", None, none) {
        assert_eq!((euler(&surface), stats.faces_turned), ((-36, 0), 4218));
    }
    if let Some((_, stats)) = with("dirty/bodies_selfintersect.stl", None, none) {
        assert!(stats.components == 3 && stats.cavities == 0 && stats.self_intersections > 0);
    }
    if let Some((_, stats)) = with("dirty/relay_debris.stl", None, none) {
        assert_eq!(stats.components, 71);
    }
}

#[test]
fn foreign_files_become_manifolds() {
    let names = [
        "cubeNonMan.off",
        "edge_with_four_triangles.off",
        "openscad_nonmanifold.obj",
        "soup.stl",
        "trianglemesh_cutvertices.off",
        "moebius.obj",
        "sea_vase.ply",
        "cycloidal.ply",
        "thingi_100071_sf.obj",
        "thingi_112932.stl",
        "thingi_79741.stl",
        "thingi_88566.stl",
        "angle_block.stl",
        "featuretype.stl",
        "idler_riser.stl",
        "beetle_pmp.off",
        "hour_glass.off",
        "busted.stl",
        "adis16480.stl",
        "stanford-bunny.obj",
        "plane_holes.obj",
        "3holes.off",
        "fandisk.obj",
        "gears.stl",
        "joint.off",
        "self_intersectA.obj",
    ];
    for name in names {
        for fill in [FillHoles::None, FillHoles::All] {
            with(&format!("public/{name}"), None, fill);
        }
    }
}
