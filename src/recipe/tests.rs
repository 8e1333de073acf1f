//! Loading, merging, parameters and substitution; texts of any sort never panic.

use std::collections::BTreeMap;

use proptest::prelude::*;

use super::*;

fn load(files: &[(&str, &str)], overrides: &Overrides) -> Result<Recipe, Diagnostics> {
    let files: BTreeMap<PathBuf, String> =
        files.iter().map(|(name, text)| (PathBuf::from(name), (*text).to_owned())).collect();
    let first = files.keys().find(|name| name.ends_with("main.toml")).unwrap().clone();
    let loader = |path: &Path| files.get(&normalize(path)).cloned().ok_or_else(|| "no such file".to_owned());
    Recipe::load(&first, &loader, overrides)
}

fn one(text: &str) -> Recipe {
    load(&[("main.toml", text)], &Overrides::default()).unwrap()
}

fn params(recipe: &Recipe) -> (BTreeMap<String, Option<Value>>, Vec<String>) {
    let mut problems = recipe.problems.clone();
    let scope = recipe.scope(&[], &mut problems);
    (scope.params, problems.into_iter().map(|problem| problem.message).collect())
}

fn problems(text: &str) -> Vec<String> {
    params(&one(text)).1
}

#[test]
fn parameters_may_use_each_other() {
    let recipe = one("[params]\na = \"=b*2\"\nb = \"=c + 1%\"\nc = \"1%\"\nd = \"==x\"\ne = true\nf = 0x10\n");
    let (params, problems) = params(&recipe);
    assert_eq!(problems, [""; 0]);
    assert_eq!(params["a"], Some(Value::Percent(4.0)));
    assert_eq!(params["d"], Some(Value::Text("=x".to_owned())));
    assert_eq!(params["f"], Some(Value::Number(16.0)));
}

#[test]
fn a_circle_of_parameters_is_reported_once() {
    let found = problems("[params]\na = \"=b\"\nb = \"=c\"\nc = \"=a\"\nd = \"=a + 1\"\n");
    assert_eq!(found, ["parameters need each other in a circle: a -> b -> c -> a"]);
}

#[test]
fn numbers_must_be_finite() {
    assert_eq!(problems("[params]\na = nan\nb = inf\nc = [1]\n").len(), 3);
    assert_eq!(problems("[params]\na = 1e400\n"), ["`1e400` is not a finite number"]);
}

#[test]
fn unknown_sections_and_wrong_forms_are_all_reported() {
    let found = problems("nmae = \"x\"\nsteps = 3\n[parms]\n[inputs]\npart = 4\n[params]\ntrue = 1\n\"a b\" = 2\n");
    assert_eq!(found.len(), 6, "{found:?}");
    let found = problems("[steps.a]\n[steps.\"b.c\"]\nuse = \"read\"\n[steps.d]\nuse = 4\n[steps]\ne = 5\n");
    assert_eq!(found.len(), 4, "{found:?}");
}

#[test]
fn later_recipes_lie_on_those_they_extend() {
    let base = r#"
        name = "base"
        [inputs]
        part = "part.stl"
        [params]
        size = "2%"
        [steps.a]
        use = "smooth"
        times = 3
        keep = ["x", "y"]
        [steps.b]
        use = "smooth"
        times = 4
    "#;
    let main = r#"
        extends = "../lab/base.toml"
        [params]
        extra = 1
        [steps.a]
        keep = ["z"]
        [steps.b]
        use = "repair"
    "#;
    let recipe = load(&[("own/main.toml", main), ("lab/base.toml", base)], &Overrides::default()).unwrap();
    assert_eq!(recipe.problems, []);
    assert_eq!(recipe.name, "base");
    assert_eq!(recipe.params.entries.len(), 2);
    let a = &recipe.step("a").unwrap().table;
    assert_eq!(a.get("times").unwrap().value.as_number(), Some(3.0));
    assert!(matches!(&a.get("keep").unwrap().value.value, Node::List(items) if items.len() == 1));
    assert!(recipe.step("b").unwrap().table.entries.is_empty());
    let scope = recipe.scope(&[], &mut Vec::new());
    let part = scope.inputs["part"].clone().unwrap();
    assert_eq!(normalize(&part), Path::new("lab/part.stl"));
}

