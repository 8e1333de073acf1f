//! Decks that include other files: each directive is replaced by the file's lines between two comments, which tell the
//! places of errors. The caller opens the files; formats open none.
//! There are at most [`MOST_INCLUDES`] of them.
//!
//! Abaqus and CalculiX write `*INCLUDE, INPUT=file`, Nastran `INCLUDE 'file'`, where a quoted name may go on in the
//! next lines. A file may include others, at most [`DEEPEST`] deep; one that includes itself is refused.
//! Abaqus' `*NODE, INPUT=file` and its kin take the data lines of one card from a file that holds nothing else: the
//! card stays, and the lines stand below it.
//!
//! Linear in the size of all files; the caller bounds that.

use std::path::{Path, PathBuf};

use super::Format;
use super::error::{FormatError, Place, Reason};
use super::text::without_mark;

/// So deep files may include each other.
pub const DEEPEST: usize = 16;
/// So many includes a deck may have, each counted as often as it is made: files that include others many times could
/// keep a reader busy for ever without ever being large.
pub const MOST_INCLUDES: usize = 10_000;
/// A quoted name of a Nastran deck goes over this many lines at most.
const MOST_LINES: usize = 8;

const BEGIN: &[u8] = b" meshmill: from here on, ";
/// Begins the data of a card that stands in the lines before.
const BEGIN_DATA: &[u8] = b" meshmill: data from here on, ";
const END: &[u8] = b" meshmill: up to here";

/// Cards of Abaqus whose data may stand in another file.
pub(super) const TAKES_A_FILE: [&str; 5] = ["NODE", "ELEMENT", "NSET", "ELSET", "SURFACE"];

/// An included file: what tells it from others, and its bytes.
pub type Opened = (PathBuf, Vec<u8>);
/// Opens a file by the name that the deck gives it, or says why not; the second argument is the included file that
/// names it, none for the deck itself.
pub type Open<'a> = dyn FnMut(&str, Option<&Path>) -> Result<Opened, String> + 'a;

impl Format {
    /// Whether files of this format may include others.
    pub fn has_includes(self) -> bool {
        matches!(self, Self::Inp | Self::Bdf)
    }
}

/// The deck with all files that it includes; `None` where it includes none.
///
/// # Errors
/// Where a file cannot be opened, includes itself or is included too deep, with the line of the directive.
pub fn expand(format: Format, bytes: &[u8], open: &mut Open<'_>) -> Result<Option<Vec<u8>>, FormatError> {
    if !format.has_includes() || next(format, bytes, 0).is_none() {
        return Ok(None);
    }
    let mut expansion =
        Expansion { format, open, out: Vec::with_capacity(2 * bytes.len()), stack: Vec::new(), count: 0 };
    expansion.add(bytes).map_err(|error| error.in_format(format))?;
    Ok(Some(expansion.out))
}

/// The file and the line in it that line `line` of an expanded deck comes from; no file for the deck itself.
pub(super) fn locate(bytes: &[u8], line: u64) -> (Option<String>, u64) {
    let mut stack: Vec<(Option<String>, u64)> = vec![(None, 0)];
    for (raw, number) in bytes.split(|&b| b == b'\n').zip(1..=line) {
        let comment = raw.strip_prefix(b"**").or_else(|| raw.strip_prefix(b"$")).unwrap_or_default();
        if comment == END && stack.len() > 1 {
            stack.pop();
            continue;
        }
        let data = comment.strip_prefix(BEGIN_DATA);
        if let Some(top) = stack.last_mut().filter(|_| data.is_none()) {
            top.1 += 1;
        }
        if let Some(name) = comment.strip_prefix(BEGIN).or(data).filter(|_| number < line) {
            stack.push((Some(String::from_utf8_lossy(name).into_owned()), 0));
        }
    }
    stack.pop().unwrap_or((None, line))
}

/// An include in a deck.
struct Directive {
    /// Where it begins, and where the line after it begins.
    begin: usize,
    end: usize,
    /// How many lines it has.
    lines: usize,
    name: String,
    /// The card that takes its data from the file.
    card: Option<String>,
}

/// The first directive at or after the line that begins at `from`.
fn next(format: Format, bytes: &[u8], from: usize) -> Option<Directive> {
    let mut begin = from;
    while begin < bytes.len() {
        let end = line_end(bytes, begin);
        let line = bytes[begin..end].trim_ascii();
        let found = match format {
            Format::Inp if line.starts_with(b"*") && !line.starts_with(b"**") => inp_directive(bytes, begin),
            Format::Bdf if is_keyword(line, b"INCLUDE") => Some(bdf_directive(bytes, begin)),
            // Nothing after it is read.
            Format::Bdf if line.get(..7).is_some_and(|w| w.eq_ignore_ascii_case(b"ENDDATA")) => return None,
            _ => None,
        };
        if found.is_some() {
            return found;
        }
        begin = end;
    }
    None
}

