//! Bundles: what a run was made of and gave, computed again anywhere, and no way to do harm with one.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use meshmill::report::bundle::archive;
use predicates::prelude::*;
use serde_json::{Value, json};

#[path = "common/desk.rs"]
mod desk;
#[path = "common/runs.rs"]
mod runs;

use desk::Desk;
use runs::CUBE;

const BASE: &str = r#"
[params]
times = 1
limit = 0.1
[steps.raw]
use = "read"
file = "=inputs.part"
[steps.clean]
use = "repair"
from = "raw"
[steps.fine]
use = "subdivide"
from = "clean"
times = "=times"
[gates.fine]
closed = true
min-stretch = { at-least = "=limit" }
criteria = "lab"
[criteria.lab]
file = "lab.criteria.toml"
[outputs]
fine = "result.stl"
clean = "deep/clean.obj"
"#;

const RECIPE: &str = "name = \"part\"\nextends = \"lab/base.toml\"\n[inputs]\npart = \"parts/none.obj\"\n";
const CRITERIA: &str = "max-tria-angle = { ideal = 60, good = 80, warn = 120, fail = 160, worst = 180 }\n";

impl Desk {
    fn new() -> Self {
        Self::with(&[
            ("recipe.toml", RECIPE),
            ("lab/base.toml", BASE),
            ("lab/lab.criteria.toml", CRITERIA),
            ("parts/cube.obj", CUBE),
        ])
    }

    /// A desk with a bundle of a run.
    fn bundled(more: &[&str]) -> Self {
        let desk = Self::new();
        let report = desk.report(0, &["--input", "part=parts/cube.obj", "--set", "times=2"]);
        assert_eq!(report["cases"][0]["inputs"], json!({ "part": "parts/cube.obj" }));
        desk.bundle(more).success();
        desk
    }

    fn bundle(&self, more: &[&str]) -> assert_cmd::assert::Assert {
        let usual = ["bundle", "out/part", "--out", "part.zip", "--date", "2026-01-31"];
        self.meshmill(&usual).args(more).assert()
    }

    fn verify(&self, more: &[&str]) -> assert_cmd::assert::Assert {
        self.meshmill(&["verify", "part.zip"]).args(more).assert()
    }

    fn members(&self) -> archive::Members {
        archive::read(&fs::read(self.path("part.zip")).unwrap()).unwrap()
    }

    /// Changes the members of the bundle.
    fn change(&self, change: &dyn Fn(&mut archive::Members)) {
        let mut members = self.members();
        change(&mut members);
        fs::write(self.path("part.zip"), archive::write(&members).unwrap()).unwrap();
    }
}

fn replace(members: &mut archive::Members, name: &str, from: &str, to: &str) {
    let text = String::from_utf8(members[name].clone()).unwrap();
    assert!(text.contains(from), "{name} has no {from}");
    members.insert(name.to_owned(), text.replacen(from, to, 1).into_bytes());
}

#[test]
fn a_bundle_holds_everything_and_is_verified_elsewhere() {
    let desk = Desk::bundled(&[]);
    let members = desk.members();
    let names: Vec<&str> = members.keys().map(String::as_str).collect();
    assert_eq!(
        names,
        [
            "files/lab/base.toml",
            "files/lab/lab.criteria.toml",
            "files/parts/cube.obj",
            "files/recipe.toml",
            "lock.ron",
            "meshmill.json",
            "metrics.json",
            "outputs/deep/clean.obj",
            "outputs/result.stl",
            "ro-crate-metadata.json"
        ]
    );
    assert_eq!(members["outputs/result.stl"], fs::read(desk.path("out/part/result.stl")).unwrap());
    let manifest: Value = serde_json::from_slice(&members["meshmill.json"]).unwrap();
    assert_eq!(
        (&manifest["set"], &manifest["inputs"]),
        (&json!({ "times": "2" }), &json!({ "part": "files/parts/cube.obj" }))
    );
    let crated: Value = serde_json::from_slice(&members["ro-crate-metadata.json"]).unwrap();
    let entities = crated["@graph"].as_array().unwrap();
    let entity = |id: &str| entities.iter().find(|entity| entity["@id"] == id).unwrap();
    // Each member but the metadata is a part of the root and a file entity of its own.
    let parts = entity("./")["hasPart"].as_array().unwrap();
    assert_eq!(parts.len(), names.len() - 1);
    for part in parts {
        let content = &members[part["@id"].as_str().unwrap()];
        let file = entity(part["@id"].as_str().unwrap());
        assert_eq!(file["contentSize"], content.len().to_string());
        assert_eq!(file["identifier"], format!("blake3:{}", blake3::hash(content).to_hex()));
    }
    let ids: BTreeSet<&str> = entities.iter().map(|entity| entity["@id"].as_str().unwrap()).collect();
    assert_eq!(ids.len(), entities.len(), "an identifier is there twice");
    assert_eq!(entity("#metric/fine/faces")["value"], 192);
    assert_eq!(entity(entity("./")["license"]["@id"].as_str().unwrap())["name"], "no licence is stated");
    assert!(entity("./").get("author").is_none());
    let (root, described) = (entity("./"), entity("ro-crate-metadata.json"));
    assert_eq!((&root["datePublished"], &described["about"]["@id"]), (&json!("2026-01-31"), &json!("./")));
    // Nothing but the bundle is there.
    let other = Desk::with(&[]);
    fs::copy(desk.path("part.zip"), other.path("part.zip")).unwrap();
    other.verify(&[]).success().stdout(predicate::str::contains("3 results and 2 files are equal byte by byte"));
    let left: Vec<_> = fs::read_dir(other.path("")).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left, ["part.zip"]);
}

