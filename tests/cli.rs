//! The command as people use it: output, files and exit codes, in a folder of its own.

use std::fs;
use std::path::Path;

use predicates::prelude::*;

#[path = "common/desk.rs"]
mod desk;

use desk::Desk;

const RECIPE: &str = r#"
name = "part"
[inputs]
part = "cube.obj"
[params]
limit = 0.1
[steps.raw]
use = "read"
file = "=inputs.part"
[steps.clean]
use = "repair"
from = "raw"
[gates.clean]
closed = true
min-stretch = { at-least = "=limit" }
[outputs]
clean = ["result.stl", "result.vtu"]
"#;

const CUBE: &str = include_str!("common/cube.obj");

impl Desk {
    fn new() -> Self {
        Self::with(&[("recipe.toml", RECIPE), ("cube.obj", CUBE)])
    }
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn a_run_writes_its_files_and_a_second_one_finds_them_right() {
    let desk = Desk::new();
    let first = desk.meshmill(&["run", "recipe.toml"]).assert().success();
    first.stdout(predicate::str::contains("written").and(predicate::str::contains("passed")));
    assert_eq!(names(&desk.path("out/part")), ["result.png", "result.stl", "result.vtu", "run.ron"]);
    let before = fs::metadata(desk.path("out/part/result.stl")).unwrap().modified().unwrap();
    let second = desk.meshmill(&["run", "recipe.toml"]).assert().success();
    second.stdout(predicate::str::contains("up to date").and(predicate::str::contains("done").not()));
    assert_eq!(fs::metadata(desk.path("out/part/result.stl")).unwrap().modified().unwrap(), before);
}

#[test]
fn a_failed_gate_exits_with_3_and_shows_the_elements() {
    let desk = Desk::new();
    desk.meshmill(&["run", "recipe.toml"]).assert().success();
    let failed = desk.meshmill(&["run", "recipe.toml", "--set", "limit=0.99"]).assert().code(3);
    failed.stdout(predicate::str::contains("FAILED, 12 elements"));
    assert_eq!(names(&desk.path("out/part")), ["failed", "run.ron"]);
    assert_eq!(names(&desk.path("out/part/failed")), ["failed.vtu", "result.png", "result.stl", "result.vtu"]);
    desk.meshmill(&["run", "recipe.toml"]).assert().success();
    assert_eq!(names(&desk.path("out/part")), ["result.png", "result.stl", "result.vtu", "run.ron"]);
}

#[test]
fn a_wrong_recipe_or_argument_exits_with_2_and_runs_nothing() {
    let desk = Desk::new();
    let unknown = RECIPE.replace("use = \"repair\"", "use = \"repiar\"");
    desk.write("wrong.toml", &unknown);
    let wrong = desk.meshmill(&["run", "wrong.toml"]).assert().code(2);
    wrong.stderr(predicate::str::contains("wrong.toml:").and(predicate::str::contains("`repair`")));
    desk.meshmill(&["run", "missing.toml"]).assert().code(2);
    desk.meshmill(&["run", "recipe.toml", "--only", "claen"])
        .assert()
        .code(2)
        .stderr(predicate::str::contains("clean"));
    desk.meshmill(&["run", "recipe.toml", "--jobs", "0"]).assert().code(2);
    desk.meshmill(&["no-such-command"]).assert().code(2);
    assert!(!desk.path("out").exists());
}

#[test]
fn a_damaged_input_exits_with_2() {
    let desk = Desk::new();
    desk.write("cube.obj", "v 0 0 0\nf 1 2 3\n");
    desk.meshmill(&["run", "recipe.toml"]).assert().code(2).stderr(predicate::str::contains("raw"));
}

#[test]
fn what_a_failed_run_did_not_write_is_not_left_from_the_last_one() {
    let desk = Desk::new();
    desk.meshmill(&["run", "recipe.toml", "--out", "o"]).assert().success();
    desk.write("o/mine.txt", "mine");
    desk.write("o/result.stl", "changed by hand");
    desk.write("cut.obj", "v 0 0\n");
    desk.meshmill(&["run", "recipe.toml", "--out", "o", "--input", "part=cut.obj"]).assert().code(2);
    assert_eq!(names(&desk.path("o")), ["mine.txt", "result.stl", "run.ron"], "what somebody made stays");
}

#[cfg(unix)]
#[test]
fn an_output_goes_through_a_link_and_into_a_device() {
    let desk = Desk::new();
    fs::create_dir(desk.path("kept")).unwrap();
    desk.write("kept/real.off", "");
    std::os::unix::fs::symlink("kept/real.off", desk.path("link.off")).unwrap();
    desk.meshmill(&["convert", "cube.obj", "link.off"]).assert().success();
    assert!(fs::symlink_metadata(desk.path("link.off")).unwrap().is_symlink());
    assert!(fs::read(desk.path("kept/real.off")).unwrap().starts_with(b"OFF"));
}

#[test]
fn a_part_that_collapses_in_32_bits_is_not_written() {
    let desk = Desk::new();
    let far = CUBE.replace("v 0", "v 1e9").replace("v 1 ", "v 1000000001 ");
    desk.write("far.obj", &far);
    let refused = predicate::str::contains("same point in 32 bits").and(predicate::str::contains("origin"));
    desk.meshmill(&["convert", "far.obj", "far.stl"]).assert().code(4).stderr(refused);
    desk.meshmill(&["convert", "far.obj", "far.stl", "--text"]).assert().success();
}

#[test]
fn convert_tells_what_a_format_cannot_hold() {
    let desk = Desk::new();
    desk.write("named.obj", &(CUBE.replacen("f ", "g lid\nf ", 1) + "g rim\nl 1 2\n"));
    let kept = predicate::str::contains("not kept").not();
    desk.meshmill(&["convert", "named.obj", "named.vtu"]).assert().success().stderr(kept);
    let lost = predicate::str::contains("face groups `lid`").and(predicate::str::contains("edge groups `rim`"));
    let lost = lost.and(predicate::str::contains("try: --text"));
    desk.meshmill(&["convert", "named.obj", "named.stl"]).assert().success().stderr(lost);
    let points = predicate::str::contains("not kept in CSV: 12 of 12 faces");
    desk.meshmill(&["convert", "named.obj", "named.csv"]).assert().success().stderr(points);
}

#[test]
fn a_parameter_that_a_sweep_varies_cannot_be_set() {
    let desk = Desk::new();
    let arguments = ["sweep", "recipe.toml", "-s", "limit=0.1,0.2", "--set", "limit=0.3"];
    desk.meshmill(&arguments).assert().code(2).stderr(predicate::str::contains("-s limit=0.3"));
}

#[test]
fn a_cache_that_cannot_be_used_exits_with_6() {
    let desk = Desk::new();
    desk.meshmill(&["run", "recipe.toml", "--cache", "cube.obj"]).assert().code(6);
}

#[test]
fn json_is_one_document_on_stdout() {
    let desk = Desk::new();
    let output = desk.meshmill(&["run", "recipe.toml", "--json", "-q"]).assert().success().get_output().stdout.clone();
    let report: serde_json::Value = serde_json::from_slice(&output).unwrap();
    assert_eq!(report["status"], "done");
    assert_eq!(report["cases"][0]["steps"][1]["figures"]["faces"], 12);
    assert_eq!(report["cases"][0]["gates"][0]["passed"], true);
}

#[test]
fn what_is_printed_as_json_has_one_shape_and_its_schema() {
    let desk = Desk::new();
    desk.write("other.obj", &CUBE.replace("v 1 1 1", "v 1 1 2"));
    let text = desk.text("recipe.toml");
    desk.write("measured.toml", &(text + "\n[steps.numbers]\nuse = \"measure\"\nfrom = \"clean\"\n"));
    desk.meshmill(&["run", "recipe.toml", "--out", "a", "-q"]).assert().success();
    desk.meshmill(&["run", "recipe.toml", "--out", "b", "-q", "--input", "part=other.obj"]).output().unwrap();
    let schema: serde_json::Value =
        serde_json::from_slice(&desk.meshmill(&["schema", "output"]).assert().success().get_output().stdout).unwrap();
    let schema = jsonschema::draft7::new(&schema).unwrap();
    let commands: [(&[&str], &str, &str); 6] = [
        (&["run", "measured.toml", "--json", "-q"], "run", "/cases/0/steps/2/figures/metrics/values/faces"),
        (&["run", "recipe.toml", "--json", "-q", "--set", "limit=2"], "run", "/cases/0/gates/0/rows/1/measured"),
        (&["measure", "cube.obj", "--json"], "measure", "/metrics/volume"),
        (&["diff", "cube.obj", "other.obj", "--json"], "mesh-diff", "/metrics/0/after"),
        (&["diff", "a", "b", "--json"], "diff", "/steps/0/metrics/0/after"),
        (&["sweep", "recipe.toml", "-s", "limit=0.1,2", "--json", "-q"], "sweep", "/rows/1/values/0"),
    ];
    for (arguments, kind, number) in commands {
        let output = desk.meshmill(arguments).output().unwrap().stdout;
        let document: serde_json::Value = serde_json::from_slice(&output).unwrap();
        assert_eq!(document["kind"], kind);
        let wrong: Vec<String> = schema.iter_errors(&document).map(|e| format!("{}: {e}", e.instance_path())).collect();
        assert_eq!(wrong, [""; 0], "{arguments:?}");
        let value = document.pointer(number);
        assert!(value.is_some_and(serde_json::Value::is_number), "{arguments:?}: {number} is {value:?} in {document}");
        assert!(document["units"].as_object().is_some_and(|units| kind == "diff" || units.len() < 60), "{arguments:?}");
    }
}

#[test]
fn names_from_files_do_not_steer_the_terminal() {
    let desk = Desk::new();
    let named = CUBE.replacen("f ", "g \u{1b}[31mlid\u{202e}\nf ", 1);
    desk.write("named.obj", &named);
    let text = desk.text("recipe.toml").replace("cube.obj", "named.obj");
    desk.write("named.toml", &text.replace("result.vtu", "result.csv"));
    let commands: [&[&str]; 4] = [
        &["convert", "named.obj", "named.csv"],
        &["measure", "named.obj"],
        &["run", "named.toml", "--report", "--out", "o"],
        &["run", "recipe.toml", "--set", "\u{1b}[31m=\u{202e}"],
    ];
    for arguments in commands {
        let output = desk.meshmill(arguments).output().unwrap();
        let said = [output.stdout, output.stderr].concat();
        let said = String::from_utf8(said).unwrap();
        assert!(!said.contains("\u{1b}[31mlid") && !said.contains('\u{202e}'), "{arguments:?}: {said}");
    }
    let page = desk.text("o/report.html");
    assert!(page.contains("face groups") && !page.contains('\u{202e}'), "a name turns the page's direction of writing");
}

#[test]
fn plan_tells_why_a_task_has_to_run() {
    let desk = Desk::new();
    let new = desk.meshmill(&["plan", "recipe.toml"]).assert().success();
    new.stdout(predicate::str::contains("runs: new").and(predicate::str::contains("depends on raw")));
    desk.meshmill(&["run", "recipe.toml", "-q"]).assert().success();
    desk.meshmill(&["plan", "recipe.toml"]).assert().success().stdout(predicate::str::contains("0 of 3 tasks to run"));
    let changed = desk.meshmill(&["plan", "recipe.toml", "--set", "limit=0.2"]).assert().success();
    changed.stdout(predicate::str::contains("from 0.1 to 0.2").and(predicate::str::contains("1 of 3 tasks to run")));
}

#[test]
fn a_file_where_the_outputs_are_to_go_is_told_before_anything_runs() {
    let desk = Desk::new();
    let refused = desk.meshmill(&["run", "recipe.toml", "--out", "cube.obj"]).assert().failure();
    refused.stderr(predicate::str::contains("this is a file").and(predicate::str::contains("name a folder")));
    let below = desk.meshmill(&["run", "recipe.toml", "--out", "cube.obj/deep/er"]).assert().code(2);
    below.stderr(predicate::str::contains("cube.obj is a file"));
}

#[test]
fn the_smaller_commands_answer() {
    let desk = Desk::new();
    desk.meshmill(&["check", "recipe.toml"]).assert().success();
    for format in ["dot", "mermaid"] {
        let graph = desk.meshmill(&["graph", "recipe.toml", "--format", format]).assert().success();
        graph.stdout(predicate::str::contains("clean"));
    }
    desk.meshmill(&["measure", "cube.obj"]).assert().success().stdout(predicate::str::contains("volume"));
    let json = desk.meshmill(&["measure", "cube.obj", "--json"]).assert().success().get_output().stdout.clone();
    let json: serde_json::Value = serde_json::from_slice(&json).unwrap();
    assert_eq!((&json["metrics"]["faces"], &json["metrics"]["closed"]), (&12.into(), &true.into()));
    assert_eq!((&json["metrics"]["area"], &json["units"]["area"]), (&6.0.into(), &"area".into()));
    desk.meshmill(&["convert", "cube.obj", "cube.ply"]).assert().success();
    let measured = desk.meshmill(&["measure", "cube.ply", "--reference", "cube.obj"]).assert().success();
    measured.stdout(predicate::str::contains("distance"));
    desk.meshmill(&["convert", "cube.obj", "cube.nonsense"]).assert().code(2);
    desk.meshmill(&["steps"]).assert().success().stdout(predicate::str::contains("repair"));
    desk.meshmill(&["steps", "repair"]).assert().success().stdout(predicate::str::contains("fill-holes"));
    desk.meshmill(&["steps", "repiar"]).assert().code(2).stderr(predicate::str::contains("`repair`"));
    desk.meshmill(&["completions", "bash"]).assert().success().stdout(predicate::str::contains("meshmill"));
}

#[test]
fn the_cache_can_be_looked_after() {
    let desk = Desk::new();
    desk.meshmill(&["run", "recipe.toml", "-q"]).assert().success();
    desk.meshmill(&["cache", "stat"]).assert().success().stdout(predicate::str::contains("artifacts  2"));
    desk.meshmill(&["cache", "verify"]).assert().success();
    let gc = desk.meshmill(&["cache", "gc", "--max-size", "0", "--dry-run"]).assert().success();
    gc.stdout(predicate::str::contains("would remove"));
    desk.meshmill(&["cache", "clear"]).assert().success();
    desk.meshmill(&["cache", "stat"]).assert().success().stdout(predicate::str::contains("artifacts  0"));
}

#[test]
fn a_trace_is_a_timeline_in_json() {
    let desk = Desk::new();
    desk.meshmill(&["run", "recipe.toml", "-q", "--trace", "trace.json"]).assert().success();
    let trace: serde_json::Value = serde_json::from_slice(&fs::read(desk.path("trace.json")).unwrap()).unwrap();
    let names: Vec<_> = trace["traceEvents"].as_array().unwrap().iter().map(|event| event["name"].clone()).collect();
    assert!(names.contains(&"clean".into()), "{names:?}");
}

#[test]
fn a_picture_stands_beside_the_outputs_and_follows_their_gate() {
    let desk = Desk::new();
    desk.meshmill(&["run", "recipe.toml"]).assert().success();
    let picture = desk.path("out/part/result.png");
    let before = (fs::read(&picture).unwrap(), fs::metadata(&picture).unwrap().modified().unwrap());
    assert!(before.0.starts_with(b"\x89PNG"));
    desk.meshmill(&["run", "recipe.toml"]).assert().success();
    assert_eq!(fs::metadata(&picture).unwrap().modified().unwrap(), before.1);
    desk.meshmill(&["run", "recipe.toml", "--set", "limit=0.99"]).assert().code(3);
    assert!(!picture.exists() && desk.path("out/part/failed/result.png").exists());
    desk.meshmill(&["run", "recipe.toml"]).assert().success();
    assert_eq!(names(&desk.path("out/part")), ["result.png", "result.stl", "result.vtu", "run.ron"]);
    assert_eq!(fs::read(&picture).unwrap(), before.0);
}

#[test]
fn the_report_is_one_file_that_repeats_and_needs_no_network() {
    let desk = Desk::new();
    desk.meshmill(&["report", "recipe.toml"]).assert().code(2).stderr(predicate::str::contains("run the recipe first"));
    desk.meshmill(&["run", "recipe.toml", "--report"]).assert().success();
    let page = desk.text("out/part/report.html");
    desk.meshmill(&["report", "recipe.toml"]).assert().success();
    assert_eq!(desk.text("out/part/report.html"), page);
    for part in ["<h1>part</h1>", "id=\"step-clean\"", "class=\"chart\"", "min-stretch", "[steps.raw]", "id=\"data\""] {
        assert!(page.contains(part), "no {part}");
    }
    for outside in ["src=\"http", "href=\"http", "url(http", "@import"] {
        assert!(!page.contains(outside), "{outside}");
    }
    desk.meshmill(&["report", "out/part", "--step", "clean", "--out", "one.html"]).assert().success();
    assert!(desk.text("one.html").contains("\"pair\":[\"clean\",\"clean\"]"));
    let unknown = desk.meshmill(&["report", "out/part", "--step", "claen"]).assert().code(2);
    unknown.stderr(predicate::str::contains("claen").and(predicate::str::contains("raw, clean")));
}

#[test]
fn nothing_of_a_recipe_becomes_markup_of_its_report() {
    let desk = Desk::new();
    let hostile =
        RECIPE.replace("name = \"part\"", "name = \"part\"\ndescription = \"</script><img src=x onerror=1>\"");
    desk.write("recipe.toml", &hostile);
    desk.meshmill(&["run", "recipe.toml", "--report"]).assert().success();
    let page = desk.text("out/part/report.html");
    assert!(page.contains("&lt;img src=x onerror=1&gt;") && !page.contains("<img src=x"));
}

#[test]
fn the_report_of_a_sweep_shows_every_case() {
    let desk = Desk::new();
    let recipe = format!("{RECIPE}[sweep]\ncolumns = [\"clean.faces\", \"clean.min-stretch\"]\n");
    desk.write("recipe.toml", &recipe);
    desk.meshmill(&["sweep", "recipe.toml", "-s", "limit=0.1,0.2,0.99", "--report"]).assert().code(3);
    let page = desk.text("out/part-sweep/report.html");
    for part in ["id=\"sweep\"", "3 cases, 2 passed", "limit-0.99", "class=\"sortable\"", "Results"] {
        assert!(page.contains(part), "no {part}");
    }
    desk.meshmill(&["report", "out/part-sweep", "--out", "again.html"]).assert().success();
    assert_eq!(desk.text("again.html"), page);
}

#[test]
fn what_a_reader_left_out_is_told_by_every_command_alike() {
    let desk = Desk::new();
    let deck = "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n*ELEMENT, TYPE=S3\n1, 1, 3, 2\n2, 1, 2, 4\n\
        3, 2, 3, 4\n4, 1, 4, 3\n*SURFACE, NAME=s, COMBINE=UNION\nr\n";
    desk.write("part.inp", deck);
    let told = || predicate::str::contains("left out on reading: surface `s` (line 11): COMBINE=UNION").count(1);
    desk.meshmill(&["measure", "part.inp"]).assert().success().stderr(told());
    desk.meshmill(&["convert", "part.inp", "part.off"]).assert().success().stderr(told());
    let run = || desk.meshmill(&["run", "recipe.toml", "--input", "part=part.inp", "--pictures", "none"]).assert();
    // Computed, from the cache, and when nothing has changed.
    for _ in 0..3 {
        run().success().stderr(told());
    }
    let sweep = ["sweep", "recipe.toml", "--input", "part=part.inp", "-s", "limit=0.1,0.2", "--pictures", "none"];
    desk.meshmill(&sweep).assert().success().stderr(told());
}
