//! What is wrong with a recipe, as data, and how it is shown.

use std::fmt;
use std::sync::Arc;

use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer, Snippet};

use super::source::{SourceFile, SourceMap, Span};
use crate::terminal::printable_lines;

/// More than this many problems are counted, not shown; a reader mends the first ones and tries again.
const SHOWN: usize = 50;

/// After this many problems looking stops: a recipe with more was not written by a person, and each costs a search for
/// what was meant.
pub const MOST: usize = 1000;

/// Longest part of a source line that is shown, in bytes.
const LINE_WINDOW: usize = 400;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Nothing runs.
    Error,
    /// Worth knowing.
    Warning,
}

/// A place and what is to be said about it. The first label of a diagnostic is where the problem is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Label {
    /// Where.
    pub span: Span,
    /// What; may be empty.
    pub text: String,
}

/// One problem.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// How bad it is.
    pub severity: Severity,
    /// What is wrong, lower case, no full stop.
    pub message: String,
    /// Where, the problem first.
    pub labels: Vec<Label>,
    /// What to try.
    pub help: Option<String>,
}

impl Diagnostic {
    /// An error at a place.
    pub fn error(span: Span, message: impl Into<String>) -> Self {
        let labels = vec![Label { span, text: String::new() }];
        Self { severity: Severity::Error, message: message.into(), labels, help: None }
    }

    /// Says something at the place of the problem.
    #[must_use]
    pub fn note(mut self, text: impl Into<String>) -> Self {
        if let Some(first) = self.labels.first_mut() {
            first.text = text.into();
        }
        self
    }

    /// Points at a further place.
    #[must_use]
    pub fn label(mut self, span: Span, text: impl Into<String>) -> Self {
        self.labels.push(Label { span, text: text.into() });
        self
    }

    /// Says what to try.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Says what to try, where there is something to try.
    #[must_use]
    pub fn help_opt(mut self, help: Option<String>) -> Self {
        self.help = help.or(self.help);
        self
    }
}

/// Everything that is wrong with a recipe, with the texts it is about.
#[derive(Clone, Debug)]
pub struct Diagnostics {
    /// The texts.
    pub sources: Arc<SourceMap>,
    /// The problems, in the order of their places, at most [`MOST`].
    pub list: Vec<Diagnostic>,
    /// Whether looking stopped at [`MOST`], so that there may be more.
    pub stopped: bool,
}

/// Whether there are so many problems that looking for more stops.
pub fn is_full(problems: &[Diagnostic]) -> bool {
    problems.len() >= MOST
}

impl Diagnostics {
    /// Sorts the first [`MOST`] problems by place and drops repeated ones.
    pub fn new(sources: Arc<SourceMap>, mut list: Vec<Diagnostic>) -> Self {
        let stopped = is_full(&list);
        list.truncate(MOST);
        list.sort_by_key(|d| d.labels.first().map(|label| label.span));
        list.dedup();
        Self { sources, list, stopped }
    }

    /// One report for a terminal, with colours where `styled`.
    pub fn render(&self, styled: bool) -> String {
        let renderer = if styled { Renderer::styled() } else { Renderer::plain() };
        let mut parts: Vec<String> =
            self.list.iter().take(SHOWN).map(|diagnostic| render_one(diagnostic, &self.sources, &renderer)).collect();
        if self.list.len() > SHOWN {
            let more = self.list.len() - SHOWN;
            let end = if self.stopped { format!("; looking stopped after {MOST}") } else { String::new() };
            parts.push(format!("and {more} more problems{end}"));
        }
        parts.join("\n\n")
    }

    /// File, line and column of each problem with its message, for machines.
    pub fn places(&self) -> Vec<(String, usize, usize, String)> {
        let place = |diagnostic: &Diagnostic| {
            let span = diagnostic.labels.first()?.span;
            let file = self.sources.file(span)?;
            let position = file.position(span);
            Some((file.name.clone(), position.line, position.column, diagnostic.message.clone()))
        };
        self.list.iter().filter_map(place).collect()
    }
}

