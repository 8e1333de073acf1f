//! What a laboratory does with recipes: lock them, compare runs, ask why, begin new ones, search, watch.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use predicates::prelude::*;

#[path = "common/desk.rs"]
mod desk;

use desk::Desk;

const RECIPE: &str = r#"
name = "part"
[inputs]
part = "cube.obj"
[params]
times = 1
limit = 0.1
[steps.raw]
use = "read"
file = "=inputs.part"
[steps.clean]
use = "repair"
from = "raw"
[steps.fine]
use = "subdivide"
from = "clean"
times = "=times"
[gates.fine]
closed = true
min-stretch = { at-least = "=limit" }
[outputs]
fine = ["result.stl"]
"#;

const CUBE: &str = include_str!("common/cube.obj");

impl Desk {
    fn new() -> Self {
        Self::with(&[("recipe.toml", RECIPE), ("cube.obj", CUBE)])
    }

    fn run(&self, arguments: &[&str]) {
        self.meshmill(&["run", "recipe.toml", "-q"]).args(arguments).assert().success();
    }
}

#[test]
fn a_locked_recipe_passes_until_something_changes() {
    let desk = Desk::new();
    desk.meshmill(&["run", "recipe.toml", "--locked"]).assert().code(2).stderr(predicate::str::contains("lock"));
    desk.meshmill(&["lock", "recipe.toml"]).assert().success();
    let locked = |arguments: &[&str]| desk.meshmill(&["run", "recipe.toml", "-q", "--locked"]).args(arguments).assert();
    locked(&[]).success();
    let changed = locked(&["--set", "times=2"]).code(5);
    changed.stderr(
        predicate::str::contains("parameter times: locked 1, now 2")
            .and(predicate::str::contains("fine: parameter times locked 1, now 2")),
    );
    locked(&["--set", "limit=0.2"]).code(5).stderr(predicate::str::contains("gate fine: check min-stretch"));
    desk.write("cube.obj", &CUBE.replace("v 0 1 1", "v 0 1 2"));
    locked(&[]).code(5).stderr(predicate::str::contains("raw: the file `file` changed"));
    desk.write("cube.obj", CUBE);
    locked(&[]).success();
    let lock = desk.text("part.lock.ron");
    let other_revision = lock.replacen("\"revision\": \"", "\"revision\": \"9", 1);
    desk.write("other.lock.ron", &other_revision);
    desk.meshmill(&["run", "recipe.toml", "--locked=other.lock.ron"])
        .assert()
        .code(5)
        .stderr(predicate::str::contains("revision locked 9"));
    desk.write("bad.ron", "no lock");
    desk.meshmill(&["run", "recipe.toml", "--locked=bad.ron"]).assert().code(2);
}

#[test]
fn the_class_of_a_lock_decides_which_results_are_equal() {
    let desk = Desk::new();
    for (class, code) in [("bytes", 5), ("metrics", 5), ("tolerance", 0)] {
        let arguments = ["lock", "recipe.toml", "--class", class, "--tolerance", "0.01", "--to", "l.ron"];
        desk.meshmill(&arguments).assert().success();
        let lock = desk.text("l.ron");
        // As if the other machine had found a slightly better mesh.
        let digits = lock.split("\"min-stretch\": Number(").nth(1).unwrap().split(')').next().unwrap().to_owned();
        let nearby = (digits.parse::<f64>().unwrap() * 1.001).to_string();
        desk.write("l.ron", &lock.replace(&digits, &nearby));
        desk.meshmill(&["run", "recipe.toml", "-q", "--locked=l.ron"]).assert().code(code);
    }
    // Nothing is locked where a gate fails.
    desk.meshmill(&["lock", "recipe.toml", "--set", "limit=0.99", "--to", "none.ron"]).assert().code(3);
    assert!(!desk.path("none.ron").exists());
}

