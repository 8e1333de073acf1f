//! A bundle: one run with all that it was made of and all that it gave, to be handed on and computed again.
//!
//! ```text
//! ro-crate-metadata.json   what is here, as an RO-Crate
//! meshmill.json            what `verify` reads: the recipe, its overrides, what was left out
//! lock.ron                 the lock of the run
//! metrics.json             metrics of steps and gates
//! files/..                 the recipe, its bases, criteria and inputs, as they lie to each other
//! outputs/..               the files that were written
//! ```
//!
//! # Invariants
//! - The bytes of a bundle depend on the run, its date and what is said of its licence and people: no clock, no host,
//!   no folder besides those between the files.
//! - A bundle is complete without trust: what it holds is compared with its lock, and its lock with a run of its own.

pub mod archive;
mod metadata;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::lock::Lock;
use crate::metric;
use archive::Members;

/// The metadata of the crate.
pub const METADATA: &str = "ro-crate-metadata.json";
/// The list for `verify`.
pub const MANIFEST: &str = "meshmill.json";
/// The lock.
pub const LOCK: &str = "lock.ron";
/// The metrics.
pub const METRICS: &str = "metrics.json";
/// What the run read.
pub const FILES: &str = "files/";
/// What the run wrote.
pub const OUTPUTS: &str = "outputs/";
/// Version of the layout.
const LAYOUT: u32 = 1;

/// How the run of a bundle is repeated.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of the layout.
    pub layout: u32,
    /// Version of the program that ran.
    pub meshmill: String,
    /// The member that is the recipe.
    pub recipe: String,
    /// Parameters that have other values than the recipe says.
    pub set: BTreeMap<String, String>,
    /// By input of the recipe, the member that is its file.
    pub inputs: BTreeMap<String, String>,
    /// Members that are not in the bundle, with the BLAKE3 hashes of their bytes.
    pub left_out: BTreeMap<String, String>,
}

/// What a bundle is made of.
#[derive(Clone, Debug)]
pub struct Contents {
    /// How to repeat the run.
    pub manifest: Manifest,
    /// The lock of the run.
    pub lock: Lock,
    /// What the recipe says of itself.
    pub about: String,
    /// The day of the run, as `2026-01-31`.
    pub date: String,
    /// The licence of the whole, an address or a sentence.
    pub license: String,
    /// The person who made the results.
    pub author: Option<String>,
    /// The organization that hands them on.
    pub publisher: Option<String>,
    /// Files and outputs.
    pub members: Members,
}

/// What was found in a bundle.
#[derive(Clone, Debug)]
pub struct Bundle {
    /// How to repeat the run.
    pub manifest: Manifest,
    /// The lock of the run.
    pub lock: Lock,
    /// The metrics as the bundle tells them.
    pub metrics: Value,
    /// Files and outputs.
    pub members: Members,
}

/// Why a bundle cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum BundleError {
    /// Its archive cannot.
    #[error(transparent)]
    Archive(#[from] archive::ArchiveError),
    /// A member is missing.
    #[error("it has no {0}")]
    Missing(String),
    /// A member does not say what it should.
    #[error("its {0} cannot be read: {1}")]
    Member(String, String),
    /// Another version of the program made it.
    #[error("its layout is {0}, and this program knows {LAYOUT}")]
    Layout(u32),
}

impl Contents {
    /// The bytes of the bundle.
    ///
    /// # Errors
    /// Where a name of a file cannot stand in an archive.
    pub fn write(mut self) -> Result<Vec<u8>, BundleError> {
        self.manifest.layout = LAYOUT;
        let fault = |name: &str, error: &dyn ToString| BundleError::Member(name.to_owned(), error.to_string());
        let lock = self.lock.to_ron().map_err(|error| fault(LOCK, &error))?;
        let text = |value: &Value| format!("{value:#}\n").into_bytes();
        let manifest = serde_json::to_value(&self.manifest).map_err(|error| fault(MANIFEST, &error))?;
        self.members.insert(LOCK.to_owned(), lock.into_bytes());
        self.members.insert(METRICS.to_owned(), text(&metrics(&self.lock)));
        self.members.insert(MANIFEST.to_owned(), text(&manifest));
        let crated = metadata::metadata(&self);
        self.members.insert(METADATA.to_owned(), text(&crated));
        Ok(archive::write(&self.members)?)
    }

    fn description(&self) -> String {
        let (recipe, version) = (&self.lock.recipe, &self.manifest.meshmill);
        let own = if self.about.is_empty() { String::new() } else { format!(" {}", self.about.trim()) };
        format!("A run of the recipe {recipe} by meshmill {version}; `meshmill verify` computes it again.{own}")
    }
}

