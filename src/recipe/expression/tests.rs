//! Values and errors of expressions.

use super::*;

fn value(text: &str) -> Result<Value, ExpressionError> {
    let lookup = |name: &str| match name {
        "size" => Ok(Value::Percent(2.0)),
        "count" => Ok(Value::Number(3.0)),
        "max-edge" => Ok(Value::Number(0.5)),
        "inputs.part" => Ok(Value::File("part.stl".into())),
        _ => Err(ExpressionError { range: 0..0, message: format!("there is no parameter `{name}`"), help: None }),
    };
    evaluate(&parse(text)?, &lookup)
}

fn number(text: &str) -> f64 {
    match value(text) {
        Ok(Value::Number(number)) => number,
        other => panic!("{text}: {other:?}"),
    }
}

fn message(text: &str) -> String {
    value(text).unwrap_err().message
}

#[test]
fn arithmetic_binds_as_usual() {
    assert_eq!(number("1 + 2*3 - 4/2"), 5.0);
    assert_eq!(number("(1+2)*3"), 9.0);
    assert_eq!(number("-count + --1"), -2.0);
    assert_eq!(number("8/2/2"), 2.0);
    assert_eq!(number("1e3 - 1_0.5"), 989.5);
    assert_eq!(number("max-edge * 2"), 1.0);
    assert_eq!(number("count - max-edge"), 2.5);
}

#[test]
fn percents_keep_their_unit() {
    assert_eq!(value("2*size").unwrap(), Value::Percent(4.0));
    assert_eq!(value("size*2").unwrap(), Value::Percent(4.0));
    assert_eq!(value("size/4").unwrap(), Value::Percent(0.5));
    assert_eq!(value("size + 1%").unwrap(), Value::Percent(3.0));
    assert_eq!(value("-size").unwrap(), Value::Percent(-2.0));
    assert_eq!(number("size / 1%"), 2.0);
    assert_eq!(value("max(size, 5%, 1%)").unwrap(), Value::Percent(5.0));
    for wrong in ["size + 1", "1 - size", "size * size", "1 / size", "min(1, 1%)", "size < 1"] {
        assert!(value(wrong).is_err(), "{wrong}");
    }
    assert!(value("size + 1").unwrap_err().help.is_some());
}

#[test]
fn comparison_and_choice() {
    assert_eq!(value("1 < 2").unwrap(), Value::Bool(true));
    assert_eq!(value("size >= 2%").unwrap(), Value::Bool(true));
    assert_eq!(value("'a' == 'b'").unwrap(), Value::Bool(false));
    assert_eq!(value("true != false").unwrap(), Value::Bool(true));
    assert_eq!(number("if(size > 1%, 2, 3)"), 2.0);
    assert_eq!(number("if(1 > 2, 1/0, round(2.5))"), 3.0);
    assert_eq!(value("if(true, 'all', 'none')").unwrap(), Value::Text("all".to_owned()));
    assert!(message("if(1, 2, 3)").contains("not a bool"));
}

#[test]
fn functions() {
    assert_eq!(number("sqrt(9) + min(3, 1, 2) + round(1.4)"), 5.0);
    assert!(message("sqrt(-1)").contains("negative"));
    assert!(message("sqrt(1, 2)").contains("takes one value"));
    assert!(message("sqr(1)").contains("no function"));
    assert!(message("min('a')").contains("takes numbers"));
}

#[test]
fn files_come_from_inputs() {
    assert_eq!(value("inputs.part").unwrap(), Value::File("part.stl".into()));
    assert!(message("inputs.part + 1").contains("a file + a number"));
}

#[test]
fn errors_have_places() {
    let at = |text: &str| value(text).unwrap_err().range;
    assert_eq!(at("1 + zise"), 4..8);
    assert_eq!(at("1 + + 2"), 4..5);
    assert_eq!(at("2 * (size + 1)"), 4..14);
    assert_eq!(at("(1 + 2"), 0..1);
    assert_eq!(at("1 2"), 2..3);
    assert_eq!(at("'open"), 0..5);
    assert_eq!(at("1..2"), 0..4);
    assert_eq!(at(""), 0..0);
    assert!(message("1e999").contains("not a number"));
    assert!(message("1/0").contains("zero"));
    assert!(message("1e200*1e200").contains("finite"));
}

#[test]
fn nesting_and_length_are_limited() {
    assert!(message(&"(".repeat(400)).contains("nested"));
    assert!(message(&"(".repeat(100_000)).contains("longer"));
    assert!(message(&"-".repeat(900)).contains("value"));
    assert!(message(&format!("{}1", "-".repeat(900))).contains("minus"));
    assert!(message(&"min(".repeat(200)).contains("nested"));
    assert_eq!(number(&format!("1{}", "+1".repeat(499))), 500.0);
}