#[test]
fn a_key_is_explained_field_by_field() {
    let desk = Desk::new();
    let explain = |set: &str| {
        let arguments = ["plan", "recipe.toml", "--explain", "fine", "--set", set];
        let output = desk.meshmill(&arguments).assert().success().get_output().stdout.clone();
        String::from_utf8(output).unwrap()
    };
    assert!(explain("times=1").contains("not known before clean has run"));
    desk.run(&[]);
    let text = explain("times=3");
    let line = text.lines().find(|line| line.trim_start().starts_with('*')).unwrap();
    assert_eq!(line.split_whitespace().collect::<Vec<_>>(), ["*", "parameter", "times", "1", "3"]);
    let same = text.lines().find(|line| line.contains("revision")).unwrap();
    assert!(!same.starts_with(" *") && !same.starts_with('*'), "{same}");
    desk.meshmill(&["plan", "recipe.toml", "--explain", "fien"]).assert().code(2);
}

#[test]
fn two_runs_are_compared_by_cause_and_metric() {
    let desk = Desk::new();
    desk.run(&["--out", "a"]);
    desk.run(&["--out", "b", "--set", "times=2"]);
    let text = desk.meshmill(&["diff", "a", "b/run.ron"]).assert().success().get_output().stdout.clone();
    let text = String::from_utf8(text).unwrap();
    assert!(text.contains("because parameter times from 1 to 2"), "{text}");
    let faces = text.lines().find(|line| line.contains("faces")).unwrap();
    assert_eq!(faces.split_whitespace().collect::<Vec<_>>(), ["faces", "48", "192", "+300.0%"]);
    desk.meshmill(&["diff", "a", "a"]).assert().success().stdout("nothing differs\n");
    let meshes = desk.meshmill(&["diff", "a/result.stl", "b/result.stl"]).assert().success();
    meshes.stdout(predicate::str::contains("+300.0%").and(predicate::str::contains("distance")));
    desk.meshmill(&["diff", "a", "b/result.stl"]).assert().code(2);
}

#[test]
fn init_writes_a_recipe_that_is_right() {
    let desk = Desk::new();
    fs::create_dir(desk.path("sub")).unwrap();
    desk.meshmill(&["init", "cube.obj", "--out", "sub/first.toml"]).assert().success();
    let text = desk.text("sub/first.toml");
    assert!(text.contains("part = \"../cube.obj\"") && text.contains("closed = true"), "{text}");
    desk.meshmill(&["check", "sub/first.toml"])
        .assert()
        .success()
        .stdout(predicate::str::contains("a sweep of 6 cases, nothing wrong"));
    desk.meshmill(&["init", "cube.obj", "--out", "sub/first.toml"]).assert().code(2);
    desk.meshmill(&["init", "cube.obj", "--out", "sub/first.toml", "--force"]).assert().success();
    fs::write(desk.path("3 odd \"names\".obj"), CUBE).unwrap();
    desk.meshmill(&["init", "3 odd \"names\".obj"]).assert().success();
    desk.meshmill(&["check", "part-3-odd-names.toml"]).assert().success();
}

#[test]
fn init_and_the_shipped_recipe_are_one() {
    let desk = Desk::new();
    desk.meshmill(&["init", "cube.obj"]).assert().success();
    let read = |path: &Path| toml::from_str::<toml::Table>(&fs::read_to_string(path).unwrap()).unwrap();
    let mut made = read(&desk.path("cube.toml"));
    let mut shipped = read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines/fe-surface.toml"));
    assert_eq!(made["name"].as_str(), Some("cube"));
    assert_eq!(made["gates"]["fe"].as_table_mut().unwrap().remove("closed"), Some(toml::Value::Boolean(true)));
    for key in ["name", "description", "inputs"] {
        made.remove(key);
        shipped.remove(key);
    }
    for recipe in [&mut made, &mut shipped] {
        recipe["sweep"].as_table_mut().unwrap().remove("axes");
        let params = recipe["params"].as_table_mut().unwrap();
        assert!(params.remove("size").is_some() && params.remove("tolerance").is_some());
        assert!(params.contains_key("min-gap") && params.contains_key("mean-stretch"));
    }
    assert_eq!(made, shipped);
}

