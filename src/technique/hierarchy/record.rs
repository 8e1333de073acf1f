//! Recording the collapses of a workshop as a hierarchy.

use glam::DVec3;

use crate::mesh::edit::collapse::{CollapsePlan, Ring};
use crate::mesh::geometry::triangle_size;
use crate::mesh::halfedge::HalfedgeMesh;
use crate::mesh::hierarchy::{Hierarchy, NodeId};
use crate::mesh::id::{IdVec, Vertex, VertexId};
use crate::mesh::surface::Surface;

/// Watches collapses of the workshop that was entered with the finest surface, and nothing else edits.
#[derive(Clone, Debug)]
pub struct Recorder {
    hierarchy: Hierarchy,
    /// The node that each vertex of the workshop stands for now.
    node: IdVec<Vertex, NodeId>,
    ring: Ring,
}

impl Recorder {
    /// Begins a record. `curvature` has one value a vertex, in 1/length, or is empty.
    pub fn new(finest: Surface, curvature: Vec<f64>) -> Self {
        let node = finest.points.ids().map(|v| NodeId::from_raw(v.raw())).collect();
        let sizes = leaf_sizes(&finest);
        Self { hierarchy: Hierarchy::new(finest, sizes, curvature), node, ring: Ring::new() }
    }

    /// Call before the collapse is applied; `point` is where the merged vertex will lie.
    pub fn collapse(&mut self, mesh: &HalfedgeMesh, plan: &CollapsePlan, point: DVec3) {
        plan.ring(mesh, &mut self.ring);
        let (mut sum, mut count) = (0.0, 0_u32);
        for (_, corners) in plan.new_star(mesh) {
            sum += triangle_size(corners.map(|v| if v == plan.kept { point } else { mesh.point(v) }));
            count += 1;
        }
        let faces = plan.removed_faces(mesh).iter().flatten().count() as u8;
        let ends = [self.node[plan.kept], self.node[plan.removed]];
        let nodes = &self.node;
        let ring = self.ring.iter().map(|&v: &VertexId| nodes[v]);
        let merged = self.hierarchy.record(ends, point, faces, ring, sum / f64::from(count.max(1)));
        self.node[plan.kept] = merged;
    }

    /// The finished record.
    pub fn finish(self) -> Hierarchy {
        self.hierarchy
    }
}

/// Mean longest edge of the faces at each vertex.
fn leaf_sizes(surface: &Surface) -> Vec<f64> {
    let mut sums = vec![(0.0, 0_u32); surface.points.len()];
    for face in surface.faces.ids() {
        let size = triangle_size(surface.corners(face));
        for v in surface.faces[face] {
            let entry = &mut sums[v.index()];
            *entry = (entry.0 + size, entry.1 + 1);
        }
    }
    sums.into_iter().map(|(sum, count)| sum / f64::from(count.max(1))).collect()
}
