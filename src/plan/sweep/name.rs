//! Names of cases: folders that say what is special about them.

use std::collections::BTreeSet;

use crate::recipe::{Node, Tree};

/// Longer names are cut, and a number makes them unique.
const LONGEST: usize = 100;

/// The names given so far, lower case, since some file systems do not tell cases apart.
#[derive(Default)]
pub(super) struct Names(BTreeSet<String>);

impl Names {
    /// A name made of the values: `size-2pct_tolerance-0.1pct`.
    pub(super) fn of(&mut self, params: &[(String, Tree)]) -> String {
        let part = |(name, value): &(String, Tree)| {
            format!("{}-{}", name.strip_prefix("inputs.").unwrap_or(name), plain(&text(value)))
        };
        let mut name = params.iter().map(part).collect::<Vec<_>>().join("_");
        if name.len() > LONGEST {
            let end = (0..=LONGEST).rev().find(|at| name.is_char_boundary(*at)).unwrap_or(0);
            name.truncate(end);
        }
        if name.is_empty() {
            "case".clone_into(&mut name);
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
        self.0.insert(name.to_lowercase())
    }
}

/// Whether a text can be the folder of a case.
pub(super) fn is_folder(name: &str) -> bool {
    let fits = |c: char| c.is_alphanumeric() || "-_=.".contains(c);
    !name.is_empty() && name.len() <= LONGEST && !name.starts_with('.') && name.chars().all(fits)
        // What a sweep writes itself.
        && !["run.ron", "sweep.csv", "sweep.ron", "failed"].contains(&name.to_lowercase().as_str())
}

fn text(value: &Tree) -> String {
    match &value.value {
        Node::Text(text) | Node::Number(text) => text.clone(),
        Node::Bool(value) => value.to_string(),
        Node::File(path) => path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        Node::Date(_) | Node::List(_) | Node::Table(_) => String::new(),
    }
}

/// Only letters that every file system and shell takes.
fn plain(text: &str) -> String {
    let mut plain = String::new();
    for letter in text.chars() {
        match letter {
            '%' => plain.push_str("pct"),
            letter if letter.is_alphanumeric() || "-_.".contains(letter) => plain.push(letter),
            _ => {}
        }
    }
    plain
}
