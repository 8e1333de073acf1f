//! The snippet that the reference shows for each step runs as it stands.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use meshmill::plan::{Context, plan};
use meshmill::recipe::{Overrides, Recipe};
use meshmill::run::{RunOptions, Silent, run};
use meshmill::step::StepDef;
use meshmill::steps::CATALOG;
use meshmill::store::Store;

use crate::shapes;

/// What the snippets name.
const BEFORE: &str = "[inputs]\npart = \"part.obj\"\nopen = \"sheet.obj\"\n\
    [steps.flat]\nuse = \"read\"\nfile = \"=inputs.open\"\n\
    [steps.sheet]\nuse = \"repair\"\nfrom = \"flat\"\n\
    [steps.rough]\nuse = \"rough-quads\"\nfrom = \"sheet\"\ninterval = \"25%\"\n\
    [steps.raw]\nuse = \"read\"\nfile = \"=inputs.part\"\n\
    [steps.clean]\nuse = \"repair\"\nfrom = \"raw\"\n\
    [steps.marked]\nuse = \"features\"\nfrom = \"clean\"\n\
    [steps.parts]\nuse = \"partition\"\nfrom = \"marked\"\nregions = 16\n\
    [steps.curves]\nuse = \"straighten\"\nfrom = \"parts\"\n\
    [steps.fe]\nuse = \"control-properties\"\nfrom = \"clean\"\n";

/// A slender bar as an OBJ file: small steps in percent of its diagonal stay few.
fn bar() -> String {
    obj(&shapes::cylinder(8, 1), 0.05)
}

fn obj(mesh: &meshmill::mesh::Soup, width: f64) -> String {
    let points = mesh.points.iter().map(|p| format!("v {} {} {}\n", width * p.x, width * p.y, p.z));
    let faces = shapes::faces(mesh).into_iter().map(|[a, b, c]| format!("f {} {} {}\n", a + 1, b + 1, c + 1));
    points.chain(faces).collect()
}

fn runs(step: &StepDef, folder: &Path) {
    let text = format!("name = \"example\"\n{BEFORE}[steps.example]\n{}", step.example);
    let load = |_: &Path| Ok(text.clone());
    let recipe = Recipe::load(&folder.join("example.toml"), &load, &Overrides::default()).expect("a recipe");
    let context = Context { catalog: CATALOG, check_file: &|_| Ok(()), endings: &[], second_order: &[] };
    let plan = plan(&recipe, &context).unwrap_or_else(|problems| panic!("{}: {}", step.name, problems.render(false)));
    let options = RunOptions { only: vec!["example".to_owned()], ..RunOptions::new("example", folder.join("out"), 1) };
    let store = Store::open(&folder.join("cache")).expect("a store");
    let observer: Arc<dyn meshmill::run::Observer> = Arc::new(Silent);
    let outcome = run(&plan, &store, &options, &observer).expect("a run");
    let failures: Vec<_> = outcome.failures(&plan).map(|(task, failure)| format!("{task}: {failure}")).collect();
    assert!(failures.is_empty(), "the example of `{}` fails: {failures:?}", step.name);
    let made = outcome.task(plan.cases()[0].steps["example"]).content;
    assert!(made.is_some(), "the example of `{}` gives nothing", step.name);
}

#[test]
fn every_example_runs() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("part.obj"), bar()).unwrap();
    fs::write(folder.path().join("sheet.obj"), obj(&shapes::grid(20), 1.0)).unwrap();
    for step in CATALOG {
        assert!(step.example.contains(&format!("use = \"{}\"", step.name)), "the example of `{}`", step.name);
        runs(step, folder.path());
    }
}
