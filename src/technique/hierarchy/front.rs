//! A front in the vertex forest and the operations that move it.

use crate::mesh::geometry::triangle_size;
use crate::mesh::hierarchy::{Hierarchy, Node, NodeId};
use crate::mesh::id::{FaceId, IdVec};

/// Where a node stands relative to the front.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// Finer than the front: an ancestor is on it.
    Below,
    /// On the front: a vertex of the mesh.
    On,
    /// Coarser than the front: it has been split.
    Above,
}

/// A set of nodes that is a mesh, see the module's head. O(1) a legal operation; forced ones pay for what they force.
#[derive(Clone, Debug)]
pub struct Front<'a> {
    hierarchy: &'a Hierarchy,
    parents: IdVec<Node, Option<NodeId>>,
    place: IdVec<Node, Place>,
    faces: usize,
}

impl<'a> Front<'a> {
    /// The front of all leaves: the finest mesh.
    pub fn finest(hierarchy: &'a Hierarchy) -> Self {
        let mut place = IdVec::filled(Place::Above, hierarchy.node_count());
        for node in hierarchy.nodes().take(hierarchy.leaf_count()) {
            place[node] = Place::On;
        }
        Self { hierarchy, parents: hierarchy.parents(), place, faces: hierarchy.finest.faces.len() }
    }

    /// The front after the first merges, as many as keep at least `faces` faces.
    pub fn with_faces(hierarchy: &'a Hierarchy, faces: usize) -> Self {
        let mut front = Self::finest(hierarchy);
        for (index, merge) in hierarchy.merges.iter().enumerate() {
            if front.faces < faces + usize::from(merge.faces) {
                break;
            }
            front.apply_merge(NodeId::new(hierarchy.leaf_count() + index));
        }
        front
    }

    /// The front with about `faces` faces, or the coarsest one.
    pub fn base(hierarchy: &'a Hierarchy, faces: Option<usize>) -> Self {
        faces.map_or_else(|| Self::coarsest(hierarchy), |faces| Self::with_faces(hierarchy, faces))
    }

    /// The front of all roots: the coarsest mesh.
    pub fn coarsest(hierarchy: &'a Hierarchy) -> Self {
        Self::with_faces(hierarchy, 0)
    }

