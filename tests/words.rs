//! What the command says to somebody who got something a little wrong, and where: each trap that was met on real parts.

use std::fs;

use predicates::prelude::*;
use predicates::str::contains;

#[path = "common/desk.rs"]
mod desk;

use desk::Desk;

/// A box of two groups, `bottom` and the rest.
const PART: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
    g bottom\nf 1 3 2\nf 1 4 3\ng rest\nf 5 6 7\nf 5 7 8\nf 1 2 6\nf 1 6 5\nf 2 3 7\nf 2 7 6\nf 3 4 8\nf 3 8 7\nf 4 1 5\n\
    f 4 5 8\n";

const RECIPE: &str = r#"
name = "part"
[inputs]
part = "part.obj"
[params]
size = "20%"
[steps.raw]
use = "read"
file = "=inputs.part"
[steps.clean]
use = "repair"
from = "raw"
[steps.fine]
use = "refine"
from = "clean"
max-edge = "=size"
[steps.fe]
use = "control-properties"
from = "fine"
max-size = { default = "=2*size", groups = { bottom = "10%" } }
keep = ["rest"]
[outputs]
fe = ["result.vtu"]
"#;

impl Desk {
    fn new() -> Self {
        Self::with(&[("part.obj", PART), ("recipe.toml", RECIPE)])
    }

    /// What a command that ends with this code says to stderr.
    fn told(&self, arguments: &[&str], code: i32) -> String {
        let told = self.meshmill(arguments).assert().code(code);
        String::from_utf8(told.get_output().stderr.clone()).unwrap()
    }
}

#[test]
fn a_mesh_in_the_place_of_a_recipe_is_offered_one() {
    let desk = Desk::new();
    for command in ["run", "check", "sweep"] {
        let told = desk.told(&[command, "part.obj"], 2);
        assert!(told.contains("meshmill init part.obj"), "{told}");
        assert!(told.contains("meshmill run pipelines/fe-surface.toml --input part=part.obj"), "{told}");
    }
    fs::write(desk.path("recipe.toml"), [0xff, 0xfe, 0x00]).unwrap();
    let told = desk.told(&["run", "recipe.toml"], 2);
    assert!(told.contains("a recipe is a TOML file"), "{told}");
}

#[test]
fn no_message_has_the_number_of_a_system_error() {
    let desk = Desk::new();
    for arguments in [
        &["run", "missing.toml"][..],
        &["measure", "missing.stl"],
        &["convert", "missing.stl", "a.obj"],
        &["diff", "a.stl", "b.stl"],
        &["lock", "missing.toml"],
        &["report", "missing.toml"],
        &["run", "recipe.toml", "--out", "part.obj/below"],
        &["run", "recipe.toml", "--cache", "part.obj"],
        &["init", "missing.stl"],
    ] {
        let output = desk.meshmill(arguments).output().unwrap();
        let told = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success() && !told.is_empty(), "{arguments:?}");
        assert!(!told.contains("os error"), "{arguments:?}: {told}");
    }
}

#[test]
fn the_steps_are_told_in_80_columns_with_their_tables() {
    let desk = Desk::new();
    let said = |arguments: &[&str]| {
        String::from_utf8(desk.meshmill(arguments).assert().success().get_output().stdout.clone()).unwrap()
    };
    let list = said(&["steps"]);
    for name in list.lines().filter(|line| !line.starts_with(' ')).filter_map(|line| line.split_once(':')) {
        let one = said(&["steps", name.0]);
        let prose = one.split("\nexample\n").next().unwrap_or_default();
        let long = |line: &&str| line.chars().count() > 80 && !line.contains(" = {") && !line.contains(" = [");
        assert_eq!(prose.lines().find(long), None, "{}", name.0);
    }
    assert_eq!(list.lines().find(|line| line.chars().count() > 80), None);
    let select = said(&["steps", "select"]);
    for part in ["cylinder = { start = [0, 0, 0], end = [0, 0, 20], radius = 4 }", "start: list of number", "box = {"] {
        assert!(select.contains(part), "{part}: {select}");
    }
}

#[test]
fn a_size_that_makes_too_many_elements_is_refused_with_what_was_meant() {
    let desk = Desk::new();
    let told = desk.told(&["run", "recipe.toml", "--set", "size=0.0002"], 4);
    assert!(told.contains("fine: the result would have at least"), "{told}");
    assert!(told.contains("did you mean \"0.02%\"?"), "{told}");
    let told = desk.told(&["run", "recipe.toml", "--set", "size=3mm"], 2);
    assert!(told.contains("--set:1:6") && told.contains("size=3mm"), "{told}");
}

#[test]
fn groups_that_later_steps_need_are_looked_for_first() {
    let desk = Desk::new();
    for (written, key) in [("bottom = \"10%\"", "max-size.groups"), ("\"rest\"", "keep")] {
        let wrong = if key == "keep" { "\"rset\"" } else { "botom = \"10%\"" };
        desk.write("wrong.toml", &RECIPE.replace(written, wrong));
        let told = desk.told(&["run", "wrong.toml"], 4);
        assert!(told.contains("clean: `fe` names the group"), "{told}");
        assert!(told.contains(&format!("in `{key}`")) && told.contains("did you mean"), "{told}");
    }
    let selected = "\n[steps.mine]\nuse = \"select\"\nfrom = \"clean\"\nname = \"mine\"\nplane = { point = [0, 0, 1], \
        normal = [0, 0, 1] }\n";
    let made = RECIPE.replace("[\"rest\"]", "[\"mine\"]").replace("from = \"clean\"", "from = \"mine\"") + selected;
    desk.write("made.toml", &made);
    desk.meshmill(&["run", "made.toml"]).assert().success();
}

