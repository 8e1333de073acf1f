//! The metrics: one definition each, used by steps, gates, sweeps, reports and snapshots.

pub mod crossing;
pub mod distance;
pub mod element;
pub mod feature;
pub mod gate;
pub mod intersection;
pub mod measured;
pub mod number;
pub mod quad_layout;
pub mod quad_shape;
pub mod registry;
pub mod shape;
pub mod subject;
pub mod summary;
pub mod tolerance;
pub mod topology;
pub mod weld;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

pub use measured::Measured;
use registry::{METRICS, Needs};
pub use subject::Subject;
pub use tolerance::ToleranceMode;

use crate::mesh::Soup;
use crate::watch::{Cancelled, Watch};

/// A table of metrics by name, in kebab-case (`min-stretch`). Values are numbers, flags, or absent where undefined.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Measurement {
    /// Values by metric name.
    pub values: BTreeMap<String, Value>,
}

/// One measured value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Value {
    /// A count.
    Count(u64),
    /// A count that stopped here: there are as many or more.
    AtLeast(u64),
    /// A signed integer, such as the Euler characteristic.
    Integer(i64),
    /// A number in its metric's unit.
    Number(f64),
    /// A property that holds or not.
    Flag(bool),
}

/// As `--json` shows it: a number, a truth value, or null where a number is not finite.
impl schemars::JsonSchema for Value {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Value".into()
    }

    fn json_schema(_generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({ "type": ["number", "boolean", "null"] })
    }
}

impl Value {
    /// The value as a number; a flag is 1 or 0.
    pub fn as_f64(self) -> f64 {
        match self {
            Self::Count(count) | Self::AtLeast(count) => count as f64,
            Self::Integer(integer) => integer as f64,
            Self::Number(number) => number,
            Self::Flag(flag) => f64::from(u8::from(flag)),
        }
    }
}

impl Measurement {
    /// The value of a metric.
    pub fn get(&self, name: &str) -> Option<Value> {
        self.values.get(name).copied()
    }
}

/// Measures every metric that is defined: those against a reference only where there is one.
pub fn measure(mesh: &Soup, reference: Option<&Soup>, watch: &Watch) -> Result<Measurement, Cancelled> {
    measure_kept(&Subject::new(mesh, reference, watch))
}

/// The same of a subject, which may know some of it.
pub fn measure_kept(subject: &Subject<'_>) -> Result<Measurement, Cancelled> {
    let watch = subject.watch();
    let mut values = BTreeMap::new();
    watch.phase("measure", Some(METRICS.len() as u64));
    for (done, metric) in METRICS.iter().enumerate() {
        watch.check()?;
        watch.advance(done as u64, || metric.name.to_owned());
        if metric.needs == Needs::Reference && subject.reference().is_none() {
            continue;
        }
        if let Some(value) = (metric.measure)(subject) {
            values.insert(metric.name.to_owned(), value);
        }
    }
    watch.check()?;
    Ok(Measurement { values })
}
