//! The sets and surfaces of input files, and the groups they become.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use rustc_hash::FxHashMap;

use super::super::ReadCounts;
use super::super::element::Placed;
use super::super::error::{FormatError, Place, Reason};
use super::super::text::parse_integer;
use super::scope::{Scope, Shift};
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

impl Kind {
    /// Whether its members are nodes.
    pub(super) fn is_of_nodes(self) -> bool {
        matches!(self, Self::Nodes | Self::NodeSurface)
    }
}

/// One card with its data lines.
#[derive(Clone, Debug)]
pub(super) struct Card {
    /// What its members are.
    pub(super) kind: Kind,
    /// The name as written.
    pub(super) name: String,
    /// Whether its lines are ranges.
    pub(super) generate: bool,
    /// Whose set it is.
    pub(super) owner: usize,
    /// Whose numbers it uses.
    pub(super) scope: usize,
    /// Positions that the node or element card itself put in.
    pub(super) members: Vec<u32>,
    /// Items of the data lines: of surfaces whole lines, else single items.
    pub(super) rows: Arc<Vec<(Row, Place)>>,
    /// Its line.
    pub(super) line: u64,
    /// What in it is not read, such as a parameter. Such a card makes no group.
    pub(super) unread: Option<String>,
}

/// An item of a set.
#[derive(Clone, Debug)]
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

    fn push(&mut self, row: Row, place: Place) {
        Arc::make_mut(&mut self.rows).push((row, place));
    }

    fn read_row(&mut self, line: &[u8], place: Place) -> Result<(), FormatError> {
        let line = line.strip_suffix(b",").unwrap_or(line);
        let mut items = line.split(|&b| b == b',').map(<[u8]>::trim_ascii);
        let text = |item: &[u8]| String::from_utf8_lossy(item).trim_matches('"').to_owned();
        if matches!(self.kind, Kind::Surface | Kind::NodeSurface) {
            let of = text(items.next().unwrap_or(b""));
            let side = text(items.next().unwrap_or(b"")).to_ascii_uppercase();
            self.push(Row::Side(of, side), place);
        } else if self.generate {
            let mut number = |default| match items.next() {
                Some(item) if !item.is_empty() => parse_integer(item, "a range of numbers", place),
                _ => Ok(default),
            };
            let first = number(0)?;
            let (last, step) = (number(first)?, number(1)?);
            self.push(Row::Range(first, last, step.max(1)), place);
        } else {
            for item in items.filter(|i| !i.is_empty()) {
                let numeric = item[0].is_ascii_digit() || item[0] == b'-';
                let id = parse_integer(item, "a number", place).ok().filter(|_| numeric);
                self.push(id.map_or_else(|| Row::Name(text(item)), Row::Id), place);
            }
        }
        Ok(())
    }
}

/// A set as far as it is known.
#[derive(Debug, Default)]
struct Set {
    name: String,
    members: Vec<u32>,
    edges: Vec<EdgeKey>,
    /// Single sides of volumes.
    faces: Vec<FaceId>,
}

/// What a card's rows mean.
struct Found {
    members: Vec<u32>,
    edges: Vec<EdgeKey>,
    faces: Vec<FaceId>,
    /// Sides of volumes that lie inside.
    inside: usize,
}

impl Found {
    fn len(&self) -> usize {
        self.members.len() + self.edges.len() + self.faces.len()
    }
}

/// All scopes, where the nodes and elements of each are, and the instances by their names.
type Known<'a> = (&'a [Scope], &'a [Shift], &'a BTreeMap<String, usize>);

/// All sets, by kind, owner and name in upper case.
pub(super) struct Sets<'a> {
    scopes: &'a [Scope],
    shifts: &'a [Shift],
    instances: &'a BTreeMap<String, usize>,
    placed: &'a [Placed],
    faces: &'a [Facet],
    nodes: usize,
    known: BTreeMap<(Kind, usize, String), Set>,
    /// A line in words.
    at: &'a dyn Fn(u64) -> String,
    /// How many members may still be added; sets that name sets could grow without bound.
    budget: usize,
}

