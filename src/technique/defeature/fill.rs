//! Fills of rims: first without new vertices, then as fine and well shaped as the surface round them.

use std::ops::ControlFlow;

use glam::DVec3;

use crate::mesh::bvh::{Primitive, TriangleBvh};
use crate::mesh::geometry::{Aabb, area_vector};
use crate::mesh::predicate::triangle_triangle;
use crate::mesh::{Carried, EdgeKey, FaceId, IdVec, LockRules, Rim, Surface, VertexId, edge_key, resolve_freedom};
use crate::metric::ToleranceMode;
use crate::technique::collapse::{CollapseRules, Goal, Order, Priority};
use crate::technique::guarded::{Limits, Setup, SizeField, StarRules, open};
use crate::technique::refine::{Flips, MaxEdge, refine};
use crate::technique::remesh::coarsen;
use crate::technique::triangulate_loop::Loop;
use crate::watch::{Cancelled, Watch};

/// A fill with a bend beyond this (1 - cosine, so 170 degrees) folds back.
const FOLDED: f64 = 1.985;
/// Edges of a fill are aimed at this many mean edges of its rim, unless the mean size of the mesh is smaller.
const COARSENING: f64 = 1.5;
/// The longest side of a fill's faces, in sizes.
const LONGEST: f64 = 1.6;
/// How far improvement may move a fill that is not flat, in sizes.
const SLACK: f64 = 0.1;
/// A fill is flat if its rim lies this near to a plane, as a share of its extent.
const FLAT: f64 = 1e-9;
/// Faces of one fill at most; what would need more stays coarse.
const MOST_FACES: usize = 100_000;

/// New faces inside a rim.
#[derive(Clone, Debug)]
pub(super) struct Fill {
    /// The rim in the direction of the faces that stay.
    pub(super) rim: Vec<VertexId>,
    /// The face that stays at each edge of the rim.
    pub(super) beside: Vec<FaceId>,
    /// New vertices.
    pub(super) points: Vec<DVec3>,
    /// Corners: numbers of rim vertices, then of new ones.
    pub(super) triangles: Vec<[usize; 3]>,
}

impl Fill {
    fn corner(&self, surface: &Surface, corner: usize) -> DVec3 {
        match corner.checked_sub(self.rim.len()) {
            None => surface.points[self.rim[corner]],
            Some(new) => self.points[new],
        }
    }

    pub(super) fn corners(&self, surface: &Surface) -> Vec<[DVec3; 3]> {
        self.triangles.iter().map(|t| t.map(|corner| self.corner(surface, corner))).collect()
    }

