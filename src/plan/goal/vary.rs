//! What a search may change: parameters, and between which values.

use super::super::CaseSpec;
use crate::recipe::{Scope, Span, Tree, Value, node_of, suggest};

/// A parameter and where it may go.
#[derive(Clone, Debug)]
pub struct Variable {
    /// Its name.
    pub name: String,
    span: Span,
    from: f64,
    to: f64,
    is_percent: bool,
    /// Where the recipe has it.
    start: f64,
}

/// Why a parameter cannot be varied so.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unfit {
    /// What is wrong.
    pub message: String,
    /// What was perhaps meant.
    pub help: Option<String>,
}

impl Variable {
    /// Reads `FROM..TO` for a parameter of the recipe.
    ///
    /// # Errors
    /// The parameter is unknown or no number, or the range is none of its kind.
    pub fn parse(name: &str, text: &str, span: Span, scope: &Scope) -> Result<Self, Unfit> {
        let wrong = |message: String| Unfit { message, help: None };
        let Some(value) = scope.params.get(name) else {
            let help = suggest::did_you_mean(name, "there are", scope.params.keys().map(String::as_str));
            return Err(Unfit { message: format!("the recipe has no parameter `{name}`"), help });
        };
        let (start, is_percent) = match value {
            Some(Value::Number(value)) => (*value, false),
            Some(Value::Percent(value)) => (*value, true),
            _ => return Err(wrong("only a number or a percent can be varied".to_owned())),
        };
        let bound = |text: &str| -> Option<(f64, bool)> {
            let (number, percent) = text.strip_suffix('%').map_or((text, false), |number| (number, true));
            Some((number.trim().parse().ok().filter(|value: &f64| value.is_finite())?, percent))
        };
        let bounds = text.split_once("..").and_then(|(from, to)| Some((bound(from)?, bound(to)?)));
        let Some(((from, a), (to, b))) = bounds.filter(|(from, to)| from.0 < to.0) else {
            return Err(wrong("a range is FROM..TO, as in 1%..6%, the smaller one first".to_owned()));
        };
        if a != is_percent || b != is_percent {
            let kind = if is_percent { "a percent" } else { "a number" };
            return Err(wrong(format!("`{name}` is {kind}, and so must be both bounds")));
        }
        Ok(Self { name: name.to_owned(), span, from, to, is_percent, start })
    }

    /// Sizes and tolerances are matters of ratio.
    fn is_log(&self) -> bool {
        self.from > 0.0
    }

    fn part(&self, value: f64) -> f64 {
        let part = if self.is_log() {
            libm::log(value.max(self.from) / self.from) / libm::log(self.to / self.from)
        } else {
            (value - self.from) / (self.to - self.from)
        };
        part.clamp(0.0, 1.0)
    }

    /// Where the recipe has it, as a part of the range.
    pub fn start(&self) -> f64 {
        self.part(self.start)
    }

    fn value(&self, part: f64) -> Value {
        let between = |value: f64| value.clamp(self.from, self.to);
        // The start is the recipe's own value, to the last digit.
        let value = if part == self.part(self.start) && between(self.start) == self.start {
            self.start
        } else if self.is_log() {
            between(short(self.from * libm::exp(part * libm::log(self.to / self.from))))
        } else {
            between(short(self.from + part * (self.to - self.from)))
        };
        if self.is_percent { Value::Percent(value) } else { Value::Number(value) }
    }
}

/// Three significant digits: a value that a person would write.
fn short(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// The case at a point of the ranges, one coordinate from 0 to 1 a variable.
pub fn case_at(variables: &[Variable], point: &[f64]) -> CaseSpec {
    let mut spec = CaseSpec::default();
    let mut names = Vec::new();
    for (variable, part) in variables.iter().zip(point) {
        let value = variable.value(*part);
        names.push(format!("{}-{}", variable.name, value.to_string().replace('%', "pct")));
        spec.params.push((variable.name.clone(), Tree { span: variable.span, value: node_of(value) }));
    }
    spec.name = names.join("_");
    spec
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    fn variable(text: &str, value: Value) -> Result<Variable, Unfit> {
        let scope = Scope { params: BTreeMap::from([("size".to_owned(), Some(value))]), ..Scope::default() };
        Variable::parse("size", text, Span { start: 0, end: 0 }, &scope)
    }

    #[test]
    fn the_start_is_the_recipes_own_value_and_others_have_three_digits() {
        let size = variable("1%..4%", Value::Percent(2.0)).unwrap();
        assert!((size.start() - 0.5).abs() < 1e-12);
        let value = |part: f64| case_at(std::slice::from_ref(&size), &[part]).name;
        assert_eq!(value(size.start()), "size-2pct");
        assert_eq!((value(0.0).as_str(), value(1.0).as_str()), ("size-1pct", "size-4pct"));
        assert_eq!(value(0.25), "size-1.41pct");
    }

    #[test]
    fn ranges_must_be_of_the_parameters_kind() {
        for (text, value) in [
            ("1..4", Value::Percent(2.0)),
            ("1%..4%", Value::Number(2.0)),
            ("4..1", Value::Number(2.0)),
            ("1..x", Value::Number(2.0)),
            ("1..2", Value::Text("two".to_owned())),
        ] {
            assert!(variable(text, value).is_err(), "{text}");
        }
    }
}
