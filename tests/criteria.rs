//! Criteria from the recipe to the page: judged, cached, told, taken over from other programs, and never in the way.

use std::fs;

use meshmill::report::json;
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
size = 1
[steps.raw]
use = "read"
file = "=inputs.part"
[steps.clean]
use = "repair"
from = "raw"
[criteria.lab]
file = "lab.criteria.toml"
params = { size = "=size" }
[gates.clean]
criteria = "lab"
[outputs]
clean = "result.obj"
"#;

/// The cube has twelve right triangles with two equal sides: angles of 45 and 90 degrees.
const LAB: &str = r#"
params = { size = 7 }
max-tria-angle = { ideal = 60, good = 80, warn = 100, fail = 120, worst = 180 }
edge-ratio = { ideal = 1, good = 1.2, warn = 1.3, fail = 2, worst = 5, weight = 3 }
max-length = { ideal = "=size", good = "=2*size", warn = "=3*size", fail = "=4*size", worst = "=9*size" }
"#;

impl Desk {
    fn new() -> Self {
        Self::with(&[("recipe.toml", RECIPE), ("cube.obj", CUBE), ("lab.criteria.toml", LAB)])
    }
}

#[test]
fn a_changed_criterion_is_judged_again_and_nothing_is_meshed_again() {
    let desk = Desk::new();
    let first = desk.report(0, &[]);
    assert_eq!(first["timings"]["ran"], json!({ "gate": 1, "read": 1, "repair": 1 }));
    desk.run(&[]).success();
    // A plain run is remembered as a whole, with the file of criteria among what it read.
    let content = first["cases"][0]["steps"][1]["content"].clone();
    desk.write("lab.criteria.toml", &LAB.replace("fail = 120", "fail = 101").replace("worst = 180", "worst = 150"));
    let second = desk.report(0, &[]);
    assert_eq!(second["timings"]["ran"], json!({ "gate": 1 }));
    assert_eq!(second["cases"][0]["steps"][1]["content"], content);
    desk.write(
        "lab.criteria.toml",
        &LAB.replace("good = 80, warn = 100, fail = 120", "good = 60, warn = 70, fail = 80"),
    );
    desk.run(&[]).code(3).stderr(predicate::str::contains("clean: criteria lab"));
    assert_eq!(desk.report(3, &[])["timings"]["ran"], json!({}));
    // As it was: the verdict is known.
    desk.write("lab.criteria.toml", LAB);
    assert_eq!(desk.report(0, &[])["timings"]["ran"], json!({}));
    // What the expressions use counts too.
    assert_eq!(desk.report(0, &["--set", "size=0.9"])["timings"]["ran"], json!({ "gate": 1 }));
    assert_eq!(desk.report(3, &["--set", "size=0.1"])["timings"]["ran"], json!({ "gate": 1 }));
}

#[test]
fn the_report_tells_classes_index_and_the_worst_element() {
    let desk = Desk::new();
    let report = desk.report(0, &[]);
    let gate = &report["cases"][0]["gates"][0];
    assert_eq!(gate["rows"][0]["metric"], "criteria lab");
    let criteria = &gate["criteria"][0];
    let row =
        |metric: &str| criteria["rows"].as_array().unwrap().iter().find(|row| row["metric"] == metric).unwrap().clone();
    // 90 degrees lie half between 80 and 100: 0.4. √2 lies between 1.3 and 2: 0.8 and (√2 − 1.3) / 0.7 of 0.2.
    let (angle, ratio) = (0.4, 0.8 + 0.2 * (2.0_f64.sqrt() - 1.3) / 0.7);
    let near = |value: &Value, expected: f64| assert!((value.as_f64().unwrap() - expected).abs() < 1e-12, "{value}");
    near(&row("max-tria-angle")["quality_index"], angle);
    near(&row("edge-ratio")["quality_index"], ratio);
    near(&criteria["quality_index"], (angle + 3.0 * ratio) / 5.0);
    assert_eq!(row("edge-ratio")["levels"], json!([0, 0, 12, 0, 0]));
    assert_eq!(criteria["levels"], json!([0, 0, 12, 0, 0]));
    assert_eq!(row("edge-ratio")["worst"][0]["at"].as_array().unwrap().len(), 3);
    let schema = jsonschema::draft7::new(&json::schema()).unwrap();
    let faults: Vec<String> = schema.iter_errors(&report).map(|error| error.to_string()).collect();
    assert_eq!(faults, [""; 0]);
    let text = String::from_utf8(desk.run(&[]).success().get_output().stdout.clone()).unwrap();
    assert!(text.contains("criteria lab of clean: passed, quality index"), "{text}");
    assert!(text.contains("edge-ratio") && text.contains("at most 120°") && text.contains("face "), "{text}");
    desk.run(&["--report"]).success();
    let page = desk.text("out/part/report.html");
    assert!(page.contains("Criteria lab <span class=\"badge good\">passed</span>"));
    assert!(page.contains("aria-label=\"12 warn\"") && page.contains("\"criteria-lab\""));
    assert!(page.contains("lab.criteria.toml"), "the text of the criteria is not on the page");
}

