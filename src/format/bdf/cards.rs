//! Lines of a bulk data file as cards of fields.

use super::super::error::{FormatError, Place};
use super::super::text::{Scanner, parse_integer, parse_number};

/// More fields than any card that is read has; further continuation lines are skipped.
const MOST_FIELDS: usize = 64;

/// A card: its name in upper case without `*`, and its fields without blanks.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Card {
    pub(super) name: String,
    pub(super) fields: Vec<Vec<u8>>,
    /// Its first line.
    pub(super) line: u64,
}

impl Card {
    pub(super) fn place(&self) -> Place {
        Place::Line(self.line)
    }

    /// The field at this position after the name; a missing one is blank.
    pub(super) fn field(&self, position: usize) -> &[u8] {
        self.fields.get(position).map_or(&[], Vec::as_slice)
    }

    /// An integer; `None` where the field is blank.
    pub(super) fn integer(&self, position: usize, what: &'static str) -> Result<Option<i64>, FormatError> {
        let field = self.field(position);
        if field.is_empty() { Ok(None) } else { parse_integer(field, what, self.place()).map(Some) }
    }

    /// A number; blank is zero, and `1.5-3` is 1.5e-3.
    pub(super) fn number(&self, position: usize, what: &'static str) -> Result<f64, FormatError> {
        let field = self.field(position);
        if field.is_empty() {
            return Ok(0.0);
        }
        // FORTRAN's double precision: `1.5D-3`.
        let field: Vec<u8> = field.iter().map(|&b| if b.eq_ignore_ascii_case(&b'd') { b'e' } else { b }).collect();
        let field = field.as_slice();
        match bare_exponent(field) {
            Some(at) => parse_number(&[&field[..at], b"e", &field[at..]].concat(), what, self.place()),
            None => parse_number(field, what, self.place()),
        }
    }
}

/// Where a sign stands after a digit or point: the exponent begins there without its letter.
fn bare_exponent(field: &[u8]) -> Option<usize> {
    let sign = |pair: &[u8]| (pair[0].is_ascii_digit() || pair[0] == b'.') && matches!(pair[1], b'+' | b'-');
    field.windows(2).position(sign).map(|before| before + 1)
}

/// The cards of a file one after another, and the comments between them.
pub(super) struct Cards<'a> {
    scanner: Scanner<'a>,
    ended: bool,
    /// The first line of the next card.
    ahead: Option<Line>,
}

/// What a line is.
enum Line {
    Card { card: Card },
    Continuation { fields: Vec<Vec<u8>> },
    Comment { text: Vec<u8> },
    Blank,
}

/// A card, or a comment without its `$`.
pub(super) enum Item {
    Card(Card),
    Comment(Vec<u8>),
}

impl<'a> Cards<'a> {
    /// Cards of a whole deck begin after `BEGIN BULK`, else at the first line.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        let mut scanner = Scanner::new(bytes);
        let mut bulk = scanner.clone();
        loop {
            let line = bulk.rest_of_line();
            let more = bulk.next_line();
            let (word, rest) = line.split_at(line.len().min(5));
            let rest = rest.trim_ascii_start();
            if word.eq_ignore_ascii_case(b"BEGIN") && rest.get(..4).is_some_and(|w| w.eq_ignore_ascii_case(b"BULK")) {
                scanner = bulk;
                break;
            }
            if !more {
                break;
            }
        }
        Self { scanner, ended: false, ahead: None }
    }

    /// How many bytes were read.
    pub(super) fn offset(&self) -> usize {
        self.scanner.offset()
    }

    /// The next card with its continuation lines, or the next comment.
    pub(super) fn next(&mut self) -> Option<Item> {
        let mut current: Option<Card> = None;
        while let Some(line) = self.line() {
            match line {
                Line::Continuation { mut fields } => {
                    if let Some(card) = &mut current
                        && card.fields.len() < MOST_FIELDS
                    {
                        card.fields.append(&mut fields);
                    }
                }
                Line::Card { card } => match current.take() {
                    Some(complete) => {
                        self.ahead = Some(Line::Card { card });
                        return Some(Item::Card(complete));
                    }
                    None if card.name == "ENDDATA" => self.ended = true,
                    None => current = Some(card),
                },
                Line::Comment { text } => match current.take() {
                    Some(complete) => {
                        self.ahead = Some(Line::Comment { text });
                        return Some(Item::Card(complete));
                    }
                    None => return Some(Item::Comment(text)),
                },
                Line::Blank => {}
            }
        }
        current.map(Item::Card)
    }

    fn line(&mut self) -> Option<Line> {
        if let Some(line) = self.ahead.take() {
            return Some(line);
        }
        if self.ended || self.scanner.is_at_end() {
            return None;
        }
        let Place::Line(number) = self.scanner.place() else { return None };
        let line = split_line(self.scanner.raw_rest_of_line(), number);
        self.scanner.next_line();
        Some(line)
    }
}

fn split_line(raw: &[u8], number: u64) -> Line {
    if let Some(comment) = raw.strip_prefix(b"$") {
        return Line::Comment { text: comment.to_vec() };
    }
    let raw = raw.split(|&b| b == b'$').next().unwrap_or_default();
    if raw.trim_ascii().is_empty() {
        return Line::Blank;
    }
    let free = raw.contains(&b',');
    let expanded = if free { raw.to_vec() } else { expand_tabs(raw) };
    let first = if free { expanded.split(|&b| b == b',').next().unwrap_or_default() } else { fixed(&expanded, 0, 8) };
    let first = first.trim_ascii().to_ascii_uppercase();
    let long = first.contains(&b'*');
    let fields: Vec<Vec<u8>> = if free {
        let wanted = if long { 4 } else { 8 };
        let mut fields: Vec<_> =
            expanded.split(|&b| b == b',').skip(1).take(wanted).map(|f| f.trim_ascii().to_vec()).collect();
        fields.resize(wanted, Vec::new());
        fields
    } else if long {
        (0..4).map(|i| fixed(&expanded, 8 + 16 * i, 16).trim_ascii().to_vec()).collect()
    } else {
        (0..8).map(|i| fixed(&expanded, 8 + 8 * i, 8).trim_ascii().to_vec()).collect()
    };
    if first.is_empty() || matches!(first[0], b'+' | b'*') {
        return Line::Continuation { fields };
    }
    let name = String::from_utf8_lossy(first.strip_suffix(b"*").unwrap_or(&first)).trim_end().to_owned();
    Line::Card { card: Card { name, fields, line: number } }
}

/// The columns of a field, as far as the line goes.
fn fixed(line: &[u8], start: usize, width: usize) -> &[u8] {
    let end = line.len().min(start + width);
    line.get(start..end).unwrap_or_default()
}

/// A tab goes to the next multiple of eight columns. Only the first ten fields of a line count.
fn expand_tabs(line: &[u8]) -> Vec<u8> {
    let mut expanded = Vec::with_capacity(80);
    for &byte in line.iter().take(80) {
        if byte == b'\t' {
            expanded.resize((expanded.len() / 8 + 1) * 8, b' ');
        } else {
            expanded.push(byte);
        }
    }
    expanded
}
