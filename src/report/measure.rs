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
        Value::Integer(number) => number.to_string(),
        Value::Number(number) => number_text(*number),
        Value::Flag(flag) => if *flag { "yes" } else { "no" }.to_owned(),
    }
}

fn unit_text(unit: Unit) -> &'static str {
    match unit {
        Unit::Length => "length",
        Unit::Area => "area",
        Unit::Volume => "volume",
        Unit::Degrees => "degrees",
        Unit::Share => "share",
        Unit::Ratio | Unit::Count | Unit::Flag => "",
    }
}

/// A table of metrics as programs read it: `metrics` holds numbers and booleans by name, `units` the unit of each that
/// has one (`length`, `area`, `volume`, `degrees`, `share`). Numbers that are not finite are null.
pub fn flat(measurement: &Measurement) -> serde_json::Value {
    let mut metrics = serde_json::Map::new();
    let mut units = serde_json::Map::new();
    for (name, value) in &measurement.values {
        let value = match *value {
            Value::Count(count) => count.into(),
            Value::Integer(number) => number.into(),
            Value::Number(number) => number.into(),
            Value::Flag(flag) => flag.into(),
        };
        metrics.insert(name.clone(), value);
        if let Some(unit) = METRICS.iter().find(|metric| metric.name == name).map(|metric| unit_text(metric.unit))
            && !unit.is_empty()
        {
            units.insert(name.clone(), unit.into());
        }
    }
    serde_json::json!({ "metrics": metrics, "units": units })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flat_form_has_numbers_and_booleans_with_units_beside_them() {
        let values = [
            ("faces", Value::Count(12)),
            ("closed", Value::Flag(true)),
            ("area", Value::Number(6.5)),
            ("euler-characteristic", Value::Integer(-2)),
        ];
        let values = values.map(|(name, value)| (name.to_owned(), value)).into();
        let expected = serde_json::json!({
            "metrics": { "area": 6.5, "closed": true, "euler-characteristic": -2, "faces": 12 },
            "units": { "area": "area" },
        });
        assert_eq!(flat(&Measurement { values }), expected);
    }
}
