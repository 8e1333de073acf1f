//! Building the hierarchy.

use glam::DVec3;

use super::{Aabb, Bvh, Node, Primitive};

/// Primitives in a leaf: fewer cost more nodes, more cost more tests. 4 was the fastest of 2, 4 and 8.
const LEAF: usize = 4;
const BINS: usize = 16;
/// Below this depth the heuristic may have chosen badly; halving from here on bounds the depth.
const MAX_SAH_DEPTH: u32 = 48;

#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    index: u32,
}

impl Item {
    #[inline]
    fn centre(&self) -> DVec3 {
        self.bounds.centre()
    }
}

pub(super) fn build<P: Primitive>(primitives: &[P]) -> Bvh<P> {
    let mut items: Vec<Item> =
        primitives.iter().enumerate().map(|(i, p)| Item { bounds: p.bounds(), index: i as u32 }).collect();
    let mut nodes = Vec::with_capacity(items.len());
    if !items.is_empty() {
        nodes.push(Node { bounds: bounds_of(&items), first: 0, count: 0 });
        let mut stack = vec![(0_usize, 0_usize, items.len(), 0_u32)];
        while let Some((node, start, end, depth)) = stack.pop() {
            let Some((middle, left, right)) = split(&mut items[start..end], depth) else {
                nodes[node].first = start as u32;
                nodes[node].count = (end - start) as u32;
                continue;
            };
            let child = nodes.len();
            nodes[node].first = child as u32;
            nodes.push(Node { bounds: left, first: 0, count: 0 });
            nodes.push(Node { bounds: right, first: 0, count: 0 });
            stack.push((child + 1, start + middle, end, depth + 1));
            stack.push((child, start, start + middle, depth + 1));
        }
    }
    nodes.shrink_to_fit();
    Bvh {
        nodes,
        primitives: items.iter().map(|item| primitives[item.index as usize]).collect(),
        indices: items.iter().map(|item| item.index).collect(),
    }
}

fn bounds_of(items: &[Item]) -> Aabb {
    items.iter().fold(Aabb::EMPTY, |all, item| all.union(item.bounds))
}

/// Partitions the items of a node; returns the size of the left part and both boxes, or `None` for a leaf.
fn split(items: &mut [Item], depth: u32) -> Option<(usize, Aabb, Aabb)> {
    if items.len() <= LEAF {
        return None;
    }
    let centres = Aabb::of(items.iter().map(Item::centre));
    let extent = centres.max - centres.min;
    let axis = extent.max_position();
    let by_bins = (extent[axis] > 0.0 && depth < MAX_SAH_DEPTH)
        .then(|| split_bins(items, axis, centres.min[axis], extent[axis]))
        .flatten();
    Some(by_bins.unwrap_or_else(|| split_middle(items, axis)))
}

fn split_bins(items: &mut [Item], axis: usize, start: f64, extent: f64) -> Option<(usize, Aabb, Aabb)> {
    let scale = BINS as f64 / extent;
    let bin_of = |item: &Item| (((item.centre()[axis] - start) * scale) as usize).min(BINS - 1);
    let mut bins = [(Aabb::EMPTY, 0_usize); BINS];
    for item in items.iter() {
        let bin = &mut bins[bin_of(item)];
        *bin = (bin.0.union(item.bounds), bin.1 + 1);
    }
    let mut right = [(Aabb::EMPTY, 0_usize); BINS];
    let mut sum = (Aabb::EMPTY, 0);
    for i in (1..BINS).rev() {
        sum = (sum.0.union(bins[i].0), sum.1 + bins[i].1);
        right[i] = sum;
    }
    let mut best: Option<(f64, usize, Aabb)> = None;
    let mut left = (Aabb::EMPTY, 0_usize);
    for i in 1..BINS {
        left = (left.0.union(bins[i - 1].0), left.1 + bins[i - 1].1);
        if left.1 == 0 || right[i].1 == 0 {
            continue;
        }
        let cost = left.0.half_area() * left.1 as f64 + right[i].0.half_area() * right[i].1 as f64;
        if best.is_none_or(|(least, ..)| cost < least) {
            best = Some((cost, i, left.0));
        }
    }
    let (_, bin, left) = best?;
    let middle = partition(items, |item| bin_of(item) < bin);
    Some((middle, left, right[bin].0))
}

/// Moves the items that belong to the left before the others; returns how many there are.
fn partition(items: &mut [Item], is_left: impl Fn(&Item) -> bool) -> usize {
    let (mut i, mut j) = (0, items.len());
    while i < j {
        if is_left(&items[i]) {
            i += 1;
        } else {
            j -= 1;
            items.swap(i, j);
        }
    }
    i
}

fn split_middle(items: &mut [Item], axis: usize) -> (usize, Aabb, Aabb) {
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |a, b| {
        a.centre()[axis].total_cmp(&b.centre()[axis]).then(a.index.cmp(&b.index))
    });
    (middle, bounds_of(&items[..middle]), bounds_of(&items[middle..]))
}
