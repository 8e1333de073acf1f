//! Nothing that a run reads is lost, nothing outside its folder is touched, and two runs never mix.

use std::fs;

use assert_cmd::Command;
use predicates::prelude::*;

#[path = "common/desk.rs"]
mod desk;

use desk::Desk;

const RECIPE: &str = r#"
name = "part"
[inputs]
part = "cube.obj"
[params]
stretch = 0.1
[steps.raw]
use = "read"
file = "=inputs.part"
[steps.clean]
use = "repair"
from = "raw"
[gates.clean]
min-stretch = { at-least = "=stretch" }
[outputs]
clean = ["result.obj", "deep/result.vtu"]
"#;

const CUBE: &str = include_str!("common/cube.obj");

impl Desk {
    fn new() -> Self {
        Self::with(&[("recipe.toml", RECIPE), ("cube.obj", CUBE)])
    }

    fn run(&self, arguments: &[&str]) -> assert_cmd::assert::Assert {
        self.meshmill(&["run", "recipe.toml", "--pictures", "none"]).args(arguments).assert()
    }
}

/// The run is refused and the input is what it was, whether its gates would hold or not.
fn refused(desk: &Desk, input: &str, out: &str) {
    for stretch in ["stretch=0.1", "stretch=0.99"] {
        desk.run(&["--input", &format!("part={input}"), "--out", out, "--set", stretch])
            .code(2)
            .stderr(predicate::str::contains("which the run reads"));
        assert_eq!(desk.text(input), CUBE, "{input} was changed");
    }
}

#[test]
fn an_output_that_is_the_input_is_refused() {
    let desk = Desk::new();
    desk.write("o/result.obj", CUBE);
    refused(&desk, "o/result.obj", "o");
    refused(&desk, "o/../o/./result.obj", "o");
    refused(&desk, "o/result.obj", "./o");
    desk.write("o/failed/result.obj", CUBE);
    refused(&desk, "o/failed/result.obj", "o");
    assert!(!desk.path("o/run.ron").exists() && !desk.path("o/deep").exists(), "something was written");
}

#[cfg(unix)]
#[test]
fn an_output_that_is_the_input_by_a_link_is_refused() {
    use std::os::unix::fs::symlink;
    let desk = Desk::new();
    fs::create_dir_all(desk.path("hard")).unwrap();
    fs::hard_link(desk.path("cube.obj"), desk.path("hard/result.obj")).unwrap();
    refused(&desk, "cube.obj", "hard");
    fs::create_dir_all(desk.path("soft")).unwrap();
    symlink("../cube.obj", desk.path("soft/result.obj")).unwrap();
    refused(&desk, "cube.obj", "soft");
    symlink("soft", desk.path("folder")).unwrap();
    desk.write("soft/deep/result.vtu", "");
    symlink(desk.path("folder/result.obj"), desk.path("input.obj")).unwrap();
    refused(&desk, "input.obj", "folder");
}

#[test]
fn a_recipe_a_base_or_a_lock_is_no_output() {
    let desk = Desk::new();
    desk.write("o/result.obj", RECIPE);
    desk.write("recipe.toml", "name = \"part\"\nextends = \"o/result.obj\"\n[inputs]\npart = \"cube.obj\"\n");
    desk.run(&["--out", "o"]).code(2).stderr(predicate::str::contains("o/result.obj, which the run reads"));
    assert_eq!(desk.text("o/result.obj"), RECIPE);
    let lock = Desk::new();
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("meshmill"));
    command.current_dir(lock.path("")).env("MESHMILL_CACHE", lock.path("cache"));
    command.args(["lock", "recipe.toml", "--to", "cube.obj"]).assert().code(2);
    assert_eq!(lock.text("cube.obj"), CUBE);
    lock.run(&["--trace", "./recipe.toml"]).code(2);
    assert_eq!(lock.text("recipe.toml"), RECIPE);
}

