//! The shipped pipelines, run as a newcomer runs them: golden metrics and gates, and files that read back sound.

#![expect(clippy::print_stderr, reason = "a skipped test says so")]

#[path = "common/corpus.rs"]
mod corpus;
#[path = "common/snapshot.rs"]
mod snapshot;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use meshmill::format::{Format, read};
use meshmill::mesh::Soup;
use meshmill::metric::{self, Value};
use meshmill::watch::Watch;
use serde_json::{Map, json};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn pipelines() -> Vec<PathBuf> {
    let entries = fs::read_dir(root().join("pipelines")).expect("the folder of pipelines");
    let files = entries.map(|entry| entry.expect("an entry").path());
    let mut recipes: Vec<_> = files.filter(|file| file.extension().is_some_and(|ending| ending == "toml")).collect();
    recipes.sort();
    recipes
}

/// A run in a folder of its own: the JSON document on stdout, and the files in `out`.
struct Run {
    folder: tempfile::TempDir,
    report: serde_json::Value,
}

impl Run {
    /// Runs a recipe on its own part or on `part`, with its own parameters but for `sets`; it must exit with 0.
    fn of(recipe: &Path, part: Option<&Path>, sets: &[&str]) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let mut command = assert_cmd::Command::new(assert_cmd::cargo::cargo_bin!("meshmill"));
        command.current_dir(folder.path()).env("MESHMILL_CACHE", folder.path().join("cache"));
        command.arg("run").arg(recipe).args(["--json", "--out", "out"]);
        if let Some(part) = part {
            command.arg("--input").arg(format!("part={}", part.display()));
        }
        for set in sets {
            command.args(["--set", set]);
        }
        let done = command.assert().success();
        let report = serde_json::from_slice(&done.get_output().stdout).expect("one JSON document");
        Self { folder, report }
    }

    /// Steps with their size and quality, tables of `measure`, and the gates: what does not depend on place or time.
    fn golden(&self) -> serde_json::Value {
        let case = &self.report["cases"][0];
        let steps = case["steps"].as_array().expect("steps").iter().map(|step| {
            let figures = step["figures"].as_object().cloned().unwrap_or_default();
            (step["name"].as_str().expect("a name").to_owned(), figures.into())
        });
        let gates = case["gates"].as_array().expect("gates").iter().map(|gate| {
            let rows = gate["rows"].as_array().expect("rows").iter();
            let rows =
                rows.map(|row| json!([row["metric"], row["limit"], row["measured"], row["passed"], row["note"]]));
            (gate["step"].as_str().expect("a step").to_owned(), rows.collect())
        });
        json!({ "steps": steps.collect::<Map<_, _>>(), "gates": gates.collect::<Map<_, _>>() })
    }

    /// The files that it wrote, read back.
    fn meshes(&self) -> Vec<(String, Soup)> {
        let files = self.report["cases"][0]["files"].as_array().expect("files");
        let paths = files.iter().map(|file| self.folder.path().join(file["path"].as_str().expect("a path")));
        // Patches are no mesh.
        let meshes = paths.filter(|path| path.extension().is_none_or(|ending| ending != "json"));
        let read_back = meshes.map(|path| {
            let name = path.file_name().expect("a name").to_string_lossy().into_owned();
            let bytes = fs::read(&path).unwrap_or_else(|error| panic!("{name}: {error}"));
            let format = Format::detect(&name, &bytes).expect("a known format");
            let mesh = read(format, &bytes, &Watch::silent()).unwrap_or_else(|error| panic!("{name}: {error}")).0;
            (name, mesh)
        });
        read_back.collect()
    }
}

fn holds(mesh: &Soup, name: &str) -> bool {
    let table = metric::measure(mesh, None, &Watch::silent()).expect("not cancelled");
    table.get(name) == Some(Value::Flag(true))
}

#[test]
fn shipped_pipelines_give_the_golden_metrics_and_sound_files() {
    for recipe in pipelines() {
        let name = recipe.file_stem().expect("a name").to_string_lossy().into_owned();
        // The chain of the paper takes its time; a coarse result tells as much of it.
        let sets: &[&str] = if name == "date-2005" { &["size=8%"] } else { &[] };
        let run = Run::of(&recipe, None, sets);
        snapshot::assert_golden("pipelines", &name, &run.golden());
        let meshes = run.meshes();
        assert!(meshes.iter().any(|(file, _)| file == "result.vtu"), "{name} writes no result.vtu");
        for (file, mesh) in &meshes {
            // The part that these ship with is an open sheet.
            let is_open = ["rough-quads", "surface-reconstruction", "quads-open"].contains(&name.as_str());
            for property in ["closed", "manifold", "oriented"].into_iter().skip(usize::from(is_open)) {
                assert!(holds(mesh, property), "{name}: {file} is not {property}");
            }
        }
        let results = meshes.iter().filter(|(file, _)| file.starts_with("result."));
        let sizes: BTreeSet<_> = results.map(|(_, mesh)| (mesh.points.len(), mesh.faces.len())).collect();
        assert_eq!(sizes.len(), 1, "{name}: the files differ in size: {sizes:?}");
    }
}

