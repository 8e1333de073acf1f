//! Cavities with several bores: what lies behind openings of flat faces, as a whole.
//!
//! The surface is cut along all openings. A piece that is bounded by openings alone, all of them round and below the
//! diameter, and that lies inside the cylinders through them and faces their axes, is made of bores that cross, end in
//! each other or in a floor: it goes as one. What lies behind a small opening and is no such piece is told, with the
//! reason, so that no opening stays without a word.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use rustc_hash::FxHashSet;

use super::cavity::{CONCENTRIC, Cavity, Found, PARALLEL, ROUND, WIDEST_CONE, WIDEST_FLOOR, WIDEST_STEP};
use super::openings::{Opening, Rims, inwards, openings};
use super::patches::Patches;
use super::round::{SIDE, circle};
use super::{Kind, Reason, Rejected};
use crate::mesh::geometry::centroid;
use crate::mesh::id::{Edge, Face};
use crate::mesh::topology::EdgeTable;
use crate::mesh::{EdgeId, FaceId, IdVec, Surface, edge_key};

/// Cosine by which the steepest face of a feature turns against its opening: 30 degrees.
const STEEP: f64 = 0.866;
/// How far above the plane of its rim a hole may reach, as a share of its width.
const ABOVE: f64 = 0.15;
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
        kind: Rims,
    ) -> Self {
        let mut openings = openings(surface, normals, patches, kind);
        if kind == Rims::Any {
            let sides = edges.edges_of_triangles(surface.faces.len());
            for opening in openings.iter_mut().filter(|o| o.width <= WIDEST_CONE * most) {
                opening.bore = bore(surface, edges, &sides, normals, opening);
            }
        }
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
                openings.iter().copied().filter(|o| o.bore <= self.most && is_wanted(o)).collect();
            if small.is_empty() || !self.is_steep(piece, &openings) {
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
        if openings.iter().any(|o| o.bore > self.most) {
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

    /// Whether anything of a piece stands up against its openings: a lid over a rim is no feature.
    fn is_steep(&self, piece: u32, openings: &[&Opening]) -> bool {
        let turns = |f: &FaceId| self.normals[*f].dot(openings[0].normal).abs() < STEEP;
        self.pieces.all[piece as usize].faces.iter().any(turns)
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

/// The width of the side behind an opening, which a rounding or a chamfer may part from it; the opening's own where
/// there is no side, or a funnel leads to it.
fn bore(
    surface: &Surface,
    edges: &EdgeTable,
    sides: &IdVec<Face, [EdgeId; 3]>,
    normals: &IdVec<Face, DVec3>,
    opening: &Opening,
) -> f64 {
    let aside = |p: DVec3| {
        let off = p - opening.centre;
        (off - opening.normal * off.dot(opening.normal)).length()
    };
    let is_near = |f: FaceId| surface.corners(f).into_iter().all(|p| aside(p) <= 0.5 * WIDEST_FLOOR * opening.width);
    let mut faces = opening.behind.clone();
    let mut seen: FxHashSet<FaceId> = faces.iter().copied().collect();
    let mut widest = 0.0_f64;
    while let Some(f) = faces.pop() {
        if normals[f].dot(opening.normal).abs() < SIDE {
            widest = surface.corners(f).into_iter().map(aside).fold(widest, f64::max);
            continue;
        }
        let beyond = sides[f].into_iter().flat_map(|e| edges.sides(e)).map(|side| side.face);
        faces.extend(beyond.filter(|&g| is_near(g) && seen.insert(g)));
    }
    let is_rim_of_it = opening.width <= WIDEST_CONE * 2.0 * widest;
    if is_rim_of_it { opening.width.min(2.0 * widest) } else { opening.width }
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
    openings.iter().map(|o| o.bore).fold(0.0, f64::max)
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
    let axis = openings.iter().find(|o| o.bore >= diameter)?.normal;
    let bores = bores(openings).iter().map(|bore| (middle(bore), widest(bore))).collect();
    let rims = (0..openings.len()).map(|rim| (piece, rim)).collect();
    Some(Cavity { kind, patches: vec![piece], rims, axis, diameter, bores })
}
