//! The house rules that a compiler does not check: layers, file length, one stem a step, formatting.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

#[path = "tidy/circles.rs"]
mod circles;

/// Which top-level modules each may import. `watch` and `terminal` are open to all.
const LAYERS: &[(&str, &[&str])] = &[
    ("watch", &[]),
    ("terminal", &[]),
    ("mesh", &[]),
    ("recipe", &[]),
    ("format", &["mesh"]),
    ("metric", &["mesh"]),
    ("criteria", &["metric", "recipe"]),
    ("technique", &["mesh", "metric"]),
    ("step", &["mesh", "metric"]),
    ("steps", &["mesh", "metric", "technique", "step"]),
    ("plan", &["recipe", "criteria", "step", "mesh", "metric"]),
    ("store", &["step", "mesh", "metric"]),
    ("schema", &["step", "metric", "criteria"]),
    ("run", &["plan", "store", "step", "metric", "format", "mesh", "recipe"]),
    ("report", &["run", "step", "metric", "mesh", "technique"]),
    (
        "cli",
        &[
            "report",
            "run",
            "plan",
            "criteria",
            "store",
            "schema",
            "steps",
            "step",
            "technique",
            "metric",
            "format",
            "recipe",
            "mesh",
        ],
    ),
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn rust_files(folder: &str) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![root().join(folder)];
    while let Some(folder) = folders.pop() {
        let Ok(entries) = fs::read_dir(&folder) else { continue };
        for entry in entries.flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}

fn relative(path: &Path) -> String {
    path.strip_prefix(root()).unwrap_or(path).to_string_lossy().replace('\\', "/")
}

/// The first module below `src` that a file belongs to: `steps` for `src/steps/repair/weld.rs`.
fn top_module(file: &str) -> Option<&str> {
    let inside = file.strip_prefix("src/")?;
    let first = inside.split('/').next()?;
    Some(first.strip_suffix(".rs").unwrap_or(first))
}

/// The code of a line: no comment, and nothing after the unit tests of a file began.
fn code_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines()
        .enumerate()
        .take_while(|(_, line)| !line.starts_with("#[cfg(test)]"))
        .map(|(number, line)| (number + 1, line.split("//").next().unwrap_or("")))
}

/// The modules named by `crate::a::b` paths and by `use crate::{a::b, c}` groups on a line.
fn imports(line: &str) -> Vec<String> {
    let mut found = Vec::new();
    for part in line.split("crate::").skip(1) {
        if let Some(group) = part.strip_prefix('{') {
            found.extend(top_names(group));
        } else {
            found.push(path_of(part));
        }
    }
    found
}

fn path_of(text: &str) -> String {
    text.chars().take_while(|c| c.is_alphanumeric() || *c == '_' || *c == ':').collect()
}

/// The paths at the first level of an import group.
fn top_names(group: &str) -> Vec<String> {
    let (mut depth, mut start, mut names) = (0_i32, 0, Vec::new());
    for (at, letter) in group.char_indices() {
        match letter {
            '{' => depth += 1,
            '}' if depth == 0 => {
                names.push(path_of(group[start..at].trim()));
                return names;
            }
            '}' => depth -= 1,
            ',' if depth == 0 => {
                names.push(path_of(group[start..at].trim()));
                start = at + 1;
            }
            _ => {}
        }
    }
    names.push(path_of(group[start..].trim()));
    names.retain(|n| !n.is_empty());
    names
}

fn forbidden(file: &str, module: &str, target: &str) -> bool {
    if target == module || ["watch", "terminal"].contains(&target) || module == "main" || module == "lib" {
        return false;
    }
    let Some((_, allowed)) = LAYERS.iter().find(|(name, _)| *name == module) else { return true };
    let read_may_use_formats = target == "format" && file == "src/steps/read.rs";
    LAYERS.iter().any(|(name, _)| *name == target) && !allowed.contains(&target) && !read_may_use_formats
}

/// As wide as rustfmt makes code; it leaves comments alone.
const WIDTH: usize = 120;

