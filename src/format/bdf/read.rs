//! Reads bulk data.

use std::collections::BTreeMap;

use glam::DVec3;
use rustc_hash::FxHashMap;

use super::super::ReadResult;
use super::super::element::{Elements, Placed, Shape};
use super::super::error::{FormatError, Place, Reason};
use super::cards::{Card, Cards, Item};
use super::harmless::{Unread, judge};
use super::systems::{Grid, Systems};
use crate::mesh::{EdgeKey, FaceId, Soup};
use crate::watch::Watch;

/// Cards between two looks at the watch.
const STRIDE: u64 = 1 << 16;

/// Names of cards that are neither read nor harmless which are kept.
const MOST_UNREAD: usize = 1000;

pub(super) fn read(bytes: &[u8], watch: &Watch) -> ReadResult {
    let mut deck = Deck::default();
    watch.phase("reading cards", Some(bytes.len() as u64));
    let mut cards = Cards::new(bytes);
    let mut count = 0;
    while let Some(item) = cards.next() {
        match item {
            Item::Card(card) => deck.card(&card)?,
            Item::Comment(text) => deck.comment(&text),
        }
        count += 1;
        if u64::is_multiple_of(count, STRIDE) {
            watch.check()?;
            watch.advance(cards.offset() as u64, || format!("{count} cards"));
        }
    }
    deck.finish()
}

/// A shell, bar or solid that waits for the grid points, which may stand after it.
struct Waiting {
    shape: Shape,
    corners: usize,
    property: i64,
    /// Its part of `Deck::nodes`.
    end: usize,
    line: u64,
}

#[derive(Default)]
struct Deck {
    grids: Vec<Grid>,
    systems: Systems,
    positions: FxHashMap<i64, u32>,
    elements: Vec<Waiting>,
    /// The grid numbers of all elements, one after another.
    nodes: Vec<i64>,
    names: BTreeMap<i64, String>,
    /// Cards that are neither read nor harmless, and how many of each.
    unread: BTreeMap<String, (Unread, usize)>,
}

impl Deck {
    fn card(&mut self, card: &Card) -> Result<(), FormatError> {
        match card.name.as_str() {
            "GRID" => self.grid(card),
            "CTRIA3" | "CTRIAR" | "CPLSTN3" | "CPLSTS3" | "CTRAX3" => self.element(card, Shape::Triangle, 2, 3..=3),
            "CTRIA6" | "CTRIAX" | "CPLSTN6" | "CPLSTS6" => self.element(card, Shape::Triangle, 2, 3..=6),
            "CQUAD4" | "CQUADR" | "CSHEAR" | "CPLSTN4" | "CPLSTS4" | "CQUADX4" => {
                self.element(card, Shape::Quad, 2, 4..=4)
            }
            "CQUAD8" | "CPLSTN8" | "CPLSTS8" | "CQUADX8" => self.element(card, Shape::Quad, 2, 4..=8),
            "CQUAD" | "CQUADX" => self.element(card, Shape::Quad, 2, 4..=9),
            "CBAR" | "CBEAM" | "CROD" | "CTUBE" => self.element(card, Shape::Line, 2, 2..=2),
            "CONROD" | "PLOTEL" => self.element(card, Shape::Line, 1, 2..=2),
            "CTETRA" => self.element(card, Shape::Volume, 2, 4..=10),
            "CPYRAM" => self.element(card, Shape::Volume, 2, 5..=13),
            "CPENTA" => self.element(card, Shape::Volume, 2, 6..=15),
            "CHEXA" => self.element(card, Shape::Volume, 2, 8..=20),
            name if name.starts_with("INCLUDE") => {
                Err(FormatError::new(card.place(), Reason::Unsupported("`INCLUDE`".into()))
                    .with_remedy("give the deck the ending .bdf, so that what it includes is looked for"))
            }
            _ if self.systems.card(card)? => Ok(()),
            name => self.unread(name, card),
        }
    }

    /// A card that is not read: refused where it makes geometry, else noted unless it is harmless.
    fn unread(&mut self, name: &str, card: &Card) -> Result<(), FormatError> {
        let unread = judge(name);
        if unread == Unread::MakesGeometry {
            let what = format!("`{name}`, which makes or moves parts of the mesh,");
            return Err(FormatError::new(card.place(), Reason::Unsupported(what))
                .with_remedy("let the program that wrote the deck write out its grid points and elements"));
        }
        if unread != Unread::Harmless && (self.unread.len() < MOST_UNREAD || self.unread.contains_key(name)) {
            self.unread.entry(name.to_owned()).or_insert((unread, 0)).1 += 1;
        }
        Ok(())
    }

