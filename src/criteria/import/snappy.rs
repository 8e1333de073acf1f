//! `meshQualityDict` of snappyHexMesh.
//!
//! # Algorithm
//! A dictionary is read as OpenFOAM writes them: comments, entries `key value;`, dictionaries `name { … }`, directives
//! that begin with `#`. Of a whole `snappyHexMeshDict` only `meshQualityControls` counts. A limit becomes `fail`. Where
//! the dictionary `relaxed` has a looser one, that becomes `fail` and the strict one `warn`: what the mesher aims for,
//! and what it accepts in the end. Without, `warn` stands at four fifths of the way from good to fail.
//!
//! # Source
//! The OpenFOAM user guide, "Mesh quality controls", and the comments of the dictionaries that it ships.
//!
//! # Cost
//! Linear in the text; dictionaries are followed to a depth of [`DEEPEST`], words to a length of [`LONGEST`], and a
//! file has at most [`MOST`] entries.

use super::{Check, ImportError, Item, level};

/// Dictionaries within dictionaries.
const DEEPEST: usize = 16;
/// Bytes of a word.
const LONGEST: usize = 200;
/// Entries of a file.
const MOST: usize = 10_000;

/// What the limit of a check means to us.
struct Known {
    key: &'static str,
    metric: &'static str,
    ideal: f64,
    worst: f64,
    /// Added to their limit.
    offset: f64,
    /// Whether this limit judges anything.
    judges: fn(f64) -> bool,
    note: &'static str,
}

const CHECKS: [Known; 6] = [
    Known {
        key: "maxConcave",
        metric: "max-quad-angle",
        ideal: 90.0,
        worst: 360.0,
        offset: 180.0,
        judges: |limit| limit < 180.0,
        note: "An angle beyond 180 degrees at a corner of a face.",
    },
    Known {
        key: "minTwist",
        metric: "twist",
        ideal: 1.0,
        worst: -1.0,
        offset: 0.0,
        judges: |limit| limit > -1.0,
        note: "Normal of a face against those of the triangles round its centre.",
    },
    Known {
        key: "minTriangleTwist",
        metric: "triangle-twist",
        ideal: 1.0,
        worst: -1.0,
        offset: 0.0,
        judges: |limit| limit > -1.0,
        note: "Normals of neighbouring triangles round the centre of a face.",
    },
    Known {
        key: "minFlatness",
        metric: "flatness",
        ideal: 1.0,
        worst: 0.0,
        offset: 0.0,
        judges: |limit| limit > 0.0,
        note: "Projected area / area of a face.",
    },
    Known {
        key: "minArea",
        metric: "area",
        ideal: f64::NAN,
        worst: 0.0,
        offset: 0.0,
        judges: |limit| limit > 0.0,
        note: "Area of a face; no area is ideal, so that only the limit counts.",
    },
    Known {
        key: "minEdgeLength",
        metric: "min-length",
        ideal: f64::NAN,
        worst: 0.0,
        offset: 0.0,
        judges: |limit| limit > 0.0,
        note: "Length of a side; no length is ideal, so that only the limit counts.",
    },
];

const OF_CELLS: &str = "it judges volume cells, and a surface has none";
const OF_THE_MESHER: &str = "it says how the mesher takes steps back, and is no limit";

const OTHERS: [(&str, &str); 12] = [
    ("maxNonOrtho", OF_CELLS),
    ("maxBoundarySkewness", OF_CELLS),
    ("maxInternalSkewness", OF_CELLS),
    ("minVol", OF_CELLS),
    ("minTetQuality", OF_CELLS),
    ("minDeterminant", OF_CELLS),
    ("minFaceWeight", OF_CELLS),
    ("minVolRatio", OF_CELLS),
    ("minVolCollapseRatio", OF_CELLS),
    ("nSmoothScale", OF_THE_MESHER),
    ("errorReduction", OF_THE_MESHER),
    ("FoamFile", "the head of the file"),
];

/// Keys that tell such a file.
pub(super) const KEYS: [&str; 6] =
    ["meshQualityControls", "meshQualityDict", "maxNonOrtho", "maxConcave", "minTwist", "minFlatness"];

