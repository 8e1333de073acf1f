//! Syntax tree to value.

use super::parse::{Expression, Function, Node, Operator};
use super::{ExpressionError, Value};

/// The value of an expression. `lookup` knows the parameters and `inputs.NAME`; its error says why a name has none.
pub fn evaluate(
    expression: &Expression,
    lookup: &dyn Fn(&str) -> Result<Value, ExpressionError>,
) -> Result<Value, ExpressionError> {
    let at = |message: String| ExpressionError::new(expression.range.clone(), message);
    let value = match &expression.node {
        Node::Number(value) => Value::Number(*value),
        Node::Percent(value) => Value::Percent(*value),
        Node::Bool(value) => Value::Bool(*value),
        Node::Text(text) => Value::Text(text.clone()),
        Node::Name(name) => {
            return lookup(name).map_err(|mut error| {
                error.range = expression.range.clone();
                error
            });
        }
        Node::Negate(inner) => match evaluate(inner, lookup)? {
            Value::Number(value) => Value::Number(-value),
            Value::Percent(value) => Value::Percent(-value),
            other @ (Value::Bool(_) | Value::Text(_) | Value::File(_)) => {
                return Err(at(format!("cannot negate {}", other.kind())));
            }
        },
        Node::Binary(operator, left, right) => {
            let (left, right) = (evaluate(left, lookup)?, evaluate(right, lookup)?);
            binary(*operator, &left, &right).map_err(|(message, help)| {
                let mut error = at(message);
                error.help = help.map(str::to_owned);
                error
            })?
        }
        Node::Call(Function::If, arguments) => return branch(arguments, lookup),
        Node::Call(function, arguments) => {
            let values = arguments.iter().map(|argument| evaluate(argument, lookup)).collect::<Result<Vec<_>, _>>()?;
            call(*function, &values).map_err(at)?
        }
    };
    match value {
        Value::Number(number) | Value::Percent(number) if !number.is_finite() => {
            Err(at("the result is not a finite number".to_owned()))
        }
        finite => Ok(finite),
    }
}

fn branch(
    arguments: &[Expression],
    lookup: &dyn Fn(&str) -> Result<Value, ExpressionError>,
) -> Result<Value, ExpressionError> {
    let [condition, then, otherwise] = arguments else {
        return Err(ExpressionError::new(0..0, "`if` takes three values"));
    };
    match evaluate(condition, lookup)? {
        Value::Bool(true) => evaluate(then, lookup),
        Value::Bool(false) => evaluate(otherwise, lookup),
        other @ (Value::Number(_) | Value::Percent(_) | Value::Text(_) | Value::File(_)) => {
            let message = format!("the condition of `if` is {}, not a bool", other.kind());
            Err(ExpressionError::new(condition.range.clone(), message)
                .help("compare something, as in `if(size > 1%, 2, 3)`"))
        }
    }
}

type BinaryError = (String, Option<&'static str>);

fn binary(operator: Operator, left: &Value, right: &Value) -> Result<Value, BinaryError> {
    use Operator::{Add, Divide, Equal, Greater, GreaterOrEqual, Less, LessOrEqual, Multiply, NotEqual, Subtract};
    use Value::{Number, Percent};
    let value = match (operator, left, right) {
        (Divide, _, Number(0.0) | Percent(0.0)) => return Err(("division by zero".to_owned(), None)),
        (Add, Number(a), Number(b)) => Number(a + b),
        (Subtract, Number(a), Number(b)) => Number(a - b),
        (Multiply, Number(a), Number(b)) => Number(a * b),
        (Divide, Number(a), Number(b)) | (Divide, Percent(a), Percent(b)) => Number(a / b),
        (Add, Percent(a), Percent(b)) => Percent(a + b),
        (Subtract, Percent(a), Percent(b)) => Percent(a - b),
        (Multiply, Percent(a), Number(b)) | (Multiply, Number(a), Percent(b)) => Percent(a * b),
        (Divide, Percent(a), Number(b)) => Percent(a / b),
        (Equal, _, _) if same_kind(left, right) => Value::Bool(left == right),
        (NotEqual, _, _) if same_kind(left, right) => Value::Bool(left != right),
        (Less, Number(a), Number(b)) | (Less, Percent(a), Percent(b)) => Value::Bool(a < b),
        (LessOrEqual, Number(a), Number(b)) | (LessOrEqual, Percent(a), Percent(b)) => Value::Bool(a <= b),
        (Greater, Number(a), Number(b)) | (Greater, Percent(a), Percent(b)) => Value::Bool(a > b),
        (GreaterOrEqual, Number(a), Number(b)) | (GreaterOrEqual, Percent(a), Percent(b)) => Value::Bool(a >= b),
        _ => return Err(mismatch(operator, left, right)),
    };
    Ok(value)
}

fn same_kind(left: &Value, right: &Value) -> bool {
    std::mem::discriminant(left) == std::mem::discriminant(right)
}

fn mismatch(operator: Operator, left: &Value, right: &Value) -> BinaryError {
    let message = format!("cannot compute {} {} {}", left.kind(), operator.symbol(), right.kind());
    let numeric = |value: &Value| matches!(value, Value::Percent(_) | Value::Number(_));
    let mixes = numeric(left) && numeric(right);
    (message, mixes.then_some("a percent may be added to a percent, and multiplied with or divided by a number"))
}

fn call(function: Function, values: &[Value]) -> Result<Value, String> {
    match (function, values) {
        (Function::Sqrt, [Value::Number(value)]) if *value >= 0.0 => Ok(Value::Number(value.sqrt())),
        (Function::Sqrt, [Value::Number(_)]) => Err("the square root of a negative number".to_owned()),
        (Function::Round, [Value::Number(value)]) => Ok(Value::Number(value.round())),
        (Function::Round, [Value::Percent(value)]) => Ok(Value::Percent(value.round())),
        (Function::Min, values) => extremum(values, "min", f64::min),
        (Function::Max, values) => extremum(values, "max", f64::max),
        (Function::Sqrt, _) => Err(format!("`sqrt` takes a number, got {}", kinds(values))),
        (Function::Round, _) => Err(format!("`round` takes a number or a percent, got {}", kinds(values))),
        (Function::If, _) => Err("`if` takes a condition and two values".to_owned()),
    }
}

fn extremum(values: &[Value], name: &str, choose: fn(f64, f64) -> f64) -> Result<Value, String> {
    let wrong = || format!("`{name}` takes numbers or percents, not both, got {}", kinds(values));
    let mut values_left = values.iter();
    let mut best = values_left.next().cloned().ok_or_else(wrong)?;
    if !matches!(best, Value::Number(_) | Value::Percent(_)) {
        return Err(wrong());
    }
    for value in values_left {
        best = match (&best, value) {
            (Value::Number(a), Value::Number(b)) => Value::Number(choose(*a, *b)),
            (Value::Percent(a), Value::Percent(b)) => Value::Percent(choose(*a, *b)),
            _ => return Err(wrong()),
        };
    }
    Ok(best)
}

fn kinds(values: &[Value]) -> String {
    values.iter().map(Value::kind).collect::<Vec<_>>().join(", ")
}
