//! Edits of a few cells: turned edges, collapsed and opened quads, nodes of two and three patches removed.

use super::{LEAST, Memory};
use crate::mesh::VertexId;
use crate::technique::fill::new_node;
use crate::technique::layout::Layout;
use crate::technique::layout::proposal::Proposal;
use crate::watch::{Cancelled, Watch};

/// A change must lower the cost by more than rounding.
const LESS: f64 = -1e-9;

/// Carries out edits that lower the cost, until there is none; how many.
pub(super) fn improve(layout: &mut Layout<'_>, memory: &mut Memory, watch: &Watch) -> Result<usize, Cancelled> {
    /// Later passes hardly find anything.
    const PASSES: usize = 8;
    let mut total = 0;
    for _ in 0..PASSES {
        let mut edits = 0;
        for cell in layout.cells().collect::<Vec<_>>() {
            watch.check()?;
            if layout.exists(cell) {
                edits += usize::from(best(layout, proposals(layout, cell), memory));
            }
        }
        total += edits;
        if edits == 0 {
            break;
        }
    }
    Ok(total)
}

/// Carries out the first of the proposals, best first, that lowers the cost and can be embedded.
fn best(layout: &mut Layout<'_>, proposals: Vec<Proposal>, memory: &mut Memory) -> bool {
    let mut ranked: Vec<(f64, Proposal)> = proposals.into_iter().map(|p| (layout.gain(&p), p)).collect();
    ranked.retain(|(gain, proposal)| *gain < LESS && !memory.refused.contains(proposal));
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (_, proposal) in ranked {
        if layout.carry_out(&proposal, LEAST).is_some() {
            return true;
        }
        memory.refused.insert(proposal);
    }
    false
}

/// Everything that can be done to a cell and its surroundings.
pub(super) fn proposals(layout: &Layout<'_>, cell: u32) -> Vec<Proposal> {
    let mut all = Vec::new();
    for k in 0..layout.ring(cell).len() {
        if let Some(other) = layout.neighbour(cell, k).filter(|&other| other > cell) {
            turned(layout, cell, other, &mut all);
        }
    }
    if layout.ring(cell).len() == 4 {
        collapsed(layout, cell, &mut all);
    }
    let lowest = |v: VertexId| layout.cells_at(v).iter().min() == Some(&cell);
    for v in layout.nodes(cell).into_iter().filter(|&v| lowest(v)) {
        opened(layout, v, layout.domain(cell), &mut all);
        removed(layout, v, &mut all);
    }
    all
}

/// Two quads as a hexagon have three diagonals; a quad and a triangle as a pentagon five.
fn turned(layout: &Layout<'_>, a: u32, b: u32, all: &mut Vec<Proposal>) {
    let Some(rim) = layout.rim(&[a, b]) else { return };
    let n = rim.len();
    if !(5..=6).contains(&n) {
        return;
    }
    let starts = if n == 6 { 3 } else { 5 };
    for i in 0..starts {
        let at = |k: usize| rim[(i + k) % n];
        let first = vec![at(0), at(1), at(2), at(3)];
        let second = (3..=n).map(at).collect();
        all.push(Proposal { cells: vec![a, b], faces: vec![first, second] });
    }
}

/// A quad collapsed along each of its diagonals.
fn collapsed(layout: &Layout<'_>, cell: u32, all: &mut Vec<Proposal>) {
    let ring = layout.nodes(cell);
    let domain = layout.domain(cell);
    for k in 0..2 {
        let (mut stays, mut goes) = (ring[k], ring[k + 2]);
        if layout.is_on_border(goes) {
            std::mem::swap(&mut stays, &mut goes);
        }
        if layout.is_on_border(goes) {
            continue;
        }
        let mut cells: Vec<u32> = [stays, goes].iter().flat_map(|&v| layout.cells_at(v)).copied().collect();
        cells.retain(|&c| layout.domain(c) == domain);
        cells.sort_unstable();
        cells.dedup();
        let rest = cells.iter().filter(|&&c| c != cell);
        let faces: Vec<Vec<VertexId>> =
            rest.map(|&c| layout.nodes(c).into_iter().map(|v| if v == goes { stays } else { v }).collect()).collect();
        let twice = |face: &Vec<VertexId>| face.iter().filter(|&&v| v == stays).count() > 1;
        if !faces.is_empty() && !faces.iter().any(twice) {
            all.push(Proposal { cells, faces });
        }
    }
}

