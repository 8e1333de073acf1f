//! Limits of time: what is over them fails, says what to change, and takes nothing else along.

use predicates::prelude::*;
use serde_json::Value;

#[path = "common/desk.rs"]
mod desk;

use desk::Desk;

const RECIPE: &str = r#"
name = "part"
[inputs]
part = "cube.obj"
[params]
time = "1 h"
[limits]
timeout = "2 h"
[limits.steps]
fine = { timeout = "=time" }
[steps.raw]
use = "read"
file = "=inputs.part"
[steps.clean]
use = "repair"
from = "raw"
[steps.fine]
use = "remesh"
from = "clean"
max-size = "20%"
[steps.told]
use = "measure"
from = "clean"
[outputs]
fine = "fine.obj"
clean = "clean.obj"
"#;

const CUBE: &str = include_str!("common/cube.obj");

/// No step is as fast as that.
const NO_TIME: &str = "time=1e-9";

impl Desk {
    fn new() -> Self {
        Self::with(&[("recipe.toml", RECIPE), ("cube.obj", CUBE)])
    }

    fn run(&self, arguments: &[&str]) -> assert_cmd::assert::Assert {
        self.meshmill(&["run", "recipe.toml", "--pictures", "none"]).args(arguments).assert()
    }
}

#[test]
fn a_step_over_its_limit_fails_and_the_others_go_on() {
    let desk = Desk::new();
    let assert = desk.run(&["--set", NO_TIME, "--json"]).code(4);
    let report: Value = serde_json::from_slice(&assert.get_output().stdout).unwrap();
    let steps = report["cases"][0]["steps"].as_array().unwrap().clone();
    let fine = steps.iter().find(|step| step["name"] == "fine").unwrap();
    assert_eq!(fine["failure"]["kind"], "timed-out");
    desk.run(&["--set", NO_TIME]).code(4).stderr(
        predicate::str::contains("fine: took longer than its limit").and(predicate::str::contains("[limits.steps]")),
    );
    assert!(desk.path("out/part/clean.obj").exists() && !desk.path("out/part/fine.obj").exists());
}

#[test]
fn a_limit_is_no_part_of_a_key() {
    let desk = Desk::new();
    // Nothing of a failure by time is remembered.
    desk.run(&["--set", NO_TIME]).code(4);
    desk.run(&[]).success();
    let fine = desk.text("out/part/fine.obj");
    // What is known needs no time.
    desk.run(&["--set", NO_TIME]).success();
    assert_eq!(desk.text("out/part/fine.obj"), fine);
    desk.write(
        "recipe.toml",
        &RECIPE.replace("timeout = \"=time\"", "timeout = false").replace("[params]\ntime = \"1 h\"", ""),
    );
    desk.run(&[]).success();
}

#[test]
fn wrong_limits_are_told_at_their_place() {
    let desk = Desk::new();
    for (from, to, said) in [
        ("fine = { timeout", "fin = { timeout", "the recipe has no step `fin`"),
        ("fine = { timeout", "told = { timeout", "`told` measures, and measuring has no limit"),
        ("\"2 h\"", "\"2 days\"", "`timeout` is a number of seconds"),
        ("\"2 h\"", "0", "`timeout` is a number of seconds"),
        ("\"2 h\"", "-1", "`timeout` is a number of seconds"),
        ("\"2 h\"", "inf", "`timeout` is a number of seconds"),
        ("\"2 h\"", "1e300", "`timeout` is a number of seconds"),
        ("timeout = \"2 h\"", "timeuot = 1", "did you mean `timeout`?"),
        ("{ timeout = \"=time\" }", "{ time = \"=time\" }", "limits have no key `time`"),
        ("{ timeout = \"=time\" }", "\"=time\"", "the limits of a step are a table"),
    ] {
        desk.write("recipe.toml", &RECIPE.replace(from, to));
        desk.run(&[]).code(2).stderr(predicate::str::contains(said));
    }
}