#[test]
fn init_looks_at_the_mesh_as_the_recipe_will() {
    let desk = Desk::new();
    // The top of the cube has vertices of its own, a hair beside those of the sides.
    let loose = CUBE.replace("f 5 6 7\nf 5 7 8\n", "f 9 10 11\nf 9 11 12\n");
    let top = "v 0 0 1.0000001\nv 1 0 1.0000001\nv 1 1 1.0000001\nv 0 1 1.0000001\n";
    let (points, faces) = loose.split_at(loose.find("f ").unwrap());
    desk.write("loose.obj", &format!("{points}{top}{faces}"));
    desk.meshmill(&["init", "loose.obj"]).assert().success();
    let text = desk.text("loose.toml");
    for found in ["# - 12 faces, 12 vertices, 1 body", "# - closed", "\nclosed = true", "4 vertices lie on others"] {
        assert!(text.contains(found), "{found}: {text}");
    }
}

#[test]
fn a_search_finds_the_limit_and_writes_the_best_recipe() {
    let desk = Desk::new();
    let recipe = RECIPE.replace(
        "use = \"subdivide\"\nfrom = \"clean\"\ntimes = \"=times\"",
        "use = \"refine\"\nfrom = \"clean\"\nmax-edge = \"=size\"",
    );
    let recipe = recipe.replace("times = 1\n", "size = \"20%\"\n");
    desk.write("recipe.toml", &recipe);
    let goal = "min faces where max-size <= 0.3";
    let arguments = ["sweep", "recipe.toml", "--goal", goal, "--vary", "size=5%..80%", "--evaluations", "8"];
    let search = desk.meshmill(&arguments).assert().success();
    search.stderr(predicate::str::contains("best of")).stdout(predicate::str::contains("best.toml"));
    let best = desk.text("out/part-goal/best.toml");
    desk.meshmill(&["run", "out/part-goal/best.toml", "--out", "best"]).assert().success();
    let mut rows = csv::Reader::from_path(desk.path("out/part-goal/sweep.csv")).unwrap();
    let rows: Vec<csv::StringRecord> = rows.records().collect::<Result<_, _>>().unwrap();
    assert!(rows.len() <= 8 && !rows.is_empty());
    let faces = |row: &csv::StringRecord| row[2].parse::<u64>().unwrap();
    let passed = rows.iter().filter(|row| row.iter().any(|field| field == "passed"));
    let fewest = passed.min_by_key(|row| faces(row)).unwrap();
    assert!(faces(fewest) < faces(&rows[0]) || faces(fewest) == faces(&rows[0]));
    assert!(best.contains(&format!("size = \"{}\"", &fewest[1])), "{best}");
    for (goal, vary, message) in [
        ("few faces", "size=1%..2%", "begins with `min` or `max`"),
        ("min facs", "size=1%..2%", "`faces`"),
        ("min faces", "sise=1%..2%", "`size`"),
        ("min faces", "size=1..2", "is a percent"),
        ("min faces", "size=2%..1%", "the smaller one first"),
    ] {
        let arguments = ["sweep", "recipe.toml", "--goal", goal, "--vary", vary];
        desk.meshmill(&arguments).assert().code(2).stderr(predicate::str::contains(message));
    }
    let never = [
        "sweep",
        "recipe.toml",
        "--goal",
        "min faces where max-size <= 0.0001",
        "--vary",
        "size=50%..80%",
        "--evaluations",
        "2",
    ];
    desk.meshmill(&never).assert().code(3).stderr(predicate::str::contains("none of 2 evaluations"));
}

