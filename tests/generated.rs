//! Files made from the code are up to date, and recipes agree with the schema by the word of an independent library.
//!
//! `UPDATE_SCHEMAS=1 cargo test --test generated` writes them.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use meshmill::criteria::{LEVEL_KEYS, OWN_KEYS};
use meshmill::format::Format;
use meshmill::plan::{CHECK_KEYS, CRITERIA_KEYS, ELEMENTS, LIMIT_KEYS, LIMITS_KEYS, METRIC_ENDINGS, OUTPUT_KEYS};
use meshmill::report::json;
use meshmill::schema::{
    criteria_schema, criteria_schema_text, nested_tables, recipe_schema, recipe_schema_text, steps_reference,
};
use meshmill::step::parameters::ParameterSchema;
use meshmill::steps::CATALOG;
use serde_json::Value;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn endings() -> Vec<&'static str> {
    Format::ALL.iter().flat_map(|format| format.endings()).copied().chain(METRIC_ENDINGS).collect()
}

fn compare(file: &str, generated: &str) {
    let path = root().join(file);
    if std::env::var_os("UPDATE_SCHEMAS").is_some() {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, generated).unwrap();
    }
    let found = fs::read_to_string(&path).unwrap_or_default().replace("\r\n", "\n");
    assert!(found == generated, "`{file}` is out of date: run UPDATE_SCHEMAS=1 cargo test --test generated");
}

#[test]
fn schema_is_up_to_date() {
    compare("schemas/recipe.schema.json", &recipe_schema_text(CATALOG, &endings()));
}

#[test]
fn the_schema_of_what_is_printed_is_up_to_date() {
    assert!(jsonschema::draft7::meta::is_valid(&json::schema()));
    compare("schemas/output.schema.json", &json::schema_text());
}

#[test]
fn the_schema_of_criteria_is_up_to_date_and_shipped_criteria_agree_with_it() {
    let schema = criteria_schema();
    assert!(jsonschema::draft7::meta::is_valid(&schema));
    compare("schemas/criteria.schema.json", &criteria_schema_text());
    let validator = jsonschema::draft7::new(&schema).unwrap();
    let files = recipes("pipelines/criteria");
    assert_eq!(files.len(), 3);
    for file in files {
        let criteria: Value = toml::from_str(&fs::read_to_string(&file).unwrap()).unwrap();
        let faults: Vec<String> = validator.iter_errors(&criteria).map(|error| error.to_string()).collect();
        assert_eq!(faults, [""; 0], "{}", file.display());
    }
    let limits = recipe_schema(CATALOG, &endings()).pointer("/properties/limits/properties").cloned().unwrap();
    assert!(
        LIMITS_KEYS.iter().all(|key| limits.get(key).is_some())
            && limits.as_object().unwrap().len() == LIMITS_KEYS.len()
    );
    let own = limits.pointer("/steps/additionalProperties/properties").and_then(Value::as_object).unwrap();
    assert_eq!(own.keys().map(String::as_str).collect::<Vec<_>>(), LIMIT_KEYS);
    let keys: BTreeSet<&str> = schema["properties"].as_object().unwrap().keys().map(String::as_str).collect();
    assert!(OWN_KEYS.iter().filter(|key| **key != "file").all(|key| keys.contains(key)));
    let levels = schema.pointer("/definitions/NumberCriterion/anyOf/1/properties").and_then(Value::as_object).unwrap();
    assert_eq!(levels.keys().map(String::as_str).collect::<BTreeSet<_>>(), BTreeSet::from(LEVEL_KEYS));
    let recipe = recipe_schema(CATALOG, &endings());
    let of_gate = recipe.pointer("/definitions/Gate/properties/criteria/anyOf/0/anyOf/1/properties").unwrap();
    let of_gate: BTreeSet<&str> = of_gate.as_object().unwrap().keys().map(String::as_str).collect();
    assert_eq!(of_gate, BTreeSet::from(CRITERIA_KEYS));
}

#[test]
fn reference_is_up_to_date() {
    compare("schemas/steps.md", &steps_reference(CATALOG));
}

fn recipes(folder: &str) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = fs::read_dir(root().join(folder))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "toml"))
        .collect();
    files.sort();
    files
}

fn faults(file: &Path) -> Vec<String> {
    let recipe: Value = toml::from_str(&fs::read_to_string(file).unwrap()).unwrap();
    let validator = jsonschema::draft7::new(&recipe_schema(CATALOG, &endings())).unwrap();
    validator.iter_errors(&recipe).map(|error| format!("{}: {error}", error.instance_path())).collect()
}

#[test]
fn the_schema_is_a_schema() {
    assert!(jsonschema::draft7::meta::is_valid(&recipe_schema(CATALOG, &endings())));
}

#[test]
fn shipped_recipes_agree_with_the_schema() {
    let files = [recipes("pipelines"), recipes("tests/recipes")].concat();
    assert!(files.len() >= 4);
    for file in files {
        assert_eq!(faults(&file), [""; 0], "{}", file.display());
    }
}

#[test]
fn the_schema_refuses_what_the_planner_refuses_by_form() {
    for name in ["unknown-step", "unknown-key", "wrong-type"] {
        let file = root().join(format!("tests/recipes/wrong/{name}.toml"));
        assert_ne!(faults(&file), [""; 0], "{name}");
    }
}

#[test]
fn schema_and_planner_know_the_same_keys() {
    let schema = recipe_schema(CATALOG, &endings());
    let keys = |pointer: &str| -> BTreeSet<String> {
        schema.pointer(pointer).and_then(Value::as_object).unwrap().keys().cloned().collect()
    };
    let set = |keys: &[&str]| -> BTreeSet<String> { keys.iter().map(|key| (*key).to_owned()).collect() };
    assert_eq!(keys("/definitions/NumberCheck/anyOf/1/properties"), set(&CHECK_KEYS));
    assert_eq!(keys("/definitions/Output/anyOf/1/properties"), set(&OUTPUT_KEYS));
    let elements = schema.pointer("/definitions/Output/anyOf/1/properties/element/anyOf/0/enum").unwrap();
    assert_eq!(elements, &serde_json::json!(ELEMENTS));
}

#[test]
fn every_nested_table_has_an_example_that_the_step_reads() {
    let mut seen = 0;
    for def in CATALOG {
        let parameters = ParameterSchema::of(def);
        for name in parameters.properties.keys() {
            for table in nested_tables(name, &parameters) {
                seen += 1;
                let recipe: Result<toml::Table, _> = toml::from_str(&table.example);
                assert!(recipe.is_ok_and(|recipe| recipe.contains_key(name)), "{}: {name}", def.name);
                let text = format!("{{ {} }}", table.example);
                let value = toml::de::ValueDeserializer::parse(&text).unwrap();
                // Other parameters may be missing; this one must be right.
                if let Err(error) = (def.bind)(value) {
                    assert!(error.message().starts_with("missing field"), "{}: {name}: {error}", def.name);
                }
            }
        }
    }
    assert!(seen > 12, "{seen}");
}