impl<'a> Sets<'a> {
    /// No sets yet, over these elements and so many nodes.
    pub(super) fn new(
        (scopes, shifts, instances): Known<'a>,
        placed: &'a [Placed],
        faces: &'a [Facet],
        nodes: usize,
        at: &'a dyn Fn(u64) -> String,
    ) -> Self {
        let budget = 64 * (nodes + placed.len() + 1024);
        Self { scopes, shifts, instances, placed, faces, nodes, known: BTreeMap::new(), at, budget }
    }

    /// The groups that the cards make; what is left out is noted.
    pub(super) fn resolve(mut self, cards: Vec<Card>, counts: &mut ReadCounts) -> Result<Groups, FormatError> {
        // Surfaces may stand before the sets that they name.
        let (surfaces, plain): (Vec<Card>, Vec<Card>) =
            cards.into_iter().partition(|c| matches!(c.kind, Kind::Surface | Kind::NodeSurface));
        for card in plain.into_iter().chain(surfaces) {
            self.add(card, counts)?;
        }
        Ok(self.into_groups())
    }

    /// Adds what a card holds to its set. A card that cannot be understood is left out whole and named, since half a
    /// set under its full name would deceive; numbers that nobody has are left out of it, as the solvers do.
    fn add(&mut self, card: Card, counts: &mut ReadCounts) -> Result<(), FormatError> {
        let what = || {
            let what = match card.kind {
                Kind::Nodes => "node set",
                Kind::Elements => "element set",
                Kind::Surface | Kind::NodeSurface => "surface",
            };
            format!("{what} `{}` ({})", card.name, (self.at)(card.line))
        };
        if let Some(unread) = &card.unread {
            counts.note_with(|| format!("{}: {unread}", what()));
            return Ok(());
        }
        let mut missing = 0;
        let mut found = Found { members: card.members.clone(), edges: Vec::new(), faces: Vec::new(), inside: 0 };
        let mut left = self.budget;
        for (row, place) in card.rows.iter() {
            let before = found.len();
            if let Err(why) = self.resolve_row(card.kind, (card.owner, card.scope), row, &mut found, &mut missing) {
                counts.note_with(|| format!("{}: {why}", what()));
                return Ok(());
            }
            let limit = 64 * self.placed.len() as u64;
            let error = || FormatError::new(*place, Reason::TooMany { what: "members of sets", limit });
            left = left.checked_sub(found.len() - before).ok_or_else(error)?;
        }
        if missing > 0 {
            counts.note_with(|| format!("{missing} members of {}, which the file does not have", what()));
        }
        if found.inside > 0 {
            counts.note_with(|| format!("{} sides of {}, which lie inside", found.inside, what()));
        }
        self.budget = left;
        let key = (card.kind, card.owner, card.name.to_ascii_uppercase());
        let set = self.known.entry(key).or_default();
        if set.name.is_empty() {
            set.name = card.name;
        }
        set.members.extend(found.members);
        set.members.sort_unstable();
        set.members.dedup();
        set.edges.extend(found.edges);
        set.faces.extend(found.faces);
        Ok(())
    }

