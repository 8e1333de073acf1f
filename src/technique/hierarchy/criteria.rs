//! Which nodes to split: by curvature, by region, and with the distribution of density kept.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::front::Front;
use crate::mesh::hierarchy::{Hierarchy, Node, NodeId};
use crate::mesh::id::{IdVec, VertexId};
use crate::watch::{Cancelled, Watch};

/// The element size asked for at each node; infinite where any will do.
pub type Thresholds = IdVec<Node, f64>;

/// Sizes that shrink with curvature: `largest · (1 − min(κ / κ_p, 1))^gamma`, where `κ_p` is the given share of all
/// leaves' curvatures (0.95: the 95th percentile).
///
/// The paper divides by the largest curvature of the mesh; one crease or noise spike then flattens all the rest, which
/// is why a percentile is used here.
pub fn curvature_thresholds(hierarchy: &Hierarchy, largest: f64, share: f64, gamma: f64) -> Thresholds {
    let mut sorted: Vec<f64> = hierarchy.curvature.iter().take(hierarchy.leaf_count()).copied().collect();
    sorted.sort_by(f64::total_cmp);
    let at = ((sorted.len() as f64 - 1.0) * share.clamp(0.0, 1.0)).round() as usize;
    let peak = sorted.get(at).copied().unwrap_or(0.0);
    let size = |kappa: f64| {
        let relative = if peak > 0.0 { (kappa / peak).min(1.0) } else { 0.0 };
        largest * libm::pow(1.0 - relative, gamma)
    };
    hierarchy.curvature.iter().map(|&kappa| size(kappa)).collect()
}

/// The size of the finest wish among a node's leaves: `size(leaf)` is the size wanted there, infinite for none.
///
/// The paper hands a wish down to the nearest child only; with the forest at hand the leaves themselves say what they
/// want, so a region keeps its shape however coarse the front is that it is asked on.
pub fn region_thresholds(hierarchy: &Hierarchy, size: impl Fn(VertexId) -> f64) -> Thresholds {
    let mut wanted: Thresholds = IdVec::filled(f64::INFINITY, hierarchy.node_count());
    for node in hierarchy.nodes() {
        wanted[node] = match hierarchy.merge(node) {
            Some(merge) => wanted[merge.kept].min(wanted[merge.removed]),
            None => size(VertexId::from_raw(node.raw())),
        };
    }
    wanted
}

impl Front<'_> {
    /// Splits, coarsest first, until no node on the front has elements larger than its threshold.
    pub fn refine_to(&mut self, thresholds: &Thresholds, watch: &Watch) -> Result<(), Cancelled> {
        let sizes = &self.hierarchy().element_size;
        let mut queue: BinaryHeap<NodeId> = self.nodes().collect();
        let mut splits = 0_u64;
        while let Some(node) = queue.pop() {
            if !self.contains(node) || sizes[node] <= thresholds[node] {
                continue;
            }
            for split in self.force_split(node) {
                if let Some(merge) = self.hierarchy().merge(split) {
                    queue.extend([merge.kept, merge.removed]);
                }
                splits += 1;
            }
            if splits.is_multiple_of(1024) {
                watch.check()?;
                watch.advance(splits, || format!("{} faces", self.face_count()));
            }
        }
        Ok(())
    }
}

impl Front<'_> {
    /// As [`Front::refine_to`], and on until no face has a side longer than the threshold of any of its corners, but
    /// for sides of the finest mesh.
    ///
    /// A node's recorded size is the mean over its star when it was made; its faces grow when neighbours merge later,
    /// and the longest one counts here. O(finest faces) a round; few rounds.
    pub fn refine_faces_to(&mut self, thresholds: &Thresholds, watch: &Watch) -> Result<(), Cancelled> {
        self.refine_to(thresholds, watch)?;
        loop {
            watch.check()?;
            let mut coarse: Vec<NodeId> =
                self.faces().into_iter().filter_map(|corners| self.coarse_end(corners, thresholds)).collect();
            coarse.sort_unstable();
            coarse.dedup();
            for &node in coarse.iter().rev() {
                self.force_split(node);
            }
            if coarse.is_empty() {
                return Ok(());
            }
        }
    }

    /// Vertices of the finest mesh at whose place here a face has a longer side than wished for there, and the side and
    /// the wish that lie farthest apart. O(nodes + finest faces).
    pub fn coarser(&self, wish: impl Fn(NodeId) -> f64) -> (usize, Option<[f64; 2]>) {
        let (stands, longest) = (self.representatives(), self.longest_sides());
        let (mut count, mut worst) = (0, None);
        for leaf in self.hierarchy().nodes().take(self.hierarchy().leaf_count()) {
            let Some(side) = stands[leaf].map(|node| longest[node]).filter(|&side| side > wish(leaf)) else { continue };
            count += 1;
            let excess = side / wish(leaf);
            if worst.is_none_or(|[side, wish]: [f64; 2]| excess > side / wish) {
                worst = Some([side, wish(leaf)]);
            }
        }
        (count, worst)
    }

    /// The end of a face's longest side that was merged last, where the side is too long for a corner; `None` where it
    /// is not, or neither end can be split.
    fn coarse_end(&self, corners: [NodeId; 3], thresholds: &Thresholds) -> Option<NodeId> {
        let points = corners.map(|node| self.hierarchy().point(node));
        let sides = [(0, 1), (1, 2), (2, 0)].map(|(i, j)| (points[i].distance(points[j]), corners[i].max(corners[j])));
        let wish = corners.into_iter().map(|node| thresholds[node]).fold(f64::INFINITY, f64::min);
        let too_long =
            sides.into_iter().filter(|&(length, end)| length > wish && self.hierarchy().merge(end).is_some());
        too_long.max_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1))).map(|(_, end)| end)
    }
}