#[test]
fn a_recipe_takes_things_of_its_base_away() {
    let base =
        "[steps.a]\nuse = \"x\"\n[gates.a]\nclosed = true\nmanifold = true\n[outputs]\na = \"a.vtu\"\nb = \"b.vtu\"\n";
    let main = "extends = \"base.toml\"\ndrop = [\"gates.a.closed\", \"outputs.a\", \"outputs.\\\"b\\\"\"]\n[outputs]\na = \"own.vtu\"\n";
    let recipe = load(&[("main.toml", main), ("base.toml", base)], &Overrides::default()).unwrap();
    assert_eq!(recipe.problems, []);
    let Node::Table(gate) = &recipe.gates.get("a").unwrap().value.value else { panic!("a table") };
    assert_eq!(gate.entries.keys().collect::<Vec<_>>(), ["manifold"]);
    assert_eq!(recipe.outputs.get("a").unwrap().value.value, Node::Text("own.vtu".to_owned()));
    assert!(recipe.outputs.get("b").is_none());
}

#[test]
fn what_cannot_be_dropped_is_told() {
    let base = "name = \"base\"\n[gates.fe]\nclosed = true\n";
    let told = |drop: &str| {
        let main = format!("extends = \"base.toml\"\ndrop = {drop}\n");
        let recipe = load(&[("main.toml", &main), ("base.toml", base)], &Overrides::default()).unwrap();
        Diagnostics::new(recipe.sources, recipe.problems).render(false)
    };
    for (drop, message, help) in [
        ("[\"gates.fe.closde\"]", "the extended recipe has no `gates.fe.closde`", "did you mean `closed`?"),
        ("[\"gates.ef.closed\"]", "the extended recipe has no `gates.ef`", "it has: `fe`"),
        ("[\"name.x\"]", "`name` of the extended recipe has no parts", "drop `name` whole"),
        ("[\"a = 1\\nb\"]", "is not the name of an entry", "gates.fe.closed"),
        ("[\"\"]", "`` is not the name of an entry", "gates.fe.closed"),
        ("[4]", "`drop` lists names, got a number", "gates.fe.closed"),
    ] {
        let told = told(drop);
        assert!(told.contains(message) && told.contains(help) && told.contains("main.toml:2:"), "{told}");
    }
    assert_eq!(problems("drop = [\"steps.a\"]\n").len(), 1);
}

#[test]
fn a_value_of_another_variant_replaces_the_whole_one() {
    let base =
        "[steps.a]\nuse = \"x\"\nsize = { default = 1, groups = { r = 2 } }\nball = { centre = 1, radius = 2 }\n";
    let main = "extends = \"base.toml\"\n[steps.a]\nsize = { field = \"f\" }\nball = { radius = 3 }\n";
    let recipe = load(&[("main.toml", main), ("base.toml", base)], &Overrides::default()).unwrap();
    let keys = |name: &str| match &recipe.step("a").unwrap().table.get(name).unwrap().value.value {
        Node::Table(table) => table.entries.keys().cloned().collect::<Vec<_>>(),
        _ => panic!("a table"),
    };
    assert_eq!(keys("size"), ["field"]);
    assert_eq!(keys("ball"), ["centre", "radius"]);
}

#[test]
fn recipes_that_extend_each_other_are_refused() {
    let found =
        load(&[("main.toml", "extends = \"a.toml\""), ("a.toml", "extends = \"./main.toml\"")], &Overrides::default())
            .unwrap();
    assert_eq!(found.problems[0].message, "recipes extend each other in a circle: main.toml -> a.toml -> main.toml");
    let found = load(&[("main.toml", "extends = \"none.toml\"")], &Overrides::default()).unwrap();
    assert!(found.problems[0].message.starts_with("cannot read the extended recipe `none.toml`"));
}

