//! Cavities with several bores: what lies behind openings of flat faces, as a whole.
//!
//! The surface is cut along all openings. A piece that is bounded by openings alone, all of them round and below the
//! diameter, and that lies inside the cylinders through them and faces their axes, is made of bores that cross, end in
//! each other or in a floor: it goes as one. What lies behind a small opening and is no such piece is told, with the
//! reason, so that no opening stays without a word.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;

use super::cavity::{CONCENTRIC, Cavity, Found, PARALLEL, ROUND, WIDEST_FLOOR, WIDEST_STEP};
use super::openings::{Opening, inwards, openings};
use super::patches::Patches;
use super::round::circle;
use super::{Kind, Reason, Rejected};
use crate::mesh::geometry::centroid;
use crate::mesh::id::{Edge, Face};
use crate::mesh::topology::EdgeTable;
use crate::mesh::{FaceId, IdVec, Surface, edge_key};

/// How far above the plane of its rim a hole may reach, as a share of its width.
const ABOVE: f64 = 0.05;
/// Sine by which faces of a hole may turn away from its axis.
const AWAY: f64 = 0.1;

/// Looks for cavities behind openings.
pub(super) struct Compounds<'a> {
    surface: &'a Surface,
    normals: &'a IdVec<Face, DVec3>,
    /// The patches between sharp edges.
    patches: &'a Patches,
    openings: Vec<Opening>,
    /// The pieces between openings.
    pub(super) pieces: Patches,
    /// Pieces that an opening lies in.
    hosts: BTreeSet<u32>,
    most: f64,
}

impl<'a> Compounds<'a> {
    pub(super) fn new(
        surface: &'a Surface,
        edges: &EdgeTable,
        normals: &'a IdVec<Face, DVec3>,
        patches: &'a Patches,
        most: f64,
    ) -> Self {
        let openings = openings(surface, normals, patches);
        let mut is_cut: IdVec<Edge, bool> = IdVec::filled(false, edges.len());
        for opening in &openings {
            let rim = &patches.all[opening.patch as usize].rims[opening.rim].vertices;
            for (i, &v) in rim.iter().enumerate() {
                if let Some(e) = edges.find(edge_key(v, rim[(i + 1) % rim.len()])) {
                    is_cut[e] = true;
                }
            }
        }
        let pieces = Patches::new(surface, edges, &is_cut);
        let host = |o: &Opening| patches.all[o.patch as usize].faces.first().map(|&f| pieces.of_face[f]);
        let hosts = openings.iter().filter_map(host).collect();
        Self { surface, normals, patches, openings, pieces, hosts, most }
    }

    /// The cavities of the wanted kinds, and the openings below the diameter that stay.
    pub(super) fn find(&self, kinds: &[Kind]) -> Found {
        let mut behind: BTreeMap<u32, Vec<&Opening>> = BTreeMap::new();
        for opening in &self.openings {
            behind.entry(self.pieces.of_face[opening.behind[0]]).or_default().push(opening);
        }
        let mut found = Found::default();
        for (piece, openings) in behind {
            let is_wanted = |o: &Opening| {
                let holes = kinds.contains(&Kind::ThroughHoles) || kinds.contains(&Kind::BlindHoles);
                if o.is_hole { holes } else { kinds.contains(&Kind::Bosses) }
            };
            let small: Vec<&Opening> =
                openings.iter().copied().filter(|o| o.width <= self.most && is_wanted(o)).collect();
            if small.is_empty() {
                continue;
            }
            match self.refusal(piece, &openings) {
                Some(reason) => {
                    let left = bores(&small).into_iter().map(|bore| rejected(&bore, reason));
                    found.rejected.extend(left);
                }
                None => found.cavities.extend(cavity(piece, &openings).filter(|c| kinds.contains(&c.kind))),
            }
        }
        found
    }

