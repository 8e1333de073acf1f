//! The small language of recipe values that begin with `=`: arithmetic and comparison over parameters.
//!
//! ```text
//! expression := sum (("<" | "<=" | ">" | ">=" | "==" | "!=") sum)?
//! sum        := product (("+" | "-") product)*
//! product    := unary (("*" | "/") unary)*
//! unary      := "-" unary | primary
//! primary    := number | number "%" | 'text' | true | false | NAME | inputs.NAME
//!             | FUNCTION "(" expression ("," expression)* ")" | "(" expression ")"
//! ```
//!
//! Names are kebab-case, so a minus between names needs spaces. Functions: `min`, `max`, `sqrt`, `round`, and
//! `if(condition, then, otherwise)`, which looks only at the branch it takes.
//!
//! # Invariants
//! - A result is finite; what would not be is an error at its operator.
//! - Length and nesting are limited, so neither parsing nor evaluation can exhaust the stack.

mod eval;
mod parse;
#[cfg(test)]
mod tests;

use std::fmt;
use std::ops::Range;
use std::path::PathBuf;

pub use eval::evaluate;
pub use parse::{Expression, parse};

/// A value of a parameter or an expression.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A number.
    Number(f64),
    /// Percent as written: `2%` is 2.
    Percent(f64),
    /// True or false.
    Bool(bool),
    /// A text.
    Text(String),
    /// A file of `[inputs]`, with its path as it is opened.
    File(PathBuf),
}

impl Value {
    /// The name of its type, for messages.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Number(_) => "a number",
            Self::Percent(_) => "a percent",
            Self::Bool(_) => "a bool",
            Self::Text(_) => "a string",
            Self::File(_) => "a file",
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(value) => write!(f, "{value}"),
            Self::Percent(value) => write!(f, "{value}%"),
            Self::Bool(value) => write!(f, "{value}"),
            Self::Text(text) => f.write_str(text),
            Self::File(path) => write!(f, "{}", path.display()),
        }
    }
}

/// What is wrong with an expression, and where: a byte range of its text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExpressionError {
    /// Bytes of the expression.
    pub range: Range<usize>,
    /// What is wrong.
    pub message: String,
    /// What to try.
    pub help: Option<String>,
}

impl ExpressionError {
    fn new(range: Range<usize>, message: impl Into<String>) -> Self {
        Self { range, message: message.into(), help: None }
    }

    fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}
