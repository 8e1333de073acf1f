//! From a table to criteria, with the place of every fault.

use crate::metric::element::{ELEMENT_METRICS, ElementMetric, find};
use crate::metric::gate::Limit;
use crate::metric::gate::criteria::{Criteria, Criterion, LEVELS, PENALTIES};
use crate::metric::registry::{Direction, Unit};
use crate::recipe::suggest::did_you_mean;
use crate::recipe::{Diagnostic, Entry, Node, Scope, SourceMap, Span, Table, Tree, is_full, names_used};

/// The keys of a table of criteria besides its metrics. `file` is followed by the loader.
pub const OWN_KEYS: [&str; 4] = ["file", "description", "params", "penalties"];
/// The keys of a criterion.
pub const LEVEL_KEYS: [&str; 7] = ["ideal", "good", "warn", "fail", "worst", "weight", "on"];

/// Larger numbers than these are no levels of anything; their differences would be no numbers.
const LARGEST: f64 = 1e150;
/// The largest weight or penalty.
const HEAVIEST: f64 = 1e9;

/// Reads the criteria `name` out of a table at `place`. `None` where something is wrong; then `problems` says what, or
/// has said so before.
pub fn read(
    (name, place): (&str, Span),
    table: &Table,
    scope: &Scope,
    sources: &SourceMap,
    problems: &mut Vec<Diagnostic>,
) -> Option<Criteria> {
    let before = problems.len();
    let mut reader = Reader { scope: scope.clone(), sources, problems, lost: false };
    reader.params(table);
    let mut criteria =
        Criteria { name: name.to_owned(), penalties: PENALTIES, criteria: Vec::new(), except: Vec::new() };
    for (key, entry) in table.in_order() {
        if is_full(reader.problems) {
            break;
        }
        match key {
            "params" => {}
            // Its file could not be read, which was told.
            "file" => reader.lost = true,
            "description" => reader.description(entry),
            "penalties" => criteria.penalties = reader.penalties(&entry.value).unwrap_or(PENALTIES),
            _ => match find(key) {
                Some(metric) => criteria.criteria.extend(reader.criterion(metric, entry)),
                None => reader.unknown(key, entry),
            },
        }
    }
    let lost = reader.lost;
    if criteria.criteria.is_empty() && problems.len() == before && !lost {
        let message = format!("the criteria `{name}` judge nothing");
        let help = "write a metric, such as skew = { ideal = 0, good = 10, warn = 35, fail = 45, worst = 70 }";
        problems.push(Diagnostic::error(place, message).help(help));
    }
    let order = |criterion: &Criterion| ELEMENT_METRICS.iter().position(|metric| metric.name == criterion.metric);
    criteria.criteria.sort_by_key(order);
    (problems.len() == before && !lost).then_some(criteria)
}

struct Reader<'a> {
    scope: Scope,
    sources: &'a SourceMap,
    problems: &'a mut Vec<Diagnostic>,
    /// A value is wrong whose fault was told elsewhere.
    lost: bool,
}