#[test]
fn junit_has_a_test_for_each_check_and_replaces_nothing() {
    let desk = Desk::new();
    desk.run(&["--junit", "tests.xml"]).success();
    let text = desk.text("tests.xml");
    let xml = roxmltree::Document::parse(&text).unwrap();
    assert_eq!(xml.root_element().attribute("failures"), Some("0"));
    assert_eq!(xml.descendants().filter(|node| node.has_tag_name("testcase")).count(), 6);
    desk.run(&["--junit", "tests.xml", "--set", "size=0.1"]).code(3);
    let text = desk.text("tests.xml");
    let xml = roxmltree::Document::parse(&text).unwrap();
    let failed: Vec<_> = xml.descendants().filter(|node| node.has_tag_name("failure")).collect();
    let names: Vec<_> = failed.iter().filter_map(|node| node.parent()?.attribute("name")).collect();
    assert_eq!(names, ["criteria lab", "max-length"]);
    for (file, text) in [("cube.obj", CUBE), ("recipe.toml", RECIPE), ("lab.criteria.toml", LAB)] {
        desk.run(&["--junit", file]).code(2).stderr(predicate::str::contains("which the run reads"));
        assert_eq!(desk.text(file), text);
    }
}

#[test]
fn a_file_of_criteria_is_an_input_that_no_output_replaces() {
    let desk = Desk::new();
    desk.write("o/result.obj", LAB);
    desk.write("base.toml", LAB);
    for (name, text) in [("o/result.obj", LAB), ("middle.toml", "extends = \"o/result.obj\"\ntaper = false\n")] {
        desk.write(name, text);
        desk.write("recipe.toml", &RECIPE.replace("lab.criteria.toml", name));
        desk.run(&["--out", "o"]).code(2).stderr(predicate::str::contains("o/result.obj, which the run reads"));
        assert_eq!(desk.text("o/result.obj"), LAB);
    }
}

#[test]
fn criteria_are_extended_and_faults_are_told_in_their_file() {
    let desk = Desk::new();
    desk.write("strict.toml", "extends = \"lab.criteria.toml\"\ndrop = \"max-length\"\nmax-tria-angle.fail = 101\n");
    let recipe = RECIPE.replace("lab.criteria.toml", "strict.toml").replace("params = { size = \"=size\" }", "");
    let recipe = recipe.replace("[params]\nsize = 1\n", "");
    // Nothing uses the size any more.
    desk.write("recipe.toml", &recipe);
    desk.run(&[]).code(2).stderr(predicate::str::contains("nothing in these criteria uses the parameter `size`"));
    desk.write(
        "strict.toml",
        "extends = \"lab.criteria.toml\"\ndrop = [\"max-length\", \"params\"]\nedge-ratio.fail = 3\n",
    );
    let report = desk.report(0, &[]);
    let rows = report["cases"][0]["gates"][0]["criteria"][0]["rows"].as_array().unwrap().clone();
    assert_eq!(rows.len(), 2);
    assert_eq!(rows[0]["limits"], json!([1.0, 1.2, 1.3, 3.0, 5.0]));
    for (text, said) in [
        ("edge-ratio = { ideal = 1, good = 2, warn = 3, fail = 2.5, worst = 5 }", "strict.toml:1:54"),
        ("extends = \"strict.toml\"", "files of criteria extend each other in a circle"),
        ("extends = \"gone.toml\"", "cannot read the extended file of criteria `gone.toml`: there is no such file"),
        ("edge-ratio = ", "not TOML"),
        ("file = \"lab.criteria.toml\"", "a file of criteria has no key `file`"),
        ("", "the criteria `lab` judge nothing"),
    ] {
        desk.write("strict.toml", text);
        desk.run(&[]).code(2).stderr(predicate::str::contains(said));
    }
    desk.write("recipe.toml", &recipe.replace("strict.toml", "."));
    desk.run(&[]).code(2).stderr(predicate::str::contains("cannot read the criteria"));
}

