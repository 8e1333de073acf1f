//! What a wrong recipe is told: every file of `tests/recipes/wrong` and the rendered report, without colour.

use std::fs;
use std::path::{Path, PathBuf};

use meshmill::plan::{Context, METRIC_ENDINGS, plan};
use meshmill::recipe::{Diagnostics, Overrides, Recipe};
use meshmill::steps::CATALOG;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Reads and plans a recipe as the command line does, with paths relative to this package.
fn check(path: &Path, overrides: &Overrides) -> Result<(), Diagnostics> {
    let loader = |path: &Path| fs::read_to_string(root().join(path)).map_err(|error| error.to_string());
    let recipe = Recipe::load(path, &loader, overrides)?;
    let exists = |path: &Path| {
        if root().join(path).is_file() { Ok(()) } else { Err("no such file".to_owned()) }
    };
    let endings: Vec<&str> = meshmill::format::Format::ALL
        .iter()
        .flat_map(|format| format.endings())
        .copied()
        .chain(METRIC_ENDINGS)
        .collect();
    let second_order = &["inp", "msh", "vtu"];
    let context = Context { catalog: CATALOG, check_file: &exists, endings: &endings, second_order };
    plan(&recipe, &context).map(drop)
}

fn report(path: &str, overrides: &Overrides) -> String {
    match check(Path::new(path), overrides) {
        Ok(()) => panic!("`{path}` is not wrong"),
        Err(found) => found.render(false).replace('\\', "/"),
    }
}

fn wrong_recipes() -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = fs::read_dir(root().join("tests/recipes/wrong"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "toml"))
        .collect();
    files.sort();
    files
}

#[test]
fn wrong_recipes_are_explained() {
    let files = wrong_recipes();
    assert!(files.len() >= 10);
    for file in files {
        let name = file.file_stem().unwrap().to_str().unwrap();
        let report = report(&format!("tests/recipes/wrong/{name}.toml"), &Overrides::default());
        insta::with_settings!({ snapshot_path => "snapshots/diagnostics", prepend_module_to_snapshot => false, omit_expression => true }, {
            insta::assert_snapshot!(name, report);
        });
    }
}

#[test]
fn the_good_recipe_is_good() {
    if let Err(found) = check(Path::new("tests/recipes/good.toml"), &Overrides::default()) {
        panic!("{found}");
    }
}

#[test]
fn the_command_line_is_explained_too() {
    let overrides = Overrides {
        set: vec![("sise".to_owned(), "3%".to_owned()), ("size".to_owned(), "=1 + ".to_owned())],
        inputs: vec![("part".to_owned(), "nowhere.stl".into())],
        ..Overrides::default()
    };
    insta::with_settings!({ snapshot_path => "snapshots/diagnostics", prepend_module_to_snapshot => false, omit_expression => true }, {
        insta::assert_snapshot!("command-line", report("tests/recipes/good.toml", &overrides));
    });
}

#[test]
fn a_wrong_argument_is_underlined_in_the_argument() {
    let overrides = Overrides { set: vec![("size".to_owned(), "3mm".to_owned())], ..Overrides::default() };
    insta::with_settings!({ snapshot_path => "snapshots/diagnostics", prepend_module_to_snapshot => false, omit_expression => true }, {
        insta::assert_snapshot!("wrong-argument", report("tests/recipes/good.toml", &overrides));
    });
}

/// Recipes that no person writes: each name that is unknown is compared with all that are known.
#[test]
fn thousands_of_wrong_names_end_after_a_thousand() {
    let head =
        "[inputs]\npart = \"examples/meshes/l_bracket.stl\"\n[steps.raw]\nuse = \"read\"\nfile = \"=inputs.part\"\n";
    let many = |line: &dyn Fn(usize) -> String| (0..20_000).map(line).collect::<String>();
    let bodies = [
        format!("[steps.c]\nuse = \"repair\"\nfrom = \"raw\"\n{}", many(&|i| format!("kez{i} = 1\n"))),
        format!("[params]\n{}", many(&|i| format!("kez{i} = \"=b{i}\"\n"))),
        format!("[params]\n{}", many(&|i| format!("kez{i} = 1\n"))),
        format!("[gates.raw]\n{}", many(&|i| format!("kez{i} = 1\n"))),
        many(&|i| format!("[steps.s{i}]\nuse = \"repair\"\nfrom = \"raww{i}\"\n")),
    ];
    for body in bodies {
        let text = format!("{head}{body}");
        let loader = |_: &Path| Ok(text.clone());
        let recipe = Recipe::load(Path::new("many.toml"), &loader, &Overrides::default()).expect("it is TOML");
        let context = Context { catalog: CATALOG, check_file: &|_| Ok(()), endings: &["stl"], second_order: &[] };
        let found = plan(&recipe, &context).map(drop).expect_err("names are wrong");
        assert!(found.stopped && found.list.len() == 1000, "{}", found.list.len());
        assert!(found.render(false).ends_with("and 950 more problems; looking stopped after 1000"));
    }
}
