//! The surface that is meshed anew: the way back onto it, its curves, and how long edges may be on each of its faces.

use glam::DVec3;

use super::Rules;
use crate::mesh::bvh::TriangleBvh;
use crate::mesh::geometry::{area_vector, closest_on_triangle};
use crate::mesh::halfedge::HalfedgeMesh;
use crate::mesh::id::Face;
use crate::mesh::{FaceId, Freedom, IdVec, Soup, Surface};
use crate::metric::distance::Target;
use crate::technique::guarded::Curves;
use crate::technique::sizing::curvature::{Chord, longest_edges};

/// A point of the reference.
#[derive(Clone, Copy, Debug)]
pub(super) struct Foot {
    pub(super) point: DVec3,
    pub(super) face: FaceId,
    pub(super) distance_squared: f64,
}

/// The reference.
pub(super) struct Reference<'a> {
    surface: &'a Surface,
    tree: &'a TriangleBvh,
    normals: IdVec<Face, DVec3>,
    /// The longest edge that curvature and wishes allow, by face.
    pub(super) longest: IdVec<Face, f64>,
    pub(super) curves: Curves,
    /// The same surface as certificates see it.
    pub(super) soup: Soup,
    pub(super) target: Target,
}

impl<'a> Reference<'a> {
    /// Prepares the surface that `mesh` was made of, for edges that turn by no more than so many radians.
    pub(super) fn new(
        surface: &'a Surface,
        tree: &'a TriangleBvh,
        mesh: &HalfedgeMesh,
        rules: &Rules,
        turn: f64,
    ) -> Self {
        let soup = surface.to_soup();
        let is_curve = |e| mesh.edge_freedom(e) != Freedom::Free || mesh.is_boundary_edge(e);
        let segments = mesh.edges().filter(|&e| is_curve(e)).map(|e| mesh.ends(e).map(|v| mesh.point(v)));
        let chord = Chord { sagitta: SAGITTA * rules.tolerance, most: rules.size.most(), turn };
        let mut longest = longest_edges(mesh, chord);
        for f in surface.faces.ids() {
            longest[f] = longest[f].min(rules.size.at(f));
        }
        Self {
            surface,
            tree,
            normals: surface.faces.ids().map(|f| area_vector(surface.corners(f)).normalize_or_zero()).collect(),
            longest,
            curves: Curves::new(segments.collect(), rules.curve_tolerance),
            target: Target::of(&soup),
            soup,
        }
    }

    /// The point nearest to `p`, found faster where `hint` is near.
    pub(super) fn project(&self, p: DVec3, hint: FaceId) -> Foot {
        let near = closest_on_triangle(p, self.surface.corners(hint));
        match self.tree.closest_within(p, near.distance_squared) {
            Some(found) => Foot {
                point: found.nearest.point,
                face: found.face(),
                distance_squared: found.nearest.distance_squared,
            },
            None => Foot { point: near.point, face: hint, distance_squared: near.distance_squared },
        }
    }

    /// Whether `p` lies within a distance, whose square is given; found faster where `hint` is near.
    pub(super) fn is_within(&self, p: DVec3, hint: FaceId, squared: f64) -> bool {
        closest_on_triangle(p, self.surface.corners(hint)).distance_squared <= squared
            || self.tree.near(p, squared, squared).is_some()
    }

    /// The unit normal of a face; zero where it has none.
    pub(super) fn normal(&self, face: FaceId) -> DVec3 {
        self.normals[face]
    }
}

/// The part of the tolerance that chords of the size chosen beforehand lie off their arcs: triangles stray further than
/// their sides, and edges are up to a third longer than the size.
const SAGITTA: f64 = 0.5;
