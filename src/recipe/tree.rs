//! Values of a recipe with their places, after TOML and before types.
//!
//! Like the TOML reader's own tree, but it owns its text, its spans are in the joined range of all texts, and a value
//! may be a file. It goes back to the reader's tree to be deserialized.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::PathBuf;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::source::Span;

/// A value and where it is written.
#[derive(Clone, Debug, PartialEq)]
pub struct Tree {
    /// Where.
    pub span: Span,
    /// What.
    pub value: Node,
}

/// A value.
#[derive(Clone, Debug, PartialEq)]
pub enum Node {
    /// A string.
    Text(String),
    /// An integer or a float, in TOML's spelling.
    Number(String),
    /// A truth value.
    Bool(bool),
    /// A date or time; recipes have no use for one, and say so where it stands.
    Date(String),
    /// An array.
    List(Vec<Tree>),
    /// A table.
    Table(Table),
    /// A file, which only the value of an expression can be; the path as it is opened.
    File(PathBuf),
}

impl Node {
    /// What it is, for messages.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Text(_) => "a string",
            Self::Number(_) => "a number",
            Self::Bool(_) => "a bool",
            Self::Date(_) => "a date",
            Self::List(_) => "an array",
            Self::Table(_) => "a table",
            Self::File(_) => "a file",
        }
    }
}

/// A key's place and its value.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Where the key is written.
    pub key: Span,
    /// The value.
    pub value: Tree,
}

/// Entries by key.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// The entries.
    pub entries: BTreeMap<String, Entry>,
}

impl Table {
    /// The entry of a key.
    pub fn get(&self, key: &str) -> Option<&Entry> {
        self.entries.get(key)
    }

    /// Takes an entry out.
    pub fn take(&mut self, key: &str) -> Option<Entry> {
        self.entries.remove(key)
    }

    /// The keys in the order they are written.
    pub fn in_order(&self) -> Vec<(&str, &Entry)> {
        let mut entries: Vec<_> = self.entries.iter().map(|(key, entry)| (key.as_str(), entry)).collect();
        entries.sort_by_key(|(_, entry)| entry.key.start);
        entries
    }
}

impl Tree {
    /// From the TOML reader's tree, with spans moved by `base`.
    pub(super) fn from_toml(tree: Spanned<DeValue<'_>>, base: usize) -> Self {
        let span = moved(&tree.span(), base);
        let value = match tree.into_inner() {
            DeValue::String(text) => Node::Text(text.into_owned()),
            DeValue::Integer(value) => Node::Number(value.to_string()),
            DeValue::Float(value) => Node::Number(value.to_string()),
            DeValue::Boolean(value) => Node::Bool(value),
            DeValue::Datetime(value) => Node::Date(value.to_string()),
            DeValue::Array(items) => Node::List(items.into_iter().map(|item| Self::from_toml(item, base)).collect()),
            DeValue::Table(table) => Node::Table(Table::from_toml(table, base)),
        };
        Self { span, value }
    }

    /// As the TOML reader would have given it, to be deserialized.
    pub fn to_toml(&self) -> Spanned<DeValue<'_>> {
        let value = match &self.value {
            Node::Text(text) | Node::Date(text) => DeValue::String(Cow::Borrowed(text)),
            Node::Number(spelling) => {
                DeValue::parse(spelling).map_or_else(|_| DeValue::String(Cow::Borrowed(spelling)), Spanned::into_inner)
            }
            Node::Bool(value) => DeValue::Boolean(*value),
            Node::List(items) => DeValue::Array(items.iter().map(Self::to_toml).collect()),
            Node::Table(table) => DeValue::Table(table.to_toml()),
            Node::File(path) => DeValue::String(path.to_string_lossy()),
        };
        Spanned::new(self.span.range(), value)
    }

    /// The number, where it is one that a float can hold.
    pub fn as_number(&self) -> Option<f64> {
        let Node::Number(spelling) = &self.value else { return None };
        let spelling = spelling.replace('_', "");
        let radix = |digits: &str, radix| i64::from_str_radix(digits, radix).ok().map(|value| value as f64);
        match spelling.get(..2) {
            Some("0x") => radix(&spelling[2..], 16),
            Some("0o") => radix(&spelling[2..], 8),
            Some("0b") => radix(&spelling[2..], 2),
            _ => spelling.parse().ok(),
        }
    }
}

impl Table {
    /// From the TOML reader's table, with spans moved by `base`.
    pub(super) fn from_toml(table: DeTable<'_>, base: usize) -> Self {
        let entry = |(key, value): (Spanned<Cow<'_, str>>, Spanned<DeValue<'_>>)| {
            let span = moved(&key.span(), base);
            (key.into_inner().into_owned(), Entry { key: span, value: Tree::from_toml(value, base) })
        };
        Self { entries: table.into_iter().map(entry).collect() }
    }

    /// As the TOML reader would have given it.
    pub fn to_toml(&self) -> DeTable<'_> {
        let mut table = DeTable::new();
        for (key, entry) in &self.entries {
            table.insert(Spanned::new(entry.key.range(), Cow::Borrowed(key.as_str())), entry.value.to_toml());
        }
        table
    }
}

fn moved(range: &std::ops::Range<usize>, base: usize) -> Span {
    Span { start: range.start + base, end: range.end + base }
}
