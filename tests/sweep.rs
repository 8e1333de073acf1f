//! `meshmill sweep` as people use it: shared work, tables, failed cases, interrupted and simultaneous sweeps.

use std::fs;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use assert_cmd::Command;
use predicates::prelude::*;

#[path = "common/desk.rs"]
mod desk;

use desk::Desk;

/// Three parameters: one upstream of everything that is slow, one in the middle, one in the gate only.
const RECIPE: &str = r#"
name = "study"
[inputs]
part = "cube.obj"
[params]
fill = "none"
times = 1
limit = 0.1
[steps.raw]
use = "read"
file = "=inputs.part"
[steps.clean]
use = "repair"
from = "raw"
fill-holes = "=fill"
[steps.fine]
use = "subdivide"
from = "clean"
times = "=times"
[gates.fine]
closed = true
min-stretch = { at-least = "=limit" }
[outputs]
fine = ["result.stl"]
[sweep]
columns = ["faces", "fine.min-stretch", { metric = "distance", of = "fine", to = "clean" }]
[sweep.axes]
times = [1, 2, 3]
limit = [0.1, 0.2]
"#;

const CUBE: &str = include_str!("common/cube.obj");

impl Desk {
    fn new() -> Self {
        Self::with(&[("recipe.toml", RECIPE), ("cube.obj", CUBE)])
    }

    fn sweep(&self, arguments: &[&str]) -> Command {
        let mut command = self.meshmill(&["sweep", "recipe.toml"]);
        command.args(arguments);
        command
    }

    fn start(&self, out: &str) -> Child {
        std::process::Command::new(assert_cmd::cargo::cargo_bin!("meshmill"))
            .current_dir(self.path(""))
            .env("MESHMILL_CACHE", self.path("cache"))
            .args(["sweep", "recipe.toml", "-q", "-s", "times=1,2,3,4,5", "--out", out])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap()
    }

    fn csv(&self, out: &str) -> Vec<csv::StringRecord> {
        let mut reader = csv::Reader::from_path(self.path(out).join("sweep.csv")).unwrap();
        reader.records().collect::<Result<_, _>>().unwrap()
    }

    /// How many tasks of each kind ran, as run.ron tells.
    fn ran(&self, out: &str) -> String {
        let text = self.text(&format!("{out}/run.ron"));
        let ran = text.split("ran: {").nth(1).unwrap().split('}').next().unwrap();
        ran.split_whitespace().collect()
    }
}

/// All files below a folder but run.ron, whose timings differ.
fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut found = Vec::new();
    let mut open = vec![folder.to_path_buf()];
    while let Some(next) = open.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else if path.file_name().unwrap() != "run.ron" {
                let name = path.strip_prefix(folder).unwrap().display().to_string();
                found.push((name, fs::read(&path).unwrap()));
            }
        }
    }
    found.sort();
    found
}

#[test]
fn cases_share_what_they_have_in_common_and_a_second_sweep_does_nothing() {
    let desk = Desk::new();
    let first = desk.sweep(&[]).assert().success();
    first.stdout(predicate::str::contains("fine.faces").and(predicate::str::contains("times-3_limit-0.2")));
    // Gates: one for each of six cases; metrics: three for each of three meshes.
    assert_eq!(desk.ran("out/study-sweep"), "\"gate\":15,\"read\":1,\"repair\":1,\"subdivide\":3,");
    let rows = desk.csv("out/study-sweep");
    assert_eq!(rows.len(), 6);
    let faces: Vec<&str> = rows.iter().map(|row| &row[3]).collect();
    assert_eq!(faces, ["48", "48", "192", "192", "768", "768"]);
    assert!(rows.iter().all(|row| row.iter().any(|field| field == "passed")));
    assert!(desk.path("out/study-sweep/times-2_limit-0.1/result.stl").is_file());
    let before = contents(&desk.path("out/study-sweep"));
    desk.sweep(&["-q"]).assert().success();
    assert_eq!(desk.ran("out/study-sweep"), "");
    assert_eq!(contents(&desk.path("out/study-sweep")), before);
    let ron = desk.text("out/study-sweep/sweep.ron");
    let table: meshmill::report::sweep::SweepTable = ron::from_str(&ron).unwrap();
    assert_eq!((table.rows.len(), table.parameters), (6, vec!["times".to_owned(), "limit".to_owned()]));
}

