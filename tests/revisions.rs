//! A step whose output changes must say so: its revision is part of every key, so that no cache serves old results.
//!
//! `tests/snapshots/revisions.ron` records for every step its revision and the hash of what it makes of fixed input.
//! The test fails when a hash moves and the revision does not. After raising `REVISION` (and a line in the changelog)
//! `UPDATE_REVISIONS=1 cargo test --test revisions` records the new hashes; it refuses to do so without.

#[path = "common/levels.rs"]
mod levels;
#[path = "common/shapes.rs"]
mod shapes;
#[path = "common/step.rs"]
mod step;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use meshmill::step::Artifact;
use meshmill::steps::CATALOG;
use meshmill::store::codec::{self, CODEC_VERSION};
use ron::ser::PrettyConfig;
use serde::{Deserialize, Serialize};

use step::{run, run_locked};

/// Parameters and locks that reach the branches of a step; each case runs on every fixed input that fits.
const CASES: &[(&str, &str, &str)] = &[
    ("read", "", ""),
    ("read", "scale = 0.001", ""),
    ("repair", "", ""),
    ("repair", "fill-holes = \"all\", non-manifold = \"seam\", weld = 0.01", ""),
    ("repair", "self-intersections = \"remove\", bodies = \"union\"", ""),
    ("repair", "self-intersections = \"remove\", bodies = \"keep\"", ""),
    ("select", "name = \"low\", box = { min = [-9, -9, -9], max = [9, 9, 0.5] }", ""),
    ("select", "name = \"up\", of = \"edges\", normal = { direction = [0, 0, 1] }", ""),
    ("features", "", ""),
    ("features", "angle = 12, corner-angle = 20", ""),
    ("remove-features", "max-diameter = 0.8", ""),
    ("subdivide", "", "boundary = \"exact\""),
    ("refine", "max-edge = \"7%\"", ""),
    ("refine", "max-edge = \"9%\"", "keep = [\"top\"]"),
    ("remesh", "max-size = \"15%\", tolerance = \"1%\"", ""),
    ("remesh", "max-size = \"25%\", mean-stretch = 0.9", "keep = [\"top\"]"),
    ("improve-quality", "max-edge = \"9%\", tolerance = \"1%\"", ""),
    ("improve-quality", "max-edge = \"9%\", tolerance = \"1%\", tolerance-mode = \"quadric-rms\"", "only = [\"top\"]"),
    ("control-properties", "max-size = \"25%\", tolerance = \"2%\"", ""),
    ("control-properties", "tolerance = \"2%\", min-stretch = 0.4, optimize = false", "keep = [\"top\"]"),
    ("control-properties", "tolerance = 0.01, tolerance-mode = \"quadric-sum\", target-faces = 60", ""),
    ("simplify-fit", "", ""),
    ("simplify-fit", "remove = \"60%\", tolerance = \"2%\", dispersion = \"std\"", "keep = [\"top\"]"),
    ("simplify-fit", "target-faces = 60, tolerance = \"1%\", tolerance-mode = \"plane\"", ""),
    ("resolution", "share = \"50%\"", ""),
    ("adapt-curvature", "smallest = \"3%\"", ""),
    ("adapt-region", "size = \"8%\", half-spaces = [{ point = [0, 0, 0], normal = [1, 2, 3] }]", ""),
    ("adapt-density", "base = \"60%\", share = \"40%\"", ""),
    ("partition", "", ""),
    ("partition", "regions = 5, metric = \"l2\", seed = 3", ""),
    ("partition", "max-angle = 60, disk = true, mark-borders = true", ""),
    ("straighten", "", ""),
    ("straighten", "method = \"flip-geodesic\", rounds = 3", ""),
    ("split", "", ""),
    ("split", "snap = 0, flips = false", ""),
    ("rough-quads", "interval = 0.25", ""),
    ("rough-quads", "interval = 0.2, thickness = { strips = 4 }, optimize = false", ""),
    ("fit-patches", "tolerance = \"0.1%\", density = 3", ""),
    ("fit-patches", "max-spans = 2", ""),
    ("q-morph", "size = \"9%\"", ""),
    // Patches meshed anew, searches over sizes and flattening have something to do here.
    ("q-morph", "size = \"14%\", tolerance = \"0.05%\", attempts = 4", ""),
    ("measure", "", ""),
];

/// What is recorded of a step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Recorded {
    revision: u32,
    /// By case, the hash of the canonical bytes that came out, or why nothing did.
    hashes: BTreeMap<String, String>,
}

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Record {
    /// Version of the canonical bytes: another one moves every hash.
    codec: u16,
    steps: BTreeMap<String, Recorded>,
}

fn file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/snapshots/revisions.ron")
}