#[test]
fn manual_pages_cover_every_command() {
    let desk = Desk::new();
    desk.meshmill(&["man", "--out", "pages"]).assert().success();
    for page in ["meshmill.1", "meshmill-run.1", "meshmill-sweep.1", "meshmill-watch.1"] {
        let text = fs::read_to_string(desk.path("pages").join(page)).unwrap();
        assert!(text.contains(".TH meshmill"), "{page}");
    }
    desk.meshmill(&["man"]).assert().success().stdout(predicate::str::contains(".SH SYNOPSIS"));
}

fn wait_for(what: &dyn Fn() -> bool) -> bool {
    let end = Instant::now() + Duration::from_mins(1);
    while Instant::now() < end {
        if what() {
            return true;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    false
}

#[test]
fn a_watched_recipe_runs_again_when_its_input_changes() {
    let desk = Desk::new();
    let log = fs::File::create(desk.path("log")).unwrap();
    let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin!("meshmill"))
        .current_dir(desk.path(""))
        .env("MESHMILL_CACHE", desk.path("cache"))
        .args(["watch", "recipe.toml"])
        .stdout(Stdio::null())
        .stderr(log)
        .spawn()
        .unwrap();
    let times = || fs::read_to_string(desk.path("log")).unwrap_or_default().matches("watching 2 files").count();
    let size = |path: &Path| fs::metadata(path).map_or(0, |meta| meta.len());
    let result = desk.path("out/part/result.stl");
    let first = wait_for(&|| times() == 1);
    let before = size(&result);
    desk.write("recipe.toml", &RECIPE.replace("times = 1", "times = 2"));
    let second = wait_for(&|| times() == 2);
    let after = size(&result);
    desk.write("cube.obj", &CUBE.replace("v 0 1 1", "v 0 1 3"));
    let third = wait_for(&|| times() == 3);
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(first && second && third, "{}", desk.text("log"));
    assert!(after > 3 * before, "{before} {after}");
}

/// The fenced blocks of a page: language and text.
fn blocks(page: &str) -> Vec<(&str, &str)> {
    let fences: Vec<&str> = page.split("```").collect();
    assert!(fences.len() % 2 == 1, "a fence is open");
    fences.iter().skip(1).step_by(2).filter_map(|block| block.split_once('\n')).collect()
}

#[test]
fn every_command_of_the_walk_through_does_what_it_says() {
    let page = include_str!("../docs/lab.md");
    let desk = Desk::with(&[]);
    let part = fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/meshes/l_bracket.stl")).unwrap();
    fs::create_dir(desk.path("bracket")).unwrap();
    fs::write(desk.path("bracket/bracket.stl"), part).unwrap();
    let program = Path::new(assert_cmd::cargo::cargo_bin!("meshmill")).parent().unwrap().to_owned();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap_or_default());
    let (mut files, mut commands, mut exported) = (0, 0, Vec::new());
    for (language, text) in blocks(page) {
        if language == "toml" {
            let name = text.lines().next().and_then(|line| line.strip_prefix("# ")).unwrap();
            desk.write(name, text);
            files += 1;
            continue;
        }
        assert_eq!(language, "sh");
        for line in text.lines() {
            if line.starts_with("export ") {
                exported.push(line);
                continue;
            }
            let expected = line.split_once("# ends with ").map_or(0, |(_, code)| code.trim().parse().unwrap());
            let script = [exported.clone(), vec![line]].concat().join("\n");
            let mut command = Command::new("sh");
            command.args(["-c", &script]).current_dir(desk.path("")).env("PATH", &path);
            command.env("XDG_CACHE_HOME", desk.path("home")).env("XDG_CONFIG_HOME", desk.path("home"));
            let output = command.env_remove("MESHMILL_CACHE").output().unwrap();
            let said = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(expected), "{line}\n{said}");
            commands += 1;
        }
    }
    assert!(files == 4 && commands > 15, "{files} files, {commands} commands");
    // What the page promises of them.
    assert!(desk.text("tests.xml").contains("<testsuite"));
    let record = desk.text("second/run.ron");
    assert!(record.contains("ran: {}"), "the second run computed something");
    assert_eq!(desk.text("study.csv").lines().count(), 3);
}
