//! A table of metrics as text: one row a metric, in the order of the registry.

pub use crate::metric::number::number_text;
use crate::metric::registry::{METRICS, Unit};
use crate::metric::{Measurement, Value};

/// Name, value and unit of every metric that is defined. Metrics that the registry does not know come last.
pub fn rows(measurement: &Measurement) -> Vec<[String; 3]> {
    let known = METRICS.iter().filter_map(|metric| {
        let value = measurement.values.get(metric.name)?;
        Some([metric.name.to_owned(), value_text(value), unit_text(metric.unit).to_owned()])
    });
    let others =
        measurement.values.iter().filter(|(name, _)| !METRICS.iter().any(|metric| metric.name == name.as_str()));
    known.chain(others.map(|(name, value)| [name.clone(), value_text(value), String::new()])).collect()
}

/// A value for people.
pub fn value_text(value: &Value) -> String {
    match value {
        Value::Count(count) => count.to_string(),
        Value::AtLeast(count) => format!("≥ {count}"),
        Value::Integer(number) => number.to_string(),
        Value::Number(number) => number_text(*number),
        Value::Flag(flag) => if *flag { "yes" } else { "no" }.to_owned(),
    }
}

/// The unit of a metric in words; empty where the value says it.
pub fn unit_text(unit: Unit) -> &'static str {
    match unit {
        Unit::Length => "length",
        Unit::Area => "area",
        Unit::Volume => "volume",
        Unit::Degrees => "degrees",
        Unit::Share => "share",
        Unit::Ratio | Unit::Count | Unit::Flag => "",
    }
}
