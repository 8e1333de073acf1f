//! Which borders of regions are worth following: those that force bad faces are left out of the network.
//!
//! A border that meets another curve in a narrow wedge, or ends so near to another node that nothing fits between,
//! would cost more in shapes than it gives in order. Marked edges and borders of face groups are always followed.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;

use super::curve::{Curve, Network, curves, nodes};
use crate::mesh::topology::EdgeTable;
use crate::mesh::{MarkCause, Surface, VertexId, edge_key};

/// When a border is left out.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    /// It meets another curve at less than this angle, in radians.
    pub angle: f64,
    /// How far from a node directions are taken.
    pub reach: f64,
    /// A piece of the network shorter than this costs a border at one of its ends.
    pub gap: f64,
}

/// Rounds of choosing: each leaves out the worst border of each neighbourhood.
const ROUNDS: usize = 40;

/// The end of a curve at a node.
struct Spoke {
    curve: usize,
    direction: DVec3,
}

/// Leaves out borders until none is bad. Returns the vertices at their ends, whose pins no longer count.
pub(super) fn leave_out(
    surface: &Surface,
    edges: &EdgeTable,
    network: &mut Network,
    corner: f64,
    choice: &Choice,
) -> (usize, BTreeSet<VertexId>) {
    let (mut dropped, mut released) = (0, BTreeSet::new());
    for _ in 0..ROUNDS {
        let is_node = nodes(surface, network, corner, &released);
        let curves = curves(surface, network, is_node);
        let mut bad = judge(surface, edges, &curves, choice);
        bad.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        let mut touched = BTreeSet::new();
        for (_, at) in bad {
            let curve = &curves[at];
            let ends = [curve.vertices[0], curve.vertices[curve.vertices.len() - 1]];
            if ends.iter().any(|v| touched.contains(v)) {
                continue;
            }
            touched.extend(ends);
            released.extend(ends);
            dropped += 1;
            for pair in curve.vertices.windows(2) {
                for (v, w) in [(pair[0], pair[1]), (pair[1], pair[0])] {
                    if let Some(spokes) = network.get_mut(&v) {
                        spokes.retain(|(x, _)| *x != w);
                    }
                }
            }
        }
        if touched.is_empty() {
            break;
        }
        network.retain(|_, spokes| !spokes.is_empty());
    }
    (dropped, released)
}

/// The borders that are bad now, with what makes them so: less is worse.
fn judge(surface: &Surface, edges: &EdgeTable, curves: &[Curve], choice: &Choice) -> Vec<(f64, usize)> {
    let may_go: Vec<bool> = curves.iter().map(|curve| is_optional(surface, edges, curve)).collect();
    let mut at: BTreeMap<VertexId, Vec<Spoke>> = BTreeMap::new();
    for (i, curve) in curves.iter().enumerate() {
        let (length, last) = (curve.length(), curve.vertices.len() - 1);
        let reach = choice.reach.min(0.5 * length);
        for (v, from, to) in [(0, 0.0, reach), (last, length, length - reach)] {
            let direction = (curve.at(to) - curve.at(from)).normalize_or_zero();
            at.entry(curve.vertices[v]).or_default().push(Spoke { curve: i, direction });
        }
    }
    let mut bad = Vec::new();
    let longest = curves.iter().map(Curve::length).fold(f64::MIN_POSITIVE, f64::max);
    for spokes in at.values() {
        for (i, s) in spokes.iter().enumerate() {
            for t in &spokes[i + 1..] {
                let angle = crate::mesh::geometry::angle(s.direction, t.direction);
                let goes = [s.curve, t.curve].into_iter().filter(|&c| may_go[c]);
                // Of two borders the shorter one goes.
                let goes = goes.min_by(|&x, &y| curves[x].length().total_cmp(&curves[y].length()));
                if let Some(curve) = goes
                    && angle < choice.angle
                {
                    bad.push((angle, curve));
                }
            }
        }
    }
    for (i, curve) in curves.iter().enumerate() {
        if curve.length() >= choice.gap || curve.is_closed() {
            continue;
        }
        let score = 10.0 + curve.length() / longest;
        if may_go[i] {
            bad.push((score, i));
            continue;
        }
        // A short piece of a marked curve between two ends of borders: one of them goes if that makes the piece longer.
        let ends = [curve.vertices[0], curve.vertices[curve.vertices.len() - 1]];
        let movable = ends.iter().filter_map(|v| at.get(v)).filter_map(|spokes| {
            let goes: Vec<usize> = spokes.iter().map(|s| s.curve).filter(|&c| may_go[c]).collect();
            (spokes.len() - goes.len() == 2 && goes.len() == 1).then(|| goes[0])
        });
        if let Some(c) = movable.min_by(|&x, &y| curves[x].length().total_cmp(&curves[y].length())) {
            bad.push((score, c));
        }
    }
    bad
}

/// Whether a curve is nothing but a border of regions.
fn is_optional(surface: &Surface, edges: &EdgeTable, curve: &Curve) -> bool {
    if curve.mark.cause != MarkCause::RegionBorder {
        return false;
    }
    let groups = &surface.carried.groups;
    if groups.faces.is_empty() && groups.edges.is_empty() {
        return true;
    }
    let mut keys = curve.vertices.windows(2).map(|pair| edge_key(pair[0], pair[1]));
    keys.all(|key| {
        let divides = |members: &Vec<crate::mesh::FaceId>| {
            let sides = edges.find(key).map(|e| edges.sides(e)).unwrap_or_default();
            let inside = sides.iter().filter(|s| members.binary_search(&s.face).is_ok()).count();
            inside != 0 && inside != sides.len()
        };
        !groups.faces.values().any(divides) && !groups.edges.values().any(|m| m.binary_search(&key).is_ok())
    })
}
