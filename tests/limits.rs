//! Limits of time and memory: what is over them fails, says what to change, and takes nothing else along.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use meshmill::plan::{Context, plan};
use meshmill::recipe::{Overrides, Recipe};
use meshmill::run::{self, Event, Observer, RunError, RunOptions, TaskState};
use meshmill::steps::CATALOG;
use meshmill::store::Store;
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
use = "refine"
from = "clean"
max-edge = "20%"
[steps.told]
use = "measure"
from = "clean"
[outputs]
fine = "fine.obj"
clean = "clean.obj"
"#;

/// No step is as fast as that.
const NO_TIME: &str = "time=1e-9";

impl Desk {
    fn new() -> Self {
        Self::with(&[("recipe.toml", RECIPE), ("cube.obj", CUBE)])
    }
}

/// What became of the step `fine`.
fn failure(report: &Value) -> Value {
    let steps = report["cases"][0]["steps"].as_array().unwrap();
    steps.iter().find(|step| step["name"] == "fine").unwrap()["failure"].clone()
}

#[test]
fn a_step_over_its_limit_fails_and_the_others_go_on() {
    let desk = Desk::new();
    assert_eq!(failure(&desk.report(4, &["--set", NO_TIME]))["kind"], "timed-out");
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
        ("timeout = \"2 h\"", "memory = \"much\"", "`memory` is a number of bytes"),
        ("timeout = \"2 h\"", "memory = 0", "`memory` is a number of bytes"),
        ("timeout = \"2 h\"", "memory = true", "`memory` is a number of bytes"),
        ("timeout = \"2 h\"", "retries = 1.5", "`retries` is a whole number from 0 to 100"),
        ("timeout = \"2 h\"", "retries = 101", "`retries` is a whole number from 0 to 100"),
        ("timeout = \"2 h\"", "retries = false", "`retries` is a whole number from 0 to 100"),
        ("{ timeout = \"=time\" }", "{ time = \"=time\" }", "limits have no key `time`"),
        ("{ timeout = \"=time\" }", "\"=time\"", "the limits of a step are a table"),
    ] {
        desk.write("recipe.toml", &RECIPE.replace(from, to));
        desk.run(&[]).code(2).stderr(predicate::str::contains(said));
    }
}

/// The recipe with these limits of the step `fine`.
fn with_limits(limits: &str) -> String {
    RECIPE.replace("{ timeout = \"=time\" }", &format!("{{ {limits} }}")).replace("[params]\ntime = \"1 h\"", "")
}

#[test]
fn a_step_that_takes_too_much_memory_fails_and_the_others_go_on() {
    let desk = Desk::new();
    desk.write("recipe.toml", &with_limits("memory = \"1 kB\""));
    let report = desk.report(4, &[]);
    let told = failure(&report);
    assert_eq!(
        (&told["kind"], &told["message"]),
        (&json!("over-memory"), &json!("took more memory than its limit of 1.0 kB"))
    );
    assert!(told["help"].as_str().unwrap().contains("`memory` in [limits]"));
    // It ran once, or beside another and then again alone; the others are done.
    assert!(desk.path("out/part/clean.obj").exists() && !desk.path("out/part/fine.obj").exists());
    // Nothing of it is remembered, and what is known needs no memory.
    desk.write("recipe.toml", &with_limits("memory = \"1 GB\""));
    desk.run(&[]).success();
    desk.write("recipe.toml", &with_limits("memory = \"1 kB\""));
    desk.run(&[]).success();
}

#[test]
fn the_memory_of_tasks_is_recorded_with_their_time() {
    let desk = Desk::new();
    let first = desk.report(0, &["--jobs", "1"]);
    let fine = &first["timings"]["memory"]["fine"];
    // One at a time, so that it is exact; its result alone is not less than a kilobyte.
    assert_eq!(fine["alone"], true);
    assert!(fine["bytes"].as_u64().unwrap() > 1000, "{fine}");
    // A cached result tells what it once took, as it tells its time.
    assert_eq!(&desk.report(0, &[])["timings"]["memory"]["fine"], fine);
    let schema = jsonschema::draft7::new(&meshmill::report::json::schema()).unwrap();
    assert_eq!(schema.iter_errors(&first).map(|error| error.to_string()).collect::<Vec<_>>(), [""; 0]);
    // What there is room for decides when tasks run, never what they give.
    let result = desk.text("out/part/fine.obj");
    desk.run(&["--jobs", "4", "--memory", "1", "--out", "narrow", "--force", "fine"]).success();
    assert_eq!(desk.text("narrow/fine.obj"), result);
    desk.run(&["--memory", "much"]).code(2).stderr(predicate::str::contains("expected a size"));
}

