//! What is at hand while one case of a recipe is planned.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::recipe::{Diagnostic, Recipe, Scope, Tree};
use crate::step::StepDef;
use crate::step::parameters::ParameterSchema;

/// What planning needs to know besides the recipe.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// The steps that a recipe can use.
    pub catalog: &'static [StepDef],
    /// Says why an input file cannot be read, without reading it.
    pub check_file: &'a dyn Fn(&Path) -> Result<(), String>,
    /// The endings of files that can be written, lower case, without the dot.
    pub endings: &'a [&'a str],
    /// Those among them whose files hold elements with mid-side nodes.
    pub second_order: &'a [&'a str],
}

/// A case to plan: a name, and parameters that replace those of the recipe.
#[derive(Clone, Debug, Default)]
pub struct CaseSpec {
    /// Folder of its outputs; empty for a plain run.
    pub name: String,
    /// Parameters and their values.
    pub params: Vec<(String, Tree)>,
}

/// The state while one case is planned.
pub(super) struct CaseContext<'r> {
    pub(super) recipe: &'r Recipe,
    pub(super) catalog: &'static [StepDef],
    pub(super) endings: &'r [&'r str],
    pub(super) second_order: &'r [&'r str],
    pub(super) scope: Scope,
    pub(super) problems: Vec<Diagnostic>,
    /// Where the steps of a name stand among those that could be read.
    pub(super) places: BTreeMap<&'r str, usize>,
    check: &'r dyn Fn(&Path) -> Result<(), String>,
    checked: BTreeMap<PathBuf, Result<(), String>>,
    schemas: BTreeMap<&'static str, ParameterSchema>,
}

impl<'r> CaseContext<'r> {
    pub(super) fn new(recipe: &'r Recipe, context: &Context<'r>) -> Self {
        Self {
            recipe,
            catalog: context.catalog,
            endings: context.endings,
            second_order: context.second_order,
            scope: Scope::default(),
            problems: Vec::new(),
            places: BTreeMap::new(),
            check: context.check_file,
            checked: BTreeMap::new(),
            schemas: BTreeMap::new(),
        }
    }

    /// Whether a file can be read; asked once for each path.
    pub(super) fn check_file(&mut self, path: &Path) -> Result<(), String> {
        if let Some(known) = self.checked.get(path) {
            return known.clone();
        }
        let result = (self.check)(path);
        self.checked.insert(path.to_path_buf(), result.clone());
        result
    }

    /// The parameters of a step kind.
    pub(super) fn schema(&mut self, def: &'static StepDef) -> &ParameterSchema {
        self.schemas.entry(def.name).or_insert_with(|| ParameterSchema::of(def))
    }
}
