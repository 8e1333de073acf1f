//! What is inside of a mesh's bodies.

use glam::DVec3;

use crate::mesh::bvh::{Ray, TriangleBvh};
use crate::mesh::topology::{EdgeTable, components};
use crate::mesh::{FaceId, Facet, Soup};

/// The closed components of a mesh.
#[derive(Clone, Debug)]
pub struct Inside {
    triangles: Vec<[DVec3; 3]>,
    tree: TriangleBvh,
}

/// Directions along no edge that people draw; what most of them say counts.
const DIRECTIONS: [DVec3; 3] = [
    DVec3::new(0.532_1, 0.271_3, 0.801_7),
    DVec3::new(-0.713_9, 0.482_6, 0.507_4),
    DVec3::new(0.118_7, -0.861_2, -0.494_3),
];

impl Inside {
    /// Of the components whose edges all have two faces; O(n log n).
    pub fn of(mesh: &Soup) -> Self {
        let parts = components(mesh);
        let mut is_closed = vec![true; parts.count];
        for (_, _, sides) in EdgeTable::new(mesh).iter().filter(|(.., sides)| sides.len() != 2) {
            for side in sides {
                is_closed[parts.of_face[side.face] as usize] = false;
            }
        }
        let closed = |(f, _): &(FaceId, &Facet)| is_closed[parts.of_face[*f] as usize];
        let triangles = mesh.faces.enumerate().filter(closed).flat_map(|(_, facet)| {
            let corners: Vec<DVec3> = facet.corners().iter().map(|&v| mesh.points[v]).collect();
            (1..corners.len() - 1).map(|i| [corners[0], corners[i], corners[i + 1]]).collect::<Vec<_>>()
        });
        Self::over(triangles.collect())
    }

    fn over(triangles: Vec<[DVec3; 3]>) -> Self {
        Self { tree: TriangleBvh::new(triangles.clone()), triangles }
    }

    /// The same about another origin.
    pub(super) fn moved(&self, origin: DVec3) -> Self {
        Self::over(self.triangles.iter().map(|t| t.map(|p| p - origin)).collect())
    }

    /// Whether a point, which is not on the surface, is inside of a body and not in a cavity of it: rays leave bodies
    /// once more often than they enter them.
    pub(super) fn holds(&self, point: DVec3) -> bool {
        if !self.tree.bounds().contains(point) {
            return false;
        }
        let leaves = |direction: &DVec3| {
            let hits = self.tree.all_hits(&Ray { origin: point, direction: *direction });
            hits.iter().map(|hit| if hit.front { -1 } else { 1 }).sum::<i32>() >= 1
        };
        DIRECTIONS.iter().filter(|direction| leaves(direction)).count() >= 2
    }
}
