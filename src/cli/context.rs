//! What several subcommands share: the arguments that choose a recipe, its plan, and the cache.

use std::collections::BTreeSet;
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

use clap::Args;

use super::Global;
use super::config;
use super::exit::Fault;
use crate::format::Format;
use crate::plan::{self, CaseSpec, ColumnRequest, Context, Plan};
use crate::recipe::{LARGEST, Overrides, Recipe, suggest};
use crate::run::{self, RunError};
use crate::step::failure::without_code;
use crate::steps::CATALOG;
use crate::store::Store;
use crate::store::stamp::Seen;

/// Which recipe, with which values.
#[derive(Clone, Debug, Args)]
pub(super) struct RecipeArguments {
    /// The recipe, a TOML file.
    recipe: PathBuf,
    /// Set a parameter of the recipe.
    #[arg(long, value_name = "NAME=VALUE", value_parser = pair)]
    set: Vec<(String, String)>,
    /// Replace an input file of the recipe; relative to the working directory.
    #[arg(long, value_name = "NAME=FILE", value_parser = pair)]
    input: Vec<(String, String)>,
}

/// A recipe and its plan.
pub(super) struct Planned {
    pub(super) recipe: Recipe,
    pub(super) plan: Plan,
}

impl RecipeArguments {
    /// Loads and plans the recipe; all that is wrong with it is one fault.
    pub(super) fn plan(&self) -> Result<Planned, Fault> {
        let recipe = self.load(&[])?;
        let plan = plan_cases(&recipe, &[CaseSpec::default()], None)?;
        Ok(Planned { recipe, plan })
    }

    /// Fails where a mesh was given in the place of a recipe.
    fn check_is_recipe(&self) -> Result<(), Fault> {
        let Some(format) = Format::from_file_name(&self.recipe.to_string_lossy()) else { return Ok(()) };
        let (file, title) = (self.recipe.display(), format.title());
        Err(Fault::usage(format!("{file}: this is a mesh ({title}), and a recipe is a TOML file")).help(format!(
            "`meshmill init {file}` writes a recipe for it, and `meshmill run pipelines/fe-surface.toml --input \
             part={file}` runs one that is there"
        )))
    }

    /// All of them as they decide which run is meant.
    pub(super) fn identity(&self) -> Vec<Vec<u8>> {
        let Self { recipe, set, input } = self;
        let mut parts = vec![recipe.as_os_str().as_encoded_bytes().to_vec()];
        for (option, pairs) in [("--set", set), ("--input", input)] {
            for (name, value) in pairs {
                parts.extend([option, name, value].map(|text| text.as_bytes().to_vec()));
            }
        }
        parts
    }

    /// The file of the recipe.
    pub(super) fn path(&self) -> &Path {
        &self.recipe
    }

    /// Fails where a parameter is set that a sweep varies: its cases would not look at it.
    pub(super) fn check_fixed(&self, varied: &[String]) -> Result<(), Fault> {
        let Some((name, value)) = self.set.iter().find(|(name, _)| varied.contains(name)) else { return Ok(()) };
        Err(Fault::usage(format!("--set {name}={value}: the sweep varies `{name}`"))
            .help(format!("`-s {name}={value}` gives it this value in every case")))
    }

    /// Loads the recipe, with further axes of a sweep.
    pub(super) fn load(&self, axes: &[(String, String)]) -> Result<Recipe, Fault> {
        let overrides = Overrides {
            set: self.set.clone(),
            inputs: self.input.iter().map(|(name, file)| (name.clone(), PathBuf::from(file))).collect(),
            axes: axes.to_vec(),
        };
        self.check_is_recipe()?;
        Ok(Recipe::load(&self.recipe, &read_text, &overrides)?)
    }
}

/// The text of a recipe or of criteria, or why it cannot be read. Of a file that is longer than any of them only so
/// much that whoever looks at it sees that; it may have no end.
pub(super) fn read_text(path: &Path) -> Result<String, String> {
    let system = |error: std::io::Error| match error.kind() {
        std::io::ErrorKind::NotFound => "there is no such file".to_owned(),
        _ => without_code(&error.to_string()),
    };
    let mut bytes = Vec::new();
    let most = LARGEST as u64 + 1;
    fs::File::open(path).and_then(|file| file.take(most).read_to_end(&mut bytes)).map_err(system)?;
    match String::from_utf8(bytes) {
        Ok(text) => Ok(text),
        Err(error) if error.as_bytes().len() > LARGEST => Ok(String::from_utf8_lossy(error.as_bytes()).into_owned()),
        Err(_) => Err("it is no text; a recipe is a TOML file".to_owned()),
    }
}