/// Where the line after the one at `begin` begins.
fn line_end(bytes: &[u8], begin: usize) -> usize {
    bytes[begin..].iter().position(|&b| b == b'\n').map_or(bytes.len(), |length| begin + length + 1)
}

fn is_keyword(line: &[u8], keyword: &[u8]) -> bool {
    let (word, rest) = line.split_at(line.len().min(keyword.len()));
    word.eq_ignore_ascii_case(keyword) && rest.first().is_none_or(|b| !b.is_ascii_alphanumeric())
}

/// `*INCLUDE, INPUT=file`, or a card with its data in a file; either goes on in the next line after a comma at the end.
fn inp_directive(bytes: &[u8], begin: usize) -> Option<Directive> {
    let first = &bytes[begin..line_end(bytes, begin)];
    let keyword = first.split(|&b| b == b',').next().unwrap_or(first).trim_ascii();
    let keyword = String::from_utf8_lossy(keyword).trim_start_matches('*').trim().to_ascii_uppercase();
    let includes = keyword == "INCLUDE";
    if !includes && !TAKES_A_FILE.contains(&keyword.as_str()) {
        return None;
    }
    let (mut end, mut lines) = (begin, 0);
    let mut text = String::new();
    while (lines == 0 || text.ends_with(',')) && end < bytes.len() {
        let after = line_end(bytes, end);
        text.push_str(String::from_utf8_lossy(bytes[end..after].trim_ascii()).as_ref());
        (end, lines) = (after, lines + 1);
    }
    let input = |part: &str| {
        let (key, value) = part.split_once('=')?;
        let is_file = |wanted: &str| key.trim().eq_ignore_ascii_case(wanted);
        (is_file("INPUT") || !includes && is_file("FILE"))
            .then(|| value.trim().trim_matches(['"', '\'']).trim().to_owned())
    };
    let name = text.split(',').find_map(input);
    if includes {
        return Some(Directive { begin, end, lines, name: name.unwrap_or_default(), card: None });
    }
    let rest: Vec<&str> = text.split(',').filter(|part| input(part).is_none() && !part.trim().is_empty()).collect();
    Some(Directive { begin, end, lines, name: name?, card: Some(rest.join(",")) })
}

/// `INCLUDE 'file'`, which goes on in the next lines until the quote ends.
fn bdf_directive(bytes: &[u8], begin: usize) -> Directive {
    let mut end = line_end(bytes, begin);
    let line = String::from_utf8_lossy(&bytes[begin..end]);
    let rest = line.trim().get("INCLUDE".len()..).unwrap_or_default().trim_start_matches([' ', '\t', '=']);
    let Some(quote) = rest.chars().next().filter(|c| matches!(c, '\'' | '"')) else {
        let name = rest.split([' ', '\t', '$']).next().unwrap_or_default().to_owned();
        return Directive { begin, end, lines: 1, name, card: None };
    };
    let mut name = rest[1..].trim_end().to_owned();
    let mut lines = 1;
    while !name.contains(quote) && lines < MOST_LINES && end < bytes.len() {
        let after = line_end(bytes, end);
        name.push_str(String::from_utf8_lossy(bytes[end..after].trim_ascii()).as_ref());
        (end, lines) = (after, lines + 1);
    }
    let name = name.split(quote).next().unwrap_or_default().to_owned();
    Directive { begin, end, lines, name, card: None }
}

struct Expansion<'a, 'b> {
    format: Format,
    open: &'a mut Open<'b>,
    out: Vec<u8>,
    /// The files that are being read, from the outermost on, with their names.
    stack: Vec<(PathBuf, String)>,
    count: usize,
}

impl Expansion<'_, '_> {
    fn add(&mut self, bytes: &[u8]) -> Result<(), FormatError> {
        let (mut from, mut line) = (0, 1);
        let lines = |part: &[u8]| part.iter().map(|&b| u64::from(b == b'\n')).sum::<u64>();
        while let Some(directive) = next(self.format, bytes, from) {
            let before = &bytes[from..directive.begin];
            line += lines(before);
            self.out.extend_from_slice(before);
            from = directive.end;
            self.include(&directive).map_err(|why| self.error(line, &directive.name, why))?;
            line += lines(&bytes[directive.begin..directive.end]);
        }
        self.out.extend_from_slice(&bytes[from..]);
        Ok(())
    }

