//! What the store knows of a finished task without loading its artifact.
//!
//! An entry is a JSON document sealed with its key, so that it serves no other; one small read serves a cache hit, the
//! report and the explanation why a later run misses.

use blake3::Hash;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

use super::level::Flaw;
use super::seal::{self, SealError};
use crate::metric::Measurement;

/// Numbers of an artifact for progress, tables and run records.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Figures {
    /// Port type of the artifact.
    pub port: String,
    /// Number of vertices.
    pub vertices: Option<u64>,
    /// Number of faces.
    pub faces: Option<u64>,
    /// Smallest stretch of a triangle.
    pub min_stretch: Option<f64>,
    /// Mean stretch of the triangles.
    pub mean_stretch: Option<f64>,
    /// The metrics themselves, where the artifact is a table of metrics.
    pub metrics: Option<Measurement>,
}

/// What a task gave.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// A step made an artifact.
    Artifact {
        /// Hash of its canonical bytes.
        #[serde(serialize_with = "write_hash", deserialize_with = "read_hash")]
        content: Hash,
        /// Length of its canonical bytes.
        bytes: u64,
        /// Its numbers.
        figures: Figures,
    },
    /// A gate gave its verdicts.
    Gate(Value),
    /// A step could not do its work, and said why.
    Failure(Value),
    /// An output file was written.
    File {
        /// Hash of its bytes.
        #[serde(serialize_with = "write_hash", deserialize_with = "read_hash")]
        content: Hash,
        /// Length in bytes.
        bytes: u64,
    },
}

/// What the store keeps under a key.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Version of the program that made it.
    pub version: String,
    /// Machine that made it; empty in entries of earlier versions.
    #[serde(default)]
    pub host: String,
    /// Name of the task in the recipe that asked first, such as `bracket/fe`.
    pub task: String,
    /// The fields behind the key, name and value, so that a later run can say what changed.
    pub record: Vec<(String, String)>,
    /// What came out.
    pub outcome: Outcome,
    /// Statistics of the step, replayed with the cached result.
    pub stats: Value,
    /// Seconds that it took.
    pub seconds: f64,
    /// The most memory that it took, where that was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory: Option<Peak>,
}

/// The most memory that a task held at once, beyond what was there when it began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Peak {
    /// Bytes that were allocated and not freed.
    pub bytes: u64,
    /// Whether nothing else ran meanwhile; else it is an estimate, the task's share of what all of them took.
    pub alone: bool,
}

/// Why bytes are not an entry.
#[derive(Debug, thiserror::Error)]
pub enum EntryError {
    /// Damaged, of another version, or the entry of another key.
    #[error(transparent)]
    Seal(#[from] SealError),
    /// The document does not fit.
    #[error("{0}")]
    Json(#[from] serde_json::Error),
}

impl EntryError {
    /// Whether the bytes are damaged, or sound and of another version: a seal that holds, over what does not fit.
    pub(super) fn flaw(&self) -> Flaw {
        match self {
            Self::Seal(SealError::Foreign) | Self::Json(_) => Flaw::Foreign(self.to_string()),
            Self::Seal(SealError::NotSealed | SealError::Checksum) => Flaw::Damaged(self.to_string()),
        }
    }
}

impl Entry {
    /// The bytes of the entry file of this key.
    pub fn encode(&self, key: &Hash) -> Vec<u8> {
        // A map with string keys and finite or absent numbers cannot fail to serialise.
        seal::seal(key.as_bytes(), &serde_json::to_vec(self).unwrap_or_default())
    }

    /// The entry of this key in these bytes.
    pub fn decode(key: &Hash, bytes: &[u8]) -> Result<Self, EntryError> {
        Ok(serde_json::from_slice(seal::open(key.as_bytes(), bytes)?)?)
    }

    /// The content hash of what came out, where it is an artifact.
    pub fn content(&self) -> Option<Hash> {
        match &self.outcome {
            Outcome::Artifact { content, .. } => Some(*content),
            Outcome::Gate(_) | Outcome::Failure(_) | Outcome::File { .. } => None,
        }
    }
}

fn write_hash<S: Serializer>(hash: &Hash, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(hash.to_hex().as_str())
}

fn read_hash<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Hash, D::Error> {
    let text = String::deserialize(deserializer)?;
    Hash::from_hex(text).map_err(serde::de::Error::custom)
}