#[test]
fn a_bundle_says_who_made_it_under_which_licence() {
    let license = "https://example.org/licence";
    let desk = Desk::bundled(&["--author", "Ada \"A\" Muster", "--publisher", "Lab", "--license", license]);
    let crated: Value = serde_json::from_slice(&desk.members()["ro-crate-metadata.json"]).unwrap();
    let entities = crated["@graph"].as_array().unwrap();
    let entity = |id: &str| entities.iter().find(|entity| entity["@id"] == id).unwrap();
    let of_root = |key: &str| entity(entity("./")[key]["@id"].as_str().unwrap());
    assert_eq!(
        (&of_root("author")["name"], &of_root("author")["@type"]),
        (&json!("Ada \"A\" Muster"), &json!("Person"))
    );
    assert_eq!(of_root("publisher")["@type"], "Organization");
    assert_eq!((&of_root("license")["@id"], &of_root("license")["@type"]), (&json!(license), &json!("CreativeWork")));
}

#[test]
fn equal_runs_give_equal_bundles() {
    let (first, second) = (Desk::bundled(&[]), Desk::bundled(&[]));
    let bytes = |desk: &Desk| fs::read(desk.path("part.zip")).unwrap();
    assert_eq!(bytes(&first), bytes(&second));
    first.bundle(&["--jobs", "3"]).code(2);
    first.run(&["--input", "part=parts/cube.obj", "--set", "times=2", "--force", "fine", "--jobs", "1"]).success();
    first.bundle(&[]).success();
    assert_eq!(bytes(&first), bytes(&second));
}

#[test]
fn what_differs_is_told_with_5() {
    let said = |change: &dyn Fn(&mut archive::Members), lines: &[&str]| {
        let desk = Desk::bundled(&[]);
        desk.change(change);
        let assert = desk.verify(&[]).code(5);
        let text = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
        for line in lines {
            assert!(text.contains(line), "{line}: {text}");
        }
    };
    let other = "outputs/deep/clean.obj";
    said(
        &|members| replace(members, other, "v 0 0 0", "v 0 0 1"),
        &["outputs/deep/clean.obj: the file in the bundle is not"],
    );
    said(
        &|members| replace(members, "files/parts/cube.obj", "v 0 1 1", "v 0 1 2"),
        &[
            "raw: the file `file` changed",
            "fine: result locked as",
            "fine.min-stretch: locked",
            "file result.stl: locked as",
        ],
    );
    said(
        &|members| replace(members, "files/lab/base.toml", "limit = 0.1", "limit = 0.2"),
        &["parameter limit: locked 0.1, now 0.2"],
    );
    said(
        &|members| replace(members, "metrics.json", "\"faces\": ", "\"faces\": 1"),
        &["metrics.json: does not say what the lock says"],
    );
    said(&|members| replace(members, "files/lab/base.toml", "limit = 0.1", "limit = 0.99"), &["gate"]);
    said(&|members| replace(members, "lock.ron", "\"faces\": Count(", "\"faces\": Count(1"), &["faces: locked 1"]);
}

#[test]
fn inputs_may_be_told_by_their_hashes() {
    let desk = Desk::bundled(&["--hashes-only"]);
    assert!(!desk.members().contains_key("files/parts/cube.obj"));
    desk.verify(&[]).code(2).stderr(predicate::str::contains("--inputs DIR"));
    desk.verify(&["--inputs", "parts"]).success();
    desk.verify(&["--inputs", "."]).success();
    desk.verify(&["--inputs", "lab"]).code(2).stderr(predicate::str::contains("has no parts/cube.obj"));
    desk.write("parts/cube.obj", &CUBE.replace("v 0 1 1", "v 0 1 2"));
    desk.verify(&["--inputs", "parts"])
        .code(5)
        .stderr(predicate::str::contains("this is not the input that was locked"));
}

#[test]
fn the_class_of_a_bundle_decides_what_is_equal() {
    let nearby = |members: &mut archive::Members| {
        let lock = String::from_utf8(members["lock.ron"].clone()).unwrap();
        let digits = lock.split("\"min-stretch\": Number(").nth(1).unwrap().split(')').next().unwrap().to_owned();
        let other = (digits.parse::<f64>().unwrap() * 1.001).to_string();
        for name in ["lock.ron", "metrics.json"] {
            let text = String::from_utf8(members[name].clone()).unwrap();
            members.insert(name.to_owned(), text.replace(&digits, &other).into_bytes());
        }
    };
    for (class, code) in [("bytes", 5), ("metrics", 5), ("tolerance", 0)] {
        let desk = Desk::bundled(&["--class", class, "--tolerance", "0.01"]);
        desk.change(&nearby);
        desk.verify(&[]).code(code);
    }
}