#[test]
fn a_mesh_is_judged_without_a_recipe() {
    let desk = Desk::new();
    let measure =
        |more: &[&str]| desk.meshmill(&["measure", "cube.obj", "--criteria", "lab.criteria.toml"]).args(more).assert();
    measure(&[]).success().stdout(predicate::str::contains("criteria lab: passed, quality index"));
    measure(&["--set", "size=0.1"]).code(3).stdout(predicate::str::contains("max-length"));
    measure(&["--set", "sise=0.1"]).code(2).stderr(predicate::str::contains("did you mean `size`?"));
    let output = measure(&["--json"]).success().get_output().stdout.clone();
    let report: Value = serde_json::from_slice(&output).unwrap();
    assert_eq!(report["criteria"]["levels"], json!([0, 0, 12, 0, 0]));
    assert_eq!(report["units"]["max-tria-angle"], "degrees");
    let schema = jsonschema::draft7::new(&json::schema()).unwrap();
    assert!(schema.is_valid(&report));
    desk.write("lab.criteria.toml", "chordal-deviation = { ideal = 0, good = 1, warn = 2, fail = 3, worst = 4 }");
    measure(&[]).code(2).stderr(predicate::str::contains("--reference"));
    measure(&["--reference", "cube.obj"]).success();
    desk.write("lab.criteria.toml", "skw = 1");
    measure(&[]).code(2).stderr(predicate::str::contains("lab.criteria.toml:1:1"));
}

#[cfg(unix)]
#[test]
fn a_file_without_end_is_refused() {
    let desk = Desk::new();
    desk.write("recipe.toml", &RECIPE.replace("lab.criteria.toml", "/dev/zero"));
    desk.run(&[]).code(2).stderr(predicate::str::contains("/dev/zero"));
    desk.meshmill(&["criteria", "import", "/dev/zero"]).assert().code(2);
}

#[test]
fn criteria_that_compare_name_what_they_are_compared_with() {
    let desk = Desk::new();
    let chord = "chordal-deviation = { ideal = 0, good = \"0.1%\", warn = \"0.2%\", fail = \"1%\", worst = \"2%\" }";
    let recipe = RECIPE.replace("file = \"lab.criteria.toml\"\nparams = { size = \"=size\" }", chord);
    let recipe = recipe.replace("[params]\nsize = 1\n", "");
    desk.write("recipe.toml", &recipe);
    desk.run(&[]).code(2).stderr(predicate::str::contains("nothing says with what"));
    desk.write("recipe.toml", &recipe.replace("\"lab\"", "{ use = \"lab\", to = \"raw\" }"));
    let report = desk.report(0, &[]);
    assert_eq!(report["cases"][0]["gates"][0]["references"], json!(["raw"]));
    assert_eq!(report["cases"][0]["gates"][0]["criteria"][0]["levels"], json!([12, 0, 0, 0, 0]));
}

#[test]
fn a_sweep_has_a_column_for_criteria() {
    let desk = Desk::new();
    desk.meshmill(&["sweep", "recipe.toml", "-s", "size=1,0.1", "--pictures", "none"]).assert().code(3);
    let mut table = csv::Reader::from_path(desk.path("out/part-sweep/sweep.csv")).unwrap();
    let head: Vec<String> = table.headers().unwrap().iter().map(str::to_owned).collect();
    let passed = head.iter().position(|name| name == "gate clean.criteria lab passed").unwrap();
    let rows: Vec<csv::StringRecord> = table.records().map(Result::unwrap).collect();
    let verdicts: Vec<&str> = rows.iter().map(|row| &row[passed]).collect();
    assert_eq!(verdicts, ["true", "false"]);
    let index: f64 = rows[1][passed - 1].parse().unwrap();
    assert!(index > 1.0, "{index}");
}