#[test]
fn an_unknown_group_is_named_where_it_is_used_first() {
    let desk = Desk::new();
    let recipe = "[inputs]\npart = \"part.obj\"\n[steps.raw]\nuse = \"read\"\nfile = \"=inputs.part\"\n[steps.clean]\n\
        use = \"repair\"\nfrom = \"raw\"\n[steps.better]\nuse = \"improve-quality\"\nfrom = \"clean\"\nkeep = [\"rset\"]\n\
        max-edge = \"20%\"\n";
    desk.write("recipe.toml", recipe);
    let told = desk.told(&["run", "recipe.toml"], 4);
    assert!(told.contains("the group `rset`") && !told.contains("larger `max-edge`"), "{told}");
}

#[test]
fn off_a_terminal_a_run_prints_one_line_a_task() {
    let desk = Desk::new();
    let sweep = &["sweep", "recipe.toml", "-s", "size=20%,30%"];
    let told = desk.told(sweep, 0);
    let mut lines: Vec<&str> = told.lines().filter_map(|line| line.split_once(": ")).map(|line| line.0).collect();
    let all = lines.len();
    lines.sort_unstable();
    lines.dedup();
    assert_eq!(lines.len(), all, "{told}");
}

#[test]
fn limits_have_no_idle_digits() {
    let desk = Desk::new();
    let gate = "[gates.fe]\nmax-size = { at-most = \"33%\" }\ndistance = { to = \"clean\", at-most = \"0.7%\" }\n";
    desk.write("recipe.toml", &(RECIPE.to_owned() + gate));
    let said = desk.meshmill(&["run", "recipe.toml"]).assert().success().stdout(contains("at most 33% = 0.571577"));
    said.stdout(contains("FAILED").not());
}

#[test]
fn what_failed_is_red_where_colours_are_shown() {
    let desk = Desk::new();
    desk.write("recipe.toml", &(RECIPE.to_owned() + "[gates.fe]\nfaces = { at-most = 1 }\n"));
    let plain = desk.meshmill(&["run", "recipe.toml"]).assert().code(3);
    plain.stdout(contains("FAILED").and(contains("\u{1b}[").not()));
    let coloured = desk.meshmill(&["run", "recipe.toml"]).env("CLICOLOR_FORCE", "1").assert().code(3);
    coloured.stdout(contains("\u{1b}[1m\u{1b}[31mFAILED\u{1b}[0m"));
}

/// A run whose gate fails: what it says to try.
fn advice(desk: &Desk, recipe: &str) -> String {
    desk.write("recipe.toml", recipe);
    let told = desk.told(&["run", "recipe.toml", "--report"], 3);
    let json = desk.meshmill(&["run", "recipe.toml", "--json"]).assert().code(3).get_output().stdout.clone();
    let json = String::from_utf8(json).unwrap();
    let page = desk.text("out/part/report.html");
    let tried: Vec<&str> = told.lines().filter_map(|line| line.trim().strip_prefix("try: ")).collect();
    for line in &tried {
        let parts: Vec<&str> = line.split(": ").collect();
        assert!(page.contains("Try: ") && json.contains(parts[1]), "{line}");
    }
    tried.join("\n")
}

#[test]
fn a_failed_gate_says_what_to_turn() {
    let desk = Desk::new();
    let gate = |checks: &str| format!("{RECIPE}[gates.fe]\n{checks}\n");
    let tried = advice(&desk, &gate("max-size = { at-most = \"1%\" }\nmax-valence = { at-most = 4 }"));
    assert!(tried.contains("fe: max-size: lower `max-size` of `fe`"), "{tried}");
    assert!(tried.contains("fe: max-valence: lower `max-valence` of `fe`, now 12"), "{tried}");
    let tried = advice(&desk, &gate("min-stretch = { at-least = 0.9999 }\nfaces = { at-most = 2 }"));
    assert!(tried.contains("fe: min-stretch: raise `min-stretch` of `fe`, now 0.2"), "{tried}");
    assert!(tried.contains("or lower the limit to 0."), "{tried}");
    let open = PART.replace("f 5 6 7\n", "");
    desk.write("part.obj", &open);
    let tried = advice(&desk, &gate("closed = true"));
    assert!(tried.contains("fe: closed: write fill-holes = \"all\" in `clean`"), "{tried}");
}

#[test]
fn a_region_that_stays_coarser_than_asked_for_is_told() {
    let desk = Desk::new();
    let recipe = RECIPE.replace("[outputs]\nfe = [\"result.vtu\"]", "")
        + "[steps.near]\nuse = \"adapt-region\"\n\
        from = \"fe.hierarchy\"\nsize = \"0.1%\"\nspheres = [{ centre = [0, 0, 0], radius = 0.5 }]\n[outputs]\n\
        near = \"near.vtu\"\n";
    desk.write("recipe.toml", &recipe);
    for _ in 0..2 {
        let told = desk.told(&["run", "recipe.toml"], 0);
        assert!(told.contains("warning: near: at ") && told.contains("longer than asked for"), "{told}");
    }
}
