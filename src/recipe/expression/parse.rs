//! Text to syntax tree, by recursive descent.

use std::ops::Range;

use super::ExpressionError;

/// Nobody writes longer ones by hand, and it bounds the depth of the tree.
const LONGEST: usize = 1000;

/// Parentheses, minus signs and calls within each other.
const DEEPEST: usize = 50;

/// The functions, for messages.
pub(super) const FUNCTIONS: [&str; 5] = ["min", "max", "sqrt", "round", "if"];

/// A parsed expression and the bytes it was written in.
#[derive(Clone, Debug, PartialEq)]
pub struct Expression {
    /// Bytes of the text.
    pub range: Range<usize>,
    /// What it is.
    pub(super) node: Node,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Node {
    Number(f64),
    Percent(f64),
    Bool(bool),
    Text(String),
    /// A parameter, or `inputs.NAME`.
    Name(String),
    Negate(Box<Expression>),
    Binary(Operator, Box<Expression>, Box<Expression>),
    Call(Function, Vec<Expression>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operator {
    Add,
    Subtract,
    Multiply,
    Divide,
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
    Equal,
    NotEqual,
}

impl Operator {
    pub(super) fn symbol(self) -> &'static str {
        match self {
            Self::Add => "+",
            Self::Subtract => "-",
            Self::Multiply => "*",
            Self::Divide => "/",
            Self::Less => "<",
            Self::LessOrEqual => "<=",
            Self::Greater => ">",
            Self::GreaterOrEqual => ">=",
            Self::Equal => "==",
            Self::NotEqual => "!=",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Function {
    Min,
    Max,
    Sqrt,
    Round,
    If,
}

impl Expression {
    /// The names it uses, with their places.
    pub fn names(&self) -> Vec<(&str, Range<usize>)> {
        let mut names = Vec::new();
        self.collect_names(&mut names);
        names
    }

    fn collect_names<'a>(&'a self, names: &mut Vec<(&'a str, Range<usize>)>) {
        match &self.node {
            Node::Name(name) => names.push((name, self.range.clone())),
            Node::Negate(inner) => inner.collect_names(names),
            Node::Binary(_, left, right) => {
                left.collect_names(names);
                right.collect_names(names);
            }
            Node::Call(_, arguments) => arguments.iter().for_each(|argument| argument.collect_names(names)),
            Node::Number(_) | Node::Percent(_) | Node::Bool(_) | Node::Text(_) => {}
        }
    }
}

/// Parses the text after the `=`.
pub fn parse(text: &str) -> Result<Expression, ExpressionError> {
    if text.len() > LONGEST {
        let message = format!("the expression is longer than {LONGEST} bytes");
        return Err(ExpressionError::new(0..text.len(), message));
    }
    let mut parser = Parser { text, at: 0, depth: 0 };
    let expression = parser.comparison()?;
    parser.skip_space();
    if parser.at < text.len() {
        let rest = parser.rest_of_token();
        return Err(ExpressionError::new(parser.at..parser.at + rest.len(), format!("did not expect `{rest}` here"))
            .help("an operator or the end of the expression fits here"));
    }
    Ok(expression)
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    depth: usize,
}

impl<'a> Parser<'a> {
    fn skip_space(&mut self) {
        self.at = self.text.len() - self.text[self.at..].trim_start().len();
    }

    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    /// The next few characters, for messages.
    fn rest_of_token(&self) -> &'a str {
        let rest = self.rest();
        let word = rest.find(|c: char| !(c.is_alphanumeric() || c == '_' || c == '.')).unwrap_or(rest.len());
        let first = rest.chars().next().map_or(0, char::len_utf8);
        &rest[..word.max(first)]
    }

    fn eat(&mut self, symbol: &str) -> bool {
        self.skip_space();
        let found = self.rest().starts_with(symbol);
        if found {
            self.at += symbol.len();
        }
        found
    }

    fn eat_operator(&mut self, operators: &[Operator]) -> Option<Operator> {
        operators.iter().copied().find(|operator| self.eat(operator.symbol()))
    }

    fn comparison(&mut self) -> Result<Expression, ExpressionError> {
        const OPERATORS: [Operator; 6] = [
            Operator::LessOrEqual,
            Operator::GreaterOrEqual,
            Operator::Equal,
            Operator::NotEqual,
            Operator::Less,
            Operator::Greater,
        ];
        self.depth += 1;
        if self.depth > DEEPEST {
            let message = format!("the expression is nested deeper than {DEEPEST} levels");
            return Err(ExpressionError::new(self.at..self.at + self.rest_of_token().len(), message));
        }
        let left = self.sum()?;
        let expression = match self.eat_operator(&OPERATORS) {
            Some(operator) => binary(operator, left, self.sum()?),
            None => left,
        };
        self.depth -= 1;
        Ok(expression)
    }

    fn sum(&mut self) -> Result<Expression, ExpressionError> {
        let mut left = self.product()?;
        while let Some(operator) = self.eat_operator(&[Operator::Add, Operator::Subtract]) {
            left = binary(operator, left, self.product()?);
        }
        Ok(left)
    }

    fn product(&mut self) -> Result<Expression, ExpressionError> {
        let mut left = self.unary()?;
        while let Some(operator) = self.eat_operator(&[Operator::Multiply, Operator::Divide]) {
            left = binary(operator, left, self.unary()?);
        }
        Ok(left)
    }

    fn unary(&mut self) -> Result<Expression, ExpressionError> {
        self.skip_space();
        let start = self.at;
        let mut minuses = 0_usize;
        while self.eat("-") {
            minuses += 1;
        }
        let mut inner = self.primary()?;
        if minuses > DEEPEST {
            return Err(ExpressionError::new(start..inner.range.end, "too many minus signs"));
        }
        for _ in 0..minuses {
            let range = start..inner.range.end;
            inner = Expression { range, node: Node::Negate(Box::new(inner)) };
        }
        Ok(inner)
    }

    fn primary(&mut self) -> Result<Expression, ExpressionError> {
        self.skip_space();
        let start = self.at;
        let node = match self.rest().chars().next() {
            Some('(') => {
                self.at += 1;
                let inner = self.comparison()?;
                self.close(start)?;
                inner.node
            }
            Some('\'') => self.quoted(start)?,
            Some(c) if c.is_ascii_digit() || c == '.' => self.number()?,
            Some(c) if c.is_alphabetic() || c == '_' => self.word()?,
            Some(_) => {
                let token = self.rest_of_token();
                let range = start..start + token.len();
                return Err(ExpressionError::new(range, format!("expected a value, found `{token}`"))
                    .help("a value is a number, a percent, a 'string', true, false, a parameter or `inputs.NAME`"));
            }
            None => {
                let at = self.text.len().saturating_sub(1);
                return Err(ExpressionError::new(
                    at..self.text.len(),
                    "a value is missing at the end of the expression",
                ));
            }
        };
        Ok(Expression { range: start..self.at, node })
    }

    fn close(&mut self, open: usize) -> Result<(), ExpressionError> {
        if self.eat(")") {
            return Ok(());
        }
        Err(ExpressionError::new(open..open + 1, "this parenthesis is not closed"))
    }

    fn quoted(&mut self, start: usize) -> Result<Node, ExpressionError> {
        let content = &self.rest()[1..];
        let Some(end) = content.find('\'') else {
            return Err(ExpressionError::new(start..self.text.len(), "this string is not closed"));
        };
        self.at += end + 2;
        Ok(Node::Text(content[..end].to_owned()))
    }

    fn number(&mut self) -> Result<Node, ExpressionError> {
        let bytes = self.rest().as_bytes();
        let mut length = 0;
        while let Some(byte) = bytes.get(length) {
            let sign_of_exponent =
                matches!(byte, b'+' | b'-') && length > 0 && matches!(bytes[length - 1], b'e' | b'E');
            if !(byte.is_ascii_alphanumeric() || matches!(byte, b'.' | b'_') || sign_of_exponent) {
                break;
            }
            length += 1;
        }
        let written = &self.rest()[..length];
        let range = self.at..self.at + length;
        let value = written.replace('_', "").parse::<f64>().ok().filter(|value| value.is_finite());
        let Some(value) = value else {
            return Err(ExpressionError::new(range, format!("`{written}` is not a number")));
        };
        self.at += length;
        if self.rest().starts_with('%') {
            self.at += 1;
            return Ok(Node::Percent(value));
        }
        Ok(Node::Number(value))
    }

    fn word(&mut self) -> Result<Node, ExpressionError> {
        let start = self.at;
        let name = self.name();
        match name {
            "true" => return Ok(Node::Bool(true)),
            "false" => return Ok(Node::Bool(false)),
            _ => {}
        }
        let range = start..self.at;
        if !self.eat("(") {
            self.at = range.end;
            return Ok(Node::Name(name.to_owned()));
        }
        let function = match name {
            "min" => Function::Min,
            "max" => Function::Max,
            "sqrt" => Function::Sqrt,
            "round" => Function::Round,
            "if" => Function::If,
            _ => {
                let help = crate::recipe::suggest::did_you_mean(name, "functions", FUNCTIONS);
                let mut error = ExpressionError::new(range, format!("there is no function `{name}`"));
                error.help = help;
                return Err(error);
            }
        };
        let open = self.at - 1;
        let mut arguments = vec![self.comparison()?];
        while self.eat(",") {
            arguments.push(self.comparison()?);
        }
        self.close(open)?;
        let fits = match function {
            Function::Min | Function::Max => true,
            Function::Sqrt | Function::Round => arguments.len() == 1,
            Function::If => arguments.len() == 3,
        };
        if !fits {
            let wanted =
                if function == Function::If { "three values: if(condition, then, otherwise)" } else { "one value" };
            let message = format!("`{name}` takes {wanted}, got {}", arguments.len());
            return Err(ExpressionError::new(start..self.at, message));
        }
        Ok(Node::Call(function, arguments))
    }

    /// A kebab-case name with dots: a minus belongs to it when a letter or digit stands on both sides.
    fn name(&mut self) -> &'a str {
        let rest = self.rest();
        let mut end = 0;
        let mut characters = rest.char_indices().peekable();
        while let Some((at, c)) = characters.next() {
            let joins = matches!(c, '-' | '.')
                && characters.peek().is_some_and(|(_, next)| next.is_alphanumeric() || *next == '_');
            if !(c.is_alphanumeric() || c == '_' || joins) {
                break;
            }
            end = at + c.len_utf8();
        }
        self.at += end;
        &rest[..end]
    }
}

fn binary(operator: Operator, left: Expression, right: Expression) -> Expression {
    let range = left.range.start..right.range.end;
    Expression { range, node: Node::Binary(operator, Box::new(left), Box::new(right)) }
}
