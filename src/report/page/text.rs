//! Words and numbers for the page.

use serde::Serialize;

use crate::metric::Value;
use crate::metric::registry::Unit;
use crate::report::table::grouped;

/// An element that a link leads to.
#[derive(Serialize)]
pub(super) struct FaultView {
    pub(super) mesh: String,
    pub(super) label: String,
    pub(super) value: String,
    pub(super) at: String,
    pub(super) place: String,
}

/// The text with everything that means something in HTML written out.
pub(super) fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            other => safe.push(other),
        }
    }
    safe
}

/// A number in three significant digits.
pub(super) fn short(number: f64) -> String {
    digits(number, 3)
}

/// A number in so many significant digits, without idle zeros.
pub(super) fn digits(number: f64, count: i32) -> String {
    if number == 0.0 {
        return "0".to_owned();
    }
    if !number.is_finite() {
        return "∞".to_owned();
    }
    let magnitude = libm::floor(libm::log10(number.abs())) as i32;
    if !(-4..7).contains(&magnitude) {
        let text = format!("{number:.*e}", usize::try_from(count - 1).unwrap_or(0));
        return text.replace('-', "−");
    }
    let decimals = usize::try_from(count - 1 - magnitude).unwrap_or(0);
    let text = format!("{number:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text };
    text.replace('-', "−")
}

/// The value of a metric.
pub(super) fn value(value: &Value, unit: Unit) -> String {
    match (value, unit) {
        (Value::Count(count), _) => grouped(*count),
        (Value::AtLeast(count), _) => format!("≥ {}", grouped(*count)),
        (Value::Integer(number), _) => number.to_string().replace('-', "−"),
        (Value::Number(number), Unit::Share) => format!("{} %", short(100.0 * number)),
        (Value::Number(number), _) => digits(*number, 4),
        (Value::Flag(flag), _) => if *flag { "yes" } else { "no" }.to_owned(),
    }
}

/// The unit of a metric, empty where the value says it.
pub(super) fn unit(unit: Unit) -> &'static str {
    match unit {
        Unit::Length => "length",
        Unit::Area => "length²",
        Unit::Volume => "length³",
        Unit::Degrees => "°",
        Unit::Share | Unit::Ratio | Unit::Count | Unit::Flag => "",
    }
}

/// Seconds for people.
pub(super) fn seconds(seconds: f64) -> String {
    if seconds < 0.001 {
        "< 1 ms".to_owned()
    } else if seconds < 1.0 {
        format!("{:.0} ms", 1000.0 * seconds)
    } else if seconds < 100.0 {
        format!("{seconds:.1} s")
    } else {
        format!("{:.0} min {:.0} s", (seconds / 60.0).floor(), seconds % 60.0)
    }
}

/// A name as part of an address within the page.
pub(super) fn anchor(name: &str) -> String {
    name.chars().map(|c| if c.is_alphanumeric() || c == '-' || c == '_' { c } else { '.' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (number, text) in [
            (0.123_456, "0.123"),
            (-1234.5, "−1234"),
            (0.000_012_3, "1.23e−5"),
            (100.0, "100"),
            (0.0, "0"),
            (2.50, "2.5"),
            (1.5e9, "1.50e9"),
        ] {
            assert_eq!(short(number), text);
        }
        assert_eq!(value(&Value::Number(0.0637), Unit::Share), "6.37 %");
        assert_eq!(
            [seconds(0.0), seconds(0.25), seconds(16.92), seconds(125.0)],
            ["< 1 ms", "250 ms", "16.9 s", "2 min 5 s"]
        );
    }

    #[test]
    fn nothing_of_a_name_reaches_the_page_as_markup() {
        assert_eq!(escape("<a href='x'>&\""), "&lt;a href=&#39;x&#39;&gt;&amp;&quot;");
        assert_eq!(anchor("fe.hierarchy/<b>"), "fe.hierarchy..b.");
    }
}