#[test]
fn comments_are_no_wider_than_code() {
    let mut faults = Vec::new();
    for path in ["src", "tests", "benches", "examples"].into_iter().flat_map(rust_files) {
        let text = fs::read_to_string(&path).expect("readable source");
        let comments = text.lines().enumerate().filter(|(_, line)| line.trim_start().starts_with("//"));
        let wide = comments.filter(|(_, line)| line.chars().count() > WIDTH);
        faults.extend(wide.map(|(number, _)| format!("{}:{}", relative(&path), number + 1)));
    }
    assert!(faults.is_empty(), "comments wider than {WIDTH}:\n{}", faults.join("\n"));
}

#[test]
fn imports_point_only_downwards() {
    let mut faults = Vec::new();
    for path in rust_files("src") {
        let file = relative(&path);
        let module = top_module(&file).unwrap_or_default().to_owned();
        assert!(
            LAYERS.iter().any(|(name, _)| *name == module) || module == "main" || module == "lib",
            "{file}: the module `{module}` has no place in the layer table"
        );
        let text = fs::read_to_string(&path).expect("readable source");
        for (number, line) in code_lines(&text) {
            for import in imports(line) {
                let target = import.split("::").next().unwrap_or_default();
                if forbidden(&file, &module, target) {
                    faults.push(format!("{file}:{number}: `{module}` may not use `{target}`"));
                }
            }
        }
    }
    assert!(faults.is_empty(), "imports against the layers:\n{}", faults.join("\n"));
}

/// The room of a step or technique: `repair` for `src/steps/repair/weld.rs`.
fn room<'a>(file: &'a str, folder: &str) -> Option<&'a str> {
    let inside = file.strip_prefix(folder)?;
    let first = inside.split('/').next()?;
    let name = first.strip_suffix(".rs").unwrap_or(first);
    (name != "mod").then_some(name)
}

#[test]
fn no_step_uses_another_step() {
    let mut faults = Vec::new();
    for path in rust_files("src/steps") {
        let file = relative(&path);
        let Some(own) = room(&file, "src/steps/") else { continue };
        let text = fs::read_to_string(&path).expect("readable source");
        for (number, line) in code_lines(&text) {
            for import in imports(line) {
                let other = import.strip_prefix("steps::").map(|rest| rest.split("::").next().unwrap_or_default());
                if other.is_some_and(|other| other != own) {
                    faults.push(format!("{file}:{number}: step `{own}` uses `{import}`"));
                }
            }
        }
    }
    assert!(faults.is_empty(), "steps that use another step:\n{}", faults.join("\n"));
}

#[test]
fn techniques_form_no_circle() {
    let mut uses: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for path in rust_files("src/technique") {
        let file = relative(&path);
        let Some(own) = room(&file, "src/technique/") else { continue };
        let text = fs::read_to_string(&path).expect("readable source");
        for (_, line) in code_lines(&text) {
            for import in imports(line) {
                if let Some(rest) = import.strip_prefix("technique::") {
                    let other = rest.split("::").next().unwrap_or_default();
                    if other != own {
                        uses.entry(own.to_owned()).or_default().insert(other.to_owned());
                    }
                }
            }
        }
    }
    let nodes: Vec<String> = uses.keys().cloned().collect();
    for start in &nodes {
        let (mut seen, mut stack) = (BTreeSet::new(), vec![start.clone()]);
        while let Some(node) = stack.pop() {
            for next in uses.get(&node).into_iter().flatten() {
                assert!(next != start, "technique `{start}` uses itself through `{node}`");
                if seen.insert(next.clone()) {
                    stack.push(next.clone());
                }
            }
        }
    }
}

