//! Reads a recipe's text and those it extends into one tree whose values remember their file and place.
//!
//! Tables merge key by key; arrays, single values, a step whose `use` differs, and a parameter of another form replace
//! what was there. `drop` takes entries away.

use std::path::{Component, Path, PathBuf};

use toml::de::DeTable;

use super::diagnostic::Diagnostic;
use super::drop;
use super::source::{SourceMap, Span};
use super::tree::{Entry, Node, Table, Tree};

/// Gives the text of a recipe, or says why it cannot.
pub type Loader<'a> = &'a dyn Fn(&Path) -> Result<String, String>;

/// Longer than any recipe a person keeps, in bytes; a mesh given by mistake ends here.
pub const LARGEST: usize = 4 << 20;

/// Recipes that extend each other.
const DEEPEST: usize = 16;

/// Loads `path` and what it extends. Problems that leave a tree are added to `problems`; without a tree, `None`.
pub(super) fn load(
    path: &Path,
    loader: Loader<'_>,
    sources: &mut SourceMap,
    problems: &mut Vec<Diagnostic>,
) -> Option<Table> {
    let text = match loader(path) {
        Ok(text) => text,
        Err(reason) => {
            let message = format!("cannot read the recipe `{}`: {reason}", path.display());
            problems.push(Diagnostic { labels: Vec::new(), ..Diagnostic::error(Span::default(), message) });
            return None;
        }
    };
    let mut chain = Chain { loader, sources, problems, open: vec![normalize(path)], what: "recipe" };
    let mut table = chain.file(path, &text)?;
    chain.open.clear();
    chain.criteria(&mut table);
    Some(table)
}

/// Loads a file of criteria and what it extends.
pub(super) fn load_criteria(
    path: &Path,
    loader: Loader<'_>,
    sources: &mut SourceMap,
    problems: &mut Vec<Diagnostic>,
) -> Option<Table> {
    let mut chain = Chain { loader, sources, problems, open: vec![normalize(path)], what: "file of criteria" };
    match loader(path) {
        Ok(text) => chain.file(path, &text).map(|table| chain.without_file(table)),
        Err(reason) => {
            let message = format!("cannot read the criteria `{}`: {reason}", path.display());
            problems.push(Diagnostic { labels: Vec::new(), ..Diagnostic::error(Span::default(), message) });
            None
        }
    }
}

struct Chain<'a> {
    loader: Loader<'a>,
    sources: &'a mut SourceMap,
    problems: &'a mut Vec<Diagnostic>,
    /// The files from the first one to the one being read.
    open: Vec<PathBuf>,
    /// What they are.
    what: &'static str,
}

impl Chain<'_> {
    fn file(&mut self, path: &Path, text: &str) -> Option<Table> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut table = parse(&path.display().to_string(), folder, text, self.sources, self.problems)?;
        let dropped = table.take("drop");
        let Some(extends) = table.take("extends") else {
            self.problems.extend(dropped.as_ref().map(drop::without_base));
            return Some(table);
        };
        let span = extends.value.span;
        let Node::Text(name) = &extends.value.value else {
            let message = format!("`extends` names one {}, got {}", self.what, extends.value.value.kind());
            self.problems.push(Diagnostic::error(span, message).help("write extends = \"lab-standard.toml\""));
            return Some(table);
        };
        match self.base(&folder.join(name), span) {
            Some(mut base) => {
                if let Some(dropped) = &dropped {
                    drop::take_away(&mut base, dropped, self.problems);
                }
                Some(merge(base, table, &[]))
            }
            None => Some(table),
        }
    }

    fn base(&mut self, path: &Path, span: Span) -> Option<Table> {
        let normal = normalize(path);
        if let Some(first) = self.open.iter().position(|open| *open == normal) {
            let names: Vec<_> =
                self.open[first..].iter().chain([&normal]).map(|open| open.display().to_string()).collect();
            let message = format!("{} extend each other in a circle: {}", self.many(), names.join(" -> "));
            self.problems.push(Diagnostic::error(span, message));
            return None;
        }
        if self.open.len() >= DEEPEST {
            let message = format!("more than {DEEPEST} {} extend each other", self.many());
            self.problems.push(Diagnostic::error(span, message));
            return None;
        }
        match (self.loader)(path) {
            Ok(text) => {
                self.open.push(normal);
                let table = self.file(path, &text);
                self.open.pop();
                table
            }
            Err(reason) => {
                let message = format!("cannot read the extended {} `{}`: {reason}", self.what, path.display());
                let help = format!("the path is relative to the {} that writes it", self.what);
                self.problems.push(Diagnostic::error(span, message).help(help));
                None
            }
        }
    }

    fn many(&self) -> &'static str {
        if self.what == "recipe" { "recipes" } else { "files of criteria" }
    }

    /// Puts below each table of `[criteria]` that names a `file` what that file says.
    fn criteria(&mut self, root: &mut Table) {
        let Some(Entry { value: Tree { value: Node::Table(all), .. }, .. }) = root.entries.get_mut("criteria") else {
            return;
        };
        self.what = "file of criteria";
        for entry in all.entries.values_mut() {
            let Node::Table(own) = &mut entry.value.value else { continue };
            let Some(file) = own.take("file") else { continue };
            let span = file.value.span;
            let Node::Text(name) = &file.value.value else {
                let message = format!("`file` names a file of criteria, got {}", file.value.value.kind());
                let problem = Diagnostic::error(span, message).help("write file = \"lab.criteria.toml\"");
                self.problems.push(problem);
                continue;
            };
            let path = self.sources.folder(span).join(name);
            match (self.loader)(&path) {
                Ok(text) => {
                    self.open = vec![normalize(&path)];
                    if let Some(base) = self.file(&path, &text) {
                        *own = merge(self.without_file(base), std::mem::take(own), &[]);
                        continue;
                    }
                }
                Err(reason) => {
                    let message = format!("cannot read the criteria `{}`: {reason}", path.display());
                    let help = "the path is relative to the recipe that writes it";
                    self.problems.push(Diagnostic::error(span, message).help(help));
                }
            }
            // What is left says that the criteria are not whole.
            own.entries.insert("file".to_owned(), file);
        }
    }

    /// A file of criteria does not name another one as a recipe does.
    fn without_file(&mut self, mut table: Table) -> Table {
        if let Some(file) = table.take("file") {
            let message = "a file of criteria has no key `file`";
            let help = "write extends = \"other.criteria.toml\" for what it changes";
            self.problems.push(Diagnostic::error(file.key, message).help(help));
        }
        table
    }
}

