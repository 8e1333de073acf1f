//! What the store knows of a finished task without loading its artifact.
//!
//! An entry is one line with a checksum and a JSON document; one small read serves a cache hit, the report and the
//! explanation why a later run misses.

use blake3::Hash;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

use crate::metric::Measurement;

/// First word of an entry file.
const MAGIC: &str = "meshmill-entry-1 ";
/// Length of the checksum: BLAKE3 in hexadecimal.
const CHECKSUM: usize = 64;

/// Numbers of an artifact for progress, tables and run records.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
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
}

/// Why bytes are not an entry.
#[derive(Debug, thiserror::Error)]
pub enum EntryError {
    /// Not an entry, or cut short.
    #[error("not an entry of this version")]
    NotAnEntry,
    /// The bytes are not those that were written.
    #[error("the checksum differs")]
    Checksum,
    /// The document does not fit.
    #[error("{0}")]
    Json(#[from] serde_json::Error),
}

impl Entry {
    /// The bytes of an entry file.
    pub fn encode(&self) -> Vec<u8> {
        // A map with string keys and finite or absent numbers cannot fail to serialise.
        let body = serde_json::to_vec(self).unwrap_or_default();
        let mut bytes = Vec::with_capacity(body.len() + MAGIC.len() + CHECKSUM + 1);
        bytes.extend_from_slice(MAGIC.as_bytes());
        bytes.extend_from_slice(blake3::hash(&body).to_hex().as_bytes());
        bytes.push(b'\n');
        bytes.extend_from_slice(&body);
        bytes
    }

    /// The entry in these bytes.
    pub fn decode(bytes: &[u8]) -> Result<Self, EntryError> {
        let rest = bytes.strip_prefix(MAGIC.as_bytes()).ok_or(EntryError::NotAnEntry)?;
        let (checksum, rest) = rest.split_at_checked(CHECKSUM).ok_or(EntryError::NotAnEntry)?;
        let body = rest.strip_prefix(b"\n").ok_or(EntryError::NotAnEntry)?;
        if blake3::hash(body).to_hex().as_bytes() != checksum {
            return Err(EntryError::Checksum);
        }
        Ok(serde_json::from_slice(body)?)
    }

    /// The content hash of what came out, where it is an artifact.
    pub fn content(&self) -> Option<Hash> {
        match &self.outcome {
            Outcome::Artifact { content, .. } => Some(*content),
            Outcome::Gate(_) | Outcome::File { .. } => None,
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
