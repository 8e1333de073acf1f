//! What a search looks for: `min faces where min-stretch >= 0.3 and distance <= 0.2%`.

pub mod search;
pub mod vary;

use super::columns::ColumnRequest;
use crate::metric::gate::Limit;
use crate::recipe::{Diagnostic, Span};

/// A goal: one metric to make small or large, and others that must stay within their limits.
#[derive(Clone, Debug, PartialEq)]
pub struct Goal {
    /// Whether the metric is made large.
    pub maximize: bool,
    /// The metric, then those with limits.
    pub columns: Vec<ColumnRequest>,
}

/// Reads a goal that is written at `base`.
///
/// # Errors
/// What is wrong with it, and where.
pub fn parse(text: &str, base: usize) -> Result<Goal, Diagnostic> {
    let mut words = words(text, base).into_iter().peekable();
    let whole = Span { start: base, end: base + text.len() };
    let form = "write \"min METRIC where METRIC >= NUMBER and METRIC <= NUMBER\"";
    let wrong = |span: Span, message: &str| Diagnostic::error(span, message.to_owned()).help(form);
    let maximize = match words.next() {
        Some(("min", _)) => false,
        Some(("max", _)) => true,
        Some((_, span)) => return Err(wrong(span, "a goal begins with `min` or `max`")),
        None => return Err(wrong(whole, "a goal begins with `min` or `max`")),
    };
    let Some((metric, span)) = words.next() else {
        return Err(wrong(whole, "the goal does not say which metric it is about"));
    };
    let mut columns = vec![ColumnRequest::parse(metric, span)];
    let mut expected = "where";
    while let Some((word, span)) = words.next() {
        if word != expected {
            return Err(wrong(span, &format!("`{expected}` is wanted here, got `{word}`")));
        }
        let (Some((metric, at)), Some((relation, sign)), Some((number, place))) =
            (words.next(), words.next(), words.next())
        else {
            return Err(wrong(span, "a condition is a metric, `>=` or `<=`, and a number"));
        };
        let mut column = ColumnRequest::parse(metric, at);
        let Some(limit) = limit(number) else {
            return Err(wrong(place, "this is neither a number nor a percent"));
        };
        match relation {
            ">=" => column.at_least = Some(limit),
            "<=" => column.at_most = Some(limit),
            _ => return Err(wrong(sign, "a condition compares with `>=` or `<=`")),
        }
        columns.push(column);
        expected = "and";
    }
    Ok(Goal { maximize, columns })
}

fn limit(text: &str) -> Option<Limit> {
    let finite = |text: &str| text.parse().ok().filter(|value: &f64| value.is_finite());
    match text.strip_suffix('%') {
        Some(percent) => finite(percent).map(Limit::Percent),
        None => finite(text).map(Limit::Number),
    }
}

/// Words and their places; relations are words though nothing stands around them.
fn words(text: &str, base: usize) -> Vec<(&str, Span)> {
    let mut words = Vec::new();
    let mut start = None;
    let bytes = text.as_bytes();
    let kind = |byte: u8| match byte {
        b'<' | b'>' | b'=' => 1,
        byte if byte.is_ascii_whitespace() => 0,
        _ => 2,
    };
    for at in 0..=bytes.len() {
        let here = bytes.get(at).map_or(0, |byte| kind(*byte));
        if let Some(begin) = start
            && here != kind(bytes[begin])
        {
            words.push((&text[begin..at], Span { start: base + begin, end: base + at }));
            start = None;
        }
        if start.is_none() && here != 0 {
            start = Some(at);
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_goal_is_a_metric_and_conditions() {
        let goal = parse("min faces where min-stretch>=0.3 and fe.distance <= 0.2%", 10).unwrap();
        assert!(!goal.maximize);
        assert_eq!(goal.columns.len(), 3);
        assert_eq!(goal.columns[0].metric.0, "faces");
        assert_eq!(goal.columns[1].at_least, Some(Limit::Number(0.3)));
        assert_eq!(goal.columns[2].of.as_ref().map(|of| of.0.as_str()), Some("fe"));
        assert_eq!(goal.columns[2].at_most, Some(Limit::Percent(0.2)));
        assert!(parse("max mean-stretch", 0).is_ok_and(|goal| goal.maximize));
    }

    #[test]
    fn what_is_no_goal_is_told_where_it_goes_wrong() {
        for (text, at) in [
            ("", 0),
            ("least faces", 0),
            ("min", 0),
            ("min faces if x", 10),
            ("min faces where a > 3", 18),
            ("min faces where a >= x", 21),
            ("min faces where a >= 1 where b >= 2", 23),
            ("min faces where a", 10),
        ] {
            let problem = parse(text, 0).unwrap_err();
            assert_eq!(problem.labels[0].span.start, at, "{text}: {}", problem.message);
        }
    }
}