/// The one door of guarded edits: its fields are open to its own folder only, so that nothing else can change the mesh.
#[test]
fn guarded_meshes_have_one_door() {
    let mut faults = Vec::new();
    for path in rust_files("src/technique/guarded") {
        let text = fs::read_to_string(&path).expect("readable source");
        for (number, line) in code_lines(&text) {
            let is_open = line.contains("pub(in crate::technique)") || line.contains("pub(crate)");
            if is_open {
                faults.push(format!("{}:{number}: open beyond the folder", relative(&path)));
            }
        }
    }
    let door = fs::read_to_string(root().join("src/technique/guarded/mesh.rs")).expect("the guarded mesh");
    let (_, body) = door.split_once("pub struct GuardedMesh<'a> {").expect("its type");
    let fields = body.split_once("\n}").map_or(body, |(fields, _)| fields);
    let open = fields.lines().filter(|line| line.trim_start().starts_with("pub "));
    faults.extend(open.map(|line| format!("src/technique/guarded/mesh.rs: the field `{}` is public", line.trim())));
    let rooms = fs::read_to_string(root().join("src/technique/guarded/mod.rs")).expect("its folder");
    let doors = code_lines(&rooms).filter(|(_, line)| line.trim_start().starts_with("pub mod"));
    faults.extend(doors.map(|(number, _)| format!("src/technique/guarded/mod.rs:{number}: a module is public")));
    assert!(faults.is_empty(), "ways round the door:\n{}", faults.join("\n"));
}

/// Collapse is below remeshing, and both below the steps; the guarded mesh knows none of them.
#[test]
fn guarded_edits_are_used_from_above_only() {
    for (own, above) in [("guarded", &["collapse", "remesh"][..]), ("collapse", &["remesh"])] {
        for path in rust_files(&format!("src/technique/{own}")) {
            let text = fs::read_to_string(&path).expect("readable source");
            for (number, line) in code_lines(&text) {
                let used = above.iter().find(|other| line.contains(&format!("technique::{other}")));
                assert!(used.is_none(), "{}:{number}: `{own}` uses `{used:?}`", relative(&path));
            }
        }
    }
}

#[test]
fn no_file_is_longer_than_500_lines() {
    let mut faults = Vec::new();
    for folder in ["src", "tests", "examples", "benches"] {
        for path in rust_files(folder) {
            let lines = fs::read_to_string(&path).expect("readable source").lines().count();
            if lines > 500 {
                faults.push(format!("{}: {lines} lines", relative(&path)));
            }
        }
    }
    assert!(faults.is_empty(), "files over 500 lines:\n{}", faults.join("\n"));
}

#[test]
fn every_source_file_says_what_it_is() {
    let faults: Vec<String> = rust_files("src")
        .iter()
        .filter(|path| !fs::read_to_string(path).expect("readable source").trim_start().starts_with("//!"))
        .map(|path| relative(path))
        .collect();
    assert!(faults.is_empty(), "files without a head comment:\n{}", faults.join("\n"));
}

#[test]
fn every_step_is_one_room_one_line_and_one_stem() {
    let list = fs::read_to_string(root().join("src/steps/mod.rs")).expect("the list of steps");
    for step in meshmill::steps::CATALOG {
        let stem = step.name.replace('-', "_");
        let file = root().join(format!("src/steps/{stem}.rs"));
        let folder = root().join(format!("src/steps/{stem}/mod.rs"));
        let room = if file.exists() { file } else { folder };
        let text = fs::read_to_string(&room).unwrap_or_else(|_| panic!("step `{}` has no room {stem}", step.name));
        assert!(list.contains(&format!("StepDef::of::<{stem}::")), "step `{}` is not a line of the list", step.name);
        assert!(text.contains(&format!("pub fn {stem}")), "{}: no function `{stem}`", relative(&room));
        for heading in ["# Invariants", "# Cost"] {
            assert!(text.contains(heading), "{}: the head comment has no `{heading}`", relative(&room));
        }
        assert!(text.contains("Based on:") || text.contains("Folklore"), "{}: no source cited", relative(&room));
    }
}

#[test]
fn import_parser_sees_paths_and_groups() {
    assert_eq!(imports("use crate::mesh::{Soup, Surface};"), ["mesh::"]);
    assert_eq!(imports("use crate::{mesh::{Soup, id}, step::Port};"), ["mesh::", "step::Port"]);
    assert_eq!(imports("let x = crate::plan::key(crate::store::open());"), ["plan::key", "store::open"]);
    assert!(imports("fn crate_name() {}").is_empty());
}
