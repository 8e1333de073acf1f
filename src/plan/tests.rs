//! Planning with the toy catalog: graph, merging, checks, keys.

use std::path::Path;

use super::*;
use crate::recipe::{Diagnostics, Node as TreeNode, Overrides, Recipe, Span, Tree};

const RECIPE: &str = r#"
name = "toy"
[inputs]
part = "part.stl"
[params]
size = "2%"
times = 3
[steps.raw]
use = "read"
file = "=inputs.part"
[steps.clean]
use = "repair"
from = "raw"
[steps.fine]
use = "smooth"
from = "clean"
reference = "clean"
tolerance = "=size/10"
times = "=2*times"
keep = ["rim"]
[gates.fine]
min-stretch = { at-least = 0.2 }
distance = { to = "clean", at-most = "=size" }
closed = true
[outputs]
fine = ["{name}-{size}.vtu", { file = "a/result.inp", element = "S6", midside-on = "clean" }]
"#;

fn context() -> Context<'static> {
    Context {
        catalog: toy::CATALOG,
        check_file: &|path| if path.ends_with("missing.stl") { Err("no such file".to_owned()) } else { Ok(()) },
        endings: &["stl", "vtu", "inp"],
        second_order: &["vtu", "inp"],
    }
}

fn recipe(text: &str) -> Recipe {
    let text = text.to_owned();
    Recipe::load(Path::new("lab/toy.toml"), &move |_| Ok(text.clone()), &Overrides::default()).unwrap()
}

fn planned(text: &str) -> Plan {
    plan(&recipe(text), &context()).unwrap()
}

fn messages(text: &str) -> Vec<String> {
    let found: Diagnostics = plan(&recipe(text), &context()).unwrap_err();
    found.list.into_iter().map(|diagnostic| diagnostic.message).collect()
}

#[test]
fn a_recipe_becomes_a_graph() {
    let plan = planned(RECIPE);
    let labels: Vec<_> = plan.order().map(|id| plan.node(id).label.clone()).collect();
    assert_eq!(labels, ["lab/part.stl", "raw", "clean", "fine", "gate fine", "gate fine to clean"]);
    let case = &plan.cases()[0];
    let fine = case.steps["fine"];
    let clean = case.steps["clean"];
    assert_eq!(plan.inputs(fine), [("from", clean), ("reference", clean)]);
    let Task::Step(task) = &plan.node(fine).task else { panic!("a step") };
    assert_eq!(task.bound.canonical(), serde_json::json!({ "tolerance": "0.2%", "times": 6, "damping": 0.0 }));
    assert_eq!(task.locks.keep, ["rim"]);
    assert_eq!(case.outputs[0].file, Path::new("toy-2pct.vtu"));
    assert_eq!(case.outputs[1].options.element.as_deref(), Some("S6"));
    assert_eq!(case.outputs[1].options.midside_on, Some(clean));
    assert_eq!(case.params["times"], "3");
    assert_eq!(case.gates[0].tasks.len(), 2);
    let with_reference = plan.inputs(case.gates[0].tasks[1]);
    assert_eq!(with_reference, [("reference", clean), ("target", fine)]);
}

#[test]
fn cases_share_what_they_have_in_common() {
    let recipe = recipe(RECIPE);
    let case = |name: &str, times: &str| CaseSpec {
        name: name.to_owned(),
        params: vec![("times".to_owned(), Tree { span: Span::default(), value: TreeNode::Number(times.to_owned()) })],
    };
    let plan = plan_cases(&recipe, &[case("a", "1"), case("b", "2"), case("c", "1")], None, &context()).unwrap();
    let [a, b, c] = plan.cases() else { panic!("three cases") };
    assert_eq!(a.steps["clean"], b.steps["clean"]);
    assert_ne!(a.steps["fine"], b.steps["fine"]);
    assert_eq!(a.steps["fine"], c.steps["fine"]);
    assert_eq!(plan.len(), 9);
}

#[test]
fn the_name_of_a_step_is_not_its_identity() {
    let twice = RECIPE.replace("[gates.fine]", "[steps.again]\nuse = \"repair\"\nfrom = \"raw\"\n[gates.fine]");
    let plan = planned(&twice);
    assert_eq!(plan.cases()[0].steps["clean"], plan.cases()[0].steps["again"]);
}

#[test]
fn only_outputs_in_use_are_tasks() {
    let coarse = RECIPE.replace("fine = [\"{name}-{size}.vtu\", ", "\"fine.coarse\" = [");
    let plan = planned(&coarse);
    assert!(plan.cases()[0].steps.contains_key("fine.coarse"));
    let unused =
        RECIPE.replace("[gates.fine]", "[steps.side]\nuse = \"smooth\"\nfrom = \"clean\"\ntolerance = 1\n[gates.fine]");
    assert!(planned(&unused).cases()[0].steps.contains_key("side"));
}

#[test]
fn every_error_is_reported_at_once() {
    let wrong = RECIPE
        .replace("use = \"repair\"", "use = \"repare\"")
        .replace("=size/10", "=size+1")
        .replace("keep = [\"rim\"]", "kepe = 3\ndamping = \"much\"\n")
        .replace("{ at-least = 0.2 }", "{ atleast = 0.2 }")
        .replace("{ to = \"clean\", at-most = \"=size\" }", "{ to = \"klean\", at-most = \"=size\" }")
        .replace("element = \"S6\"", "element = \"S7\"");
    assert_eq!(
        messages(&wrong),
        [
            "there is no kind of step `repare`",
            "cannot compute a percent + a number",
            "the step kind `smooth` has no parameter `kepe`",
            "`damping`: invalid type: string \"much\", expected a number",
            "a check has no key `atleast`",
            "there is no step `klean`",
            "there is no shell element `S7`",
        ]
    );
}