    /// The edges between rim vertices.
    pub(super) fn rim_edges(&self) -> impl Iterator<Item = EdgeKey> + '_ {
        let sides = self.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        sides.filter_map(|[a, b]| Some(edge_key(*self.rim.get(a)?, *self.rim.get(b)?)))
    }

    /// Triangulates a rim with the least bend; `None` where every fill repeats an edge or folds back.
    pub(super) fn coarse(
        surface: &Surface,
        rim: Vec<VertexId>,
        beside: Vec<FaceId>,
        is_taken: &dyn Fn(EdgeKey) -> bool,
    ) -> Option<Self> {
        let points: Vec<DVec3> = rim.iter().map(|&v| surface.points[v]).collect();
        let normal = |&f: &FaceId| {
            let [a, b, c] = surface.corners(f);
            (b - a).cross(c - a).normalize_or_zero()
        };
        let normals: Vec<DVec3> = beside.iter().map(normal).collect();
        let is_free = |i: usize, k: usize| !is_taken(edge_key(rim[i], rim[k]));
        if points.len() < 3 {
            return None;
        }
        let found = Loop { points: &points, normals: &normals, is_free: &is_free }.triangulate()?;
        (found.bend <= FOLDED).then_some(Self { rim, beside, points: Vec::new(), triangles: found.triangles })
    }

    /// The same fill as fine as its surroundings and well shaped; `None` where that cannot be had.
    ///
    /// Works on the fill alone with its rim kept, so nothing else can change.
    pub(super) fn improved(&self, surface: &Surface, mean_size: f64, watch: &Watch) -> Result<Option<Self>, Cancelled> {
        let points: IdVec<_, DVec3> = self.rim.iter().map(|&v| surface.points[v]).collect();
        let around: f64 = (0..self.rim.len())
            .map(|i| points[VertexId::new(i)].distance(points[VertexId::new((i + 1) % self.rim.len())]))
            .sum();
        let size = mean_size.min(COARSENING * around / self.rim.len() as f64);
        let faces = self.triangles.iter().map(|t| t.map(VertexId::new)).collect();
        let membrane = Surface { points, faces, carried: Carried::default() };
        let locks = LockRules { rim: Rim::Exact, ..LockRules::default() };
        let limit = MaxEdge::Uniform(size);
        let Ok((fine, _)) = refine(&membrane, &limit, MOST_FACES, Flips::None, &locks, &Watch::silent()) else {
            return Ok(None);
        };
        watch.check()?;
        let Ok(freedom) = resolve_freedom(&fine, &locks) else { return Ok(None) };
        let tree = TriangleBvh::of_surface(&membrane);
        // In a plane nothing can leave the membrane, and quadrics are cheaper than certified distances.
        let mode = if is_flat(&membrane) { ToleranceMode::QuadricRms } else { ToleranceMode::Distance };
        let setup = Setup {
            mode,
            tolerance: SLACK * size,
            feature_tolerance: SLACK * size,
            feature_weight: 100.0,
            limits: Limits { min_stretch: 0.2, max_size: SizeField::Uniform(LONGEST * size), max_valence: 12 },
            may_merge_corners: false,
        };
        let Ok(mut guarded) = open(&fine, &freedom, &membrane, &tree, setup) else { return Ok(None) };
        let rules = CollapseRules {
            star: StarRules { min_stretch: 0.2, ..StarRules::default() },
            order: Order::OnSurface,
            priority: Priority::QualityGain,
        };
        coarsen(&mut guarded, &rules, Goal::default(), &Watch::silent())?;
        let left = guarded.into_mesh().leave();
        Ok(self.stitched(&left))
    }

    /// The fill out of a workshop, with its rim's own numbers.
    fn stitched(&self, left: &crate::mesh::halfedge::Left) -> Option<Self> {
        let count = self.rim.len();
        let mut corner = IdVec::filled(usize::MAX, left.surface.points.len());
        for i in 0..count {
            corner[left.vertices.get(VertexId::new(i))?] = i;
        }
        let mut points = Vec::new();
        for v in left.surface.points.ids() {
            if corner[v] == usize::MAX {
                corner[v] = count + points.len();
                points.push(left.surface.points[v]);
            }
        }
        let triangles = left.surface.faces.iter().map(|t| t.map(|v| corner[v])).collect();
        Some(Self { points, triangles, rim: self.rim.clone(), beside: self.beside.clone() })
    }

    /// Whether the fill meets itself, a face that stays or another fill elsewhere than along its rim.
    pub(super) fn meets(
        &self,
        surface: &Surface,
        tree: &TriangleBvh,
        stays: impl Fn(FaceId) -> bool,
        others: &[[DVec3; 3]],
    ) -> bool {
        let corners = self.corners(surface);
        let own = TriangleBvh::new(corners.clone());
        let stop_at = |meets: bool| if meets { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let hit = |mine: [DVec3; 3], other: [DVec3; 3]| triangle_triangle(mine, other).is_intersection();
        own.for_each_self_pair(|i, j| stop_at(hit(corners[i as usize], corners[j as usize]))).is_break()
            || corners.iter().any(|&mine| {
                let visit = |i: u32, other: &[DVec3; 3]| stop_at(stays(FaceId::from_raw(i)) && hit(mine, *other));
                tree.for_each_in(&mine.bounds(), visit).is_break()
            })
            || others
                .iter()
                .any(|&other| own.for_each_in(&other.bounds(), |_, mine| stop_at(hit(*mine, other))).is_break())
    }
}

/// Whether all points lie in the plane of the widest triangle.
fn is_flat(membrane: &Surface) -> bool {
    let normals = membrane.faces.ids().map(|f| area_vector(membrane.corners(f)));
    let widest = normals.fold(DVec3::ZERO, |a, b| if b.length_squared() > a.length_squared() { b } else { a });
    let normal = widest.normalize_or_zero();
    let heights = || membrane.points.iter().map(|p| (*p - membrane.points[VertexId::from_raw(0)]).dot(normal));
    let (low, high) = heights().fold((0.0_f64, 0.0_f64), |(low, high), h| (low.min(h), high.max(h)));
    high - low <= FLAT * Aabb::of(membrane.points.iter().copied()).diagonal()
}
