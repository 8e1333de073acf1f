//! Opening a guarded mesh: what its tolerance means, what it is held against, and which corners may merge.

use glam::DVec3;

use super::certificate::Envelope;
use super::corners::free_close_corners;
use super::keeper::{Curves, Keeper};
use super::limits::Limits;
use super::mesh::GuardedMesh;
use super::pen::Pen;
use crate::mesh::bvh::TriangleBvh;
use crate::mesh::geometry::Aabb;
use crate::mesh::halfedge::{EnterError, HalfedgeMesh, halfedge_of, twin};
use crate::mesh::{Freedom, ResolvedFreedom, Surface};
use crate::metric::ToleranceMode;

/// What a guarded mesh is opened with.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The meaning of `tolerance`.
    pub mode: ToleranceMode,
    /// In mesh units, or their square in [`ToleranceMode::QuadricSum`].
    pub tolerance: f64,
    /// How far marked curves may move, in mesh units.
    pub feature_tolerance: f64,
    /// The weight of the sharpest lines in the quadrics.
    pub feature_weight: f64,
    /// Thresholds.
    pub limits: Limits,
    /// Whether corners nearer to each other than `feature_tolerance` may become one; not where elements are locked.
    pub may_merge_corners: bool,
}

/// The hierarchy over the reference that a tolerance of this meaning needs: an empty one for the quadrics.
pub fn reference_tree(mode: ToleranceMode, reference: &Surface) -> TriangleBvh {
    match mode {
        ToleranceMode::Distance => TriangleBvh::of_surface(reference),
        ToleranceMode::QuadricSum | ToleranceMode::QuadricRms => TriangleBvh::new(Vec::new()),
    }
}

/// The diagonal of a surface's bounding box.
pub fn diagonal(surface: &Surface) -> f64 {
    Aabb::of(surface.points.iter().copied()).diagonal()
}

/// Opens a guarded mesh on `surface`, held against `reference`; `tree` is [`reference_tree`].
///
/// # Errors
/// A surface that is no oriented 2-manifold.
pub fn open<'a>(
    surface: &Surface,
    freedom: &ResolvedFreedom,
    reference: &'a Surface,
    tree: &'a TriangleBvh,
    setup: Setup,
) -> Result<GuardedMesh<'a>, EnterError> {
    opened(surface, freedom, reference, tree, setup, None)
}

fn opened<'a>(
    surface: &Surface,
    freedom: &ResolvedFreedom,
    reference: &'a Surface,
    tree: &'a TriangleBvh,
    setup: Setup,
    pen: Option<Pen>,
) -> Result<GuardedMesh<'a>, EnterError> {
    let mut mesh = HalfedgeMesh::new(surface, freedom)?;
    if setup.may_merge_corners
        && let Some(loosened) = free_close_corners(&mesh, freedom, setup.feature_tolerance)
    {
        mesh = HalfedgeMesh::new(surface, &loosened)?;
    }
    let keeper = match setup.mode {
        ToleranceMode::QuadricSum => Keeper::QuadricSum { most: setup.tolerance, weight: setup.feature_weight },
        ToleranceMode::QuadricRms => Keeper::QuadricRms { most: setup.tolerance },
        ToleranceMode::Distance => {
            let is_same = surface.faces == reference.faces && surface.points == reference.points;
            let own = (!is_same).then(|| TriangleBvh::of_surface(surface));
            let envelope = Envelope::new(reference, tree, setup.tolerance, &mesh, own.as_ref());
            let curves = Curves::new(curve_segments(surface, &mesh, reference), setup.feature_tolerance);
            Keeper::Distance { envelope: Box::new(envelope), curves }
        }
    };
    Ok(GuardedMesh::new(mesh, keeper, setup.limits, setup.feature_weight, pen))
}

/// Opens a guarded mesh on a part of a larger surface, held against itself, in a pen; `tree` is [`reference_tree`].
///
/// # Errors
/// A part that is no oriented 2-manifold.
pub fn open_part<'a>(
    part: &'a Surface,
    freedom: &ResolvedFreedom,
    tree: &'a TriangleBvh,
    setup: Setup,
    pen: Pen,
) -> Result<GuardedMesh<'a>, EnterError> {
    let reach = setup.feature_tolerance;
    let mut guarded = opened(part, freedom, part, tree, setup, Some(pen))?;
    let GuardedMesh { mesh, pen, keeper, .. } = &mut guarded;
    if let Keeper::Distance { curves, .. } = keeper {
        // Where the part was cut out is no rim.
        let is_fixed = |f| pen.as_ref().is_some_and(|pen| pen.is_fixed(f));
        let is_cut = |e| {
            let h = halfedge_of(e);
            let faces = [mesh.face(h), mesh.face(twin(h))];
            mesh.is_boundary_edge(e) && faces.into_iter().flatten().all(is_fixed)
        };
        let edges = mesh.edges().filter(|&e| mesh.edge_freedom(e) != Freedom::Free && !is_cut(e));
        *curves = Curves::new(edges.map(|e| mesh.ends(e).map(|v| mesh.point(v))).collect(), reach);
    }
    Ok(guarded)
}

/// The curves that marked edges are held against: the reference's own where it has any, and those of the mesh.
fn curve_segments(surface: &Surface, mesh: &HalfedgeMesh, reference: &Surface) -> Vec<[DVec3; 2]> {
    let marked = reference.carried.marks.keys().map(|key| key.map(|v| reference.points[v]));
    if reference.carried.marks.is_empty() {
        let edges = mesh.edges().filter(|&e| mesh.edge_freedom(e) != Freedom::Free);
        return edges.map(|e| mesh.ends(e).map(|v| surface.points[v])).collect();
    }
    // Rims are curves even where nobody marked them.
    let rims = mesh.edges().filter(|&e| mesh.is_boundary_edge(e)).map(|e| mesh.ends(e).map(|v| surface.points[v]));
    marked.chain(rims).collect()
}
