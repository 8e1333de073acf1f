//! Real parts from the folder in `MESHMILL_CORPUS`: counts as its `MANIFEST.tsv` says.

use std::path::{Path, PathBuf};

use glam::DVec3;
use meshmill::format::{Format, read};
use meshmill::mesh::{Facet, Soup, VertexId};
use meshmill::watch::Watch;

fn folder() -> Option<PathBuf> {
    let folder = std::env::var_os("MESHMILL_CORPUS").map(PathBuf::from);
    if folder.is_none() {
        eprintln!("skipped: MESHMILL_CORPUS names no folder of meshes");
    }
    folder
}

fn load(path: &Path) -> Soup {
    let name = path.file_name().and_then(|n| n.to_str()).expect("a file name");
    let bytes = std::fs::read(path).expect("a file of the manifest");
    let format = Format::detect(name, &bytes).expect("a known format");
    read(format, &bytes, &Watch::silent()).unwrap_or_else(|error| panic!("{name}: {error}")).0
}

/// Distinct positions that faces use: what the manifest counts.
fn distinct_points(soup: &Soup) -> usize {
    let corner = |v: &VertexId| (soup.points[*v] + DVec3::ZERO).to_array().map(f64::to_bits);
    let used: std::collections::BTreeSet<_> = soup.faces.iter().flat_map(Facet::corners).map(corner).collect();
    used.len()
}

#[test]
fn counts_are_those_of_the_manifest() {
    let Some(folder) = folder() else { return };
    let manifest = std::fs::read_to_string(folder.join("MANIFEST.tsv")).expect("a manifest");
    let mut wrong = Vec::new();
    for line in manifest.lines().skip(1) {
        let columns: Vec<&str> = line.split('\t').collect();
        if Format::from_file_name(columns[0]).is_none() {
            continue;
        }
        let soup = load(&folder.join(columns[0]));
        let triangles: usize = soup.faces.iter().map(|f| f.corners().len() - 2).sum();
        let found = (distinct_points(&soup).to_string(), triangles.to_string());
        if found != (columns[3].to_owned(), columns[4].to_owned()) {
            wrong.push(format!("{}: found {found:?}, manifest {:?}", columns[0], &columns[3..5]));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn all_variants_of_one_part_are_the_same_mesh() {
    let Some(folder) = folder() else { return };
    let mut names: Vec<PathBuf> = std::fs::read_dir(folder.join("dirty"))
        .expect("a folder of dirty meshes")
        .filter_map(|entry| entry.ok().map(|e| e.path()))
        .filter(|p| p.file_name().and_then(|n| n.to_str()).is_some_and(|n| n.starts_with("fmt_")))
        .filter(|p| p.to_str().and_then(Format::from_file_name).is_some())
        .collect();
    names.sort();
    assert!(names.len() >= 4, "{names:?}");
    // STL numbers points by their first use and holds 32 bits: positions are compared as such, face by face.
    let corners = |soup: &Soup| -> Vec<[u32; 3]> {
        let corners = soup.faces.iter().flat_map(Facet::corners).map(|&v| soup.points[v]);
        corners.map(|p| p.to_array().map(|x| (x as f32 + 0.0).to_bits())).collect()
    };
    let first = corners(&load(&names[0]));
    for name in &names[1..] {
        assert!(corners(&load(name)) == first, "{} differs from {}", name.display(), names[0].display());
    }
}
