//! Failures that are remembered: told again at once, tried again when asked, and never in the way of another input.

use predicates::prelude::*;
use serde_json::{Value, json};

#[path = "common/desk.rs"]
mod desk;
#[path = "common/runs.rs"]
mod runs;

use desk::Desk;
use runs::CUBE;

const RECIPE: &str = r#"
name = "part"
[inputs]
part = "part.obj"
[steps.raw]
use = "read"
file = "=inputs.part"
[steps.clean]
use = "repair"
from = "raw"
[outputs]
clean = "clean.obj"
"#;

const WRONG: &str = "v 0 0 0\nv 1 0 zero\n";

impl Desk {
    fn new() -> Self {
        Self::with(&[("recipe.toml", RECIPE), ("part.obj", WRONG)])
    }
}

#[test]
fn a_failure_is_told_again_without_work_and_tried_again_when_asked() {
    let desk = Desk::new();
    let first = desk.report(2, &[]);
    assert_eq!(first["timings"]["ran"], json!({ "read": 1 }));
    let second = desk.report(2, &[]);
    assert_eq!(second["timings"]["ran"], json!({}));
    let failure = |report: &Value| report["cases"][0]["steps"][0]["failure"].clone();
    assert_eq!(failure(&first)["message"], failure(&second)["message"]);
    assert_eq!((second["status"].clone(), failure(&second)["kind"].clone()), (json!("bad-input"), json!("bad-input")));
    assert!(failure(&second)["help"].as_str().unwrap().contains("--retry-failed"));
    assert!(!failure(&first).to_string().contains("--retry-failed"));
    assert_eq!(desk.report(2, &["--retry-failed"])["timings"]["ran"], json!({ "read": 1 }));
    assert_eq!(desk.report(2, &["--force", "raw"])["timings"]["ran"], json!({ "read": 1 }));
    assert_eq!(desk.report(2, &[])["timings"]["ran"], json!({}));
}

#[test]
fn a_plan_shows_it_and_another_input_knows_nothing_of_it() {
    let desk = Desk::new();
    desk.run(&[]).code(2);
    let plan = |arguments: &[&str]| desk.meshmill(&["plan", "recipe.toml"]).args(arguments).assert().success();
    plan(&[]).stdout(predicate::str::contains("failed before: ").and(predicate::str::contains("1 of 2 tasks to run")));
    plan(&["--json"])
        .stdout(predicate::str::contains("\"state\":\"failed\"").or(predicate::str::contains("\"state\": \"failed\"")));
    plan(&["--retry-failed"]).stdout(predicate::str::contains("failed before").not());
    desk.write("part.obj", CUBE);
    assert_eq!(desk.report(0, &[])["timings"]["ran"], json!({ "read": 1, "repair": 1 }));
    desk.write("part.obj", WRONG);
    assert_eq!(desk.report(2, &[])["timings"]["ran"], json!({}));
}

#[test]
fn a_time_out_is_not_remembered() {
    let desk = Desk::new();
    desk.write("part.obj", CUBE);
    let short = format!("{RECIPE}[limits]\ntimeout = 1e-9\n");
    desk.write("recipe.toml", &short);
    assert_eq!(desk.report(4, &[])["timings"]["ran"], json!({ "read": 1 }));
    assert_eq!(desk.report(4, &[])["timings"]["ran"], json!({ "read": 1 }));
    desk.write("recipe.toml", RECIPE);
    desk.run(&[]).success();
    assert!(desk.text("out/part/clean.obj").contains("\nf "));
}