impl fmt::Display for Diagnostics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(false))
    }
}

impl std::error::Error for Diagnostics {}

fn render_one(diagnostic: &Diagnostic, sources: &SourceMap, renderer: &Renderer) -> String {
    let level = match diagnostic.severity {
        Severity::Error => Level::ERROR,
        Severity::Warning => Level::WARNING,
    };
    let message = shown(&diagnostic.message);
    let mut group = Group::with_title(level.primary_title(message));
    let mut labels = diagnostic.labels.as_slice();
    let mut primary = true;
    while let Some(first) = labels.first() {
        let Some(file) = sources.file(first.span) else { break };
        // Labels in one file that follow each other share a snippet.
        let same = |label: &&Label| sources.file(label.span).is_some_and(|f| std::ptr::eq(f, file));
        let count = labels.iter().take_while(same).count();
        let (here, rest) = labels.split_at(count.max(1));
        group = add_snippet(group, file, here, primary);
        labels = rest;
        primary = false;
    }
    if let Some(help) = &diagnostic.help {
        group = group.element(Level::HELP.message(shown(help)));
    }
    renderer.render(&[group])
}

/// Shows the lines of the labels. A line too long to show is cut to a window around its label, and then the place is
/// printed on its own, since columns of the window would be wrong.
fn add_snippet<'a>(group: Group<'a>, file: &'a SourceFile, labels: &'a [Label], primary: bool) -> Group<'a> {
    let spans: Vec<_> = labels.iter().map(|label| file.local(label.span)).collect();
    let first = spans.iter().map(|s| file.line_of(s.start)).min().unwrap_or(0);
    let last = spans.iter().map(|s| file.line_of(s.start)).max().unwrap_or(0);
    let (start, end) = (file.line(first).start, file.line(last).end);
    let kind = |index: usize| {
        if primary && index == 0 { AnnotationKind::Primary } else { AnnotationKind::Context }
    };
    if end - start <= 64 * LINE_WINDOW && (first..=last).all(|line| file.line(line).len() <= LINE_WINDOW) {
        let mut snippet = Snippet::source(&file.text[start..end]).line_start(first + 1).path(&*file.name);
        for (index, (label, span)) in labels.iter().zip(&spans).enumerate() {
            // A value over many lines is underlined in its first line only.
            let line_end = file.line(file.line_of(span.start)).end;
            let span = span.start - start..span.end.clamp(span.start, line_end.max(span.start)) - start;
            snippet = snippet.annotation(kind(index).span(span).label(text(label)));
        }
        return group.element(snippet);
    }
    let mut group = group;
    for (index, (label, span)) in labels.iter().zip(&spans).enumerate() {
        let position = file.position(label.span);
        let line = file.line(file.line_of(span.start));
        let shown = window(&file.text, span.start, line.start, line.end);
        let (from, to) = (span.start - shown.start, span.end.clamp(span.start, shown.end) - shown.start);
        let snippet = Snippet::source(&file.text[shown])
            .line_start(position.line)
            .annotation(kind(index).span(from..to).label(text(label)));
        let origin = Origin::path(&*file.name).line(position.line).char_column(position.column);
        group = group.element(origin).element(snippet);
    }
    group
}

fn text(label: &Label) -> Option<&str> {
    Some(label.text.as_str()).filter(|text| !text.is_empty())
}

/// At most [`LINE_WINDOW`] bytes of a line, around a place in it, in whole characters.
fn window(text: &str, at: usize, line_start: usize, line_end: usize) -> std::ops::Range<usize> {
    let mut start = at.saturating_sub(LINE_WINDOW / 4).max(line_start);
    while !text.is_char_boundary(start) {
        start -= 1;
    }
    let mut end = (at + LINE_WINDOW * 3 / 4).min(line_end);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    start..end.max(start)
}

/// A message fit for a terminal: what the recipe contains may be long or hold control characters.
fn shown(message: &str) -> String {
    let short: String = message.chars().take(600).collect();
    let more = if short.len() < message.len() { "…" } else { "" };
    format!("{}{more}", printable_lines(&short))
}
