//! Nodes on the borders between domains, so many that each domain gets an even number: an odd one leaves a triangle.
//!
//! Each stretch of a border between two nodes gets as many parts as its length asks for, or one more or less where the
//! domains beside it would be odd: odd domains are joined in pairs by the ways over the domains between that change
//! lengths least.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use rustc_hash::FxHashSet;

use super::sample::Rope;
use super::strips::border_loops;
use crate::mesh::carried::{EdgeKey, edge_key};
use crate::mesh::id::Vertex;
use crate::mesh::{IdVec, VertexId};
use crate::technique::layout::Ground;

/// A stretch between two nodes.
struct Stretch {
    vertices: Vec<VertexId>,
    /// The length up to each vertex.
    at: Vec<f64>,
    /// The domains on both sides; the number of domains stands for the outside.
    beside: [usize; 2],
    /// Parts, and how many it may have instead.
    parts: [usize; 2],
    /// What it costs to have the other number.
    cost: f64,
}

/// Puts nodes on the stretches between domains; the edges of these stretches, which need no more. Loops of fewer than
/// three nodes are left to the belts, so that rows can run on to them.
pub(super) fn settle(ground: &Ground<'_>, node: &mut IdVec<Vertex, bool>, interval: f64) -> FxHashSet<EdgeKey> {
    let mut settled = FxHashSet::default();
    if ground.domains < 2 {
        return settled;
    }
    let (mut stretches, is_free) = stretches(ground, node, interval);
    pair_odd(&mut stretches, &is_free);
    for stretch in &stretches {
        settled.extend(stretch.vertices.windows(2).map(|w| edge_key(w[0], w[1])));
        for part in 1..stretch.parts[0] {
            let aim = stretch.at[stretch.at.len() - 1] * part as f64 / stretch.parts[0] as f64;
            let off = |k: &usize| (stretch.at[*k] - aim).abs();
            let near = (1..stretch.vertices.len() - 1).min_by(|a, b| off(a).total_cmp(&off(b)));
            if let Some(k) = near {
                node[stretch.vertices[k]] = true;
            }
        }
    }
    settled
}

/// All stretches, and which domains, the outside last, can take an odd number.
fn stretches(ground: &Ground<'_>, node: &IdVec<Vertex, bool>, interval: f64) -> (Vec<Stretch>, Vec<bool>) {
    let mut known: BTreeMap<EdgeKey, Stretch> = BTreeMap::new();
    let mut is_free = vec![false; ground.domains + 1];
    is_free[ground.domains] = true;
    for sides in border_loops(ground, &ground.domain) {
        let own = ground.domain[sides[0].face] as usize;
        let rope = Rope::new(ground, &sides);
        let n = rope.len();
        let places: Vec<usize> = (0..n).filter(|&k| node[rope.vertices[k]]).collect();
        if places.len() < 3 {
            is_free[own] = true;
            continue;
        }
        for (i, &from) in places.iter().enumerate() {
            let steps = (places[(i + 1) % places.len()] + n - from) % n;
            let vertices: Vec<VertexId> = (0..=steps).map(|k| rope.vertices[(from + k) % n]).collect();
            let Some(name) = vertices.windows(2).map(|w| edge_key(w[0], w[1])).min() else { continue };
            let beyond = ground.beyond(sides[from]).map_or(ground.domains, |f| ground.domain[f] as usize);
            known.entry(name).or_insert_with(|| Stretch::new(ground, vertices, [own, beyond], interval));
        }
    }
    (known.into_values().collect(), is_free)
}

impl Stretch {
    fn new(ground: &Ground<'_>, vertices: Vec<VertexId>, beside: [usize; 2], interval: f64) -> Self {
        /// Parts longer than this many intervals would be cut again.
        const LONGEST: f64 = 1.7;
        let mut at = vec![0.0];
        for w in vertices.windows(2) {
            at.push(at[at.len() - 1] + ground.point(w[0]).distance(ground.point(w[1])));
        }
        let wanted = at[at.len() - 1] / interval;
        let most = vertices.len() - 1;
        let parts = (wanted.round() as usize).clamp(1, most);
        let is_long = parts as f64 > wanted && parts > 1 && wanted <= LONGEST * (parts - 1) as f64;
        let other = if is_long || parts + 1 > most { parts - 1 } else { parts + 1 };
        let change = (other as f64 - wanted).abs() - (parts as f64 - wanted).abs();
        let cost = if other == 0 { f64::INFINITY } else { change.max(0.0) / wanted.max(0.5) };
        Self { vertices, at, beside, parts: [parts, other], cost }
    }
}