#[test]
fn a_failed_case_is_a_row_with_its_reason_and_the_others_go_on() {
    let desk = Desk::new();
    desk.write("broken.obj", "v 0 0 0\nf 1 2 3\n");
    let arguments = ["-s", "part=cube.obj,broken.obj", "-s", "times=1", "-s", "limit=0.1,0.99"];
    let swept = desk.sweep(&arguments).assert().code(4);
    swept.stderr(predicate::str::contains("broken").and(predicate::str::contains("1 of 4 cases passed")));
    let rows = desk.csv("out/study-sweep");
    let state = |row: &csv::StringRecord| row[row.len() - 5].to_owned();
    let mut states: Vec<String> = rows.iter().map(state).collect();
    states.sort();
    assert_eq!(states, ["FAILED", "FAILED", "gate failed", "passed"]);
    let gate = rows.iter().find(|row| state(row) == "gate failed").unwrap();
    assert!(gate[gate.len() - 4].contains("fine.min-stretch is"), "{gate:?}");
    let failed = rows.iter().find(|row| state(row) == "FAILED").unwrap();
    assert!(failed[failed.len() - 4].starts_with("raw: "), "{failed:?}");
    desk.sweep(&["-s", "times=1", "-s", "limit=0.99"]).assert().code(3);
}

#[test]
fn tables_go_to_stdout_as_csv_and_json() {
    let desk = Desk::new();
    let csv = desk.sweep(&["--csv"]).assert().success().get_output().stdout.clone();
    assert_eq!(String::from_utf8(csv).unwrap(), desk.text("out/study-sweep/sweep.csv"));
    let json = desk.sweep(&["--json"]).assert().success().get_output().stdout.clone();
    let table: serde_json::Value = serde_json::from_slice(&json).unwrap();
    assert_eq!(table["rows"][0]["state"], "passed");
    assert_eq!(table["rows"].as_array().unwrap().len(), 6);
    desk.sweep(&["--list"]).assert().success().stdout(predicate::str::contains("times-1_limit-0.1\n"));
}

#[test]
fn a_wrong_sweep_exits_with_2_and_runs_nothing() {
    let desk = Desk::new();
    for (arguments, message) in [
        (["-s", "tims=1"], "`times`"),
        (["-s", "times=1..9/1000000000"], "whole number from 2 to 10000"),
        (["-s", "times=1..9/9999"], "cases, and 10000 is the most"),
        (["-s", "times=200"], "must be at most"),
    ] {
        desk.sweep(&arguments).assert().code(2).stderr(predicate::str::contains(message));
    }
    assert!(!desk.path("out").exists());
}

#[test]
fn two_sweeps_at_once_give_the_same_bytes() {
    let desk = Desk::new();
    let (mut first, mut second) = (desk.start("one"), desk.start("two"));
    assert!(first.wait().unwrap().success() && second.wait().unwrap().success());
    assert_eq!(contents(&desk.path("one")), contents(&desk.path("two")));
    assert_eq!(contents(&desk.path("one")).len(), 20 + 2);
}

#[test]
fn killed_in_the_middle_a_sweep_goes_on_from_the_last_finished_task() {
    let desk = Desk::new();
    let mut child = desk.start("out");
    let results = || fs::read_dir(desk.path("cache/v2/cas")).map_or(0, Iterator::count);
    let end = Instant::now() + Duration::from_mins(1);
    while results() < 4 && child.try_wait().unwrap().is_none() && Instant::now() < end {
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let stored = |folder: &str| -> Vec<(String, std::time::SystemTime)> {
        contents(&desk.path("cache/v2").join(folder))
            .into_iter()
            .map(|(name, _)| {
                let time = fs::metadata(desk.path("cache/v2").join(folder).join(&name)).unwrap().modified().unwrap();
                (name, time)
            })
            .collect()
    };
    let before = stored("ac");
    assert!(desk.start("out").wait().unwrap().success());
    let after = stored("ac");
    // What was finished before was not done again.
    assert!(before.iter().all(|entry| after.contains(entry)));
    assert!(desk.start("other").wait().unwrap().success());
    assert_eq!(contents(&desk.path("out")), contents(&desk.path("other")));
}

#[cfg(target_os = "linux")]
#[test]
fn a_file_that_fits_a_pattern_and_cannot_be_used_is_named() {
    use std::os::unix::ffi::OsStrExt;
    let desk = Desk::new();
    fs::create_dir(desk.path("parts")).unwrap();
    fs::copy(desk.path("cube.obj"), desk.path("parts/good.obj")).unwrap();
    let list = |code: i32| {
        desk.sweep(&["-s", "inputs.part=parts/*.obj", "--list"]).assert().code(code).get_output().stderr.clone()
    };
    list(0);
    let link = desk.path("parts/broken.obj");
    std::os::unix::fs::symlink("nowhere", &link).unwrap();
    assert!(String::from_utf8_lossy(&list(2)).contains("leads nowhere"));
    fs::remove_file(&link).unwrap();
    let name = std::ffi::OsStr::from_bytes(b"lat\xe4.obj");
    fs::copy(desk.path("cube.obj"), desk.path("parts").join(name)).unwrap();
    assert!(String::from_utf8_lossy(&list(2)).contains("not UTF-8"));
}
