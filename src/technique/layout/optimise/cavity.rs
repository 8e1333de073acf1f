//! Cavities round irregular nodes are filled with regular patches: a grid, or three or five grids round one node.
//!
//! A cavity grows cell by cell until its rim turns like a polygon of three, four or five sides with edges that such a
//! patch can have. So irregular nodes that lie apart cancel each other out.

use std::collections::BTreeMap;

use super::LEAST;
use crate::mesh::VertexId;
use crate::technique::layout::Layout;
use crate::technique::layout::proposal::{Proposal, new_node};
use crate::watch::{Cancelled, Watch};

/// Larger cavities change more than they gain.
const LARGEST: usize = 140;

/// Grows a cavity round each irregular node; how many were filled anew.
pub(super) fn improve(layout: &mut Layout<'_>, watch: &Watch) -> Result<usize, Cancelled> {
    let mut filled = 0;
    let mut nodes: Vec<VertexId> = layout.ground.surface.points.ids().filter(|&v| layout.is_node(v)).collect();
    nodes.retain(|&v| is_irregular(layout, v));
    for node in nodes {
        watch.check()?;
        if layout.is_node(node) && is_irregular(layout, node) {
            filled += usize::from(grow(layout, node));
        }
    }
    Ok(filled)
}

fn is_irregular(layout: &Layout<'_>, v: VertexId) -> bool {
    let mut domains: Vec<u32> = layout.cells_at(v).iter().map(|&c| layout.domain(c)).collect();
    domains.sort_unstable();
    domains.dedup();
    domains.into_iter().any(|d| layout.patches(v, d) != layout.wanted(v, d))
}

fn grow(layout: &mut Layout<'_>, seed: VertexId) -> bool {
    let Some(&first) = layout.cells_at(seed).iter().min() else { return false };
    let domain = layout.domain(first);
    let mut cells: Vec<u32> = layout.cells_at(seed).iter().copied().filter(|&c| layout.domain(c) == domain).collect();
    cells.sort_unstable();
    let mut tries = 0;
    while cells.len() <= LARGEST {
        let Some(rim) = layout.rim(&cells) else { return false };
        let turns = turns(layout, &rim, &cells, domain);
        if turns.iter().all(|&t| t <= 2)
            && let Some(faces) = fill(&rim, &turns)
        {
            let proposal = Proposal { cells: cells.clone(), faces };
            if layout.gain(&proposal) < -1e-9 {
                tries += 1;
                if layout.carry_out(&proposal, LEAST).is_some() {
                    return true;
                }
                if tries > 8 {
                    return false;
                }
            }
        }
        let Some(next) = next_cell(layout, &cells, &rim, &turns) else { return false };
        cells.push(next);
    }
    false
}

/// How many patches inside the cavity each node of its rim should have.
fn turns(layout: &Layout<'_>, rim: &[VertexId], cells: &[u32], domain: u32) -> Vec<i32> {
    let inside = |v: VertexId| layout.cells_at(v).iter().filter(|c| cells.contains(c)).count() as i32;
    let turn = |&v: &VertexId| {
        let outside = layout.patches(v, domain) as i32 - inside(v);
        layout.wanted(v, domain) as i32 - outside
    };
    rim.iter().map(turn).collect()
}

/// The neighbour that makes the cavity roundest: at a node that turns back first, then the one with most common edges.
fn next_cell(layout: &Layout<'_>, cells: &[u32], rim: &[VertexId], turns: &[i32]) -> Option<u32> {
    let mut scores: BTreeMap<u32, i32> = BTreeMap::new();
    for &cell in cells {
        for k in 0..layout.ring(cell).len() {
            if let Some(next) = layout.neighbour(cell, k).filter(|next| !cells.contains(next)) {
                *scores.entry(next).or_default() += 10;
            }
        }
    }
    for (&v, &turn) in rim.iter().zip(turns) {
        for &cell in layout.cells_at(v) {
            if let Some(score) = scores.get_mut(&cell) {
                *score += if turn >= 3 { 25 } else { 1 };
            }
        }
    }
    let mut ranked: Vec<(i32, u32)> = scores.into_iter().map(|(c, s)| (-s, c)).collect();
    ranked.sort_unstable();
    let grown = |c: u32| [cells, &[c]].concat();
    ranked.into_iter().take(6).map(|r| r.1).find(|&c| layout.rim(&grown(c)).is_some())
}