/// Fixed inputs by name: a file, broken soups, and surfaces with groups, marks, rims and seams.
fn inputs() -> Vec<(String, Artifact)> {
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0.5\ng left\nf 1 2 3 4\ng right\nf 2 5 6 3\n";
    let named = |mesh: &meshmill::mesh::Soup| {
        let plain = step::surface(shapes::surface(mesh));
        let top = run("select", "name = \"top\", normal = { direction = [0, 0, 1], angle = 40 }", &plain).artifact;
        run("features", "angle = 35", &top).artifact
    };
    let curves = |mesh: &meshmill::mesh::Soup| {
        let parts = run("partition", "regions = 7", &named(mesh)).artifact;
        run("straighten", "", &parts).artifact
    };
    let broken = shapes::duplicate_face(shapes::flipped_face(shapes::hole(shapes::sphere(1), 9), 3), 4);
    let mut inputs: Vec<_> = shapes::STANDARD.iter().map(|(name, shape)| (*name, step::soup(shape()))).collect();
    // Another input with each revision of the step that makes it: what others make of it then is nothing of theirs.
    let rough = format!("bowl by rough-quads {}", step::step("rough-quads").revision);
    inputs.extend([
        ("plates.obj", step::file("plates.obj", text)),
        ("broken-sphere", step::soup(broken)),
        ("named-cylinder", named(&shapes::cylinder(20, 3))),
        ("named-washer", named(&shapes::washer(20))),
        ("named-grid", named(&shapes::grid(7))),
        ("curves-on-a-sphere", curves(&shapes::sphere(3))),
        ("levels-of-a-sphere", levels::levels(&shapes::sphere(3))),
        ("bowl", bowl()),
        (&rough, run("rough-quads", "interval = 0.3", &bowl()).artifact),
    ]);
    inputs.into_iter().map(|(name, artifact)| (name.to_owned(), artifact)).collect()
}

/// A curved sheet, fine enough for rough quads.
fn bowl() -> Artifact {
    let mut mesh = shapes::grid(40);
    mesh.points.iter_mut().for_each(|p| p.z = p.x * p.x - 0.5 * p.y * p.y * p.x);
    step::surface(shapes::surface(&mesh))
}

/// The hashes of all cases of a step, by input, parameters and output.
fn hashes(name: &str, inputs: &[(String, Artifact)]) -> BTreeMap<String, String> {
    let def = step::step(name);
    let main = &def.inputs[0];
    let mut found = BTreeMap::new();
    for (_, parameters, locks) in CASES.iter().filter(|(step, _, _)| *step == name) {
        for (input, artifact) in inputs.iter().filter(|(_, artifact)| main.accepts.contains(&artifact.port())) {
            for output in def.outputs {
                let mut given = vec![(main.name, artifact.clone())];
                if name == "fit-patches" {
                    given.push(("surface", bowl()));
                }
                let made = run_locked(name, output.name, parameters, locks, &given);
                // A refusal is an answer too.
                let answer = match made {
                    Ok(made) => codec::content_hash(&codec::encode(&made.artifact)).to_hex()[..32].to_owned(),
                    Err(failure) => format!("refused: {failure}"),
                };
                let case = [input.as_str(), *parameters, *locks, output.name].join(" | ");
                found.insert(case, answer);
            }
        }
    }
    found
}

fn now() -> Record {
    let inputs = inputs();
    let steps = CATALOG.iter().map(|step| {
        let hashes = hashes(step.name, &inputs);
        assert!(!hashes.is_empty(), "step `{}` has no case in CASES that any fixed input fits", step.name);
        (step.name.to_owned(), Recorded { revision: step.revision, hashes })
    });
    Record { codec: CODEC_VERSION, steps: steps.collect() }
}

/// Cases that both know and that gave something else.
fn moved<'a>(old: &'a Recorded, new: &'a Recorded) -> BTreeSet<&'a str> {
    let both = old.hashes.iter().filter_map(|(case, hash)| Some((case, hash, new.hashes.get(case)?)));
    both.filter(|(_, old, new)| old != new).map(|(case, _, _)| case.as_str()).collect()
}

#[test]
fn a_changed_output_raises_the_revision() {
    let new = now();
    let update = std::env::var_os("UPDATE_REVISIONS").is_some();
    let text = std::fs::read_to_string(file()).unwrap_or_default();
    let old = ron::from_str(&text).unwrap_or(Record { codec: CODEC_VERSION, steps: BTreeMap::new() });
    let mut faults = Vec::new();
    if old.codec == new.codec {
        for (name, recorded) in &old.steps {
            let Some(step) = new.steps.get(name).filter(|step| step.revision == recorded.revision) else { continue };
            let cases: Vec<_> = moved(recorded, step).into_iter().map(|case| format!("\n    {case}")).collect();
            if !cases.is_empty() {
                let stem = name.replace('-', "_");
                faults.push(format!(
                    "`{name}` gives another result in revision {}: raise REVISION of src/steps/{stem}, add a line to \
                     CHANGELOG.md, then record the new hashes with UPDATE_REVISIONS=1{}",
                    step.revision,
                    cases.concat()
                ));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    if update {
        let config = PrettyConfig::default().struct_names(false).indentor("  ");
        std::fs::write(file(), ron::ser::to_string_pretty(&new, config).unwrap() + "\n").unwrap();
    } else {
        assert!(old == new, "steps, revisions or cases are new: UPDATE_REVISIONS=1 cargo test --test revisions");
    }
}