/// Plans cases of a recipe over the steps that there are.
pub(super) fn plan_cases(
    recipe: &Recipe,
    cases: &[CaseSpec],
    columns: Option<&[ColumnRequest]>,
) -> Result<Plan, Fault> {
    let (endings, second_order) = (endings(), second_order());
    let context = Context { catalog: CATALOG, check_file: &check_file, endings: &endings, second_order: &second_order };
    Ok(plan::plan_cases(recipe, cases, columns, &context)?)
}

/// The files below a folder that fit a pattern, sorted, at most so many. What fits and cannot be used is an error: a
/// study that leaves out parts without a word is wrong.
pub(super) fn list_files(folder: &Path, pattern: &str, most: usize) -> Result<Vec<PathBuf>, String> {
    let folder = glob::Pattern::escape(&folder.to_string_lossy());
    let pattern = Path::new(&folder).join(pattern);
    let found = glob::glob(&pattern.to_string_lossy()).map_err(|error| error.msg.to_owned())?;
    let mut files = Vec::new();
    for path in found.take(most) {
        let path = path.map_err(|error| format!("cannot read {}", error.path().display()))?;
        if path.is_file() {
            files.push(path);
        }
    }
    unusable_names(&pattern)?;
    files.sort();
    Ok(files)
}

/// Fails where a file or folder fits a part of the pattern, and patterns pass it over: its name is not UTF-8, or it is
/// a link that leads nowhere.
fn unusable_names(pattern: &Path) -> Result<(), String> {
    for whole in pattern.ancestors() {
        let (Some(parent), Some(name)) = (whole.parent(), whole.file_name()) else { continue };
        let name = name.to_string_lossy();
        if !name.contains(['*', '?', '[']) {
            continue;
        }
        // Two stars stand for folders of any depth, so what fits them may lie in any of these.
        let parent = if name == "**" { whole } else { parent }.to_string_lossy();
        let parent = if parent.is_empty() { ".".into() } else { parent };
        let Ok(part) = glob::Pattern::new(&name) else { continue };
        let folders = glob::glob(&parent).map_err(|error| error.msg.to_owned())?;
        for folder in folders.filter_map(Result::ok) {
            unusable_name(&folder, &part, whole == pattern)?;
        }
    }
    Ok(())
}

/// Fails where something in this folder fits a part of a pattern, its last one or one before, and cannot be used.
fn unusable_name(folder: &Path, part: &glob::Pattern, is_last: bool) -> Result<(), String> {
    let Ok(entries) = fs::read_dir(folder) else { return Ok(()) };
    for entry in entries.filter_map(Result::ok) {
        let (name, path) = (entry.file_name(), entry.path());
        if !part.matches(&name.to_string_lossy()) {
            continue;
        }
        // Editors keep hidden links that lead nowhere beside a file, which are no folders of parts.
        let is_hidden = part.as_str() == "**" || name.as_encoded_bytes().starts_with(b".");
        if path.is_symlink() && !path.exists() && (is_last || !is_hidden) {
            return Err(format!("{} fits the pattern and is a link that leads nowhere", path.display()));
        }
        if name.to_str().is_none() && (is_last || path.is_dir()) {
            return Err(format!("{} fits the pattern, but its name is not UTF-8; rename it", path.display()));
        }
    }
    Ok(())
}

impl Planned {
    /// The files that the recipe consists of and those that it reads, with all that they include.
    pub(super) fn files(&self) -> Vec<PathBuf> {
        let texts = texts(&self.recipe).into_iter().map(|(name, _)| PathBuf::from(name));
        texts.chain(run::source::files(&self.plan)).collect()
    }