/// The cells of a domain at a node, counter-clockwise; at a border from the border ahead to that behind.
pub(super) fn fan(layout: &Layout<'_>, v: VertexId, domain: u32) -> Option<(Vec<u32>, bool)> {
    let mut cells: Vec<u32> = layout.cells_at(v).iter().copied().filter(|&c| layout.domain(c) == domain).collect();
    cells.sort_unstable();
    let corner = |c: u32| layout.ring(c).iter().position(|corner| corner.node == v);
    let first = cells.iter().copied().find(|&c| corner(c).is_some_and(|k| layout.neighbour(c, k).is_none()));
    let start = first.or(cells.first().copied())?;
    let mut fan = vec![start];
    let mut at = start;
    while fan.len() <= cells.len() {
        let k = corner(at)?;
        let n = layout.ring(at).len();
        match layout.neighbour(at, (k + n - 1) % n) {
            None => return (fan.len() == cells.len()).then_some((fan, false)),
            Some(next) if next == start => return (fan.len() == cells.len()).then_some((fan, true)),
            Some(next) => fan.push(next),
        }
        at = fan[fan.len() - 1];
    }
    None
}

/// A node with too many patches gives some of them to a new node, with a new quad between both.
fn opened(layout: &Layout<'_>, v: VertexId, domain: u32, all: &mut Vec<Proposal>) {
    let patches = layout.patches(v, domain);
    if patches <= layout.wanted(v, domain) || patches > 10 {
        return;
    }
    let Some((fan, is_closed)) = fan(layout, v, domain) else { return };
    // The node at the end of the edge behind each cell, seen from `v`.
    let behind = |c: u32| {
        let ring = layout.nodes(c);
        let k = ring.iter().position(|&w| w == v).unwrap_or(0);
        ring[(k + ring.len() - 1) % ring.len()]
    };
    let fresh = new_node(0);
    let n = fan.len();
    for first in 0..n {
        for count in 2..n {
            if !is_closed && first + 1 + count >= n {
                continue;
            }
            let given: Vec<u32> = (0..count).map(|i| fan[(first + 1 + i) % n]).collect();
            let (x, y) = (behind(fan[first]), behind(given[count - 1]));
            if x == y {
                continue;
            }
            let renamed = |c: &u32| {
                let swap = |w: VertexId| if w == v && given.contains(c) { fresh } else { w };
                layout.nodes(*c).into_iter().map(swap).collect::<Vec<_>>()
            };
            let mut faces: Vec<Vec<VertexId>> = fan.iter().map(renamed).collect();
            faces.push(vec![v, x, fresh, y]);
            all.push(Proposal { cells: fan.clone(), faces });
        }
    }
}

/// An inner node of two or three quads goes.
fn removed(layout: &Layout<'_>, v: VertexId, all: &mut Vec<Proposal>) {
    let cells = layout.cells_at(v).to_vec();
    if layout.is_on_border(v) || cells.len() > 3 {
        return;
    }
    let Some(rim) = layout.rim(&cells) else { return };
    match rim.len() {
        3 | 4 => all.push(Proposal { cells, faces: vec![rim] }),
        6 => {
            for i in 0..3 {
                let at = |k: usize| rim[(i + k) % 6];
                let faces = vec![(0..4).map(at).collect(), (3..7).map(at).collect()];
                all.push(Proposal { cells: cells.clone(), faces });
            }
        }
        _ => {}
    }
}
