//! The sets and surfaces of input files, and the groups they become.

use std::collections::BTreeMap;

use super::super::element::Placed;
use super::super::error::{FormatError, Place, Reason};
use super::super::text::parse_integer;
use super::read::Scope;
use crate::mesh::{EdgeKey, FaceId, Facet, Groups, VertexId, edge_key};

/// What a card's members are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    /// `*NSET`.
    Nodes,
    /// `*ELSET`.
    Elements,
    /// `*SURFACE` of elements and their sides.
    Surface,
    /// `*SURFACE` of nodes.
    NodeSurface,
}

/// One card with its data lines.
#[derive(Debug)]
pub(super) struct Card {
    /// What its members are.
    pub(super) kind: Kind,
    /// The name as written.
    pub(super) name: String,
    /// Whether its lines are ranges.
    pub(super) generate: bool,
    /// Whose numbers it uses.
    pub(super) scope: usize,
    /// Positions that the node or element card itself put in.
    pub(super) members: Vec<u32>,
    /// Items of the data lines: of surfaces whole lines, else single items.
    pub(super) rows: Vec<(Row, Place)>,
    /// Its line.
    pub(super) line: u64,
    /// What in it is not read, such as a parameter. Such a card makes no group.
    pub(super) unread: Option<String>,
}

/// An item of a set.
#[derive(Debug)]
pub(super) enum Row {
    /// A number.
    Id(i64),
    /// First, last, step.
    Range(i64, i64, i64),
    /// Another set.
    Name(String),
    /// A set or element number, and the side.
    Side(String, String),
}

impl Card {
    /// Takes a data line. Where it is no line of a set, the card makes no group.
    pub(super) fn row(&mut self, line: &[u8], place: Place) {
        if self.unread.is_none()
            && let Err(error) = self.read_row(line, place)
        {
            self.unread = Some(error.reason.to_string());
        }
    }

    fn read_row(&mut self, line: &[u8], place: Place) -> Result<(), FormatError> {
        let line = line.strip_suffix(b",").unwrap_or(line);
        let mut items = line.split(|&b| b == b',').map(<[u8]>::trim_ascii);
        let text = |item: &[u8]| String::from_utf8_lossy(item).trim_matches('"').to_owned();
        if matches!(self.kind, Kind::Surface | Kind::NodeSurface) {
            let of = text(items.next().unwrap_or(b""));
            let side = text(items.next().unwrap_or(b"")).to_ascii_uppercase();
            self.rows.push((Row::Side(of, side), place));
        } else if self.generate {
            let mut number = |default| match items.next() {
                Some(item) if !item.is_empty() => parse_integer(item, "a range of numbers", place),
                _ => Ok(default),
            };
            let first = number(0)?;
            let (last, step) = (number(first)?, number(1)?);
            self.rows.push((Row::Range(first, last, step.max(1)), place));
        } else {
            for item in items.filter(|i| !i.is_empty()) {
                let numeric = item[0].is_ascii_digit() || item[0] == b'-';
                let id = parse_integer(item, "a number", place).ok().filter(|_| numeric);
                self.rows.push((id.map_or_else(|| Row::Name(text(item)), Row::Id), place));
            }
        }
        Ok(())
    }
}

/// A set as far as it is known.
#[derive(Debug, Default)]
struct Set {
    name: String,
    scope: usize,
    members: Vec<u32>,
    edges: Vec<EdgeKey>,
}

/// What a card's rows mean.
struct Found {
    members: Vec<u32>,
    edges: Vec<EdgeKey>,
}

impl Found {
    fn len(&self) -> usize {
        self.members.len() + self.edges.len()
    }
}

/// All sets, by kind, part and name in upper case.
#[derive(Debug)]
pub(super) struct Sets<'a> {
    scopes: &'a [Scope],
    placed: &'a [Placed],
    faces: &'a [Facet],
    known: BTreeMap<(Kind, usize, String), Set>,
    /// What was left out.
    notes: Vec<String>,
    /// How many members may still be added; sets that name sets could grow without bound.
    budget: usize,
}

