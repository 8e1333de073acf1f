//! What a run writes keeps the promises of its gates, or says that it does not.

use predicates::prelude::*;

#[path = "common/desk.rs"]
mod desk;

use desk::Desk;

/// A tetrahedron far from the origin, where single precision has steps of an eighth.
const FAR: [f64; 3] = [1e6 + 0.06, 2e6 + 0.06, 0.0];

const RECIPE: &str = r#"
name = "part"
[inputs]
part = "part.obj"
[steps.raw]
use = "read"
file = "=inputs.part"
[gates.raw]
distance = { to = "raw", at-most = 0.01 }
[outputs]
raw = ["result.stl"]
"#;

impl Desk {
    fn new(at: [f64; 3], recipe: &str) -> Self {
        let corners = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]];
        let point = |p: [f64; 3]| format!("v {} {} {}\n", p[0] + at[0], p[1] + at[1], p[2] + at[2]);
        let faces = "g A\nf 1 3 2\nf 1 2 4\ng B\nf 2 3 4\nf 3 1 4\n";
        Self::with(&[("part.obj", &(corners.map(point).concat() + faces)), ("recipe.toml", recipe)])
    }

    fn run(&self, arguments: &[&str]) -> assert_cmd::assert::Assert {
        self.meshmill(&["run", "recipe.toml", "--pictures", "none", "--out", "o"]).args(arguments).assert()
    }

    fn is_text(&self, name: &str) -> bool {
        self.text(name).starts_with("solid")
    }
}

#[test]
fn a_binary_stl_that_would_break_its_gate_is_written_as_text() {
    let desk = Desk::new(FAR, RECIPE);
    let said = predicate::str::contains("written as text; as binary, its gate would not hold: `distance` is 0.0");
    desk.run(&[]).success().stdout(said.clone().count(1));
    assert!(desk.is_text("o/result.stl"));
    // Up to date, it says the same; the key of the file covers the gate.
    desk.run(&["--json"]).success().stdout(predicate::str::contains("its gate would not hold"));
    desk.write("recipe.toml", &RECIPE.replace("0.01", "10"));
    desk.run(&[]).success().stdout(said.not());
    assert!(!desk.is_text("o/result.stl"), "this gate holds in single precision");
    let near = Desk::new([0.0; 3], RECIPE);
    near.run(&[]).success();
    assert!(!near.is_text("o/result.stl"));
}

#[test]
fn where_no_gate_speaks_rounding_that_shows_is_told() {
    let recipe = RECIPE.replace("[gates.raw]\ndistance = { to = \"raw\", at-most = 0.01 }\n", "");
    let told = predicate::str::contains("rounding moves vertices by up to 0.0");
    Desk::new(FAR, &recipe).run(&[]).success().stdout(told.clone());
    Desk::new([0.0; 3], &recipe).run(&[]).success().stdout(told.not());
}

#[test]
fn a_part_that_single_precision_cannot_hold_is_written_as_text() {
    let recipe = RECIPE.replace("[gates.raw]\ndistance = { to = \"raw\", at-most = 0.01 }\n", "");
    let told = predicate::str::contains("written as text; as binary, ").and(predicate::str::contains("in 32 bits"));
    let desk = Desk::new([1e8, 1e8, 0.0], &recipe);
    desk.run(&[]).success().stdout(told);
    assert!(desk.is_text("o/result.stl"));
}

#[test]
fn a_file_that_cannot_keep_its_gate_is_not_written() {
    let recipe = RECIPE.replace("raw = [\"result.stl\"]", "raw = [{ file = \"result.obj\", precision = 4 }]");
    let desk = Desk::new(FAR, &recipe);
    let said = predicate::str::contains("would not hold what its gate promises").and(predicate::str::contains(".vtu"));
    desk.run(&[]).code(4).stderr(said);
    assert!(!desk.path("o/result.obj").exists());
}

#[test]
fn what_a_file_does_not_hold_is_in_the_report_and_a_gate_can_ask_for_it() {
    let desk = Desk::new([0.0; 3], RECIPE);
    desk.run(&[]).success().stdout(predicate::str::contains("without face groups `A`, `B`"));
    let kept = "distance = { to = \"raw\", at-most = 0.01 }\ngroups-kept = { of = \"raw\", files = true }";
    let asked = RECIPE.replace("distance = { to = \"raw\", at-most = 0.01 }", kept);
    desk.write("recipe.toml", &asked);
    // As text, an STL has solids with names.
    desk.run(&[]).success();
    assert!(desk.is_text("o/result.stl"));
    desk.write("recipe.toml", &asked.replace("result.stl", "result.csv"));
    desk.run(&[]).code(4).stderr(predicate::str::contains("`groups-kept` asks for face groups `A`, `B`"));
    desk.write("recipe.toml", &asked.replace("result.stl", "result.inp"));
    desk.run(&[]).success();
    desk.write("recipe.toml", &asked.replace("files = true", "files = 1"));
    desk.run(&[]).code(2).stderr(predicate::str::contains("`files` is true or false"));
    let wrong = asked.replace("0.01 }", "0.01, files = true }");
    desk.write("recipe.toml", &wrong);
    desk.run(&[]).code(2).stderr(predicate::str::contains("`files` is for `groups-kept`"));
}