/// `key value;` with the dictionaries that it stands in.
#[derive(Clone, Debug, PartialEq)]
struct Entry {
    line: usize,
    within: Vec<String>,
    key: String,
    value: String,
}

/// All entries of a file.
pub(super) fn items(text: &str) -> Result<Vec<Item>, ImportError> {
    let entries = entries(&tokens(text)?)?;
    let is_part = |entry: &Entry| entry.within.iter().any(|name| name == "meshQualityControls");
    let is_whole = entries.iter().any(is_part);
    let (mut strict, mut relaxed, mut items) = (Vec::new(), Vec::new(), Vec::new());
    for entry in entries {
        if is_whole && !is_part(&entry) {
            items.push(other(&entry, "it is outside of `meshQualityControls`"));
            continue;
        }
        let depth = if is_whole { entry.within.iter().position(|name| name == "meshQualityControls") } else { None };
        let below = &entry.within[depth.map_or(0, |depth| depth + 1)..];
        match below.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
            [] => strict.push(entry),
            ["relaxed"] => relaxed.push(entry),
            ["FoamFile"] => items.push(other(&entry, "the head of the file")),
            _ => items.push(other(&entry, "a dictionary that is not known")),
        }
    }
    for entry in &strict {
        items.push(item(entry, &relaxed)?);
    }
    for entry in &relaxed {
        if strict.iter().any(|strict| strict.key == entry.key) && CHECKS.iter().any(|known| known.key == entry.key) {
            // It stands in the check of the strict one.
            continue;
        }
        items.push(item(entry, &[])?);
    }
    Ok(once(items))
}

/// Of two checks of one metric the last counts, as in a dictionary; the other is told.
fn once(items: Vec<Item>) -> Vec<Item> {
    let metric = |item: &Item| if let Item::Check(check) = item { Some(check.metric) } else { None };
    let metrics: Vec<Option<&str>> = items.iter().map(metric).collect();
    let is_old = |at: usize| metrics[at].is_some() && metrics[at + 1..].contains(&metrics[at]);
    let told = |(at, item): (usize, Item)| match item {
        Item::Check(check) if is_old(at) => Item::Other {
            line: check.line,
            what: check.what.to_owned(),
            reason: "the same key stands below; that one counts".to_owned(),
        },
        item => item,
    };
    items.into_iter().enumerate().map(told).collect()
}

fn other(entry: &Entry, reason: &str) -> Item {
    let path: Vec<&str> = entry.within.iter().map(String::as_str).chain([entry.key.as_str()]).collect();
    Item::Other { line: entry.line, what: format!("{} {}", path.join("."), entry.value), reason: reason.to_owned() }
}

fn limit(entry: &Entry) -> Result<f64, ImportError> {
    let message = || format!("`{}` has a number, got `{}`", entry.key, super::comment(&entry.value));
    level(&entry.value).ok_or_else(|| ImportError { line: entry.line, message: message() })
}

fn item(entry: &Entry, relaxed: &[Entry]) -> Result<Item, ImportError> {
    let Some(known) = CHECKS.iter().find(|known| known.key == entry.key) else {
        let reason = OTHERS.iter().find(|(key, _)| *key == entry.key).map(|(_, reason)| *reason);
        let include = entry.key.starts_with('#').then_some("other files are not followed; import them by themselves");
        return Ok(other(entry, reason.or(include).unwrap_or("it is not known")));
    };
    let strict = limit(entry)?;
    let loose = relaxed.iter().rfind(|other| other.key == entry.key);
    let (end, note) = match loose {
        Some(loose) => (limit(loose)?, format!("{} Relaxed on line {}.", known.note, loose.line)),
        None => (strict, known.note.to_owned()),
    };
    if !(known.judges)(strict) && !(known.judges)(end) {
        return Ok(other(entry, "this value turns the check off"));
    }
    Ok(Item::Check(check(known, entry.line, [strict, end].map(|limit| limit + known.offset), loose.is_some(), note)))
}