    /// All of them as they are now, before the run reads them. A recipe counts only while its file holds the text that
    /// was planned.
    pub(super) fn seen(&self) -> Vec<Seen> {
        let texts = texts(&self.recipe);
        let see = |file: PathBuf| {
            let text = texts.iter().find(|(name, _)| Path::new(name) == file);
            Seen::of(&file, text.map(|(_, text)| text.as_bytes()))
        };
        // Which files a deck includes is known only by reading it: what is seen before that says whether it is still
        // so.
        let (mut files, mut seen) = (BTreeSet::new(), Vec::new());
        loop {
            let before = seen.len();
            for file in self.files() {
                if files.insert(file.clone()) {
                    seen.push(see(file));
                }
            }
            if seen.len() == before {
                return seen;
            }
        }
    }

    /// Fails where a file that is to be written is one of those that are read, or of `others`, by whatever name.
    pub(super) fn check_replaces(&self, file: &Path, others: &[PathBuf]) -> Result<(), Fault> {
        let mut read = self.files();
        read.extend_from_slice(others);
        let read: Vec<&Path> = read.iter().map(PathBuf::as_path).collect();
        match run::replaced(file, &read) {
            Some(input) => {
                Err(RunError::WouldReplace { output: file.to_path_buf(), input: input.to_path_buf() }.into())
            }
            None => Ok(()),
        }
    }

    /// Fails when a name that was given to `option` is no step of the recipe.
    pub(super) fn check_steps(&self, option: &str, names: &[String]) -> Result<(), Fault> {
        for name in names {
            if self.recipe.step(name).is_none() {
                let steps = self.recipe.steps.iter().map(|step| step.name.as_str());
                let help = suggest::did_you_mean(name, "the recipe has the steps", steps);
                return Err(Fault::usage(format!("{option} {name}: the recipe has no step `{name}`")).help_opt(help));
            }
        }
        Ok(())
    }
}

/// Where the lock of a recipe is, unless another place is named.
pub(super) fn lock_file(recipe: &Recipe) -> PathBuf {
    recipe.path.with_file_name(format!("{}.lock.ron", recipe.name))
}

/// Files that no output may replace, besides those that the plan reads: the recipe, its bases and its lock file.
pub(super) fn protected(recipe: &Recipe) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = texts(recipe).into_iter().map(|(name, _)| PathBuf::from(name)).collect();
    files.push(lock_file(recipe));
    files
}

/// The texts that a recipe was read from, with the names of their files.
pub(super) fn texts(recipe: &Recipe) -> Vec<(String, String)> {
    let files = recipe.sources.files().iter().filter(|file| !file.name.starts_with('-'));
    files.map(|file| (file.name.clone(), file.text.clone())).collect()
}

/// A path as a recipe in `folder` has to write it. Absolute paths stay as they are.
pub(super) fn relative(path: &Path, folder: &Path) -> PathBuf {
    let here = |folder: &Path| if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder.to_path_buf() };
    let (Ok(whole), Ok(folder)) = (path.canonicalize(), std::path::absolute(here(folder))) else {
        return path.to_path_buf();
    };
    if path.is_absolute() {
        return path.to_path_buf();
    }
    let folder = folder.canonicalize().unwrap_or_else(|_| crate::recipe::normalize(&folder));
    let shared = whole.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    let up = folder.components().skip(shared).map(|_| std::path::Component::ParentDir);
    up.chain(whole.components().skip(shared)).collect()
}

/// The endings of files that can be written.
pub(super) fn endings() -> Vec<&'static str> {
    Format::ALL.iter().flat_map(|format| format.endings()).copied().collect()
}

/// The endings of files that hold elements with mid-side nodes.
fn second_order() -> Vec<&'static str> {
    let formats = Format::ALL.iter().filter(|format| format.holds_second_order());
    formats.flat_map(|format| format.endings()).copied().collect()
}

fn check_file(path: &Path) -> Result<(), String> {
    match fs::metadata(path) {
        Ok(meta) if meta.is_file() => Ok(()),
        Ok(_) => Err("it is not a file".to_owned()),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Err("there is no such file".to_owned()),
        Err(error) => Err(without_code(&error.to_string())),
    }
}

/// Opens the cache, as `config` finds it.
pub(super) fn open_store(global: &Global) -> Result<Store, Fault> {
    Ok(Store::with_levels(&config::levels(&global.cache)?)?)
}

pub(super) fn pair(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.is_empty() => Ok((name.to_owned(), value.to_owned())),
        _ => Err(format!("expected NAME=VALUE, got `{text}`")),
    }
}