#[test]
fn looking_and_repairing_take_every_small_part_of_the_corpus() {
    let Some(folder) = corpus::corpus("cad") else { return };
    let entries = fs::read_dir(folder).expect("the parts").map(|entry| entry.expect("an entry").path());
    // Scans of millions of faces are for the acceptance table, which is built for speed.
    let small = |part: &PathBuf| fs::metadata(part).is_ok_and(|file| file.len() < 4_000_000);
    let stl = |part: &PathBuf| part.extension().is_some_and(|ending| ending == "stl");
    let mut parts: Vec<_> = entries.filter(|part| stl(part) && small(part)).collect();
    parts.sort();
    assert!(!parts.is_empty());
    for part in parts {
        for pipeline in ["inspect", "repair"] {
            let run = Run::of(&root().join(format!("pipelines/{pipeline}.toml")), Some(&part), &[]);
            for (file, mesh) in run.meshes() {
                let sound = holds(&mesh, "manifold") && holds(&mesh, "oriented");
                assert!(sound, "{}: {file} of {pipeline} is no surface", part.display());
            }
        }
    }
}

/// What a run of a recipe on a part came to, which must be a result or a reason; all that it told.
fn ends(recipe: &Path, part: &Path) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let mut command = assert_cmd::Command::new(assert_cmd::cargo::cargo_bin!("meshmill"));
    command.current_dir(folder.path()).env("MESHMILL_CACHE", folder.path().join("cache"));
    command.arg("run").arg(recipe).args(["--out", "out"]).arg("--input");
    let done = command.arg(format!("part={}", part.display())).assert();
    let output = done.get_output();
    let [told, shown] = [&output.stderr, &output.stdout].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    let name = format!("{} in {}", part.display(), recipe.display());
    let code = output.status.code();
    assert!(matches!(code, Some(0 | 2 | 3 | 4)), "{name}: {code:?}\n{told}");
    assert!(code == Some(0) || [&told, &shown].iter().any(|text| text.contains("FAILED")), "{name}: {told}{shown}");
    told + &shown
}

fn files_of(folder: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(root().join(folder)).expect("the folder");
    let mut files: Vec<_> = entries.map(|entry| entry.expect("an entry").path()).collect();
    files.sort();
    assert!(!files.is_empty());
    files
}

/// Soups whose faces run through each other, faces on one line, coordinates that arithmetic cannot hold: each formerly
/// kept some pipeline at work without end.
#[test]
fn nasty_meshes_end_in_every_pipeline_with_a_result_or_a_reason() {
    for part in files_of("tests/nasty") {
        for recipe in pipelines() {
            let told = ends(&recipe, &part);
            let wrong = ["NaN", "18446744073709551615"].into_iter().find(|wrong| told.contains(wrong));
            assert_eq!(wrong, None, "{} in {}: {told}", part.display(), recipe.display());
        }
    }
}

/// A rod a thousand times as long as thick, a plate with a tiny hole, a feather edge, a coarse prism.
#[test]
fn extreme_parts_end_with_a_result_or_a_reason() {
    for part in files_of("tests/geometry") {
        for recipe in ["fe-surface", "quads-closed"] {
            ends(&root().join(format!("pipelines/{recipe}.toml")), &part);
        }
    }
}

/// Edges as pairs of vertices with the number of faces there.
fn edges(mesh: &Soup) -> Vec<([usize; 2], usize)> {
    let sides = mesh.faces.iter().flat_map(|face| {
        let corners = face.corners();
        let ends = corners.iter().zip(corners.iter().cycle().skip(1));
        ends.map(|(a, b)| [a.min(b).index(), a.max(b).index()]).collect::<Vec<_>>()
    });
    let mut sides: Vec<_> = sides.collect();
    sides.sort_unstable();
    sides.chunk_by(|a, b| a == b).map(|same| (same[0], same.len())).collect()
}

#[test]
fn a_joint_of_three_plates_is_conforming_when_written() {
    let part = root().join("examples/meshes/t_joint.obj");
    let run = Run::of(&root().join("pipelines/fe-surface.toml"), Some(&part), &[]);
    let meshes = run.meshes();
    assert_eq!(meshes.len(), 3);
    for (file, mesh) in meshes {
        // The plates meet on the line x = z = 0, 60 long.
        let on_joint = |v: usize| {
            let point = mesh.points.as_slice()[v];
            point.x.abs() < 1e-4 && point.z.abs() < 1e-4
        };
        let (joint, others): (Vec<_>, Vec<_>) =
            edges(&mesh).into_iter().partition(|([a, b], _)| on_joint(*a) && on_joint(*b));
        let length: f64 =
            joint.iter().map(|([a, b], _)| mesh.points.as_slice()[*a].distance(mesh.points.as_slice()[*b])).sum();
        assert!(
            joint.iter().all(|(_, faces)| *faces == 3),
            "{file}: an edge of the joint has not three faces: {joint:?}"
        );
        assert!((length - 60.0).abs() < 1e-3, "{file}: the edges of the joint are {length} long");
        let vertices = (0..mesh.points.len()).filter(|&v| on_joint(v)).count();
        assert_eq!(vertices, joint.len() + 1, "{file}: a vertex hangs on the joint");
        assert!(others.iter().all(|(_, faces)| *faces <= 2), "{file}: plates meet away from the joint");
        let outer = others.iter().filter(|(_, faces)| *faces == 1);
        let rim: f64 = outer.map(|([a, b], _)| mesh.points.as_slice()[*a].distance(mesh.points.as_slice()[*b])).sum();
        assert!((rim - 460.0).abs() < 1e-2, "{file}: the rim is {rim} long and should be 460");
    }
}
