//! Names survive the whole way: the solids of a file, through the steps, into what is written for viewers and solvers.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use assert_cmd::Command;
use glam::{DVec3, dvec3};
use meshmill::format::{Format, read};
use meshmill::mesh::Soup;
use meshmill::watch::Watch;

/// A box of 4 by 2 by 1 as text STL of two solids: `Lid top`, the upper side, and `Body`, the other five.
fn box_of_two_solids() -> String {
    let corner = |i: usize| dvec3(4.0 * (i & 1) as f64, 2.0 * (i >> 1 & 1) as f64, (i >> 2) as f64);
    let sides = [[4, 5, 7, 6], [0, 2, 3, 1], [0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6]];
    let mut text = String::new();
    for (name, sides) in [("Lid top", &sides[..1]), ("Body", &sides[1..])] {
        writeln!(text, "solid {name}").unwrap();
        for [a, b, c, d] in sides {
            for triangle in [[a, b, c], [a, c, d]] {
                text.push_str("facet normal 0 0 0\nouter loop\n");
                for p in triangle.map(|i| corner(*i)) {
                    writeln!(text, "vertex {} {} {}", p.x, p.y, p.z).unwrap();
                }
                text.push_str("endloop\nendfacet\n");
            }
        }
        writeln!(text, "endsolid {name}").unwrap();
    }
    text
}

fn load(path: &Path) -> Soup {
    let name = path.file_name().unwrap().to_str().unwrap();
    let bytes = fs::read(path).expect("a written file");
    read(Format::detect(name, &bytes).unwrap(), &bytes, &Watch::silent()).expect("a good file").0
}

fn centre(soup: &Soup, face: meshmill::mesh::FaceId) -> DVec3 {
    let corners = soup.faces[face].corners();
    corners.iter().map(|&v| soup.points[v]).sum::<DVec3>() / corners.len() as f64
}

/// The lid's faces are the upper side and no others; the rest is the body's.
fn expect_both_solids(path: &Path, lid: &str) {
    let soup = load(path);
    let groups = &soup.carried.groups.faces;
    let at = path.display();
    let (top, body) = (&groups[lid], &groups["Body"]);
    assert!(soup.faces.len() > 50, "{at}: {} faces", soup.faces.len());
    assert_eq!(top.len() + body.len(), soup.faces.len(), "{at}");
    assert!(top.iter().all(|&f| (centre(&soup, f).z - 1.0).abs() < 1e-6), "{at}: a lid's face is not on top");
    assert!(body.iter().all(|&f| centre(&soup, f).z < 1.0 - 1e-6), "{at}: a body's face is on top");
}

#[test]
fn solids_of_an_stl_arrive_in_vtu_and_inp() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("groups");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    let part = folder.join("two_solids.stl");
    fs::write(&part, box_of_two_solids()).unwrap();
    let recipe = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines/fe-surface.toml");
    let mut command = Command::cargo_bin("meshmill").unwrap();
    command.arg("run").arg(recipe).arg("--input").arg(format!("part={}", part.display()));
    command.args(["--set", "size=15%", "--jobs", "1"]);
    command.arg("--out").arg(folder.join("out")).arg("--cache").arg(folder.join("cache"));
    command.assert().success();
    expect_both_solids(&folder.join("out/result.vtu"), "Lid top");
    // Solvers take no spaces in names.
    expect_both_solids(&folder.join("out/result.inp"), "Lid_top");
}