    fn grid(&mut self, card: &Card) -> Result<(), FormatError> {
        let Some(id) = card.integer(0, "a grid number")? else {
            return Err(FormatError::unexpected(card.place(), "a grid number", b""));
        };
        let system = card.integer(1, "a coordinate system")?;
        let [x, y, z] = [2, 3, 4].map(|field| card.number(field, "a coordinate"));
        let point = DVec3::new(x?, y?, z?);
        let position = u32::try_from(self.grids.len()).ok().filter(|&p| p != u32::MAX).ok_or_else(|| {
            FormatError::new(card.place(), Reason::TooMany { what: "vertices", limit: u64::from(u32::MAX) })
        })?;
        if self.positions.insert(id, position).is_some() {
            return Err(FormatError::new(card.place(), Reason::Duplicate { what: "grid point", id }));
        }
        self.grids.push(Grid { point, system, line: card.line });
        Ok(())
    }

    /// Notes an element whose grid numbers begin at field `first`; mid-side ones may be blank.
    fn element(
        &mut self,
        card: &Card,
        shape: Shape,
        first: usize,
        nodes: std::ops::RangeInclusive<usize>,
    ) -> Result<(), FormatError> {
        let property = if first == 2 { card.integer(1, "a property number")? } else { None };
        // An element's property is its own number where the card says none.
        let own = card.integer(0, "an element number")?;
        for position in 0..*nodes.end() {
            match card.integer(first + position, "a grid number")? {
                Some(node) => self.nodes.push(node),
                None if position < *nodes.start() => {
                    return Err(FormatError::unexpected(card.place(), "a grid number", b""));
                }
                None => {}
            }
        }
        let property = property.or(own).unwrap_or(0);
        let corners = *nodes.start();
        self.elements.push(Waiting { shape, corners, property, end: self.nodes.len(), line: card.line });
        Ok(())
    }

    /// Takes the name of a property from `HMNAME PROP 7"name"`, with or without blanks after the quotes.
    fn comment(&mut self, text: &[u8]) {
        let text = String::from_utf8_lossy(text);
        let Some(rest) = text.strip_prefix("HMNAME PROP").filter(|rest| rest.starts_with(' ')) else { return };
        let mut parts = rest.splitn(3, '"');
        if let (Some(Ok(id)), Some(name)) = (parts.next().map(|id| id.trim().parse()), parts.next()) {
            self.names.insert(id, name.to_owned());
        }
    }

    fn finish(mut self) -> ReadResult {
        let grid = |id: i64| self.positions.get(&id).map(|&at| at as usize);
        let points = std::mem::take(&mut self.systems).place(&self.grids, &grid)?;
        let mut gathered = Elements::new(points.len());
        let mut faces: BTreeMap<i64, Vec<FaceId>> = BTreeMap::new();
        let mut edges: BTreeMap<i64, Vec<EdgeKey>> = BTreeMap::new();
        let mut placed = Vec::with_capacity(self.elements.len());
        let mut positions = Vec::new();
        let mut start = 0;
        for element in &self.elements {
            positions.clear();
            for &node in &self.nodes[start..element.end] {
                positions.push(self.position(node, element.line)?);
            }
            start = element.end;
            placed.push(match element.shape {
                // Any of its mid-side nodes may be missing.
                Shape::Volume => gathered.volume(&positions, element.corners),
                shape => gathered.add(shape, &positions, &points),
            });
        }
        gathered.skin_of(&points, &mut placed);
        for (element, placed) in self.elements.iter().zip(placed) {
            match placed {
                Placed::Faces(range) | Placed::Skin(range, _) => {
                    faces.entry(element.property).or_default().extend(range.map(FaceId::new));
                }
                Placed::Edge(edge) if edge[0] != edge[1] => edges.entry(element.property).or_default().push(edge),
                Placed::Edge(_) | Placed::Vertex(_) | Placed::Volume(_) | Placed::Nothing => {}
            }
        }
        let mut soup = Soup { points: points.into(), ..Soup::default() };
        let name = |id: i64| self.names.get(&id).cloned().unwrap_or_else(|| format!("pid_{id}"));
        let groups = &mut soup.carried.groups;
        for (id, members) in faces {
            if self.names.get(&id).is_none_or(|name| !name.is_empty()) {
                groups.faces.entry(name(id)).or_default().extend(members);
            }
        }
        for (id, members) in edges {
            groups.edges.entry(name(id)).or_default().extend(members);
        }
        groups.faces.values_mut().for_each(|members| members.sort_unstable());
        for members in groups.edges.values_mut() {
            members.sort_unstable();
            members.dedup();
        }
        for (name, (unread, count)) in &self.unread {
            gathered.counts.note_with(|| match unread {
                Unread::Element => format!("{count} elements `{name}`"),
                _ => format!("{count} cards `{name}`, which are not known"),
            });
        }
        let counts = gathered.finish(&mut soup)?;
        Ok((soup, counts))
    }

    fn position(&self, node: i64, line: u64) -> Result<u32, FormatError> {
        let reason = Reason::OutOfRange { what: "grid point", index: node, count: self.grids.len() as u64 };
        self.positions.get(&node).copied().ok_or_else(|| FormatError::new(Place::Line(line), reason))
    }
}