impl<'a> Sets<'a> {
    /// The groups that the cards make.
    pub(super) fn resolve(
        scopes: &'a [Scope],
        cards: Vec<Card>,
        placed: &'a [Placed],
        faces: &'a [Facet],
        nodes: usize,
    ) -> Result<(Groups, Vec<String>), FormatError> {
        let budget = 64 * (nodes + placed.len() + 1024);
        let mut sets = Self { scopes, placed, faces, known: BTreeMap::new(), notes: Vec::new(), budget };
        // Surfaces may stand before the sets that they name.
        let (surfaces, plain): (Vec<Card>, Vec<Card>) =
            cards.into_iter().partition(|c| matches!(c.kind, Kind::Surface | Kind::NodeSurface));
        for card in plain.into_iter().chain(surfaces) {
            sets.add(card)?;
        }
        let notes = std::mem::take(&mut sets.notes);
        Ok((sets.into_groups(nodes), notes))
    }

    /// Adds what a card holds to its set. A card that cannot be understood is left out whole and named, since half a set
    /// under its full name would deceive; numbers that nobody has are left out of it, as the solvers do.
    fn add(&mut self, card: Card) -> Result<(), FormatError> {
        let what = match card.kind {
            Kind::Nodes => "node set",
            Kind::Elements => "element set",
            Kind::Surface | Kind::NodeSurface => "surface",
        };
        let what = format!("{what} `{}` (line {})", card.name, card.line);
        if let Some(unread) = &card.unread {
            self.notes.push(format!("{what}: {unread}"));
            return Ok(());
        }
        let mut missing = 0;
        let mut found = Found { members: card.members, edges: Vec::new() };
        for (row, place) in card.rows {
            let before = found.len();
            if let Err(why) = self.resolve_row(card.kind, card.scope, row, &mut found, &mut missing) {
                self.notes.push(format!("{what}: {why}"));
                return Ok(());
            }
            let limit = 64 * self.placed.len() as u64;
            let error = || FormatError::new(place, Reason::TooMany { what: "members of sets", limit });
            self.budget = self.budget.checked_sub(found.len() - before).ok_or_else(error)?;
        }
        if missing > 0 {
            self.notes.push(format!("{missing} members of {what}, which the file does not have"));
        }
        let key = (card.kind, card.scope, card.name.to_ascii_uppercase());
        let set = self.known.entry(key).or_default();
        if set.name.is_empty() {
            set.name = card.name;
            set.scope = card.scope;
        }
        set.members.extend(found.members);
        set.members.sort_unstable();
        set.members.dedup();
        set.edges.extend(found.edges);
        Ok(())
    }

    /// What one item of a set means, or why it means nothing.
    fn resolve_row(
        &self,
        kind: Kind,
        scope: usize,
        row: Row,
        found: &mut Found,
        missing: &mut usize,
    ) -> Result<(), String> {
        match row {
            Row::Id(id) => match self.numbers(kind, scope).get(&id) {
                Some(&position) => found.members.push(position),
                None => *missing += 1,
            },
            Row::Range(first, last, step) => self.range(kind, scope, [first, last, step], &mut found.members),
            Row::Name(name) => found.members.extend(self.members(kind, scope, &name)?),
            Row::Side(of, side) => {
                let base = if kind == Kind::NodeSurface { Kind::Nodes } else { Kind::Elements };
                let single;
                let named = match of.parse::<i64>() {
                    Ok(id) => {
                        single = self.numbers(base, scope).get(&id).copied();
                        *missing += usize::from(single.is_none());
                        single.as_slice()
                    }
                    Err(_) if of.is_empty() => return Err("all free faces of the model".into()),
                    Err(_) => self.members(base, scope, &of)?,
                };
                let numbered = |letter| side.strip_prefix(letter).and_then(|n: &str| n.parse::<usize>().ok());
                if base == Kind::Nodes {
                    found.members.extend(named);
                } else if let Some(number) = numbered('E') {
                    found.edges.extend(self.sides(named, number));
                } else if side.is_empty() || side == "SPOS" || side == "SNEG" || numbered('S').is_some() {
                    found.members.extend(named);
                } else {
                    return Err(format!("side `{side}`"));
                }
            }
        }
        Ok(())
    }

    fn numbers(&self, kind: Kind, scope: usize) -> &rustc_hash::FxHashMap<i64, u32> {
        match kind {
            Kind::Nodes | Kind::NodeSurface => &self.scopes[scope].nodes,
            Kind::Elements | Kind::Surface => &self.scopes[scope].elements,
        }
    }

