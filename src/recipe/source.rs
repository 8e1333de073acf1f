//! The texts a recipe consists of, and places in them.
//!
//! All texts share one range of offsets, each after the other, so that a [`Span`] alone says file and place, and so
//! that the TOML reader's byte ranges can carry it through deserialization.

use std::ops::Range;
use std::path::{Path, PathBuf};

/// A place: bytes `start..end` of the joined texts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Span {
    /// First byte.
    pub start: usize,
    /// One past the last byte.
    pub end: usize,
}

impl Span {
    /// From the range of the TOML reader.
    pub fn of(range: Range<usize>) -> Self {
        Self { start: range.start, end: range.end }
    }

    /// As the TOML reader wants it.
    pub fn range(self) -> Range<usize> {
        self.start..self.end
    }
}

/// One text.
#[derive(Clone, Debug)]
pub struct SourceFile {
    /// How messages call it.
    pub name: String,
    /// The folder that paths in it are relative to.
    pub folder: PathBuf,
    /// The content.
    pub text: String,
    base: usize,
    line_starts: Vec<usize>,
}

/// A line and column, both from 1; columns count characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Position {
    /// Line.
    pub line: usize,
    /// Column.
    pub column: usize,
}

/// All texts of a recipe: its file, those it extends, and what the command line sets.
#[derive(Clone, Debug, Default)]
pub struct SourceMap {
    files: Vec<SourceFile>,
}

impl SourceMap {
    /// Adds a text and gives the offset of its first byte.
    pub fn add(&mut self, name: impl Into<String>, folder: impl Into<PathBuf>, text: impl Into<String>) -> usize {
        let base = self.files.last().map_or(0, |last| last.base + last.text.len() + 1);
        let text = text.into();
        let line_starts = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
        self.files.push(SourceFile { name: name.into(), folder: folder.into(), text, base, line_starts });
        base
    }

    /// All texts, in the order in which they were added.
    pub fn files(&self) -> &[SourceFile] {
        &self.files
    }

    /// The text that a span lies in; the first one for a span that lies nowhere.
    pub fn file(&self, span: Span) -> Option<&SourceFile> {
        let index = self.files.partition_point(|file| file.base <= span.start);
        self.files.get(index.saturating_sub(1))
    }

    /// The folder that a path written at `span` is relative to.
    pub fn folder(&self, span: Span) -> &Path {
        self.file(span).map_or(Path::new(""), |file| &file.folder)
    }

    /// The bytes of a span as written.
    pub fn text(&self, span: Span) -> &str {
        self.file(span).and_then(|file| file.text.get(file.local(span))).unwrap_or("")
    }
}

impl SourceFile {
    /// The span within this text, clipped to it and to whole characters.
    pub fn local(&self, span: Span) -> Range<usize> {
        let clip = |offset: usize| {
            let mut offset = offset.saturating_sub(self.base).min(self.text.len());
            while !self.text.is_char_boundary(offset) {
                offset -= 1;
            }
            offset
        };
        let start = clip(span.start);
        start..clip(span.end).max(start)
    }

    /// The line (from 0) that a byte of this text lies in.
    pub fn line_of(&self, offset: usize) -> usize {
        self.line_starts.partition_point(|start| *start <= offset).saturating_sub(1)
    }

    /// The bytes of a line (from 0) without its line break.
    pub fn line(&self, line: usize) -> Range<usize> {
        let start = self.line_starts.get(line).copied().unwrap_or(self.text.len());
        let end = self.line_starts.get(line + 1).map_or(self.text.len(), |next| next - 1);
        start..end.max(start)
    }

    /// Where a span begins.
    pub fn position(&self, span: Span) -> Position {
        let start = self.local(span).start;
        let line = self.line_of(start);
        let column = self.text[self.line(line).start..start].chars().count() + 1;
        Position { line: line + 1, column }
    }
}