#[cfg(unix)]
#[test]
fn a_link_in_the_place_of_an_output_is_replaced_and_a_folder_that_is_one_refused() {
    use std::os::unix::fs::symlink;
    let desk = Desk::new();
    desk.write("victim/result.obj", "precious");
    fs::create_dir_all(desk.path("o")).unwrap();
    symlink("../victim/result.obj", desk.path("o/result.obj")).unwrap();
    desk.run(&["--out", "o"]).success();
    assert_eq!(desk.text("victim/result.obj"), "precious");
    assert!(!desk.path("o/result.obj").is_symlink());
    for link in ["failed", "deep"] {
        let desk = Desk::new();
        desk.write("victim/result.obj", "precious");
        fs::create_dir_all(desk.path("o")).unwrap();
        symlink(desk.path("victim"), desk.path("o").join(link)).unwrap();
        desk.run(&["--out", "o"]).code(2).stderr(predicate::str::contains("is a link"));
        assert_eq!(desk.text("victim/result.obj"), "precious");
        assert_eq!(fs::read_dir(desk.path("victim")).unwrap().count(), 1);
    }
}

#[test]
fn an_input_that_an_earlier_run_wrote_is_not_cleaned_away() {
    let desk = Desk::new();
    desk.run(&["--out", "o"]).success();
    let other = RECIPE.replace("\"result.obj\", \"deep/result.vtu\"", "\"new.stl\"");
    desk.write("recipe.toml", &other);
    desk.run(&["--out", "o", "--input", "part=o/result.obj", "--set", "stretch=0.99"]).code(3);
    assert!(desk.path("o/result.obj").exists(), "the input was taken for a stale output");
}

#[cfg(unix)]
#[test]
fn a_folder_that_another_run_writes_into_is_refused() {
    let desk = Desk::new();
    fs::create_dir_all(desk.path("o")).unwrap();
    let other = fs::File::open(desk.path("o")).unwrap();
    other.try_lock().unwrap();
    desk.run(&["--out", "o"]).code(6).stderr(predicate::str::contains("another run writes into o"));
    assert_eq!(fs::read_dir(desk.path("o")).unwrap().count(), 0);
    drop(other);
    desk.run(&["--out", "o"]).success();
}

#[cfg(unix)]
#[test]
fn a_limit_on_the_size_of_files_is_an_error_of_the_disk() {
    let desk = Desk::new();
    let program = assert_cmd::cargo::cargo_bin!("meshmill").display().to_string();
    let script = format!("ulimit -f 1 && exec '{program}' run recipe.toml --out o --pictures none");
    let mut command = Command::new("bash");
    command.current_dir(desk.path("")).env("MESHMILL_CACHE", desk.path("cache")).args(["-c", &script]);
    command.assert().code(6).stderr(predicate::str::contains("File too large"));
    for folder in ["o", "o/deep", "cache/v2/tmp"] {
        let Ok(entries) = fs::read_dir(desk.path(folder)) else { continue };
        let left = entries.filter(|e| e.as_ref().unwrap().file_name().to_string_lossy().starts_with('.')).count();
        assert_eq!(left, 0, "a temporary file stays in {folder}");
    }
}

#[test]
fn an_input_that_was_replaced_is_read_again() {
    let desk = Desk::new();
    desk.run(&["--out", "o"]).success();
    let before = desk.text("o/result.obj");
    desk.write("cube.obj", &CUBE.replace("v 1 1 1", "v 1 1 2"));
    desk.run(&["--out", "o"]).success();
    assert_ne!(desk.text("o/result.obj"), before);
}

#[cfg(unix)]
#[test]
fn what_lies_behind_a_link_or_above_the_folder_is_not_cleaned_away() {
    let desk = Desk::new();
    desk.run(&["--out", "o"]).success();
    desk.write("recipe.toml", &RECIPE.replace(", \"deep/result.vtu\"", ""));
    fs::rename(desk.path("o/deep"), desk.path("mine")).unwrap();
    std::os::unix::fs::symlink("../mine", desk.path("o/deep")).unwrap();
    fs::copy(desk.path("o/result.obj"), desk.path("copy.obj")).unwrap();
    let record = desk.text("o/run.ron").replace("o/result.obj", "o/../copy.obj");
    desk.write("o/run.ron", &record);
    desk.run(&["--out", "o", "--set", "stretch=0.99"]).code(3);
    assert!(desk.path("mine/result.vtu").exists(), "a file was deleted through a link");
    assert!(desk.path("copy.obj").exists(), "a file above the folder was deleted");
}