    /// Why what lies behind openings cannot be removed.
    fn refusal(&self, piece: u32, openings: &[&Opening]) -> Option<Reason> {
        let is_alone = !self.hosts.contains(&piece)
            && self.pieces.all[piece as usize].rims.len() == openings.len()
            && openings.iter().all(|o| o.is_hole == openings[0].is_hole);
        if openings.iter().any(|o| o.width > self.most) {
            Some(Reason::OpensWider)
        } else if openings.iter().any(|o| !o.is_round) {
            Some(Reason::NotRound)
        } else if !is_alone {
            Some(Reason::CutByOthers)
        } else if openings.iter().any(|o| self.lies_in_wide_step(o)) {
            Some(Reason::StepTooLarge)
        } else {
            let faces = &self.pieces.all[piece as usize].faces;
            let is_inside = faces.iter().all(|&f| openings.iter().any(|o| self.is_bore_of(f, o)));
            (!is_inside).then_some(Reason::OpensWider)
        }
    }

    /// Whether the face round an opening is the step of a wider hole that stays.
    fn lies_in_wide_step(&self, opening: &Opening) -> bool {
        let rims = &self.patches.all[opening.patch as usize].rims;
        rims.len() == 2
            && rims.iter().enumerate().filter(|(k, _)| *k != opening.rim).any(|(_, rim)| {
                let outer = circle(self.surface, rim, opening.normal);
                let off = outer.centre - opening.centre;
                let aside = (off - opening.normal * off.dot(opening.normal)).length();
                outer.error <= ROUND
                    && aside <= CONCENTRIC * opening.width
                    && 2.0 * outer.radius > self.most
                    && 2.0 * outer.radius <= WIDEST_STEP * opening.width
                    && inwards(self.surface, self.normals, rim, outer.centre, opening.normal) > 0.0
            })
    }

    /// Whether a face lies in the cylinder through an opening, on the side of the feature, and faces as its side does.
    fn is_bore_of(&self, face: FaceId, opening: &Opening) -> bool {
        let corners = self.surface.corners(face);
        let sense = if opening.is_hole { 1.0 } else { -1.0 };
        let aside = |p: DVec3| {
            let off = p - opening.centre;
            off - opening.normal * off.dot(opening.normal)
        };
        let is_in = |&p: &DVec3| {
            aside(p).length() <= 0.5 * WIDEST_FLOOR * opening.width
                && sense * (p - opening.centre).dot(opening.normal) <= ABOVE * opening.width
        };
        let out = aside(centroid(corners)).normalize_or_zero();
        corners.iter().all(is_in) && sense * self.normals[face].dot(out) <= AWAY
    }
}

/// Openings on the same axis, by the first of each.
fn bores<'o>(openings: &[&'o Opening]) -> Vec<Vec<&'o Opening>> {
    let mut bores: Vec<Vec<&Opening>> = Vec::new();
    for &opening in openings {
        let is_same = |bore: &Vec<&Opening>| {
            let off = opening.centre - bore[0].centre;
            let aside = (off - bore[0].normal * off.dot(bore[0].normal)).length();
            opening.normal.dot(bore[0].normal).abs() > PARALLEL && aside <= CONCENTRIC * bore[0].width
        };
        match bores.iter_mut().find(|bore| is_same(bore)) {
            Some(bore) => bore.push(opening),
            None => bores.push(vec![opening]),
        }
    }
    bores
}

fn middle(openings: &[&Opening]) -> DVec3 {
    openings.iter().map(|o| o.centre).sum::<DVec3>() / openings.len().max(1) as f64
}

fn widest(openings: &[&Opening]) -> f64 {
    openings.iter().map(|o| o.width).fold(0.0, f64::max)
}

fn rejected(bore: &[&Opening], reason: Reason) -> (Vec<FaceId>, Rejected) {
    let behind = bore.iter().flat_map(|o| &o.behind).copied().collect();
    (behind, Rejected { centre: middle(bore), diameter: widest(bore), reason })
}

/// What a piece behind these openings is; `None` for a column between two faces.
fn cavity(piece: u32, openings: &[&Opening]) -> Option<Cavity> {
    let kind = match (openings.first()?.is_hole, openings.len()) {
        (true, 1) => Kind::BlindHoles,
        (true, _) => Kind::ThroughHoles,
        (false, 1) => Kind::Bosses,
        (false, _) => return None,
    };
    let diameter = widest(openings);
    let axis = openings.iter().find(|o| o.width >= diameter)?.normal;
    let bores = bores(openings).iter().map(|bore| (middle(bore), widest(bore))).collect();
    let rims = (0..openings.len()).map(|rim| (piece, rim)).collect();
    Some(Cavity { kind, patches: vec![piece], rims, axis, diameter, bores })
}