    /// Numbers in a range that nobody has are skipped, as the solvers do.
    fn range(&self, kind: Kind, scope: usize, [first, last, step]: [i64; 3], members: &mut Vec<u32>) {
        let numbers = self.numbers(kind, scope);
        let count = i128::from(last) - i128::from(first);
        if count / i128::from(step) <= numbers.len() as i128 {
            let mut id = first;
            while id <= last {
                members.extend(numbers.get(&id));
                let Some(next) = id.checked_add(step) else { break };
                id = next;
            }
        } else {
            let inside =
                |id: i64| id >= first && id <= last && (i128::from(id) - i128::from(first)) % i128::from(step) == 0;
            let mut found: Vec<u32> = Vec::new();
            found.extend(self.numbers_sorted(kind, scope).into_iter().filter(|&(id, _)| inside(id)).map(|(_, p)| p));
            members.extend(found);
        }
    }

    fn numbers_sorted(&self, kind: Kind, scope: usize) -> Vec<(i64, u32)> {
        let mut all: Vec<(i64, u32)> = self.numbers(kind, scope).iter().map(|(&id, &p)| (id, p)).collect();
        all.sort_unstable();
        all
    }

    /// The members of a set of the same part, or of the assembly.
    fn members(&self, kind: Kind, scope: usize, name: &str) -> Result<&[u32], String> {
        let upper = name.to_ascii_uppercase();
        let own = self.known.get(&(kind, scope, upper.clone()));
        // A surface of the assembly names sets of its instances.
        let found = own.or_else(|| (0..self.scopes.len()).find_map(|s| self.known.get(&(kind, s, upper.clone()))));
        found.map(|set| set.members.as_slice()).ok_or_else(|| format!("no set `{name}` could be read from the file"))
    }

    /// Side `number`, counted from 1, of each face among the elements.
    fn sides(&self, elements: &[u32], number: usize) -> Vec<EdgeKey> {
        let faces = elements.iter().filter_map(|&e| match &self.placed[e as usize] {
            Placed::Faces(range) => self.faces.get(range.start),
            Placed::Edge(_) | Placed::Vertex(_) | Placed::Nothing => None,
        });
        let side = |facet: &Facet| {
            let corners = facet.corners();
            let at = number.checked_sub(1).filter(|&i| i < corners.len())?;
            Some(edge_key(corners[at], corners[(at + 1) % corners.len()]))
        };
        faces.filter_map(side).collect()
    }

    fn into_groups(self, nodes: usize) -> Groups {
        let mut groups = Groups::default();
        let mut taken: BTreeMap<(bool, String), Vec<u32>> = BTreeMap::new();
        for ((kind, _, upper), set) in self.known {
            let on_nodes = matches!(kind, Kind::Nodes | Kind::NodeSurface);
            let whole = set.members.len() == if on_nodes { nodes } else { self.placed.len() };
            if whole && upper == if on_nodes { "NALL" } else { "EALL" } {
                continue;
            }
            let mut name = set.name.clone();
            if let Some(other) = taken.get(&(on_nodes, upper.clone())) {
                // A surface made of the whole set of its name is the same group.
                if *other == set.members && set.edges.is_empty() {
                    continue;
                }
                let part = &self.scopes[set.scope].name;
                name = if part.is_empty() { format!("{name}_surface") } else { format!("{part}.{name}") };
            }
            taken.entry((on_nodes, upper)).or_insert_with(|| set.members.clone());
            if on_nodes {
                groups.vertices.insert(name, set.members.into_iter().map(VertexId::from_raw).collect());
                continue;
            }
            let (mut faces, mut edges) = (Vec::new(), set.edges);
            for placed in set.members.iter().map(|&e| &self.placed[e as usize]) {
                match placed {
                    Placed::Faces(range) => faces.extend(range.clone().map(FaceId::new)),
                    Placed::Edge(edge) => edges.push(*edge),
                    Placed::Vertex(_) | Placed::Nothing => {}
                }
            }
            edges.sort_unstable();
            edges.dedup();
            if !edges.is_empty() {
                groups.edges.insert(name.clone(), edges);
            }
            if !faces.is_empty() {
                groups.faces.insert(name, faces);
            }
        }
        groups
    }
}
