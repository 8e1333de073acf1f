//! Reads input files: first the cards with their numbers, then what the numbers mean.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec3;

use super::super::ReadCounts;
use super::super::element::Shape;
use super::super::error::{FormatError, Place, Reason};
use super::super::include::TAKES_A_FILE;
use super::super::text::{parse_integer, parse_number};
use super::elements::element_type;
use super::harmless::{MAKES_GEOMETRY, is_harmless};
use super::scope::{Instance, Placement, Scope, items};
use super::sets::{Card, Kind};
use crate::mesh::Soup;
use crate::watch::Watch;

/// Lines between two looks at the watch.
const STRIDE: u64 = 1 << 16;

/// Names of unknown cards that are kept.
const MOST_UNKNOWN: usize = 1000;

/// An element as its card gives it.
#[derive(Debug)]
pub(super) struct RawElement {
    pub(super) scope: u32,
    pub(super) shape: Option<Shape>,
    /// Where its nodes end in the list of all elements' nodes.
    pub(super) end: usize,
    pub(super) line: u64,
}

/// What data lines belong to.
#[derive(Debug)]
enum Block {
    Skip,
    Nodes { set: Option<usize> },
    Elements { shape: Option<Shape>, nodes: usize, set: Option<usize> },
    Set { card: usize },
    Instance { lines: usize },
}

#[derive(Debug)]
pub(super) struct Reader<'a> {
    /// The whole file.
    pub(super) bytes: &'a [u8],
    pub(super) points: Vec<DVec3>,
    pub(super) scopes: Vec<Scope>,
    scope: usize,
    /// Scopes of instances by name in upper case.
    pub(super) instances: BTreeMap<String, usize>,
    pub(super) elements: Vec<RawElement>,
    pub(super) element_nodes: Vec<i64>,
    pub(super) cards: Vec<Card>,
    block: Block,
    /// Nodes that the last element still wants.
    missing: usize,
    /// Cards that are not known, each with its first line.
    pub(super) unknown: BTreeMap<String, u64>,
    in_step: bool,
}

/// Reads an input file.
pub(super) fn read(bytes: &[u8], watch: &Watch) -> Result<(Soup, ReadCounts), FormatError> {
    let mut reader = Reader {
        bytes,
        points: Vec::new(),
        scopes: vec![Scope::default()],
        scope: 0,
        instances: BTreeMap::new(),
        elements: Vec::new(),
        element_nodes: Vec::new(),
        cards: Vec::new(),
        block: Block::Skip,
        missing: 0,
        unknown: BTreeMap::new(),
        in_step: false,
    };
    let mut keyword: Option<(String, u64)> = None;
    let lines = bytes.split(|&b| b == b'\n').map(<[u8]>::trim_ascii);
    for (line, number) in lines.zip(1_u64..) {
        if number.is_multiple_of(STRIDE) {
            watch.check()?;
        }
        if line.is_empty() || line.starts_with(b"**") {
            continue;
        }
        let place = Place::Line(number);
        match keyword.take() {
            Some((mut text, begun)) => {
                text.push_str(&String::from_utf8_lossy(line));
                keyword = reader.keyword(text, begun)?;
            }
            None if line.starts_with(b"*") => {
                reader.end_block(place)?;
                keyword = reader.keyword(String::from_utf8_lossy(line).into_owned(), number)?;
            }
            None => reader.data(line, number)?,
        }
    }
    reader.end_block(Place::File)?;
    reader.finish()
}