fn parse(
    name: &str,
    folder: &Path,
    text: &str,
    sources: &mut SourceMap,
    problems: &mut Vec<Diagnostic>,
) -> Option<Table> {
    if text.len() > LARGEST {
        let first_line: String = text.lines().next().unwrap_or("").chars().take(80).collect();
        let base = sources.add(name, folder, first_line);
        let message = format!("`{name}` has {} bytes; a recipe has at most {LARGEST}", text.len());
        let problem = Diagnostic::error(Span { start: base, end: base }, message);
        problems.push(problem.help("is this a mesh? Give it with `--input part=FILE`"));
        return None;
    }
    let base = sources.add(name, folder, text);
    let (table, errors) = DeTable::parse_recoverable(text);
    for error in &errors {
        let range = error.span().unwrap_or(0..0);
        let span = Span { start: base + range.start, end: base + range.end };
        problems.push(Diagnostic::error(span, format!("not TOML: {}", error.message())));
    }
    errors.is_empty().then(|| Table::from_toml(table.into_inner(), base))
}

/// Lays `over` on `base`. `path` is where in the recipe the two tables stand.
fn merge(mut base: Table, over: Table, path: &[&str]) -> Table {
    let replaces = match path {
        ["steps", _] => replaces_step(&base, &over),
        ["steps", _, _] => is_another_variant(&base, &over),
        _ => false,
    };
    if replaces {
        return over;
    }
    for (key, entry) in over.entries {
        let merged = match (base.take(&key), entry) {
            (Some(Entry { value: below, .. }), Entry { key: place, value: mut above }) => {
                above.value = match (below.value, above.value) {
                    (Node::Table(below), Node::Table(above)) => {
                        let deeper: Vec<&str> = path.iter().copied().chain([key.as_str()]).collect();
                        Node::Table(merge(below, above, &deeper))
                    }
                    (_, above) => above,
                };
                Entry { key: place, value: above }
            }
            (None, entry) => entry,
        };
        base.entries.insert(key, merged);
    }
    base
}

/// Whether two tables of one step are of different kinds, so that parameters of one mean nothing to the other.
fn replaces_step(base: &Table, over: &Table) -> bool {
    match (base.get("use"), over.get("use")) {
        (Some(below), Some(above)) => below.value.value != above.value.value,
        (None, _) | (_, None) => false,
    }
}

/// Whether two tables of one parameter are of different forms, as `{ field }` and `{ default, groups }` are: they have
/// no key in common, and one with keys of both would mean nothing.
fn is_another_variant(base: &Table, over: &Table) -> bool {
    !over.entries.is_empty() && !over.entries.keys().any(|key| base.get(key).is_some())
}

/// The path without `.` and with `x/..` taken out, without looking at the disk.
pub fn normalize(path: &Path) -> PathBuf {
    let mut normal = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir => match normal.components().next_back() {
                Some(Component::Normal(_)) => {
                    normal.pop();
                }
                Some(Component::RootDir | Component::Prefix(_)) => {}
                Some(Component::CurDir | Component::ParentDir) | None => normal.push(".."),
            },
            Component::Prefix(_) | Component::RootDir | Component::Normal(_) => normal.push(component),
        }
    }
    normal
}
