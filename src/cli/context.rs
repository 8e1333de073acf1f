//! What several subcommands share: the arguments that choose a recipe, its plan, and the cache.

use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use etcetera::BaseStrategy;

use super::Global;
use super::exit::{Exit, Fault};
use crate::format::Format;
use crate::plan::{self, Context, Plan};
use crate::recipe::{Overrides, Recipe, suggest};
use crate::steps::CATALOG;
use crate::store::Store;

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
        let overrides = Overrides {
            set: self.set.clone(),
            inputs: self.input.iter().map(|(name, file)| (name.clone(), PathBuf::from(file))).collect(),
        };
        let load = |path: &Path| fs::read_to_string(path).map_err(|error| error.to_string());
        let recipe = Recipe::load(&self.recipe, &load, &overrides)?;
        let plan = plan::plan(&recipe, &Context { catalog: CATALOG, check_file: &check_file, endings: &endings() })?;
        Ok(Planned { recipe, plan })
    }
}

impl Planned {
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

/// The texts that a recipe was read from, with the names of their files.
pub(super) fn texts(recipe: &Recipe) -> Vec<(String, String)> {
    let files = recipe.sources.files().iter().filter(|file| !file.name.starts_with("--"));
    files.map(|file| (file.name.clone(), file.text.clone())).collect()
}

/// The endings of files that can be written.
pub(super) fn endings() -> Vec<&'static str> {
    Format::ALL.iter().flat_map(|format| format.endings()).copied().collect()
}

fn check_file(path: &Path) -> Result<(), String> {
    match fs::metadata(path) {
        Ok(meta) if meta.is_file() => Ok(()),
        Ok(_) => Err("it is not a file".to_owned()),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Err("there is no such file".to_owned()),
        Err(error) => Err(error.to_string()),
    }
}

/// Opens the cache: `--cache`, else `MESHMILL_CACHE`, else `meshmill` in the user's cache folder.
pub(super) fn open_store(global: &Global) -> Result<Store, Fault> {
    let chosen = global.cache.clone().or_else(|| std::env::var_os("MESHMILL_CACHE").map(PathBuf::from));
    let root = match chosen.filter(|root| !root.as_os_str().is_empty()) {
        Some(root) => root,
        None => match etcetera::choose_base_strategy() {
            Ok(strategy) => strategy.cache_dir().join("meshmill"),
            Err(error) => {
                let message = format!("there is no cache folder: {error}");
                return Err(Fault::new(Exit::Store, message).help("name one with --cache DIR or MESHMILL_CACHE"));
            }
        },
    };
    Ok(Store::open(&root)?)
}

fn pair(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.is_empty() => Ok((name.to_owned(), value.to_owned())),
        _ => Err(format!("expected NAME=VALUE, got `{text}`")),
    }
}