impl Reader<'_> {
    /// Takes a keyword line; gives it back when it goes on in the next line.
    fn keyword(&mut self, text: String, line: u64) -> Result<Option<(String, u64)>, FormatError> {
        if text.ends_with(',') {
            return Ok(Some((text, line)));
        }
        let place = Place::Line(line);
        let mut parts = text.split(',').map(str::trim);
        let name = parts.next().unwrap_or("").trim_start_matches('*').trim().to_ascii_uppercase();
        let parameters: Vec<(String, &str)> = parts
            .map(|p| p.split_once('=').unwrap_or((p, "")))
            .map(|(k, v)| (k.trim().to_ascii_uppercase(), v.trim().trim_matches('"')))
            .collect();
        let value = |key: &str| parameters.iter().find(|(k, _)| k == key).map(|&(_, v)| v);
        if let (true, Some(file)) = (TAKES_A_FILE.contains(&name.as_str()), value("INPUT").or_else(|| value("FILE"))) {
            return Err(FormatError::new(
                place,
                Reason::Unsupported(format!("data of *{name} in another file ({file})")),
            )
            .with_remedy(
                "give the deck the ending .inp, so that the file is looked for, or put its lines below the card",
            ));
        }
        self.block = match name.as_str() {
            "NODE" => {
                if value("SYSTEM").is_some_and(|s| !s.eq_ignore_ascii_case("R")) {
                    let what = "a cylindrical or spherical system of nodes".to_owned();
                    return Err(FormatError::new(place, Reason::Unsupported(what)));
                }
                self.not_in_instance("NODE", place)?;
                Block::Nodes { set: value("NSET").map(|n| self.card(Kind::Nodes, n, line, self.scope)) }
            }
            "ELEMENT" => self.element_block(value("TYPE"), value("ELSET"), line)?,
            "NSET" | "ELSET" | "SURFACE" => self.set_block(&name, &value, line),
            "INCLUDE" => {
                return Err(FormatError::new(place, Reason::Unsupported("*INCLUDE".into()))
                    .with_remedy("give the deck the ending .inp, so that what it includes is looked for"));
            }
            "SYSTEM" => {
                return Err(FormatError::new(place, Reason::Unsupported("*SYSTEM".into()))
                    .with_remedy("write the nodes in global coordinates"));
            }
            name if MAKES_GEOMETRY.contains(&name) => {
                return Err(FormatError::new(
                    place,
                    Reason::Unsupported(format!("*{name}, which makes or moves parts of the mesh,")),
                )
                .with_remedy("let the program that wrote the deck write out its nodes, elements and sets"));
            }
            "PART" => {
                let name = value("NAME").unwrap_or("").to_owned();
                let (nodes, elements) = (self.points.len(), self.elements.len());
                let (node_range, element_range) = (nodes..nodes, elements..elements);
                self.scopes.push(Scope { name, node_range, element_range, ..Scope::default() });
                self.scope = self.scopes.len() - 1;
                Block::Skip
            }
            "STEP" | "END STEP" => {
                self.in_step = name == "STEP";
                Block::Skip
            }
            "END PART" | "ENDPART" | "END INSTANCE" | "ENDINSTANCE" => {
                self.scope = 0;
                Block::Skip
            }
            "INSTANCE" => self.instance(value("NAME").unwrap_or(""), value("PART").unwrap_or(""), place)?,
            name => {
                // In a step of the analysis all is about the analysis.
                if !self.in_step && !is_harmless(name) && self.unknown.len() < MOST_UNKNOWN {
                    self.unknown.entry(name.to_owned()).or_insert(line);
                }
                Block::Skip
            }
        };
        Ok(None)
    }

    /// A set or surface. What is not read of it is noted at its card: nodes and elements are whole without it.
    fn set_block<'p>(&mut self, keyword: &str, value: &dyn Fn(&str) -> Option<&'p str>, line: u64) -> Block {
        let name = value(if keyword == "SURFACE" { "NAME" } else { keyword }).unwrap_or("");
        let mut unread = name.is_empty().then(|| "it has no name".to_owned());
        let (kind, other) = match (keyword, value("TYPE").map(str::to_ascii_uppercase)) {
            ("NSET", _) => (Kind::Nodes, "ELSET"),
            ("ELSET", _) => (Kind::Elements, "NSET"),
            (_, Some(kind)) if kind == "NODE" => (Kind::NodeSurface, "COMBINE"),
            (_, kind) => {
                if let Some(kind) = kind.filter(|kind| kind != "ELEMENT") {
                    unread = Some(format!("TYPE={kind}"));
                }
                (Kind::Surface, "COMBINE")
            }
        };
        if let Some(how) = value(other) {
            unread = Some(format!("{other}={how}"));
        }
        let scope = self.scope_of(value("INSTANCE")).unwrap_or_else(|| {
            unread = Some(format!("no instance `{}` is defined above", value("INSTANCE").unwrap_or_default()));
            self.scope
        });
        let card = self.card(kind, name, line, scope);
        self.cards[card].generate = value("GENERATE").is_some();
        self.cards[card].unread = unread;
        Block::Set { card }
    }

    fn element_block(&mut self, kind: Option<&str>, set: Option<&str>, line: u64) -> Result<Block, FormatError> {
        let Some(kind) = kind else {
            return Err(FormatError::new(Place::Line(line), Reason::Nothing("element type (TYPE=)")));
        };
        self.not_in_instance("ELEMENT", Place::Line(line))?;
        let known = element_type(&kind.to_ascii_uppercase());
        let set = set.map(|n| self.card(Kind::Elements, n, line, self.scope));
        Ok(Block::Elements { shape: known.map(|(s, _)| s), nodes: known.map_or(0, |(_, n)| n), set })
    }

    /// An instance of a part: it has the numbers of the part, and sets of its own until it ends.
    fn instance(&mut self, name: &str, part: &str, place: Place) -> Result<Block, FormatError> {
        let is_part = |s: &Scope| s.instance.is_none() && !s.name.is_empty() && s.name.eq_ignore_ascii_case(part);
        let Some(part) = self.scopes.iter().position(is_part) else {
            return Err(FormatError::unexpected(place, "a part defined above", part.as_bytes()));
        };
        let scope = self.scopes.len();
        if self.instances.insert(name.to_ascii_uppercase(), scope).is_some() {
            return Err(FormatError::unexpected(place, "another name than that of an instance above", name.as_bytes()));
        }
        let instance = Some(Instance { part, placement: Placement::default() });
        self.scopes.push(Scope { name: name.to_owned(), instance, ..Scope::default() });
        self.scope = scope;
        Ok(Block::Instance { lines: 0 })
    }

    /// Nodes and elements belong to parts and to the assembly.
    fn not_in_instance(&self, what: &str, place: Place) -> Result<(), FormatError> {
        if self.scopes[self.scope].instance.is_none() {
            return Ok(());
        }
        Err(FormatError::new(place, Reason::Unsupported(format!("*{what} within an instance")))
            .with_remedy("define it in the part"))
    }

    fn scope_of(&self, instance: Option<&str>) -> Option<usize> {
        let Some(name) = instance else { return Some(self.scope) };
        self.instances.get(&name.to_ascii_uppercase()).copied()
    }

    fn card(&mut self, kind: Kind, name: &str, line: u64, scope: usize) -> usize {
        let (members, rows) = (Vec::new(), Arc::default());
        let (name, owner) = (name.to_owned(), self.scope);
        self.cards.push(Card { kind, name, generate: false, owner, scope, members, rows, line, unread: None });
        self.cards.len() - 1
    }

    fn data(&mut self, line: &[u8], number: u64) -> Result<(), FormatError> {
        let place = Place::Line(number);
        match self.block {
            Block::Skip => Ok(()),
            Block::Nodes { set } => self.node(line, set, place),
            Block::Elements { shape, nodes, set } => self.element(line, (shape, nodes, set), number),
            Block::Set { card } => {
                self.cards[card].row(line, place);
                Ok(())
            }
            Block::Instance { lines } => {
                self.block = Block::Instance { lines: lines + 1 };
                match &mut self.scopes[self.scope].instance {
                    Some(instance) => instance.placement.line(lines, line, place),
                    None => Ok(()),
                }
            }
        }
    }

    fn node(&mut self, line: &[u8], set: Option<usize>, place: Place) -> Result<(), FormatError> {
        let mut items = items(line);
        let id = parse_integer(items.next().unwrap_or(b""), "a node number", place)?;
        let mut position = DVec3::ZERO;
        for axis in 0..3 {
            // Coordinates that are left out are zero.
            if let Some(item) = items.next().filter(|i| !i.is_empty()) {
                position[axis] = parse_number(item, "a coordinate", place)?;
            }
        }
        // A normal may follow.
        if let Some(item) = items.nth(3).filter(|i| !i.is_empty()) {
            return Err(FormatError::unexpected(place, "the end of the node", item));
        }
        let next = self.points.len() as u32;
        if self.scopes[self.scope].nodes.insert(id, next).is_some() {
            return Err(FormatError::new(place, Reason::Duplicate { what: "node", id }));
        }
        self.points.push(position);
        self.scopes[self.scope].node_range.end = self.points.len();
        if let Some(card) = set {
            self.cards[card].members.push(next);
        }
        Ok(())
    }

    fn element(
        &mut self,
        line: &[u8],
        (shape, nodes, set): (Option<Shape>, usize, Option<usize>),
        number: u64,
    ) -> Result<(), FormatError> {
        let place = Place::Line(number);
        let mut items = items(line);
        if self.missing == 0 {
            let id = parse_integer(items.next().unwrap_or(b""), "an element number", place)?;
            let next = self.elements.len() as u32;
            if self.scopes[self.scope].elements.insert(id, next).is_some() {
                return Err(FormatError::new(place, Reason::Duplicate { what: "element", id }));
            }
            let (scope, end) = (self.scope as u32, self.element_nodes.len());
            self.elements.push(RawElement { scope, shape, end, line: number });
            self.scopes[self.scope].element_range.end = self.elements.len();
            self.missing = nodes;
            if let Some(card) = set {
                self.cards[card].members.push(next);
            }
        }
        if shape.is_none() {
            return Ok(());
        }
        // Beams may name a node for their orientation, and wedges of 15 nodes may have three more.
        let may_have_more = shape == Some(Shape::Line) || nodes == 15;
        let mut foreign = false;
        for item in items {
            if self.missing > 0 {
                self.missing -= 1;
                if self.is_of_instance(item) {
                    foreign = true;
                    continue;
                }
                self.element_nodes.push(parse_integer(item, "a node number", place)?);
            } else if !item.is_empty() && !may_have_more {
                return Err(FormatError::unexpected(place, "the end of the element", item)
                    .with_remedy("this line has too many nodes for the element type, or one before it too few"));
            }
        }
        if let Some(element) = self.elements.last_mut() {
            // An element between instances, such as a connector: it is no face, and its nodes are theirs.
            if foreign {
                element.shape = None;
            }
            element.end = self.element_nodes.len();
        }
        Ok(())
    }

    /// Whether a node is named with its instance: `INSTANCE.NUMBER`.
    fn is_of_instance(&self, item: &[u8]) -> bool {
        let Some(point) = item.iter().rposition(|&b| b == b'.') else { return false };
        let name = String::from_utf8_lossy(&item[..point]).to_ascii_uppercase();
        self.instances.contains_key(name.trim_matches('"'))
    }

    fn end_block(&mut self, place: Place) -> Result<(), FormatError> {
        self.block = Block::Skip;
        match std::mem::take(&mut self.missing) {
            0 => Ok(()),
            _ => Err(FormatError::new(place, Reason::Truncated { within: "an element" })),
        }
    }
}