/// Moves a front to another face count with the distribution of element sizes kept.
///
/// Every node has a reference size: its own on the starting front, below it that of its ancestor on the front, above it
/// the mean of its children's. Merging the node whose size relative to that is smallest, or splitting the largest,
/// keeps the ratio uniform over the mesh.
#[derive(Clone, Debug)]
pub struct Density {
    ratio: IdVec<Node, f64>,
}

/// Which operations are done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reach {
    /// Those that are legal as the front stands.
    Legal,
    /// All, after whatever they need.
    Forced,
}

/// A ratio as a sortable key; ratios are finite and not negative.
fn key(ratio: f64) -> u64 {
    ratio.to_bits()
}

impl Density {
    /// Remembers the distribution on this front.
    pub fn of(front: &Front<'_>) -> Self {
        let hierarchy = front.hierarchy();
        let sizes = &hierarchy.element_size;
        let stands = front.representatives();
        let mut reference: IdVec<Node, f64> = IdVec::filled(0.0, hierarchy.node_count());
        for node in hierarchy.nodes() {
            reference[node] = match (stands[node], hierarchy.merge(node)) {
                (Some(on_front), _) => sizes[on_front],
                (None, Some(merge)) => 0.5 * (reference[merge.kept] + reference[merge.removed]),
                (None, None) => sizes[node],
            };
        }
        Self::relative_to(hierarchy, &reference)
    }

    /// The distribution that has `leaf_size` at each leaf.
    pub fn like(hierarchy: &Hierarchy, leaf_size: impl Fn(VertexId) -> f64) -> Self {
        let mut reference: IdVec<Node, f64> = IdVec::filled(0.0, hierarchy.node_count());
        for node in hierarchy.nodes() {
            reference[node] = match hierarchy.merge(node) {
                Some(merge) => 0.5 * (reference[merge.kept] + reference[merge.removed]),
                None => leaf_size(VertexId::from_raw(node.raw())),
            };
        }
        Self::relative_to(hierarchy, &reference)
    }

    fn relative_to(hierarchy: &Hierarchy, reference: &IdVec<Node, f64>) -> Self {
        let sizes = &hierarchy.element_size;
        let ratio = |n: NodeId| if reference[n] > 0.0 { sizes[n] / reference[n] } else { 0.0 };
        Self { ratio: hierarchy.nodes().map(ratio).collect() }
    }

    /// Splits or merges until the front has `faces` faces, or one or two less or more; or as near as the forest allows.
    ///
    /// What one operation forces may overshoot far; legal operations the other way then bring the front back.
    pub fn move_to(&self, front: &mut Front<'_>, faces: usize, watch: &Watch) -> Result<(), Cancelled> {
        if front.face_count() < faces {
            self.refine(front, faces, Reach::Forced, watch)?;
            self.coarsen(front, faces, Reach::Legal, watch)
        } else {
            self.coarsen(front, faces, Reach::Forced, watch)?;
            self.refine(front, faces, Reach::Legal, watch)
        }
    }

    fn refine(&self, front: &mut Front<'_>, faces: usize, reach: Reach, watch: &Watch) -> Result<(), Cancelled> {
        // Of equals the latest merge goes first: the later one was made, the less must be split before it.
        let mut queue: BinaryHeap<(u64, NodeId)> = front.nodes().map(|n| (key(self.ratio[n]), n)).collect();
        while front.face_count() < faces {
            let Some((_, node)) = queue.pop() else { break };
            watch.check()?;
            if !front.contains(node) || (reach == Reach::Legal && !front.can_split(node)) {
                continue;
            }
            for split in front.force_split(node) {
                if let Some(merge) = front.hierarchy().merge(split) {
                    queue.extend([merge.kept, merge.removed].map(|n| (key(self.ratio[n]), n)));
                }
            }
        }
        Ok(())
    }

    fn coarsen(&self, front: &mut Front<'_>, faces: usize, reach: Reach, watch: &Watch) -> Result<(), Cancelled> {
        let parents = |front: &Front<'_>, n: NodeId| front.parent(n).map(|p| (Reverse(key(self.ratio[p])), Reverse(p)));
        let mut queue: BinaryHeap<_> = front.nodes().filter_map(|n| parents(front, n)).collect();
        while front.face_count() > faces {
            let Some((_, Reverse(node))) = queue.pop() else { break };
            watch.check()?;
            if front.contains(node) || (reach == Reach::Legal && !front.can_merge(node)) {
                continue;
            }
            for merged in front.force_merge(node) {
                queue.extend(parents(front, merged));
            }
        }
        Ok(())
    }
}
