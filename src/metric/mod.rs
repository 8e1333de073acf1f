//! The metrics: one definition each, used by steps, gates, sweeps, reports and snapshots.

pub mod gate;
pub mod registry;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// A table of metrics by name, in kebab-case (`min-stretch`). Values are numbers, flags, or absent where undefined.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    /// Values by metric name.
    pub values: BTreeMap<String, Value>,
}

/// One measured value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Value {
    /// A count.
    Count(u64),
    /// A signed integer, such as the Euler characteristic.
    Integer(i64),
    /// A number in its metric's unit.
    Number(f64),
    /// A property that holds or not.
    Flag(bool),
}
