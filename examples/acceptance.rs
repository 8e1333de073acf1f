//! Runs the shipped pipelines on many parts through the program itself and prints the table that the notes quote.
//!
//! ```sh
//! cargo run --release --example acceptance              # fe-surface on every part
//! cargo run --release --example acceptance -- papers    # Table 1 of Date et al., property control, on stand-ins
//! cargo run --release --example acceptance -- levels    # Table 1 of Date et al., adaptive levels of detail, likewise
//! cargo run --release --example acceptance -- fe-surface crankshaft fandisk
//! ```
//!
//! Parts: `examples/meshes`, and those of the folder named by `MESHMILL_CORPUS`, where it is set. Every figure is
//! measured on the file that was written, read again. The exit code is 1 when a row misses a target.

#![expect(clippy::print_stdout, reason = "this program is a table")]

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::Instant;

use meshmill::format::{Format, read};
use meshmill::mesh::Soup;
use meshmill::metric::{Measurement, Value, measure};
use meshmill::report::record::from_ron;
use meshmill::steps::repair::{RepairParams, repair};
use meshmill::watch::Watch;

/// Closed parts of the corpus on which `fe-surface` must hold its promises, by path below the corpus folder.
const CORPUS: &[&str] = &[
    "cad/l_bracket.stl",
    "cad/simple_part.stl",
    "cad/pipe_tee.stl",
    "cad/phone_panel.stl",
    "cad/hdd_cover.stl",
    "cad/relay_shell.stl",
    "cad/crankshaft.stl",
    "cad/casting_part.stl",
    "cad/valve_cover.stl",
    "cad/textured_mouse.stl",
    "cad/vase_scan.stl",
    "cad/crankshaft_scan.stl",
    "public/rocker-arm.obj",
    "public/rocker-arm-3356.stl",
    "public/fandisk.obj",
    "public/joint.off",
    "public/i4_crankshaft.stl",
    "public/i4_cylinder_head.stl",
    "public/turbineblade.ply",
];