/// Changes stretches until no domain is odd but the free ones.
fn pair_odd(stretches: &mut [Stretch], is_free: &[bool]) {
    let mut at: Vec<Vec<usize>> = vec![Vec::new(); is_free.len()];
    let mut is_odd = vec![false; is_free.len()];
    for (k, stretch) in stretches.iter().enumerate() {
        for domain in stretch.beside {
            at[domain].push(k);
            is_odd[domain] ^= stretch.parts[0] % 2 == 1;
        }
    }
    for start in 0..is_free.len() {
        if !is_odd[start] || is_free[start] {
            continue;
        }
        is_odd[start] = false;
        let Some(way) = way(stretches, &at, start, |d| is_free[d] || is_odd[d]) else { continue };
        let mut domain = start;
        for k in way {
            let stretch = &mut stretches[k];
            stretch.parts.swap(0, 1);
            // To take a change back costs nothing.
            stretch.cost = 0.0;
            domain = stretch.beside[usize::from(stretch.beside[0] == domain)];
        }
        is_odd[domain] = false;
    }
}

/// The cheapest way over stretches from a domain to one that is a goal.
fn way(stretches: &[Stretch], at: &[Vec<usize>], start: usize, is_goal: impl Fn(usize) -> bool) -> Option<Vec<usize>> {
    let mut cost = vec![f64::INFINITY; at.len()];
    let mut from: Vec<Option<usize>> = vec![None; at.len()];
    let mut queue = BinaryHeap::from([Reverse((0_u64, start))]);
    cost[start] = 0.0;
    while let Some(Reverse((bits, domain))) = queue.pop() {
        if bits != cost[domain].to_bits() {
            continue;
        }
        if domain != start && is_goal(domain) {
            let (mut way, mut back) = (Vec::new(), domain);
            while let Some(k) = from[back].filter(|_| back != start) {
                way.push(k);
                let beside = stretches[k].beside;
                back = beside[usize::from(beside[0] == back)];
            }
            way.reverse();
            return Some(way);
        }
        for &k in &at[domain] {
            let beside = stretches[k].beside;
            let next = beside[usize::from(beside[0] == domain)];
            let length = cost[domain] + stretches[k].cost;
            if length < cost[next] {
                (cost[next], from[next]) = (length, Some(k));
                queue.push(Reverse((length.to_bits(), next)));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stretch(beside: [usize; 2], parts: usize, cost: f64) -> Stretch {
        Stretch { vertices: Vec::new(), at: Vec::new(), beside, parts: [parts, parts + 1], cost }
    }

    #[test]
    fn odd_domains_are_joined_by_the_cheapest_way() {
        // Domains 0, 1, 2 in a row, 3 is the outside, where a stretch costs more than both inner ones.
        let row = |outside: f64| {
            let mut all = vec![stretch([0, 1], 2, 0.1), stretch([1, 2], 3, 0.2), stretch([0, 3], 3, outside)];
            all.extend([stretch([1, 3], 3, outside), stretch([2, 3], 2, outside)]);
            all
        };
        for (outside, changed) in [(1.0, vec![0, 1]), (0.01, vec![2, 4])] {
            let mut stretches = row(outside);
            pair_odd(&mut stretches, &[false, false, false, true]);
            let now: Vec<usize> = (0..5).filter(|&k| stretches[k].parts[0] != row(outside)[k].parts[0]).collect();
            assert_eq!(now, changed);
            for domain in 0..3 {
                let own = stretches.iter().filter(|s| s.beside.contains(&domain));
                assert_eq!(own.map(|s| s.parts[0]).sum::<usize>() % 2, 0, "domain {domain}");
            }
        }
    }
}