impl Reader<'_> {
    fn fault(&mut self, span: Span, message: String, help: Option<String>) {
        self.problems.push(Diagnostic::error(span, message).help_opt(help));
    }

    /// Opens the scope of the table's own parameters.
    fn params(&mut self, table: &Table) {
        let Some(entry) = table.get("params") else { return };
        let Node::Table(params) = &entry.value.value else {
            let message = format!("`params` is a table, got {}", entry.value.value.kind());
            return self.fault(entry.value.span, message, Some("write params = { size = 5 }".to_owned()));
        };
        self.scope = self.scope.within(params, self.sources, self.problems);
        let mut others = table.clone();
        others.take("params");
        let Some(used) = names_used(&others) else { return };
        for (name, entry) in params.in_order() {
            if !used.contains(name) && !is_full(self.problems) {
                let help = did_you_mean(name, "the criteria use", used.iter().map(String::as_str));
                self.fault(entry.key, format!("nothing in these criteria uses the parameter `{name}`"), help);
            }
        }
    }

    fn description(&mut self, entry: &Entry) {
        if !matches!(entry.value.value, Node::Text(_)) {
            let message = format!("`description` is a string, got {}", entry.value.value.kind());
            self.fault(entry.value.span, message, None);
        }
    }

    fn unknown(&mut self, key: &str, entry: &Entry) {
        let message = format!("criteria have no key `{key}`");
        let names = ELEMENT_METRICS.iter().map(|metric| metric.name).chain(OWN_KEYS);
        let help = did_you_mean(key, "metrics of elements", names)
            .unwrap_or_else(|| "`meshmill criteria metrics` lists the metrics of elements".to_owned());
        self.fault(entry.key, message, Some(help));
    }

    fn value(&mut self, tree: &Tree) -> Option<Tree> {
        let before = self.problems.len();
        let value = self.scope.substitute(tree, self.sources, self.problems);
        self.lost |= value.is_none() && self.problems.len() == before;
        value
    }

    /// Five numbers that do not fall.
    fn penalties(&mut self, tree: &Tree) -> Option<[f64; 5]> {
        let value = self.value(tree)?;
        let Node::List(items) = &value.value else {
            let message = format!("`penalties` are five numbers, got {}", value.value.kind());
            self.fault(value.span, message, Some("write penalties = [0, 0, 0.8, 1, 10]".to_owned()));
            return None;
        };
        let numbers: Vec<Option<f64>> = items.iter().map(Tree::as_number).collect();
        let good = |n: &f64| (0.0..=HEAVIEST).contains(n);
        let read: Vec<f64> = numbers.into_iter().flatten().filter(good).collect();
        match <[f64; 5]>::try_from(read.as_slice()) {
            Ok(read) if items.len() == 5 && read.is_sorted() => Some(read),
            _ => {
                let message =
                    format!("`penalties` are five numbers from 0 to {HEAVIEST:e}, none less than the one before");
                self.fault(value.span, message, Some("write penalties = [0, 0, 0.8, 1, 10]".to_owned()));
                None
            }
        }
    }

    /// A criterion; `None` where it is off or wrong.
    fn criterion(&mut self, metric: &'static ElementMetric, entry: &Entry) -> Option<Criterion> {
        let value = self.value(&entry.value)?;
        let table = match &value.value {
            Node::Bool(false) => return None,
            Node::Table(table) => table,
            other => {
                let message = format!("the criterion `{}` is a table of levels, got {}", metric.name, other.kind());
                let help = format!(
                    "write {} = {{ ideal = …, good = …, warn = …, fail = …, worst = … }}, or false where it does not count",
                    metric.name
                );
                self.fault(value.span, message, Some(help));
                return None;
            }
        };
        let (mut levels, mut weight, mut is_on) = ([None; 5], 1.0, true);
        let before = self.problems.len();
        for (key, level) in table.in_order() {
            match (key, LEVELS.iter().position(|name| *name == key)) {
                (_, Some(place)) => levels[place] = self.level(metric, key, &level.value),
                ("weight", None) => weight = self.weight(metric, &level.value),
                ("on", None) => is_on = self.is_on(metric, &level.value),
                _ => {
                    let help = did_you_mean(key, "keys", LEVEL_KEYS);
                    self.fault(level.key, format!("a criterion has no key `{key}`"), help);
                }
            }
        }
        if self.problems.len() > before {
            return None;
        }
        let missing: Vec<&str> = LEVELS.into_iter().filter(|name| table.get(name).is_none()).collect();
        if !missing.is_empty() {
            let message = format!("the criterion `{}` has no {}", metric.name, missing.join(", no "));
            let help = "a criterion has five levels: ideal, good, warn, fail and worst";
            self.fault(entry.key, message, Some(help.to_owned()));
            return None;
        }
        let levels = self.ordered(metric, table, levels)?;
        is_on.then(|| Criterion { metric: metric.name.to_owned(), levels, weight })
    }

    fn level(&mut self, metric: &ElementMetric, key: &str, tree: &Tree) -> Option<Limit> {
        let is_level = |n: &f64| n.abs() <= LARGEST;
        let percent = |text: &str| text.strip_suffix('%')?.trim().parse().ok().filter(is_level);
        let level = match &tree.value {
            Node::Number(_) => tree.as_number().filter(is_level).map(Limit::Number),
            Node::Text(text) => percent(text).and_then(|percent| match metric.unit {
                Unit::Share => Some(Limit::Number(percent / 100.0)),
                Unit::Length => Some(Limit::Percent(percent)),
                _ => None,
            }),
            Node::Bool(_) | Node::Date(_) | Node::List(_) | Node::Table(_) | Node::File(_) => None,
        };
        if level.is_none() {
            let wanted = match metric.unit {
                Unit::Length => "a number in mesh units or a percent of the diagonal such as \"2%\"",
                Unit::Share => "a number from 0 to 1 or a percent such as \"15%\"",
                Unit::Degrees => "a number of degrees",
                _ => "a number",
            };
            let got = match &tree.value {
                Node::Text(text) => format!("\"{text}\""),
                Node::Number(spelling) => spelling.clone(),
                other => other.kind().to_owned(),
            };
            self.fault(tree.span, format!("`{key}` of `{}` is {wanted}, got {got}", metric.name), None);
        }
        level
    }

    fn weight(&mut self, metric: &ElementMetric, tree: &Tree) -> f64 {
        let weight = tree.as_number().filter(|weight| (0.0..=HEAVIEST).contains(weight));
        if weight.is_none() {
            let message = format!("`weight` of `{}` is a number from 0 to {HEAVIEST:e}", metric.name);
            self.fault(tree.span, message, None);
        }
        weight.unwrap_or_default()
    }

    fn is_on(&mut self, metric: &ElementMetric, tree: &Tree) -> bool {
        if let Node::Bool(is_on) = tree.value {
            return is_on;
        }
        self.fault(tree.span, format!("`on` of `{}` is true or false, got {}", metric.name, tree.value.kind()), None);
        false
    }

    /// The levels, where each is no better than the one before.
    fn ordered(&mut self, metric: &ElementMetric, table: &Table, levels: [Option<Limit>; 5]) -> Option<[Limit; 5]> {
        let [Some(a), Some(b), Some(c), Some(d), Some(e)] = levels else { return None };
        let mut levels = [a, b, c, d, e];
        if levels.iter().any(|level| matches!(level, Limit::Percent(_))) {
            // Nothing is nothing in either unit.
            levels = levels.map(|level| if level == Limit::Number(0.0) { Limit::Percent(0.0) } else { level });
        }
        let span = |place: usize| table.get(LEVELS[place]).map(|entry| entry.value.span).unwrap_or_default();
        let sign = if metric.direction == Direction::Higher { -1.0 } else { 1.0 };
        for place in 1..5 {
            let fault = match (levels[place - 1], levels[place]) {
                (Limit::Number(a), Limit::Number(b)) | (Limit::Percent(a), Limit::Percent(b)) => {
                    let better = if metric.direction == Direction::Higher { "more" } else { "less" };
                    let message = format!(
                        "`{}` of `{}` is better than its `{}`: {better} is better here",
                        LEVELS[place],
                        metric.name,
                        LEVELS[place - 1]
                    );
                    (sign * b < sign * a).then_some(message)
                }
                _ => Some(format!("the levels of `{}` are all numbers or all percents", metric.name)),
            };
            if let Some(message) = fault {
                self.problems.push(Diagnostic::error(span(place), message).label(span(place - 1), ""));
                return None;
            }
        }
        Some(levels)
    }
}

#[cfg(test)]
mod tests;