#[test]
fn what_a_limit_ended_is_tried_again_and_a_steps_own_failure_is_not() {
    let desk = Desk::new();
    desk.write("recipe.toml", &with_limits("timeout = 1e-9, retries = 2"));
    let told = failure(&desk.report(4, &[]));
    assert_eq!(told["message"], "took longer than its limit of 0.000000001 s, 3 times");
    desk.write("recipe.toml", &with_limits("memory = 1, retries = 1"));
    assert_eq!(failure(&desk.report(4, &[]))["message"], "took more memory than its limit of 1 B, 2 times");
    desk.write("recipe.toml", &with_limits("retries = 5").replace("max-edge = \"20%\"", "max-edge = 1e-30"));
    let told = failure(&desk.report(4, &[]));
    assert!(told["kind"] == "failed" && !told["message"].as_str().unwrap().contains("times"), "{told}");
}

/// Takes away what is in the way of `fine.obj`, when the file is to be written for the second time.
struct Mender {
    tries: AtomicUsize,
    obstacle: PathBuf,
}

impl Observer for Mender {
    fn event(&self, event: &Event<'_>) {
        if matches!(event, Event::State { label: "fine.obj", state: TaskState::Running, .. })
            && self.tries.fetch_add(1, Ordering::Relaxed) == 1
        {
            fs::remove_dir_all(&self.obstacle).unwrap();
        }
    }
}

#[test]
fn a_file_that_the_disk_did_not_take_is_written_again() {
    let desk = Desk::new();
    let run = |limits: &str, out: &str| {
        let text = with_limits(limits);
        let loader = |_: &Path| Ok(text.clone());
        let recipe = Recipe::load(&desk.path("recipe.toml"), &loader, &Overrides::default()).unwrap();
        let context = Context { catalog: CATALOG, check_file: &|_| Ok(()), endings: &["obj"], second_order: &[] };
        let plan = plan(&recipe, &context).unwrap();
        let obstacle = desk.path(out).join("fine.obj");
        fs::create_dir_all(obstacle.join("full")).unwrap();
        let mender: Arc<dyn Observer> = Arc::new(Mender { tries: AtomicUsize::new(0), obstacle });
        let store = Store::open(&desk.path("cache")).unwrap();
        run::run(&plan, &store, &RunOptions::new("part", desk.path(out), 2), &mender)
    };
    assert!(matches!(run("retries = 0", "first"), Err(RunError::Output { .. })));
    run("retries = 1", "second").unwrap();
    assert!(desk.text("second/fine.obj").contains("\nf "));
}

#[test]
fn many_over_their_memory_at_once_all_fail_and_none_waits_for_ever() {
    let desk = Desk::new();
    let mut text = with_limits("memory = \"1 kB\"").replace("[outputs]", "");
    for (number, edge) in ["25%", "20%", "15%", "12%", "10%", "8%"].into_iter().enumerate() {
        let step = format!("[steps.more-{number}]\nuse = \"refine\"\nfrom = \"clean\"\nmax-edge = \"{edge}\"\n");
        text = text.replace("[limits.steps]\n", &format!("[limits.steps]\nmore-{number} = {{ memory = 1 }}\n"));
        text = text.replace("[steps.told]", &format!("{step}[steps.told]"));
    }
    let (head, _) = text.split_once("fine = \"fine.obj\"").unwrap();
    let names: Vec<String> = (0..6).map(|number| format!("more-{number}")).collect();
    let outputs: Vec<String> = names.iter().map(|name| format!("{name} = \"{name}.obj\"\n")).collect();
    desk.write("recipe.toml", &format!("{head}[outputs]\nclean = \"clean.obj\"\n{}", outputs.concat()));
    let report = desk.report(4, &["--jobs", "6"]);
    let steps = report["cases"][0]["steps"].as_array().unwrap();
    let kinds: Vec<_> =
        steps.iter().filter(|step| !step["failure"].is_null()).map(|step| &step["failure"]["kind"]).collect();
    // `fine` and one of the others are the same task.
    assert_eq!(kinds, vec![&json!("over-memory"); 7], "{report}");
    assert!(desk.path("out/part/clean.obj").exists());
}

#[test]
fn the_example_of_the_documentation_is_right() {
    let page = include_str!("../docs/limits.md");
    let example = page.split("```toml\n").nth(1).unwrap().split("```").next().unwrap().replace("fe = {", "fine = {");
    let (head, rest) = RECIPE.split_once("[limits]").unwrap();
    let (_, steps) = rest.split_once("[steps.raw]").unwrap();
    let desk = Desk::new();
    desk.write("recipe.toml", &format!("{head}{example}[steps.raw]{steps}").replace("[params]\ntime = \"1 h\"\n", ""));
    desk.run(&[]).success();
}
