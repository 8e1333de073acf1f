//! Running the program itself, and reading what it wrote.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use meshmill::format::{Format, read};
use meshmill::mesh::Soup;
use meshmill::metric::{Measurement, Value};
use meshmill::report::record::from_ron;
use meshmill::watch::Watch;

/// The folder of the project.
pub(super) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The folder of further parts, where one is named.
pub(super) fn corpus() -> Option<PathBuf> {
    std::env::var_os("MESHMILL_CORPUS").map(PathBuf::from)
}

/// Whether a part is among those asked for; none asked for means all.
pub(super) fn is_wanted(part: &Path, wanted: &[String]) -> bool {
    wanted.is_empty() || wanted.iter().any(|w| part.to_string_lossy().contains(w))
}

/// One run of a recipe: exit code and seconds.
pub(super) fn run(recipe: &str, part: &Path, out: &Path, cache: &Path, sets: &[String]) -> (i32, f64) {
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

/// The mesh of a file.
pub(super) fn load(path: &Path) -> Option<Soup> {
    let bytes = std::fs::read(path).ok()?;
    let format = Format::detect(&path.to_string_lossy(), &bytes).ok()?;
    read(format, &bytes, &Watch::silent()).ok().map(|(soup, _)| soup)
}

/// A measured value; not a number where it is undefined.
pub(super) fn number(table: &Measurement, name: &str) -> f64 {
    table.get(name).map_or(f64::NAN, Value::as_f64)
}

/// Faces below 0.2 that the gates of a run have excused, because marked edges meet there more sharply than any triangle
/// of that stretch could.
pub(super) fn excused(out: &Path) -> usize {
    let text = std::fs::read_to_string(out.join("run.ron")).unwrap_or_default();
    let Ok(report) = from_ron(&text) else { return 0 };
    let rows = report.cases.iter().flat_map(|case| &case.gates).flat_map(|gate| &gate.rows);
    rows.filter(|row| row.metric == "min-stretch").map(|row| row.excused.len()).sum()
}

/// The program, built. Together with this example, so that both share what has been built.
pub(super) fn build() -> Option<PathBuf> {
    let build = Command::new(env!("CARGO"))
        .args(["build", "--release", "--quiet", "--bin", "meshmill", "--example", "acceptance"])
        .status();
    build.is_ok_and(|status| status.success()).then(|| root().join("target/release/meshmill"))
}
