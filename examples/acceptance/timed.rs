//! One run of the program on one mesh, under limits of processor time and memory, and why it failed where it did.
//!
//! Processor seconds, not seconds of the clock, are limited and told, so that a busy machine changes neither the table
//! nor what passes. The shell does it, with `ulimit` and `times`, on every Unix; nothing else of it is used.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Runs what follows the limits, then tells what it and its children took. Not every shell limits memory.
const SCRIPT: &str = r#"ulimit -t "$1"; ulimit -v "$2" 2>"$ERRORS"; shift 2; "$@" >"$REPORT" 2>"$ERRORS"; code=$?
times; exit $code"#;

/// Most KiB of address space of one run: what asks for more would take the machine with it.
const MEMORY: u64 = 6 << 20;

/// What one run came to.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Outcome {
    /// The program and the recipe, by a hash of both.
    #[serde(default)]
    pub(super) program: String,
    /// The pipeline, by the name of its file.
    pub(super) pipeline: String,
    /// The mesh, as `FOLDER/FILE`.
    pub(super) mesh: String,
    /// Processor seconds of the whole run.
    pub(super) seconds: f64,
    /// Exit code.
    pub(super) code: i32,
    /// Why there is no result that passes.
    pub(super) reason: Option<String>,
}

/// Runs a recipe on a mesh, which is its input `part`, in a folder of its own, which is removed.
pub(super) fn run(program: &Path, recipe: &Path, mesh: &Path, limit: u64) -> std::io::Result<Outcome> {
    let folder = tempfile::tempdir()?;
    let folder = folder.path();
    let (report, errors) = (folder.join("report.json"), folder.join("errors.txt"));
    let mut command = Command::new("sh");
    command.env("LC_ALL", "C").env("REPORT", &report).env("ERRORS", &errors);
    command.args(["-c", SCRIPT, "sh"]).arg(limit.to_string()).arg(MEMORY.to_string()).arg(program);
    command.arg("run").arg(recipe);
    command.args(["--json", "--quiet", "--jobs", "1", "--pictures", "none", "--out"]).arg(folder.join("out"));
    command.arg("--cache").arg(folder.join("cache")).arg("--input").arg(format!("part={}", mesh.display()));
    let done = command.stderr(Stdio::null()).output()?;
    let code = done.status.code().unwrap_or(-1);
    let seconds = seconds(&String::from_utf8_lossy(&done.stdout)).unwrap_or(f64::NAN);
    let reason = (code != 0).then(|| {
        let read = |path: &Path| fs::read_to_string(path).unwrap_or_default();
        let report: Option<Value> = serde_json::from_str(&read(&report)).ok();
        report.as_ref().and_then(reason).unwrap_or_else(|| match read(&errors).trim() {
            // The system ends it, and counts a little more than it tells.
            _ if [137, 152].contains(&code) && seconds > 0.9 * limit as f64 => format!("not done after {limit} s"),
            "" => format!("exit {code}"),
            text => text.lines().next().unwrap_or_default().replace(&format!("{}/", folder.display()), ""),
        })
    });
    Ok(Outcome { program: String::new(), pipeline: String::new(), mesh: String::new(), seconds, code, reason })
}

/// Seconds of all children, user and system: the second line of `times`, such as `0m1.250s 0m0.040s`.
fn seconds(times: &str) -> Option<f64> {
    let one = |text: &str| {
        let (minutes, seconds) = text.strip_suffix('s')?.split_once('m')?;
        Some(60.0 * minutes.parse::<f64>().ok()? + seconds.parse::<f64>().ok()?)
    };
    times.lines().nth(1)?.split_whitespace().map(one).sum()
}

/// Of a report: the step that failed with what it says, else the metrics whose checks do not hold.
fn reason(report: &Value) -> Option<String> {
    let case = report["cases"].get(0)?;
    let steps = case["steps"].as_array()?.iter();
    let failed = steps.filter_map(|step| Some((step["name"].as_str()?, step["failure"]["message"].as_str()?)));
    if let Some((step, message)) = failed.into_iter().next() {
        return Some(format!("{step}: {message}"));
    }
    let rows = case["gates"].as_array()?.iter().filter_map(|gate| gate["rows"].as_array()).flatten();
    let misses = rows.filter(|row| row["passed"] == false).map(|row| {
        let limit = row["limit"].as_str().unwrap_or_default();
        format!("{} {}, not {limit}", row["metric"].as_str().unwrap_or_default(), short(&row["measured"]))
    });
    let misses: Vec<String> = misses.collect();
    (!misses.is_empty()).then(|| format!("gate: {}", misses.join("; ")))
}

fn short(measured: &Value) -> String {
    match measured.as_f64() {
        Some(number) if number.fract() != 0.0 => format!("{number:.3e}"),
        _ => measured.to_string(),
    }
}