    fn include(&mut self, directive: &Directive) -> Result<(), Why> {
        if directive.name.is_empty() {
            return Err(Why::Here("the directive names no file".to_owned()));
        }
        if self.stack.len() == DEEPEST {
            return Err(Why::Here(format!("files are included more than {DEEPEST} deep")));
        }
        self.count += 1;
        if self.count > MOST_INCLUDES {
            return Err(Why::Here(format!("the deck has more than {MOST_INCLUDES} includes")));
        }
        let within = self.stack.last().map(|(file, _)| file.as_path());
        let (file, bytes) = (self.open)(&directive.name, within).map_err(Why::Here)?;
        let bytes = without_mark(&bytes);
        if self.stack.iter().any(|(known, _)| *known == file) {
            return Err(Why::Here("the file includes itself".to_owned()));
        }
        let mark: &[u8] = if self.format == Format::Inp { b"**" } else { b"$" };
        if let Some(card) = &directive.card {
            self.out.extend([card.as_bytes(), b"\n"].concat());
        }
        for _ in 1..directive.lines {
            self.out.extend([mark, b"\n"].concat());
        }
        let printable: String = directive.name.chars().map(|c| if c.is_control() { '_' } else { c }).collect();
        let begin = if directive.card.is_some() { BEGIN_DATA } else { BEGIN };
        self.out.extend([mark, begin, printable.as_bytes(), b"\n"].concat());
        self.stack.push((file, directive.name.clone()));
        match directive.card {
            Some(_) => self.add_data(bytes)?,
            None => self.add(bytes).map_err(|error| Why::Within(Box::new(error)))?,
        }
        self.stack.pop();
        if self.out.last() != Some(&b'\n') {
            self.out.push(b'\n');
        }
        self.out.extend([mark, END, b"\n"].concat());
        Ok(())
    }

    /// The data of a card: no keyword may stand among them.
    fn add_data(&mut self, bytes: &[u8]) -> Result<(), Why> {
        for (line, number) in bytes.split(|&b| b == b'\n').map(<[u8]>::trim_ascii).zip(1_u64..) {
            if line.starts_with(b"*") && !line.starts_with(b"**") {
                let place = Place::Line(number);
                let mut error = FormatError::unexpected(place, "nothing but the data lines of one card", line)
                    .with_remedy("take the file in by *INCLUDE, INPUT=, which may hold cards");
                error.included = self.stack.last().map(|(_, name)| name.clone());
                return Err(Why::Within(Box::new(error)));
            }
        }
        self.out.extend_from_slice(bytes);
        Ok(())
    }

    fn error(&self, line: u64, name: &str, why: Why) -> FormatError {
        match why {
            Why::Within(error) => *error,
            Why::Here(why) => {
                let mut error = FormatError::new(Place::Line(line), Reason::Include { name: name.to_owned(), why })
                    .with_remedy(
                        "put it beside the deck or in a folder there, or put its lines in the directive's place",
                    );
                error.included = self.stack.last().map(|(_, name)| name.clone());
                error
            }
        }
    }
}

/// Why a file is not included: a reason for the directive at hand, or an error within the file.
enum Why {
    Here(String),
    Within(Box<FormatError>),
}

#[cfg(test)]
mod tests {
    use super::*;

    fn expanded(format: Format, deck: &str, files: &[(&str, &str)]) -> Result<String, String> {
        let mut open = |name: &str, _: Option<&Path>| match files.iter().find(|(known, _)| *known == name) {
            Some((_, text)) => Ok((PathBuf::from(name), text.as_bytes().to_vec())),
            None => Err("there is no such file".to_owned()),
        };
        let found = expand(format, deck.as_bytes(), &mut open).map_err(|error| error.to_string())?;
        Ok(String::from_utf8(found.unwrap_or_else(|| deck.into())).expect("text"))
    }

    #[test]
    fn directives_are_replaced_by_lines_which_keep_their_places() {
        let files = [("a b.inc", "1, 0\n*include,\ninput=c.inc"), ("c.inc", "2, 0")];
        let deck = "*NODE\n*INCLUDE, INPUT=\"a b.inc\"\n3, 0\n";
        let text = expanded(Format::Inp, deck, &files).unwrap();
        let places: Vec<_> = (1..).zip(text.lines()).filter(|(_, line)| !line.starts_with("**")).collect();
        let places: Vec<_> = places.iter().map(|(n, line)| (*line, locate(text.as_bytes(), *n))).collect();
        let within = |name: &str| Some(name.to_owned());
        assert_eq!(
            places,
            [
                ("*NODE", (None, 1)),
                ("1, 0", (within("a b.inc"), 1)),
                ("2, 0", (within("c.inc"), 1)),
                ("3, 0", (None, 3))
            ]
        );
    }