#[test]
fn a_lock_is_not_replaced_by_what_a_run_writes_nor_a_result_by_a_lock() {
    let desk = Desk::new();
    let lock = |arguments: &[&str]| {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("meshmill"));
        command.current_dir(desk.path("")).env("MESHMILL_CACHE", desk.path("cache"));
        command.args(["lock", "recipe.toml"]).args(arguments).assert()
    };
    lock(&["--out", "o"]).success();
    let text = desk.text("part.lock.ron");
    desk.run(&["--out", "o", "--trace", "part.lock.ron"]).code(2);
    assert_eq!(desk.text("part.lock.ron"), text);
    fs::copy(desk.path("part.lock.ron"), desk.path("o/report.html")).unwrap();
    desk.run(&["--out", "o", "--locked=o/report.html", "--report"]).code(2);
    assert_eq!(desk.text("o/report.html"), text);
    let result = desk.text("o/result.obj");
    lock(&["--out", "o", "--to", "o/result.obj"]).code(2);
    assert_eq!(desk.text("o/result.obj"), result);
}

#[test]
fn a_cache_that_takes_nothing_costs_no_result_and_is_told() {
    let desk = Desk::new();
    desk.run(&["--out", "first"]).success();
    for folder in ["ac", "cas", "tmp"] {
        fs::remove_dir_all(desk.path(&format!("cache/v2/{folder}"))).unwrap();
    }
    fs::create_dir(desk.path("cache/v2/ac")).unwrap();
    fs::create_dir(desk.path("cache/v2/cas")).unwrap();
    // Nothing can be prepared beside where it goes.
    desk.write("cache/v2/tmp", "in the way");
    let told = predicate::str::contains("warning: the cache could not be written").count(1);
    desk.run(&["--out", "o"]).success().stderr(told.clone());
    assert!(desk.text("o/result.obj").starts_with('#') && desk.path("o/deep/result.vtu").exists());
    // Nothing was kept, so nothing is up to date.
    desk.run(&["--out", "o"]).success().stderr(told);
    fs::remove_dir_all(desk.path("cache")).unwrap();
    let before = desk.text("o/result.obj");
    desk.run(&["--out", "o"]).success().stderr(predicate::str::contains("warning").not());
    assert_eq!(desk.text("o/result.obj"), before);
}

#[cfg(target_os = "linux")]
#[test]
fn leftovers_go_wherever_the_run_writes() {
    let desk = Desk::new();
    let host: String = fs::read_to_string("/proc/sys/kernel/hostname").unwrap();
    let host: String = host.chars().filter(char::is_ascii_alphanumeric).collect();
    let places = ["o", "o/deep", "o/failed/deep"].map(|folder| format!("{folder}/.meshmill-{host}-4194305-x.tmp"));
    for place in &places {
        desk.write(place, "left");
    }
    desk.run(&["--out", "o"]).success();
    for place in &places {
        assert!(!desk.path(place).exists(), "{place}");
    }
}

#[cfg(unix)]
#[test]
fn a_pipe_in_the_place_of_an_output_is_replaced() {
    let desk = Desk::new();
    fs::create_dir_all(desk.path("o")).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(desk.path("o/result.obj")).status().unwrap().success());
    desk.run(&["--out", "o"]).success();
    assert!(fs::symlink_metadata(desk.path("o/result.obj")).unwrap().is_file());
}

#[test]
fn an_input_replaced_during_a_run_is_noticed_by_the_next() {
    let desk = Desk::new();
    let slow = "[steps.fine]\nuse = \"subdivide\"\nfrom = \"clean\"\ntimes = 7\n[steps.finer]\nuse = \"features\"\nfrom = \"fine\"\n";
    let recipe = RECIPE.replace("[gates.clean]", &format!("{slow}[gates.clean]"));
    desk.write("recipe.toml", &recipe.replace("[outputs]\n", "[outputs]\nfiner = [\"finer.vtu\"]\n"));
    let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin!("meshmill"))
        .current_dir(desk.path(""))
        .env("MESHMILL_CACHE", desk.path("cache"))
        .args(["run", "recipe.toml", "--pictures", "none", "--out", "o", "-q"])
        .spawn()
        .unwrap();
    // The first result is there, so the part was read.
    let entries = || fs::read_dir(desk.path("cache/v2/ac")).map_or(0, Iterator::count);
    while entries() == 0 && child.try_wait().unwrap().is_none() {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    desk.write("cube.obj", &CUBE.replace("v 1 1 1", "v 1 1 2"));
    assert!(child.wait().unwrap().success());
    desk.run(&["--out", "o", "-q"]).success();
    desk.run(&["--out", "fresh", "-q"]).success();
    assert_eq!(desk.text("o/result.obj"), desk.text("fresh/result.obj"));
}