    /// What one item of a set means, or why it means nothing.
    fn resolve_row(
        &self,
        kind: Kind,
        (owner, scope): (usize, usize),
        row: &Row,
        found: &mut Found,
        missing: &mut usize,
    ) -> Result<(), String> {
        match row {
            Row::Id(id) => match self.position(kind, scope, *id) {
                Some(position) => found.members.push(position),
                None => *missing += 1,
            },
            Row::Range(first, last, step) => self.range(kind, scope, [*first, *last, *step], &mut found.members),
            Row::Name(name) => found.members.extend(self.members(kind, (owner, scope), name)?.iter()),
            Row::Side(of, side) => {
                let base = if kind == Kind::NodeSurface { Kind::Nodes } else { Kind::Elements };
                let named = match of.parse::<i64>() {
                    Ok(id) => {
                        let single: Vec<u32> = self.position(base, scope, id).into_iter().collect();
                        *missing += usize::from(single.is_empty());
                        Cow::Owned(single)
                    }
                    Err(_) if of.is_empty() => return Err("all free faces of the model".into()),
                    Err(_) => self.members(base, (owner, scope), of)?,
                };
                let numbered = |letter| side.strip_prefix(letter).and_then(|n: &str| n.parse::<usize>().ok());
                if base == Kind::Nodes {
                    found.members.extend(named.iter());
                } else if let Some(number) = numbered('E') {
                    found.edges.extend(self.sides(&named, number));
                } else if let Some(number) = numbered('S') {
                    self.volume_sides(&named, number, found);
                } else if side.is_empty() || side == "SPOS" || side == "SNEG" {
                    found.members.extend(named.iter());
                } else {
                    return Err(format!("side `{side}`"));
                }
            }
        }
        Ok(())
    }

    /// The numbers of a scope, an instance's those of its part, and what is added to their positions.
    fn numbers(&self, kind: Kind, scope: usize) -> (&FxHashMap<i64, u32>, u32) {
        let own = &self.scopes[self.scopes[scope].instance.map_or(scope, |instance| instance.part)];
        let shift = self.shifts[scope];
        if kind.is_of_nodes() { (&own.nodes, shift.nodes) } else { (&own.elements, shift.elements) }
    }

    fn position(&self, kind: Kind, scope: usize, id: i64) -> Option<u32> {
        let (numbers, shift) = self.numbers(kind, scope);
        numbers.get(&id).map(|position| position + shift)
    }

    /// Numbers in a range that nobody has are skipped, as the solvers do.
    fn range(&self, kind: Kind, scope: usize, [first, last, step]: [i64; 3], members: &mut Vec<u32>) {
        let known = self.numbers(kind, scope).0.len();
        let count = i128::from(last) - i128::from(first);
        if count / i128::from(step) <= known as i128 {
            let mut id = first;
            while id <= last {
                members.extend(self.position(kind, scope, id));
                let Some(next) = id.checked_add(step) else { break };
                id = next;
            }
        } else {
            let inside =
                |id: i64| id >= first && id <= last && (i128::from(id) - i128::from(first)) % i128::from(step) == 0;
            members.extend(self.numbers_sorted(kind, scope).into_iter().filter(|&(id, _)| inside(id)).map(|(_, p)| p));
        }
    }

    fn numbers_sorted(&self, kind: Kind, scope: usize) -> Vec<(i64, u32)> {
        let (numbers, shift) = self.numbers(kind, scope);
        let mut all: Vec<(i64, u32)> = numbers.iter().map(|(&id, &p)| (id, p + shift)).collect();
        all.sort_unstable();
        all
    }