    /// The forest this front is in.
    pub fn hierarchy(&self) -> &'a Hierarchy {
        self.hierarchy
    }

    /// Faces of the mesh.
    pub fn face_count(&self) -> usize {
        self.faces
    }

    /// Whether the node is a vertex of the mesh.
    pub fn contains(&self, node: NodeId) -> bool {
        self.place[node] == Place::On
    }

    /// The nodes of the front in order.
    pub fn nodes(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.place.enumerate().filter(|(_, place)| **place == Place::On).map(|(node, _)| node)
    }

    /// The parent of a node.
    pub fn parent(&self, node: NodeId) -> Option<NodeId> {
        self.parents[node]
    }

    /// The node of the front that stands for each node on it or below it; `None` above it.
    pub fn representatives(&self) -> IdVec<Node, Option<NodeId>> {
        let mut stands: IdVec<Node, Option<NodeId>> = IdVec::filled(None, self.place.len());
        for node in self.hierarchy.nodes().rev() {
            stands[node] = match self.place[node] {
                Place::On => Some(node),
                Place::Above => None,
                Place::Below => self.parents[node].and_then(|parent| stands[parent]),
            };
        }
        stands
    }

    /// The faces of the mesh by their corners, in the order of the finest mesh. O(nodes + finest faces).
    pub fn faces(&self) -> Vec<[NodeId; 3]> {
        let stands = self.representatives();
        self.faces_by(&stands).map(|(_, corners)| corners).collect()
    }

    /// The faces of the finest mesh that are faces of this one, with their corners there. `stands` are the front's
    /// [`Front::representatives`].
    pub(super) fn faces_by<'s>(
        &'s self,
        stands: &'s IdVec<Node, Option<NodeId>>,
    ) -> impl Iterator<Item = (FaceId, [NodeId; 3])> + 's {
        let finest = self.hierarchy.finest.faces.enumerate();
        finest.filter_map(|(old, face)| match face.map(|v| stands[NodeId::from_raw(v.raw())]) {
            [Some(a), Some(b), Some(c)] if a != b && b != c && c != a => Some((old, [a, b, c])),
            _ => None,
        })
    }

    /// The longest side of the faces at each node of the front; 0 at the others. O(nodes + finest faces).
    pub fn longest_sides(&self) -> IdVec<Node, f64> {
        let mut longest = IdVec::filled(0.0, self.place.len());
        for corners in self.faces() {
            let size = triangle_size(corners.map(|node| self.hierarchy.point(node)));
            for node in corners {
                longest[node] = size.max(longest[node]);
            }
        }
        longest
    }

    /// Whether the node may be split as it is.
    pub fn can_split(&self, node: NodeId) -> bool {
        self.contains(node)
            && self.hierarchy.merge(node).is_some()
            && self.hierarchy.ring(node).iter().all(|&r| self.contains(r))
    }

    /// Whether the children of the node may be merged as they are.
    pub fn can_merge(&self, node: NodeId) -> bool {
        self.place[node] == Place::Above
            && self.hierarchy.merge(node).is_some_and(|m| self.contains(m.kept) && self.contains(m.removed))
            && self.hierarchy.ring(node).iter().all(|&r| self.contains(r))
    }

    /// Splits the node if that is legal; says whether it did.
    pub fn split(&mut self, node: NodeId) -> bool {
        let is_legal = self.can_split(node);
        if is_legal {
            self.apply_split(node);
        }
        is_legal
    }

    /// Merges the children of the node if that is legal; says whether it did.
    pub fn merge(&mut self, node: NodeId) -> bool {
        let is_legal = self.can_merge(node);
        if is_legal {
            self.apply_merge(node);
        }
        is_legal
    }

    /// Splits the node after whatever must be split first. Returns every node split, in order; empty for a leaf or a
    /// node that is split already.
    pub fn force_split(&mut self, node: NodeId) -> Vec<NodeId> {
        let mut done = Vec::new();
        let mut stack = vec![node];
        while let Some(&top) = stack.last() {
            if self.place[top] == Place::Above || self.hierarchy.merge(top).is_none() {
                stack.pop();
            } else if let Some(first) = self.split_before(top) {
                stack.push(first);
            } else {
                self.apply_split(top);
                done.push(top);
                stack.pop();
            }
        }
        done
    }

    /// Merges the children of the node after whatever must be merged first. Returns every node made, in order; empty
    /// when the node is on the front or below it.
    pub fn force_merge(&mut self, node: NodeId) -> Vec<NodeId> {
        let mut done = Vec::new();
        let mut stack = vec![node];
        while let Some(&top) = stack.last() {
            if self.place[top] != Place::Above {
                stack.pop();
            } else if let Some(first) = self.merge_before(top) {
                stack.push(first);
            } else {
                self.apply_merge(top);
                done.push(top);
                stack.pop();
            }
        }
        done
    }

    /// A node that must be split before `node` can be: the one standing for it, or for a missing ring node.
    fn split_before(&self, node: NodeId) -> Option<NodeId> {
        std::iter::once(node)
            .chain(self.hierarchy.ring(node).iter().copied())
            .find(|&n| self.place[n] == Place::Below)
            .map(|n| self.standing_for(n))
    }

    /// A node whose children must be merged before those of `node` can be.
    fn merge_before(&self, node: NodeId) -> Option<NodeId> {
        let merge = self.hierarchy.merge(node)?;
        [merge.kept, merge.removed]
            .into_iter()
            .chain(self.hierarchy.ring(node).iter().copied())
            .find(|&n| self.place[n] == Place::Above)
    }

    fn standing_for(&self, mut node: NodeId) -> NodeId {
        while self.place[node] == Place::Below {
            match self.parents[node] {
                Some(parent) => node = parent,
                None => break,
            }
        }
        node
    }

    fn apply_split(&mut self, node: NodeId) {
        if let Some(merge) = self.hierarchy.merge(node) {
            self.place[node] = Place::Above;
            self.place[merge.kept] = Place::On;
            self.place[merge.removed] = Place::On;
            self.faces += usize::from(merge.faces);
        }
    }

    fn apply_merge(&mut self, node: NodeId) {
        if let Some(merge) = self.hierarchy.merge(node) {
            self.place[node] = Place::On;
            self.place[merge.kept] = Place::Below;
            self.place[merge.removed] = Place::Below;
            self.faces -= usize::from(merge.faces);
        }
    }
}