/// Quads over a rim whose corners are the nodes that turn by one patch or none.
fn fill(rim: &[VertexId], turns: &[i32]) -> Option<Vec<Vec<VertexId>>> {
    let corners: Vec<usize> = (0..rim.len()).filter(|&k| turns[k] <= 1).collect();
    let n = corners.len();
    if !(3..=5).contains(&n) {
        return None;
    }
    let sides: Vec<usize> = (0..n).map(|i| (corners[(i + 1) % n] + rim.len() - corners[i]) % rim.len()).collect();
    let start = corners[0];
    let at = |k: usize| rim[(start + k) % rim.len()];
    if n == 4 {
        return (sides[0] == sides[2] && sides[1] == sides[3]).then(|| grid(sides[0], sides[1], at));
    }
    let spokes = spokes(&sides)?;
    let places: Vec<usize> = corners.iter().map(|&c| (c + rim.len() - start) % rim.len()).collect();
    Some(star(&spokes, &places, rim.len(), at))
}

fn grid(a: usize, b: usize, rim: impl Fn(usize) -> VertexId) -> Vec<Vec<VertexId>> {
    let node = |i: usize, j: usize| {
        if j == 0 {
            rim(i)
        } else if i == a {
            rim(a + j)
        } else if j == b {
            rim(2 * a + b - i)
        } else if i == 0 {
            rim(2 * (a + b) - j)
        } else {
            new_node((j - 1) * (a - 1) + i - 1)
        }
    };
    let quads = (0..a * b).map(|q| (q % a, q / a));
    quads.map(|(i, j)| vec![node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)]).collect()
}

/// The lengths of the spokes of a patch of three or five sides: side `i` is as long as the spokes `i - 1` and `i + 1`.
fn spokes(sides: &[usize]) -> Option<Vec<usize>> {
    let n = sides.len();
    let along = |j: usize| sides[(2 * j + 1) % n] as i64;
    let twice: i64 = (0..n).map(|j| if j % 2 == 0 { along(j) } else { -along(j) }).sum();
    let mut spokes = vec![0; n];
    let mut length = (twice % 2 == 0).then_some(twice / 2)?;
    for j in 0..n {
        spokes[(2 * j) % n] = usize::try_from(length).ok().filter(|&l| l >= 1)?;
        length = along(j) - length;
    }
    Some(spokes)
}

/// A grid at each corner, all round a central node. `places` are the corners on the rim.
fn star(spokes: &[usize], places: &[usize], rim_len: usize, rim: impl Fn(usize) -> VertexId) -> Vec<Vec<VertexId>> {
    let n = spokes.len();
    // New nodes: the centre, then those on spokes, then those inside the grids.
    let mut first = vec![1];
    for &s in spokes {
        first.push(first[first.len() - 1] + s - 1);
    }
    let mut inside = first[n];
    let mut faces = Vec::new();
    for i in 0..n {
        let before = (i + n - 1) % n;
        let (p, s) = (spokes[before], spokes[i]);
        let base = inside;
        inside += (p - 1) * (s - 1);
        let node = |u: usize, v: usize| {
            if v == 0 {
                rim((places[i] + u) % rim_len)
            } else if u == 0 {
                rim((places[i] + rim_len - v) % rim_len)
            } else if u == p && v == s {
                new_node(0)
            } else if u == p {
                new_node(first[i] + v - 1)
            } else if v == s {
                new_node(first[before] + u - 1)
            } else {
                new_node(base + (v - 1) * (p - 1) + u - 1)
            }
        };
        for (u, v) in (0..p * s).map(|q| (q % p, q / p)) {
            faces.push(vec![node(u, v), node(u + 1, v), node(u + 1, v + 1), node(u, v + 1)]);
        }
    }
    faces
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How many quads meet in each node.
    fn counts(faces: &[Vec<VertexId>]) -> BTreeMap<VertexId, usize> {
        let mut counts = BTreeMap::new();
        faces.iter().flatten().for_each(|&v| *counts.entry(v).or_default() += 1);
        counts
    }

    #[test]
    fn patches_of_three_four_and_five_sides_are_regular_but_for_the_centre() {
        for (sides, centre) in [(vec![4, 4, 4], 3), (vec![3, 2, 3, 2], 4), (vec![2, 3, 4, 3, 4], 5), (vec![6, 4, 4], 3)]
        {
            let total: usize = sides.iter().sum();
            let rim: Vec<VertexId> = (0..total).map(VertexId::new).collect();
            let mut turns = vec![2; total];
            let mut at = 0;
            for side in &sides {
                turns[at] = 1;
                at += side;
            }
            let faces = fill(&rim, &turns).expect("a patch");
            assert!(faces.iter().all(|f| f.len() == 4));
            for (v, count) in counts(&faces) {
                let on_rim = v.index() < total;
                let wanted = if on_rim {
                    turns[v.index()] as usize
                } else if v == new_node(0) {
                    centre
                } else {
                    4
                };
                assert_eq!(count, wanted, "{sides:?} {v:?}");
            }
        }
        let rim: Vec<VertexId> = (0..5).map(VertexId::new).collect();
        assert_eq!(fill(&rim, &[1, 1, 1, 1, 2]), None, "opposite sides differ");
    }
}