fn check(known: &Known, line: usize, [strict, end]: [f64; 2], is_relaxed: bool, note: String) -> Check {
    let rises = known.worst > known.ideal;
    let worse = |a: f64, b: f64| if rises { a.max(b) } else { a.min(b) };
    let better = |a: f64, b: f64| if rises { a.min(b) } else { a.max(b) };
    let (warn, fail) = (better(strict, end), worse(strict, end));
    let levels = if known.ideal.is_nan() {
        [warn, warn, warn, fail, known.worst.min(fail)]
    } else {
        let good = better(known.ideal, warn);
        let warn = if is_relaxed { warn } else { good + 0.8 * (fail - good) };
        [good, good, warn, fail, worse(known.worst, fail)]
    };
    Check { line, what: known.key, metric: known.metric, levels, percent: false, weight: 1.0, on: true, note }
}

/// A word, a quoted text or one of `{ } ;`, with its line.
type Token = (usize, String);

fn tokens(text: &str) -> Result<Vec<Token>, ImportError> {
    let (mut tokens, mut line, mut rest) = (Vec::new(), 1, text);
    while let Some(first) = rest.chars().next() {
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            let message = "a comment has no end".to_owned();
            rest.find("*/").map(|end| end + 2).ok_or(ImportError { line, message })?
        } else if first.is_whitespace() {
            first.len_utf8()
        } else {
            let length = word(rest, first).ok_or(ImportError { line, message: "a quote has no end".to_owned() })?;
            if length > LONGEST {
                return Err(ImportError { line, message: format!("a word has more than {LONGEST} letters") });
            }
            tokens.push((line, rest[..length].to_owned()));
            length
        };
        line += rest[..length].matches('\n').count();
        rest = &rest[length..];
    }
    Ok(tokens)
}

/// The length of the token that a text begins with.
fn word(text: &str, first: char) -> Option<usize> {
    match first {
        '{' | '}' | ';' => Some(1),
        '"' => text[1..].find('"').map(|end| end + 2),
        _ => {
            let end = |letter: char| letter.is_whitespace() || "{};\"".contains(letter);
            let stop = text.find(end).unwrap_or(text.len());
            // `/` alone is part of a word; a comment is not.
            Some(["//", "/*"].into_iter().filter_map(|mark| text[..stop].find(mark)).min().unwrap_or(stop).max(1))
        }
    }
}

fn entries(tokens: &[Token]) -> Result<Vec<Entry>, ImportError> {
    let (mut within, mut found, mut words): (Vec<String>, Vec<Entry>, Vec<&Token>) =
        (Vec::new(), Vec::new(), Vec::new());
    let wrong = |line: usize, message: &str| Err(ImportError { line, message: message.to_owned() });
    for (at, token) in tokens.iter().enumerate() {
        let (line, text) = (token.0, token.1.as_str());
        if found.len() > MOST {
            return wrong(line, &format!("a file has at most {MOST} entries"));
        }
        match text {
            "{" if within.len() == DEEPEST => return wrong(line, "too many dictionaries within each other"),
            "{" => {
                let Some(name) = words.pop() else { return wrong(line, "a dictionary has no name") };
                within.push(name.1.clone());
                words.clear();
            }
            "}" if !words.is_empty() => return wrong(line, "an entry has no `;`"),
            "}" => {
                if within.pop().is_none() {
                    return wrong(line, "a dictionary ends that did not begin");
                }
            }
            ";" => found.extend(entry(&std::mem::take(&mut words), &within)),
            _ => {
                words.push(token);
                // A directive ends with its line.
                let is_last = tokens.get(at + 1).is_none_or(|next| next.0 > line);
                if is_last && words.first().is_some_and(|word| word.1.starts_with('#')) {
                    found.extend(entry(&std::mem::take(&mut words), &within));
                }
            }
        }
    }
    match (words.first(), within.last()) {
        (Some(word), _) => wrong(word.0, "an entry has no `;`"),
        (None, Some(name)) => {
            let line = tokens.last().map_or(1, |token| token.0);
            wrong(line, &format!("the dictionary `{}` has no end", super::comment(name)))
        }
        (None, None) => Ok(found),
    }
}

fn entry(words: &[&Token], within: &[String]) -> Option<Entry> {
    let (first, value) = words.split_first()?;
    let value: Vec<&str> = value.iter().map(|word| word.1.as_str()).collect();
    Some(Entry { line: first.0, within: within.to_vec(), key: first.1.clone(), value: value.join(" ") })
}