#[test]
fn the_command_line_replaces_parameters_and_inputs() {
    let overrides = Overrides {
        set: vec![
            ("size".to_owned(), "3%".to_owned()),
            ("times".to_owned(), "=2*3".to_owned()),
            ("szie".to_owned(), "1".to_owned()),
        ],
        inputs: vec![("part".to_owned(), "here.stl".into()), ("size".to_owned(), "x".into())],
        axes: Vec::new(),
    };
    let text = "[inputs]\npart = \"part.stl\"\n[params]\nsize = 1\ntimes = 2\n";
    let recipe = load(&[("lab/main.toml", text)], &overrides).unwrap();
    let shown = Diagnostics::new(Arc::clone(&recipe.sources), recipe.problems.clone()).render(false);
    assert!(shown.contains("--set:1:1") && shown.contains("did you mean `size`?"), "{shown}");
    assert!(shown.contains("the recipe has no input `size`"), "{shown}");
    let scope = recipe.scope(&[], &mut Vec::new());
    assert_eq!(scope.params["size"], Some(Value::Percent(3.0)));
    assert_eq!(scope.params["times"], Some(Value::Number(6.0)));
    assert_eq!(scope.inputs["part"].as_deref(), Some(Path::new("here.stl")));
}

#[test]
fn substitution_keeps_the_place() {
    let recipe = one("[params]\nn = 4\n[steps.a]\nuse = \"x\"\nlist = [\"=n/2\", \"=n/8\", \"=='\"]\n");
    let mut problems = Vec::new();
    let scope = recipe.scope(&[], &mut problems);
    let list = &recipe.step("a").unwrap().table.get("list").unwrap().value;
    let found = scope.substitute(list, &recipe.sources, &mut problems).unwrap();
    let Node::List(items) = &found.value else { panic!("a list") };
    assert_eq!(items[0].value, Node::Number("2".to_owned()));
    assert_eq!(items[1].value, Node::Number("0.5".to_owned()));
    assert_eq!(items[2].value, Node::Text("='".to_owned()));
    assert_eq!(recipe.sources.text(items[1].span), "\"=n/8\"");
}

#[test]
fn hostile_texts_are_refused_in_time() {
    let long = "a".repeat(10 << 20);
    assert!(load(&[("main.toml", &long)], &Overrides::default()).is_err());
    let deep = format!("x = {}", "[".repeat(100_000));
    assert!(load(&[("main.toml", &deep)], &Overrides::default()).is_err());
    let formula = format!("[params]\na = \"={}\"\n", "(".repeat(100_000));
    let found = Diagnostics::new(Arc::clone(&one(&formula).sources), {
        let mut problems = Vec::new();
        one(&formula).scope(&[], &mut problems);
        problems
    });
    assert!(found.render(false).len() < 3000);
    let chain = (0..30_000).map(|i| format!("p{i} = \"=p{}\"", i + 1)).collect::<Vec<_>>().join("\n");
    assert_eq!(problems(&format!("[params]\n{chain}")).len(), 1);
    let many = (0..30_000).map(|i| format!("s{i} = 1")).collect::<Vec<_>>().join("\n");
    let recipe = one(&many);
    let shown = Diagnostics::new(Arc::clone(&recipe.sources), recipe.problems).render(false);
    assert!(shown.ends_with("and 950 more problems; looking stopped after 1000"), "{shown}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_text_loads_or_is_explained(text in "\\PC{0,200}|([a-z\\[\\].=\"'{}% \n0-9+*/()<-]{0,200})") {
        match load(&[("main.toml", &text)], &Overrides::default()) {
            Ok(recipe) => {
                let mut problems = recipe.problems.clone();
                recipe.scope(&[], &mut problems);
                Diagnostics::new(Arc::clone(&recipe.sources), problems).render(true);
            }
            Err(found) => prop_assert!(!found.render(false).is_empty()),
        }
    }

    #[test]
    fn any_formula_has_a_value_or_an_error_inside_it(text in "[a-c0-9.%+*/()<>=!',\u{e4} -]{0,60}|\\PC{0,40}") {
        let value = expression::parse(&text).and_then(|formula| {
            expression::evaluate(&formula, &|_| Ok(Value::Percent(2.0)))
        });
        if let Err(error) = value {
            prop_assert!(error.range.start <= error.range.end && error.range.end <= text.len());
            prop_assert!(text.get(error.range).is_some());
        }
    }

    #[test]
    fn any_formula_in_a_recipe_is_underlined(text in "[a-c0-9.%+*/()<>=!,\\\\\u{e4} -]{0,60}") {
        let recipe = one(&format!("[params]\nx = '''={text}'''\ny = '={text}'\n"));
        let mut problems = recipe.problems.clone();
        recipe.scope(&[], &mut problems);
        Diagnostics::new(Arc::clone(&recipe.sources), problems).render(false);
    }
}
