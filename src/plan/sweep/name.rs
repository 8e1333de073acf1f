//! Names of cases: folders that say what is special about them.
//!
//! A name depends on the values of its case alone, so that a case keeps its folder whatever else is in the sweep. A
//! file is named by its path from the recipe's folder, `parts+bracket.stl` for `parts/bracket.stl`. Where a name cannot
//! hold all of the values, as for a file elsewhere, a few digits of their hash stand at its end. Only cases of equal
//! values are numbered.

use std::collections::BTreeSet;
use std::path::{Component, Path};

use crate::recipe::{Node, Tree};

/// Longer names are cut.
const LONGEST: usize = 100;
/// Digits of a hash that tell two names apart.
const DIGITS: usize = 8;

/// The names given so far, lower case, since some file systems do not tell cases apart.
pub(super) struct Names<'a> {
    taken: BTreeSet<String>,
    /// The folder of the recipe.
    folder: &'a Path,
}

impl<'a> Names<'a> {
    /// No names yet, for a recipe in this folder.
    pub(super) fn new(folder: &'a Path) -> Self {
        Self { taken: BTreeSet::new(), folder }
    }

    /// A name made of the values: `size-2pct_tolerance-0.1pct`.
    pub(super) fn of(&mut self, params: &[(String, Tree)]) -> String {
        let (mut name, mut whole, mut is_whole) = (String::new(), blake3::Hasher::new(), true);
        for (parameter, value) in params {
            let text = text(value, self.folder);
            let shown = shown(&text, value);
            let separator = if name.is_empty() { "" } else { "_" };
            let parameter = parameter.strip_prefix("inputs.").unwrap_or(parameter);
            name.extend([separator, parameter, "-", &shown.text]);
            is_whole &= shown.is_whole;
            for part in [parameter, &text] {
                whole.update(&(part.len() as u64).to_le_bytes());
                whole.update(part.as_bytes());
            }
        }
        if name.is_empty() {
            "case".clone_into(&mut name);
        }
        if !is_whole || name.len() > LONGEST {
            let end = (0..LONGEST - DIGITS).rev().find(|at| name.is_char_boundary(*at)).unwrap_or(0);
            name.truncate(end.min(name.len()));
            name.push('-');
            name.push_str(&whole.finalize().to_hex()[..DIGITS]);
        }
        let mut unique = name.clone();
        let mut number = 2;
        while !self.take(&unique) {
            unique = format!("{name}_{number}");
            number += 1;
        }
        unique
    }

    /// Takes a name; false when a case has it already.
    pub(super) fn take(&mut self, name: &str) -> bool {
        self.taken.insert(name.to_lowercase())
    }
}

/// Whether a text can be the folder of a case.
pub(super) fn is_folder(name: &str) -> bool {
    let fits = |c: char| c.is_alphanumeric() || "-_=.".contains(c);
    !name.is_empty() && name.len() <= LONGEST && !name.starts_with('.') && name.chars().all(fits)
        // What a sweep writes itself.
        && !["run.ron", "sweep.csv", "sweep.ron", "failed"].contains(&name.to_lowercase().as_str())
}

fn text(value: &Tree, folder: &Path) -> String {
    match &value.value {
        Node::Text(text) | Node::Number(text) => text.clone(),
        Node::Bool(value) => value.to_string(),
        Node::File(path) => path_text(path.strip_prefix(folder).unwrap_or(path)),
        Node::Date(_) | Node::List(_) | Node::Table(_) => String::new(),
    }
}

/// A path with `/` between its parts, on every system.
fn path_text(path: &Path) -> String {
    let part = |part: Component<'_>| match part {
        Component::CurDir => None,
        Component::RootDir => Some(String::new()),
        other => Some(other.as_os_str().to_string_lossy().into_owned()),
    };
    path.components().filter_map(part).collect::<Vec<_>>().join("/")
}

struct Plain {
    text: String,
    /// Whether no other value gives this text.
    is_whole: bool,
}

/// What of a value stands in a name. Of a file elsewhere, where it lies would say more about the machine.
fn shown(text: &str, value: &Tree) -> Plain {
    match (&value.value, text.rsplit_once('/')) {
        (Node::File(_), Some((folder, name))) if folder.starts_with("..") || Path::new(text).is_absolute() => {
            Plain { is_whole: false, ..plain(name) }
        }
        _ => plain(text),
    }
}

/// Only letters that every file system and shell takes.
fn plain(text: &str) -> Plain {
    let (mut plain, mut is_whole) = (String::new(), true);
    for letter in text.chars() {
        match letter {
            '%' => plain.push_str("pct"),
            '/' => plain.push('+'),
            letter if letter.is_alphanumeric() || "-_.".contains(letter) => plain.push(letter),
            _ => is_whole = false,
        }
    }
    Plain { text: plain, is_whole }
}