    /// The members of a set of the scope whose numbers are used, else of the owner, else of the instance that the name
    /// begins with (`INSTANCE.SET`, or `INSTANCE.NUMBER`), else of any scope.
    fn members(&self, kind: Kind, (owner, scope): (usize, usize), name: &str) -> Result<Cow<'_, [u32]>, String> {
        let upper = name.to_ascii_uppercase();
        let of =
            |scope: usize, name: &str| self.known.get(&(kind, scope, name.to_owned())).map(|s| s.members.as_slice());
        if let Some(members) = of(scope, &upper).or_else(|| of(owner, &upper)) {
            return Ok(Cow::Borrowed(members));
        }
        let dotted = upper.rsplit_once('.').and_then(|(instance, rest)| Some((*self.instances.get(instance)?, rest)));
        if let Some((instance, rest)) = dotted {
            let single = rest.parse().ok().and_then(|id| self.position(kind, instance, id));
            let found =
                single.map(|position| Cow::Owned(vec![position])).or_else(|| of(instance, rest).map(Cow::Borrowed));
            return found.ok_or_else(|| format!("no set `{name}` could be read from the file"));
        }
        // A surface of the assembly names sets of its instances.
        let found = (0..self.scopes.len()).find_map(|scope| of(scope, &upper));
        found.map(Cow::Borrowed).ok_or_else(|| format!("no set `{name}` could be read from the file"))
    }

    /// Side `number`, counted from 1, of each volume among the elements; other elements have one side, themselves.
    fn volume_sides(&self, elements: &[u32], number: usize, found: &mut Found) {
        for &element in elements {
            match &self.placed[element as usize] {
                Placed::Skin(range, sides) => {
                    let bit = 1_u8.checked_shl(number.saturating_sub(1) as u32).unwrap_or(0);
                    if number > 0 && sides & bit != 0 {
                        let before = (sides & (bit - 1)).count_ones() as usize;
                        found.faces.push(FaceId::new(range.start + before));
                    } else {
                        found.inside += 1;
                    }
                }
                _ => found.members.push(element),
            }
        }
    }

    /// Side `number`, counted from 1, of each face among the elements.
    fn sides(&self, elements: &[u32], number: usize) -> Vec<EdgeKey> {
        let faces = elements.iter().filter_map(|&e| match &self.placed[e as usize] {
            Placed::Faces(range) => self.faces.get(range.start),
            Placed::Edge(_) | Placed::Vertex(_) | Placed::Skin(..) | Placed::Volume(_) | Placed::Nothing => None,
        });
        let side = |facet: &Facet| {
            let corners = facet.corners();
            let at = number.checked_sub(1).filter(|&i| i < corners.len())?;
            Some(edge_key(corners[at], corners[(at + 1) % corners.len()]))
        };
        faces.filter_map(side).collect()
    }

    fn into_groups(self) -> Groups {
        let mut groups = Groups::default();
        let mut owners: BTreeMap<(bool, &str), BTreeSet<usize>> = BTreeMap::new();
        for (kind, owner, upper) in self.known.keys() {
            owners.entry((kind.is_of_nodes(), upper)).or_default().insert(*owner);
        }
        let shared: BTreeSet<(bool, String)> = owners
            .into_iter()
            .filter(|(_, of)| of.len() > 1)
            .map(|((nodes, name), _)| (nodes, name.to_owned()))
            .collect();
        let mut taken: BTreeMap<(bool, String), Vec<u32>> = BTreeMap::new();
        for ((kind, owner, upper), set) in self.known {
            let on_nodes = kind.is_of_nodes();
            let whole = set.members.len() == if on_nodes { self.nodes } else { self.placed.len() };
            if whole && upper == if on_nodes { "NALL" } else { "EALL" } {
                continue;
            }
            let mut name = set.name.clone();
            let scope = &self.scopes[owner].name;
            if !scope.is_empty() && shared.contains(&(on_nodes, upper)) {
                name = format!("{scope}.{name}");
            }
            if let Some(other) = taken.get(&(on_nodes, name.to_ascii_uppercase())) {
                // A surface made of the whole set of its name is the same group.
                if *other == set.members && set.edges.is_empty() && set.faces.is_empty() {
                    continue;
                }
                name = format!("{name}_surface");
            }
            taken.entry((on_nodes, name.to_ascii_uppercase())).or_insert_with(|| set.members.clone());
            if on_nodes {
                groups.vertices.insert(name, set.members.into_iter().map(VertexId::from_raw).collect());
                continue;
            }
            let (mut faces, mut edges) = (set.faces, set.edges);
            for placed in set.members.iter().map(|&e| &self.placed[e as usize]) {
                match placed {
                    Placed::Faces(range) | Placed::Skin(range, _) => faces.extend(range.clone().map(FaceId::new)),
                    Placed::Edge(edge) => edges.push(*edge),
                    Placed::Vertex(_) | Placed::Volume(_) | Placed::Nothing => {}
                }
            }
            faces.sort_unstable();
            faces.dedup();
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