#[test]
fn only_a_whole_run_that_is_still_there_is_bundled() {
    let desk = Desk::bundled(&[]);
    let refused = |said: &str| desk.bundle(&[]).code(2).stderr(predicate::str::contains(said.to_owned()));
    desk.write("out/part/deep/clean.obj", "v 0 0 0\n");
    refused("is not what the run wrote");
    desk.write("parts/cube.obj", &CUBE.replace("v 0 1 1", "v 0 1 2"));
    refused("raw: its file is not what it was");
    let run = ["--input", "part=parts/cube.obj", "--set", "limit=0.99"];
    desk.run(&run).code(3);
    refused("every gate held");
    desk.meshmill(&["bundle", "lab", "--out", "x.zip"]).assert().code(2);
    desk.write("lab/run.ron", "no record");
    desk.meshmill(&["bundle", "lab", "--out", "x.zip"]).assert().code(2);
    // Nothing that the run reads is replaced.
    desk.run(&run[..2]).success();
    desk.meshmill(&["bundle", "out/part", "--out", "parts/cube.obj"]).assert().code(2);
    desk.meshmill(&["bundle", "out/part", "--out", "recipe.toml"]).assert().code(2);
    assert!(desk.text("recipe.toml") == RECIPE && desk.text("parts/cube.obj").starts_with("v "));
}

#[test]
fn a_bundle_that_cannot_be_read_ends_with_2() {
    let desk = Desk::bundled(&[]);
    let whole = fs::read(desk.path("part.zip")).unwrap();
    let cut = |bytes: &[u8]| {
        fs::write(desk.path("part.zip"), bytes).unwrap();
        desk.verify(&[]).code(2).stderr(predicate::str::contains("part.zip is no bundle"));
    };
    for bytes in [&[][..], b"PK", &whole[..whole.len() / 2], &whole[..whole.len() - 1], &whole[5..]] {
        cut(bytes);
    }
    let mut damaged = whole.clone();
    damaged[whole.len() / 3] ^= 0xff;
    cut(&damaged);
    for other in ["nothing.zip", "lab", "/dev/zero"] {
        desk.meshmill(&["verify", other]).assert().code(2);
    }
    let changes: BTreeMap<&str, (&str, &str)> = BTreeMap::from([
        ("ro-crate-metadata.json", ("{", "[")),
        ("meshmill.json", ("\"layout\": 1", "\"layout\": 2")),
        ("lock.ron", ("(", "((((")),
        ("metrics.json", ("{", "{{")),
    ]);
    for (name, (from, to)) in changes {
        fs::write(desk.path("part.zip"), &whole).unwrap();
        desk.change(&|members| replace(members, name, from, to));
        desk.verify(&[]).code(2);
        fs::write(desk.path("part.zip"), &whole).unwrap();
        desk.change(&|members| drop(members.remove(name)));
        desk.verify(&[]).code(2).stderr(predicate::str::contains(format!("it has no {name}")));
    }
    for name in ["outputs/result.stl", "files/recipe.toml", "files/parts/cube.obj"] {
        fs::write(desk.path("part.zip"), &whole).unwrap();
        desk.change(&|members| drop(members.remove(name)));
        desk.verify(&[]).code(2).stderr(predicate::str::contains(name));
    }
}

#[test]
fn a_bundle_reads_nothing_outside_of_itself() {
    let desk = Desk::bundled(&[]);
    let secret = desk.path("secret.obj");
    desk.write("secret.obj", CUBE);
    desk.write("secret.toml", BASE);
    let whole = fs::read(desk.path("part.zip")).unwrap();
    let outside = secret.with_extension("toml");
    for (name, from, to) in [
        ("files/recipe.toml", "lab/base.toml", outside.to_str().unwrap()),
        ("files/recipe.toml", "lab/base.toml", "../../../../../../../../etc/passwd"),
        ("files/lab/base.toml", "=inputs.part", secret.to_str().unwrap()),
        ("files/lab/base.toml", "=inputs.part", "/dev/zero"),
        ("meshmill.json", "files/parts/cube.obj", "../secret.obj"),
        ("meshmill.json", "files/parts/cube.obj", secret.to_str().unwrap()),
        ("meshmill.json", "files/recipe.toml", "files/../../recipe.toml"),
        ("meshmill.json", "\"left_out\": {}", "\"left_out\": { \"files/lab\": \"00\" }"),
        ("meshmill.json", "\"left_out\": {}", "\"left_out\": { \"files/../x\": \"00\" }"),
    ] {
        fs::write(desk.path("part.zip"), &whole).unwrap();
        desk.change(&|members| replace(members, name, from, to));
        desk.verify(&[]).code(2);
    }
}
