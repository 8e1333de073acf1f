//! Instances of parts: where they stand, and the nodes and elements that they bring.
//!
//! After Abaqus Keywords Reference Guide, `*INSTANCE`: the first data line moves the instance, the second turns what
//! was moved about an axis through two points by an angle in degrees. The first instance of a part is made of its own
//! nodes, further ones of copies behind all others; a part without an instance, in a file that has instances, is no
//! part of the model and left out.

use std::ops::Range;

use super::super::ReadCounts;
use super::super::element::{Elements, Placed};
use super::super::error::{FormatError, Place, Reason};
use super::super::include::locate;
use super::read::Reader;
use super::scope::{Instance, Shift};
use super::sets::{Card, Sets};
use crate::mesh::Soup;

/// Instances may make so many nodes and elements for each one in the file; a hostile file could name a part without
/// end.
const MOST_COPIES: usize = 256;

impl Reader<'_> {
    /// The mesh of all cards.
    pub(super) fn finish(mut self) -> Result<(Soup, ReadCounts), FormatError> {
        let shifts = self.place_instances()?;
        let left_out = self.left_out();
        let mut elements = Elements::new(self.points.len());
        let flat = self.node_positions()?;
        let mut placed = Vec::with_capacity(self.elements.len());
        for (e, raw) in self.elements.iter().enumerate() {
            placed.push(match raw.shape {
                _ if left_out[raw.scope as usize] => Placed::Nothing,
                Some(shape) => elements.add(shape, &flat[self.nodes_of(e)], &self.points),
                None => elements.leave_out(),
            });
        }
        let mut nodes = Vec::new();
        for (scope, shift) in self.scopes.iter().zip(&shifts) {
            let Some(instance) = scope.instance.filter(|_| shift.elements > 0) else { continue };
            for e in self.scopes[instance.part].element_range.clone() {
                nodes.clear();
                nodes.extend(flat[self.nodes_of(e)].iter().map(|position| position + shift.nodes));
                placed.push(match self.elements[e].shape {
                    Some(shape) => elements.add(shape, &nodes, &self.points),
                    None => elements.leave_out(),
                });
            }
        }
        for (scope, _) in self.scopes.iter().zip(&left_out).filter(|(_, left_out)| **left_out) {
            elements.drop_nodes(scope.node_range.clone());
            elements.counts.note(&format!("part `{}`, which has no instance", scope.name));
        }
        elements.skin_of(&self.points, &mut placed);
        let mut soup = Soup { points: std::mem::take(&mut self.points).into(), ..Soup::default() };
        let faces = elements.faces.clone();
        let cards = self.cards_of_instances(&shifts, &left_out)?;
        let at = |line: u64| match locate(self.bytes, line) {
            (Some(file), line) => format!("line {line} of {file}"),
            (None, line) => format!("line {line}"),
        };
        for (name, &line) in &self.unknown {
            elements.counts.note_with(|| format!("card `*{name}` ({}), which is not known", at(line)));
        }
        let known = (self.scopes.as_slice(), shifts.as_slice(), &self.instances);
        let sets = Sets::new(known, &placed, &faces, soup.points.len(), &at);
        soup.carried.groups = sets.resolve(cards, &mut elements.counts)?;
        let counts = elements.finish(&mut soup)?;
        Ok((soup, counts))
    }

    /// Moves the parts to where their first instances stand, adds the nodes of further ones, and says where the nodes
    /// and elements of each scope are.
    fn place_instances(&mut self) -> Result<Vec<Shift>, FormatError> {
        let mut shifts = vec![Shift::default(); self.scopes.len()];
        let mut used = vec![false; self.scopes.len()];
        let pristine = if self.instances.len() > 1 { self.points.clone() } else { Vec::new() };
        let room =
            MOST_COPIES.saturating_mul(self.points.len() + self.elements.len() + 1024).min(u32::MAX as usize - 1);
        let mut elements = self.elements.len();
        for (scope, shift) in shifts.iter_mut().enumerate() {
            let Some(Instance { part, placement }) = self.scopes[scope].instance else { continue };
            let (nodes, own) = (self.scopes[part].node_range.clone(), self.scopes[part].element_range.clone());
            if !std::mem::replace(&mut used[part], true) {
                for point in &mut self.points[nodes] {
                    *point = placement.place(*point);
                }
                continue;
            }
            if self.points.len() + nodes.len() + elements + own.len() > room {
                let reason = Reason::TooMany { what: "nodes and elements of instances", limit: room as u64 };
                return Err(FormatError::new(Place::File, reason));
            }
            shift.nodes = (self.points.len() - nodes.start) as u32;
            shift.elements = (elements - own.start) as u32;
            self.points.extend(pristine[nodes].iter().map(|&point| placement.place(point)));
            elements += own.len();
        }
        if let Some(point) = self.points.iter().find(|point| !point.is_finite()) {
            let (what, found) = ("a coordinate of a moved or turned instance", point.to_string());
            return Err(FormatError::new(Place::File, Reason::NotFinite { what, found }));
        }
        if self.points.len() + elements >= u32::MAX as usize {
            let limit = u64::from(u32::MAX) - 1;
            return Err(FormatError::new(Place::File, Reason::TooMany { what: "nodes or elements", limit }));
        }
        Ok(shifts)
    }

    /// Which scopes are parts without an instance in a file with instances.
    fn left_out(&self) -> Vec<bool> {
        let mut left_out: Vec<bool> = (0..)
            .zip(&self.scopes)
            .map(|(s, scope)| s > 0 && scope.instance.is_none() && !self.instances.is_empty())
            .collect();
        for instance in self.scopes.iter().filter_map(|scope| scope.instance) {
            left_out[instance.part] = false;
        }
        left_out
    }

    /// The cards, those of parts once for each instance.
    fn cards_of_instances(&mut self, shifts: &[Shift], left_out: &[bool]) -> Result<Vec<Card>, FormatError> {
        let mut instances: Vec<Vec<usize>> = vec![Vec::new(); self.scopes.len()];
        for (scope, part) in (0..).zip(&self.scopes).filter_map(|(s, scope)| Some((s, scope.instance?.part))) {
            instances[part].push(scope);
        }
        let room = MOST_COPIES.saturating_mul(self.cards.len() + 1024);
        let mut cards = Vec::with_capacity(self.cards.len());
        for card in std::mem::take(&mut self.cards) {
            if cards.len() + instances[card.owner].len() > room {
                return Err(FormatError::new(
                    Place::File,
                    Reason::TooMany { what: "sets of instances", limit: room as u64 },
                ));
            }
            if instances[card.owner].is_empty() {
                cards.extend(Some(card).filter(|card| !left_out[card.owner]));
                continue;
            }
            for &owner in &instances[card.owner] {
                let shift = if card.kind.is_of_nodes() { shifts[owner].nodes } else { shifts[owner].elements };
                let members = card.members.iter().map(|position| position + shift).collect();
                cards.push(Card { owner, scope: owner, members, ..card.clone() });
            }
        }
        Ok(cards)
    }

    /// Where the nodes of an element of the file are in the list of all.
    fn nodes_of(&self, element: usize) -> Range<usize> {
        let begin = element.checked_sub(1).map_or(0, |before| self.elements[before].end);
        begin..self.elements[element].end
    }

    /// The positions of all elements' nodes.
    fn node_positions(&self) -> Result<Vec<u32>, FormatError> {
        let mut flat = Vec::with_capacity(self.element_nodes.len());
        let mut begin = 0;
        for raw in &self.elements {
            let known = &self.scopes[raw.scope as usize].nodes;
            for &id in &self.element_nodes[begin..raw.end] {
                let missing = || {
                    let (place, count) = (Place::Line(raw.line), known.len() as u64);
                    FormatError::new(place, Reason::OutOfRange { what: "node", index: id, count })
                };
                flat.push(*known.get(&id).ok_or_else(missing)?);
            }
            begin = raw.end;
        }
        Ok(flat)
    }
}