    #[test]
    fn the_data_of_a_card_may_stand_in_another_file() {
        let files = [("n.dat", "1, 0\n** said\n2, 0"), ("bad.dat", "1, 0\n*NODE\n2, 0\n")];
        let deck = "*Node, nset=\"all nodes\",\n input = 'n.dat', system=R\n3, 0\n";
        let text = expanded(Format::Inp, deck, &files).unwrap();
        let lines: Vec<_> = (1..)
            .zip(text.lines())
            .filter(|(_, line)| !line.starts_with("**"))
            .map(|(n, line)| (line, locate(text.as_bytes(), n)))
            .collect();
        let within = || Some("n.dat".to_owned());
        assert_eq!(
            lines,
            [
                ("*Node, nset=\"all nodes\", system=R", (None, 1)),
                ("1, 0", (within(), 1)),
                ("2, 0", (within(), 3)),
                ("3, 0", (None, 3)),
            ]
        );
        for untouched in
            ["*NODE, NSET=a\n", "*NODE PRINT, INPUT=n.dat\n", "*BOUNDARY, INPUT=n.dat\n", "** *NODE, INPUT=n.dat\n"]
        {
            assert_eq!(expanded(Format::Inp, untouched, &files).unwrap(), untouched);
        }
        let error = expanded(Format::Inp, "*ELEMENT, TYPE=S3, FILE=bad.dat\n", &files).unwrap_err();
        assert!(error.contains("bad.dat, line 2: expected nothing but the data lines of one card"), "{error}");
        let error = expanded(Format::Inp, "\n*ELSET, ELSET=a, INPUT=\n", &files).unwrap_err();
        assert!(error.ends_with("line 2: `` is not included: the directive names no file"), "{error}");
    }

    #[test]
    fn names_of_nastran_may_go_over_lines() {
        let files = [("model/grid.inc", "GRID,1\n")];
        for deck in [
            "INCLUDE 'model/grid.inc'\nX\n",
            "include \"model/grid.inc\" $ the grid\nX\n",
            "INCLUDE model/grid.inc\nX\n",
            "INCLUDE 'model/\n  grid.inc'\nX\n",
            "  Include 'model/grid.inc'\r\nX\n",
        ] {
            let text = expanded(Format::Bdf, deck, &files).unwrap();
            assert!(text.contains("\nGRID,1\n") && text.ends_with("\nX\n"), "{text}");
            let last = text.lines().count() as u64;
            assert_eq!(locate(text.as_bytes(), last), (None, deck.lines().count() as u64), "{deck}");
        }
        for deck in ["$ INCLUDE 'x'\n", "INCLUDED\n", "TITLE = INCLUDE x\n", "ENDDATA\nINCLUDE 'x'\n"] {
            assert_eq!(expanded(Format::Bdf, deck, &files).unwrap(), deck);
        }
    }

    #[test]
    fn files_that_include_others_without_end_are_refused() {
        let names: Vec<String> = (0..20).map(|i| format!("f{i}")).collect();
        let many: Vec<String> = (0..20).map(|i| format!("*INCLUDE, INPUT=f{}\n", i + 1).repeat(300)).collect();
        let files: Vec<(&str, &str)> = names.iter().map(String::as_str).zip(many.iter().map(String::as_str)).collect();
        let deep = expanded(Format::Inp, "*INCLUDE, INPUT=f0\n", &files).unwrap_err();
        assert!(deep.ends_with("files are included more than 16 deep"), "{deep}");
        let wide = [files[0], files[1], ("f2", "")];
        let wide = expanded(Format::Inp, "*INCLUDE, INPUT=f0\n", &wide).unwrap_err();
        assert!(wide.ends_with("the deck has more than 10000 includes"), "{wide}");
    }

    #[test]
    fn circles_and_missing_files_are_refused_with_their_place() {
        let files = [("a", "**\n*INCLUDE, INPUT=b\n"), ("b", "*INCLUDE, INPUT=a\n"), ("c", "\n*INCLUDE, INPUT=none\n")];
        for (deck, message) in [
            ("*INCLUDE, INPUT=a\n", "b, line 1: `a` is not included: the file includes itself"),
            ("\n*INCLUDE, INPUT=c\n", "c, line 2: `none` is not included: there is no such file"),
            ("*INCLUDE\n", "line 1: `` is not included: the directive names no file"),
        ] {
            let error = expanded(Format::Inp, deck, &files).unwrap_err();
            assert!(error.ends_with(message), "{error}");
        }
    }
}