#[test]
fn files_of_other_programs_are_taken_over_and_can_be_used_at_once() {
    let desk = Desk::new();
    desk.write(
        "lab.criteria",
        " # Criterion On Wt Ideal Good Warn Fail Worst\n 0 penalty value 0 0 0.8 1 10\n 3 aspect ratio 1 1.0 1 2 4.4 5 10 0\n \
         7 max angle tria 1 1.0 60 80 100 120 180 0\n 14 QI color legend 32 32 7 6 3\n",
    );
    desk.write("meshQualityDict", "maxNonOrtho 65;\nmaxConcave 80;\nrelaxed\n{\n    maxNonOrtho 75;\n}\n");
    let import = |arguments: &[&str]| desk.meshmill(&["criteria", "import"]).args(arguments).assert();
    let told = import(&["lab.criteria", "--to", "taken.toml"]).success();
    told.stderr(predicate::str::contains("2 checks taken over, 1 lines not supported"));
    let measured = desk.meshmill(&["measure", "cube.obj", "--criteria", "taken.toml"]).assert().success();
    measured.stdout(predicate::str::contains("max-tria-angle"));
    import(&["meshQualityDict"])
        .success()
        .stdout(predicate::str::contains("max-quad-angle = { ideal = 90, good = 90, warn = 226, fail = 260"))
        .stderr(predicate::str::contains("line 5: relaxed.maxNonOrtho 75: it judges volume cells"));
    let before = desk.text("lab.criteria");
    import(&["lab.criteria", "--to", "./lab.criteria"]).code(2);
    assert_eq!(desk.text("lab.criteria"), before);
    import(&["cube.obj"]).code(2).stderr(predicate::str::contains("--from hypermesh"));
    desk.write("solver", "maxNonOrtho 65;\n");
    import(&["solver"]).code(2).stderr(predicate::str::contains("none of its checks judges a surface"));
    desk.write("broken", "maxConcave 80;\nminTwist much;\n");
    import(&["broken"]).code(2).stderr(predicate::str::contains("line 2: `minTwist` has a number, got `much`"));
    desk.meshmill(&["criteria", "metrics"])
        .assert()
        .success()
        .stdout(predicate::str::contains("characteristic-length"));
}

#[test]
fn shipped_criteria_judge_every_kind_of_mesh() {
    let desk = Desk::new();
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/pipelines/criteria");
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path().display().to_string()).collect();
    names.sort();
    let codes: Vec<Option<i32>> = names
        .iter()
        .map(|name| {
            let assert = desk.meshmill(&["measure", "cube.obj", "--criteria", name]).assert();
            assert.get_output().status.code()
        })
        .collect();
    // A cube of triangles is no shell of quads; right triangles with two equal sides are good enough for solids.
    assert_eq!(codes, [Some(3), Some(3), Some(0)], "{names:?}");
}

#[test]
fn the_example_of_the_documentation_is_right() {
    let page = include_str!("../docs/criteria.md");
    let mut blocks = page.split("```toml\n").skip(1).map(|rest| rest.split("```").next().unwrap());
    let (file, recipe) = (blocks.next().unwrap(), blocks.next().unwrap());
    let desk = Desk::new();
    desk.write("lab.criteria.toml", file);
    desk.meshmill(&["measure", "cube.obj", "--criteria", "lab.criteria.toml", "--set", "size=1"]).assert().success();
    let (head, _) = RECIPE.split_once("[criteria.lab]").unwrap();
    let fe = "[steps.fe]\nuse = \"refine\"\nfrom = \"clean\"\nmax-edge = 2\n";
    desk.write("recipe.toml", &format!("{head}{fe}{recipe}"));
    desk.run(&[]).success();
}
