//! Files that use each other in a circle.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use super::{code_lines, path_of, relative, rust_files};

/// The file of a path, as far as there is one: `crate::run::board::Board` is of `src/run/board.rs`. `super` and names
/// of modules below the file begin at the file's own place.
fn file_of(own: &[String], path: &str, files: &BTreeSet<Vec<String>>) -> Option<Vec<String>> {
    let mut names = path.split("::").peekable();
    let mut at = match names.peek()? {
        &"crate" => {
            names.next();
            Vec::new()
        }
        &"super" => own.to_vec(),
        first => {
            let below = [own, &[(*first).to_owned()]].concat();
            files.contains(&below).then(|| own.to_vec())?
        }
    };
    while names.peek() == Some(&"super") {
        names.next();
        at.pop()?;
    }
    for name in names {
        let below = [&at[..], &[name.to_owned()]].concat();
        if !files.contains(&below) {
            break;
        }
        at = below;
    }
    files.contains(&at).then_some(at)
}

/// All paths of a `use` tree.
fn paths_of(tree: &str) -> Vec<String> {
    let Some((head, group)) = tree.trim().trim_end_matches('}').split_once('{') else {
        return vec![tree.split(" as ").next().unwrap_or_default().trim().to_owned()];
    };
    let (mut depth, mut start, mut parts) = (0_i32, 0, Vec::new());
    for (at, letter) in group.char_indices() {
        match letter {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                parts.push(&group[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    parts.push(&group[start..]);
    let nested = |part: &&str| {
        let open = part.matches('{').count().saturating_sub(part.matches('}').count());
        paths_of(&format!("{part}{}", "}".repeat(open)))
    };
    parts.iter().filter(|part| !part.trim().is_empty()).flat_map(nested).map(|path| head.to_owned() + &path).collect()
}

/// The paths that the code of a file names: its imports, and paths from `crate` or `super` in between.
fn paths_in(text: &str) -> Vec<String> {
    let mut paths = Vec::new();
    let mut import: Option<String> = None;
    for (_, line) in code_lines(text) {
        let start = line.trim_start();
        let is_import = start.starts_with("use ") || (start.starts_with("pub") && start.contains(" use "));
        if let Some(tree) = import.as_mut() {
            tree.push_str(start);
        } else if is_import {
            import = start.split_once("use ").map(|(_, tree)| tree.to_owned());
        } else {
            for root in ["crate::", "super::"] {
                paths.extend(start.match_indices(root).map(|(at, _)| path_of(&start[at..])));
            }
        }
        if import.as_ref().is_some_and(|tree| tree.contains(';')) {
            paths.extend(import.take().iter().flat_map(|tree| paths_of(tree.trim_end_matches(';'))));
        }
    }
    paths
}

/// Files that use each other cannot be read one after the other. A file and those in its folder are one family.
#[test]
fn files_form_no_circle() {
    let name_of = |path: &Path| -> Vec<String> {
        let file = relative(path).trim_start_matches("src/").trim_end_matches(".rs").replace("/mod", "");
        file.split('/').map(str::to_owned).collect()
    };
    let sources = rust_files("src");
    let files: BTreeSet<Vec<String>> = sources.iter().map(|path| name_of(path)).collect();
    let mut uses: BTreeMap<Vec<String>, BTreeSet<Vec<String>>> = BTreeMap::new();
    for path in &sources {
        let own = name_of(path);
        let text = fs::read_to_string(path).expect("readable source");
        let used = paths_in(&text).into_iter().filter_map(|path| file_of(&own, &path, &files));
        let strange = used.filter(|other| !other.starts_with(&own) && !own.starts_with(other)).collect();
        uses.insert(own, strange);
    }
    assert!(uses.values().map(BTreeSet::len).sum::<usize>() > 500, "the imports are not found");
    // What nothing uses, or uses nothing, is in no circle; of the rest the same holds again.
    loop {
        let used: BTreeSet<Vec<String>> = uses.values().flatten().cloned().collect();
        let before = uses.len();
        uses.retain(|file, others| used.contains(file) && !others.is_empty());
        let left: BTreeSet<Vec<String>> = uses.keys().cloned().collect();
        for others in uses.values_mut() {
            others.retain(|other| left.contains(other));
        }
        if uses.len() == before {
            break;
        }
    }
    let show = |(file, others): (&Vec<String>, &BTreeSet<Vec<String>>)| {
        let others: Vec<String> = others.iter().map(|other| other.join("/")).collect();
        format!("{} uses {}", file.join("/"), others.join(", "))
    };
    assert!(uses.is_empty(), "files in circles:\n{}", uses.iter().map(show).collect::<Vec<_>>().join("\n"));
}