/// The metrics of steps and gates, as a bundle tells them.
pub fn metrics(lock: &Lock) -> Value {
    let plain_all = |metrics: &BTreeMap<String, metric::Value>| -> BTreeMap<String, Value> {
        metrics.iter().map(|(name, value)| (name.clone(), plain(*value))).collect()
    };
    let steps: BTreeMap<_, _> = lock.results.iter().map(|(step, locked)| (step, plain_all(&locked.metrics))).collect();
    let gates: BTreeMap<_, _> = lock.gates.iter().map(|(name, value)| (name, value.map(plain))).collect();
    json!({ "steps": steps, "gates": gates })
}

/// A metric as a number or a truth value; a count that stopped early as a text.
fn plain(value: metric::Value) -> Value {
    match value {
        metric::Value::Flag(flag) => json!(flag),
        metric::Value::Count(count) => json!(count),
        metric::Value::AtLeast(count) => json!(format!("at least {count}")),
        metric::Value::Integer(integer) => json!(integer),
        metric::Value::Number(number) => json!(number),
    }
}

impl Bundle {
    /// Reads a bundle, which may be anybody's. What it holds is not compared with anything yet.
    ///
    /// # Errors
    /// Where it is damaged, made to do harm, or not whole.
    pub fn read(bytes: &[u8]) -> Result<Self, BundleError> {
        let mut members = archive::read(bytes)?;
        let crated = json_of(&text(&mut members, METADATA)?, METADATA)?;
        if !crated["@graph"].is_array() {
            return Err(BundleError::Member(METADATA.to_owned(), "it has no @graph".to_owned()));
        }
        let manifest = text(&mut members, MANIFEST)?;
        let manifest: Manifest = serde_json::from_str(&manifest)
            .map_err(|error| BundleError::Member(MANIFEST.to_owned(), error.to_string()))?;
        if manifest.layout != LAYOUT {
            return Err(BundleError::Layout(manifest.layout));
        }
        let lock =
            Lock::from_ron(&text(&mut members, LOCK)?).map_err(|error| BundleError::Member(LOCK.to_owned(), error))?;
        let metrics = json_of(&text(&mut members, METRICS)?, METRICS)?;
        let bundle = Self { manifest, lock, metrics, members };
        bundle.check_whole()?;
        Ok(bundle)
    }

    fn check_whole(&self) -> Result<(), BundleError> {
        let Manifest { recipe, inputs, left_out, .. } = &self.manifest;
        let outputs = self.lock.files.keys().map(|name| format!("{OUTPUTS}{name}"));
        for name in outputs {
            if !self.members.contains_key(&name) {
                return Err(BundleError::Missing(name));
            }
        }
        let odd = |name: &&String| !name.starts_with(FILES) || !archive::is_name(name);
        if let Some(name) = inputs.values().chain(left_out.keys()).chain([recipe]).find(odd) {
            return Err(BundleError::Member(MANIFEST.to_owned(), format!("it names {name:?}")));
        }
        if let Some(name) = archive::folder_among(self.members.keys().chain(left_out.keys())) {
            return Err(archive::ArchiveError::Folder(name).into());
        }
        let there = |name: &&String| self.members.contains_key(*name) || left_out.contains_key(*name);
        match inputs.values().find(|name| !there(name)) {
            Some(name) => Err(BundleError::Missing(name.clone())),
            None if !self.members.contains_key(recipe) => Err(BundleError::Missing(recipe.clone())),
            None => Ok(()),
        }
    }

    /// What of the bundle is not what its own lock says: outputs and metrics, one line each.
    pub fn contradictions(&self) -> Vec<String> {
        let mut lines = Vec::new();
        for (name, locked) in &self.lock.files {
            let content = self.members.get(&format!("{OUTPUTS}{name}"));
            let hash = content.map(|content| blake3::hash(content).to_hex().to_string());
            if hash != *locked {
                lines.push(format!("{OUTPUTS}{name}: the file in the bundle is not the one that was locked"));
            }
        }
        if self.metrics != metrics(&self.lock) {
            lines.push(format!("{METRICS}: does not say what the lock says"));
        }
        lines
    }
}

fn text(members: &mut Members, name: &str) -> Result<String, BundleError> {
    let bytes = members.remove(name).ok_or_else(|| BundleError::Missing(name.to_owned()))?;
    String::from_utf8(bytes).map_err(|_| BundleError::Member(name.to_owned(), "it is no text".to_owned()))
}

fn json_of(text: &str, name: &str) -> Result<Value, BundleError> {
    serde_json::from_str(text).map_err(|error| BundleError::Member(name.to_owned(), error.to_string()))
}