/// What ships with the project, for a run without a corpus.
const SHIPPED: &[&str] = &["l_bracket.stl", "simple_part.stl", "pipe_tee.stl"];

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

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let what = arguments.next().unwrap_or_else(|| "fe-surface".to_owned());
    let wanted: Vec<String> = arguments.collect();
    // Together with this example, so that both share what has been built.
    let build = Command::new(env!("CARGO"))
        .args(["build", "--release", "--quiet", "--bin", "meshmill", "--example", "acceptance"])
        .status();
    if !build.is_ok_and(|status| status.success()) {
        println!("the program could not be built");
        return ExitCode::FAILURE;
    }
    let holds = match what.as_str() {
        "papers" => papers(&wanted),
        "levels" => levels(&wanted),
        "fe-surface" => fe_surface(&wanted),
        other => {
            println!("unknown table `{other}`: `fe-surface`, `papers` or `levels`");
            false
        }
    };
    if holds { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn corpus() -> Option<PathBuf> {
    std::env::var_os("MESHMILL_CORPUS").map(PathBuf::from)
}

fn is_wanted(part: &Path, wanted: &[String]) -> bool {
    wanted.is_empty() || wanted.iter().any(|w| part.to_string_lossy().contains(w))
}

/// One run of a recipe: exit code and seconds.
fn run(recipe: &str, part: &Path, out: &Path, cache: &Path, sets: &[String]) -> (i32, f64) {
    let begin = Instant::now();
    let mut command = Command::new(root().join("target/release/meshmill"));
    command.arg("run").arg(root().join(recipe)).args(["--quiet", "--jobs", "1", "--out"]).arg(out);
    command.arg("--cache").arg(cache).arg("--input").arg(format!("part={}", part.display()));
    for set in sets {
        command.args(["--set", set]);
    }
    let code = command.status().ok().and_then(|status| status.code()).unwrap_or(-1);
    (code, begin.elapsed().as_secs_f64())
}

fn load(path: &Path) -> Option<Soup> {
    let bytes = std::fs::read(path).ok()?;
    let format = Format::detect(&path.to_string_lossy(), &bytes).ok()?;
    read(format, &bytes, &Watch::silent()).ok().map(|(soup, _)| soup)
}

fn number(table: &Measurement, name: &str) -> f64 {
    table.get(name).map_or(f64::NAN, Value::as_f64)
}

fn fe_surface(wanted: &[String]) -> bool {
    let shipped = SHIPPED.iter().map(|name| root().join("examples/meshes").join(name));
    let parts: Vec<PathBuf> = match corpus() {
        Some(corpus) => CORPUS.iter().map(|name| corpus.join(name)).collect(),
        None => shipped.collect(),
    };
    println!(
        "{:24} {:>8} {:>8} {:>4} {:>6} {:>4} {:>8} {:>8} {:>4} {:>7} {:>6} {:>7} {:>9} {:>8} {:>7} {:>7}  verdict",
        "part",
        "faces in",
        "out",
        "exit",
        "closed",
        "chi",
        "min st",
        "mean st",
        "low",
        "excused",
        "size %",
        "valence",
        "dist. %",
        "new s.i.",
        "run s",
        "again s"
    );
    let mut all_hold = true;
    for part in parts.iter().filter(|part| is_wanted(part, wanted)) {
        all_hold &= fe_surface_row(part);
    }
    all_hold
}

fn fe_surface_row(part: &Path) -> bool {
    let name = part.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let folder = root().join("target/acceptance").join(&name);
    let (out, cache) = (folder.join("out"), folder.join("cache"));
    let _ = std::fs::remove_dir_all(&folder);
    let (code, first) = run("pipelines/fe-surface.toml", part, &out, &cache, &[]);
    let (_, again) = run("pipelines/fe-surface.toml", part, &out, &cache, &[]);
    let failed = out.join("failed/result.vtu");
    let file = if failed.exists() { failed } else { out.join("result.vtu") };
    let (Some(input), Some(result)) = (load(part), load(&file)) else {
        println!("{name:24} exit {code}: no result to measure");
        return false;
    };
    let watch = Watch::silent();
    let Ok((clean, _)) = repair(&input, &RepairParams::default(), &watch) else { return false };
    let clean = clean.to_soup();
    let (Ok(now), Ok(before)) = (measure(&result, Some(&clean), &watch), measure(&clean, None, &watch)) else {
        return false;
    };
    let percent = |length: f64| 100.0 * length / number(&before, "diagonal");
    let chi_kept = now.get("euler-characteristic") == before.get("euler-characteristic");
    let is = |name: &str| now.get(name) == Some(Value::Flag(true));
    let new_hits = number(&now, "self-intersections") - number(&before, "self-intersections");
    let targets = [
        ("exit", code == 0),
        ("closed", is("closed")),
        ("manifold", is("manifold") && is("oriented")),
        ("chi", chi_kept),
        ("min stretch", number(&now, "low-stretch-faces") <= excused(&out) as f64),
        ("mean stretch", number(&now, "mean-stretch") >= 0.75),
        ("size", percent(number(&now, "max-size")) <= 4.0 + 1e-9),
        ("valence", number(&now, "max-valence") <= 10.0),
        ("distance", percent(number(&now, "distance")) <= 0.3),
        ("self-intersections", new_hits <= 0.0),
    ];
    let missed: Vec<&str> = targets.iter().filter(|(_, holds)| !holds).map(|(name, _)| *name).collect();
    println!(
        "{:24} {:>8} {:>8} {:>4} {:>6} {:>4} {:>8.4} {:>8.4} {:>4} {:>7} {:>6.3} {:>7} {:>9.4} {:>8} {:>7.2} {:>7.3}  {}",
        name,
        input.faces.len(),
        result.faces.len(),
        code,
        if is("closed") { "yes" } else { "no" },
        if chi_kept { "kept" } else { "lost" },
        number(&now, "min-stretch"),
        number(&now, "mean-stretch"),
        number(&now, "low-stretch-faces"),
        excused(&out),
        percent(number(&now, "max-size")),
        number(&now, "max-valence"),
        percent(number(&now, "distance")),
        new_hits,
        first,
        again,
        if missed.is_empty() { "holds".to_owned() } else { format!("misses {}", missed.join(", ")) },
    );
    missed.is_empty()
}

/// Faces below 0.2 that the gates of a run have excused, because marked edges meet there more sharply than any triangle
/// of that stretch could.
fn excused(out: &Path) -> usize {
    let text = std::fs::read_to_string(out.join("run.ron")).unwrap_or_default();
    let Ok(report) = from_ron(&text) else { return 0 };
    let rows = report.cases.iter().flat_map(|case| &case.gates).flat_map(|gate| &gate.rows);
    rows.filter(|row| row.metric == "min-stretch").map(|row| row.excused.len()).sum()
}

fn papers(wanted: &[String]) -> bool {
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

fn levels(wanted: &[String]) -> bool {
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
