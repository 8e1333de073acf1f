//! The tables of two papers, on parts of the same class as theirs.

use std::path::Path;

use meshmill::metric::measure;
use meshmill::watch::Watch;

use super::program::{corpus, excused, is_wanted, load, number, root, run};

/// Settings of Date et al., Table 1: part, subdivision size, squared tolerance, faces, largest size, largest valence.
const TABLE_1: &[(&str, &str, &str, &str, &str, &str)] = &[
    ("cad/crankshaft.stl", "8", "1.0", "7500", "20", "10"),
    ("cad/vase_scan.stl", "1000", "2.0", "10000", "5", "11"),
    ("cad/textured_mouse.stl", "1", "0.1", "40000", "2", "10"),
];

/// Settings of Date et al., adaptive levels of detail, Table 1: recipe, part, parameters, and its outputs.
const LEVELS: &[(&str, &str, &[&str], &[&str])] = &[
    (
        "date-2005-levels",
        "cad/hdd_cover.stl",
        &[],
        &["original", "one", "two", "pure-one", "pure-two", "curvature", "region", "global"],
    ),
    (
        "date-2005-levels",
        "cad/casting_part.stl",
        &[
            "edge=14",
            "quarter=7500",
            "square=1",
            "tolerance=1",
            "size=50",
            "valence=10",
            "first=14000",
            "second=7000",
            "x=-70",
            "y=0",
            "z=240",
            "radius=90",
        ],
        &["original", "one", "two", "pure-one", "pure-two"],
    ),
    ("date-2005-levels-scan", "cad/crankshaft_scan.stl", &[], &["original", "one", "two", "pure-one", "pure-two"]),
];

/// Table 1 of property control; whether every run passes.
pub(super) fn papers(wanted: &[String]) -> bool {
    let Some(corpus) = corpus() else {
        println!("skipped: the stand-ins for the papers' models lie in the folder named by MESHMILL_CORPUS");
        return true;
    };
    let mut all_hold = true;
    table_head();
    for (part, sigma, tolerance, faces, size, valence) in TABLE_1 {
        let keys = ["sigma", "tolerance", "faces", "max-size", "max-valence"];
        let sets = keys.into_iter().zip([*sigma, *tolerance, *faces, *size, *valence]);
        let sets: Vec<String> = sets.map(|(key, value)| format!("{key}={value}")).collect();
        let part = corpus.join(part);
        if is_wanted(&part, wanted) {
            let rows = table_rows("date-2005-table-1", &part, &sets, &["org", "qi", "sbd", "pc"]);
            all_hold &= rows.code == 0 && rows.sound.last() == Some(&true);
        }
    }
    all_hold
}

/// Table 1 of adaptive levels of detail; whether every run passes.
pub(super) fn levels(wanted: &[String]) -> bool {
    let Some(corpus) = corpus() else {
        println!("skipped: the stand-ins for the papers' models lie in the folder named by MESHMILL_CORPUS");
        return true;
    };
    let mut all_hold = true;
    table_head();
    for (recipe, part, sets, states) in LEVELS {
        let part = corpus.join(part);
        if is_wanted(&part, wanted) {
            let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
            let rows = table_rows(recipe, &part, &sets, states);
            // The mesh as it was and the paper's pure collapse stand beside ours.
            let judged = |state: &str| state != "original" && !state.starts_with("pure");
            all_hold &= rows.code == 0 && states.iter().zip(&rows.sound).all(|(s, &sound)| sound || !judged(s));
        }
    }
    all_hold
}

/// What became of a run whose states stand in a table.
struct Rows {
    code: i32,
    /// Whether each state that was written has no face below 0.2 but excused ones.
    sound: Vec<bool>,
}

fn table_head() {
    println!("| part | state | faces | mean stretch | min stretch | max valence | max size | run s |");
    println!("|---|---|---|---|---|---|---|---|");
}

/// Runs a recipe of `examples/compare` and prints a row for each of its outputs.
fn table_rows(recipe: &str, part: &Path, sets: &[String], states: &[&str]) -> Rows {
    let name = part.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let folder = root().join("target/acceptance").join(recipe).join(&name);
    let _ = std::fs::remove_dir_all(&folder);
    let recipe = format!("examples/compare/{recipe}.toml");
    let (code, seconds) = run(&recipe, part, &folder.join("out"), &folder.join("cache"), sets);
    let mut sound = Vec::new();
    for state in states {
        let failed = folder.join(format!("out/failed/{state}.vtu"));
        let file = if failed.exists() { failed } else { folder.join(format!("out/{state}.vtu")) };
        let Some(mesh) = load(&file) else { continue };
        let Ok(table) = measure(&mesh, None, &Watch::silent()) else { continue };
        println!(
            "| {name} | {state} | {} | {:.3} | {:.3} | {} | {:.2} | {seconds:.1} |",
            mesh.faces.len(),
            number(&table, "mean-stretch"),
            number(&table, "min-stretch"),
            number(&table, "max-valence"),
            number(&table, "max-size"),
        );
        sound.push(number(&table, "low-stretch-faces") <= excused(&folder.join("out")) as f64);
    }
    Rows { code, sound }
}
