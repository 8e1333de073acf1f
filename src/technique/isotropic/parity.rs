//! Makes the number of border edges of each region even, so that it can be filled with quads alone.
//!
//! A curve between two regions counts once on each side; splitting one of its edges turns the parity of both. The odd
//! regions are paired by a T-join in a breadth-first tree over the regions, whose root is the open border where there
//! is one: from the leaves up, an odd region splits the longest edge of the curve towards its parent. Linear time.

use std::collections::VecDeque;

use super::{Remesher, Rules};
use crate::technique::ground::Ground;
use crate::technique::mixed::{Mixed, NONE, Place};

/// Whether each region has an odd number of sides on curves and rims.
pub fn odd_regions(mesh: &Mixed, regions: usize) -> Vec<bool> {
    let mut odd = vec![false; regions];
    for h in mesh.edges().flat_map(|h| [h, h ^ 1]) {
        if mesh.face(h) != NONE && (mesh.arc(h) != NONE || mesh.face(h ^ 1) == NONE) {
            odd[mesh.region(mesh.face(h)) as usize] ^= true;
        }
    }
    odd
}

/// Splits edges of curves until no region is odd, where that is possible. Returns the number of splits.
pub fn pair_up(mesh: &mut Mixed, ground: &Ground<'_>, rules: Rules) -> usize {
    let count = ground.region_count();
    let mut odd = odd_regions(mesh, count);
    let outside = count;
    // The longest edge between two regions, for each pair in order.
    let mut between: std::collections::BTreeMap<(usize, usize), (f64, u32)> = std::collections::BTreeMap::new();
    for h in mesh.edges().filter(|&h| mesh.arc(h) != NONE) {
        let side = |k: u32| if mesh.face(k) == NONE { outside } else { mesh.region(mesh.face(k)) as usize };
        let (a, b) = (side(h), side(h ^ 1));
        let key = (a.min(b), a.max(b));
        let entry = between.entry(key).or_insert((0.0, h));
        if a != b && mesh.length(h) / mesh.size(mesh.origin(h)) > entry.0 {
            *entry = (mesh.length(h) / mesh.size(mesh.origin(h)), h);
        }
    }
    let mut beside: Vec<Vec<(usize, u32)>> = vec![Vec::new(); count + 1];
    for (&(a, b), &(_, h)) in &between {
        if a != b {
            beside[a].push((b, h));
            beside[b].push((a, h));
        }
    }
    let (order, parent) = tree(&beside, outside);
    let mut work = Remesher { mesh, ground, rules, surplus: Vec::new(), asleep: Vec::new() };
    let mut splits = 0;
    for &region in order.iter().rev() {
        let Some((up, h)) = parent[region] else { continue };
        if region != outside && odd[region] && work.halve_on_curve(h) {
            odd[region] = false;
            if up != outside {
                odd[up] ^= true;
            }
            splits += 1;
        }
    }
    splits
}

type Parents = Vec<Option<(usize, u32)>>;

/// A breadth-first forest, the outside first: the order of visits and the parent of each with the edge towards it.
fn tree(beside: &[Vec<(usize, u32)>], outside: usize) -> (Vec<usize>, Parents) {
    let mut parent: Parents = vec![None; beside.len()];
    let mut seen = vec![false; beside.len()];
    let mut order = Vec::new();
    for root in std::iter::once(outside).chain(0..outside) {
        if std::mem::replace(&mut seen[root], true) {
            continue;
        }
        let mut queue = VecDeque::from([root]);
        while let Some(at) = queue.pop_front() {
            order.push(at);
            for &(next, h) in &beside[at] {
                if !std::mem::replace(&mut seen[next], true) {
                    parent[next] = Some((at, h));
                    queue.push_back(next);
                }
            }
        }
    }
    (order, parent)
}

impl Remesher<'_, '_> {
    /// Puts a vertex into the middle of an edge of a curve.
    fn halve_on_curve(&mut self, h: u32) -> bool {
        let arc = self.mesh.arc(h);
        let curve = &self.ground.curves[arc as usize];
        let [from, to] = self.ground.ends_on(self.mesh, h);
        let at = 0.5 * (from + to);
        let size = self.size_of(h);
        self.split(h, curve.at(at), glam::DVec3::ZERO, Place::Arc { arc, at }, size).is_some()
    }
}