#[test]
fn values_of_wrong_type_and_range_are_all_reported() {
    let wrong = RECIPE
        .replace("tolerance = \"=size/10\"", "tolerance = \"2 mm\"")
        .replace("times = \"=2*times\"", "times = 1.5");
    assert_eq!(messages(&wrong).len(), 2);
    let out_of_range = RECIPE.replace("times = \"=2*times\"", "times = \"=100*times\"");
    assert_eq!(messages(&out_of_range), ["`times` must be at most 100, got 300"]);
}

#[test]
fn a_soup_is_no_surface() {
    let wrong = RECIPE.replace("from = \"clean\"", "from = \"raw\"");
    assert_eq!(messages(&wrong), ["the step `fine` (smooth) needs a surface as `from`, but `raw` gives a soup"]);
    let through_select = RECIPE
        .replace("[steps.fine]", "[steps.some]\nuse = \"select\"\nfrom = \"raw\"\n[steps.fine]")
        .replace("from = \"clean\"", "from = \"some\"");
    assert_eq!(messages(&through_select).len(), 1);
}

#[test]
fn circles_are_shown_as_paths() {
    let wrong = RECIPE.replace("from = \"raw\"", "from = \"fine\"");
    assert_eq!(messages(&wrong), ["steps need each other in a circle: clean -> fine -> clean"]);
}

#[test]
fn outputs_stay_in_their_folder_and_apart() {
    for name in ["../x.vtu", "/x.vtu", "", "a/../../x.vtu", "x.doc", "x", "run.ron", "c:x.vtu"] {
        let wrong = RECIPE.replace("{name}-{size}.vtu", name);
        assert_eq!(messages(&wrong).len(), 1, "{name}");
    }
    let twice = RECIPE.replace("{name}-{size}.vtu", "./A/Result.inp");
    assert_eq!(messages(&twice), ["two outputs write the file `a/result.inp`"]);
    let named = |names: &str| RECIPE.replace(r#""{name}-{size}.vtu""#, names);
    let clash = |names: &str| messages(&named(names));
    let within = "`X.vtu/y.vtu` would be a file and a folder at once";
    assert_eq!(clash(r#""x.vtu", "X.vtu/y.vtu""#), [within]);
    assert_eq!(clash(r#""X.vtu/y.vtu", "x.vtu""#), ["`x.vtu` would be a file and a folder at once"]);
    planned(&named(r#""x.vtu-a.vtu", "x/y.vtu", "x.vtu.vtu", "x.vtu""#));
}

#[test]
fn a_changed_field_changes_key_and_record_together() {
    let plan = planned(RECIPE);
    let fine = plan.cases()[0].steps["fine"];
    let task = &plan.node(fine).task;
    let content = blake3::hash(b"a");
    let inputs = [("from", content), ("reference", content)];
    let key = task_key(task, 1, &inputs);
    assert_eq!(key, task_key(task, 1, &[inputs[1], inputs[0]]));
    let record = task_record(task, 1, &inputs);
    assert_eq!(record.get("parameter times"), Some("6"));
    let changed = planned(&RECIPE.replace("times = 3", "times = 4"));
    let other = &changed.node(changed.cases()[0].steps["fine"]).task;
    let inputs = [("from", blake3::hash(b"b")), ("reference", content)];
    assert_ne!(key, task_key(other, 1, &inputs));
    let changes: Vec<_> =
        task_record(other, 1, &inputs).changes_since(&record).iter().map(ToString::to_string).collect();
    assert_eq!(changes, ["parameter times from 6 to 8", "input `from` changed"]);
}

#[test]
fn a_plan_can_be_drawn() {
    let plan = planned(RECIPE);
    insta::assert_snapshot!("dot", draw::dot(&plan));
    insta::assert_snapshot!("mermaid", draw::mermaid(&plan));
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig {
        cases: 200, failure_persistence: None, ..Default::default()
    })]

    /// Any line of a good recipe replaced, repeated or cut gives a plan or a report, and never a panic.
    #[test]
    fn damaged_recipes_plan_or_are_explained(
        line in 0_usize..30,
        column in 0_usize..60,
        text in "\\PC{0,8}|[a-z=\"{}\\[\\].%0-9 -]{0,8}|(raw|clean|fine|=size|fine\\.coarse)",
        cut in 0_usize..20,
    ) {
        let mut lines: Vec<String> = RECIPE.lines().map(str::to_owned).collect();
        let line = line % lines.len();
        let characters: Vec<char> = lines[line].chars().collect();
        let start = column.min(characters.len());
        let end = (start + cut).min(characters.len());
        lines[line] = characters[..start].iter().chain(text.chars().collect::<Vec<_>>().iter()).chain(&characters[end..]).collect();
        let text = lines.join("\n");
        let found = Recipe::load(Path::new("toy.toml"), &|_| Ok(text.clone()), &Overrides::default())
            .and_then(|recipe| plan(&recipe, &context()));
        if let Err(found) = found {
            proptest::prop_assert!(!found.render(true).is_empty());
        }
    }
}
