//! Connectivity nearer to the regular one, where the shapes allow it.
//!
//! Faces are close to equilateral where each vertex has as many faces as its total angle holds sixth parts of a turn:
//! 6 inside and on curves of a smooth surface, 3 on a border. Flips towards those valences are what relaxation then
//! turns into better shapes (M. Botsch, L. Kobbelt, SGP 2004); they gain nothing at once, so that they are admitted
//! where no face falls below [`FLOOR`], and must lower the sum of squared deviations, so that they end.

use crate::mesh::edit::check_flip;
use crate::mesh::geometry::angle;
use crate::mesh::halfedge::HalfedgeMesh;
use crate::mesh::id::{IdVec, Vertex};
use crate::mesh::{EdgeId, VertexId};
use crate::technique::guarded::{Gain, GuardedMesh};
use crate::watch::{Cancelled, Watch};

/// No face falls below this stretch by a flip that only lowers valences; relaxation lifts it again.
const FLOOR: f64 = 0.5;

/// Flips edges whose four vertices come nearer to their valences. Returns how many.
pub(super) fn flip_to_regular(guarded: &mut GuardedMesh<'_>, watch: &Watch) -> Result<usize, Cancelled> {
    let ideal = ideal_valences(guarded.mesh());
    let mut flips = 0;
    for e in (0..guarded.mesh().edge_slots()).map(EdgeId::new) {
        if e.index().is_multiple_of(256) {
            watch.check()?;
        }
        if guarded.mesh().edge_is_live(e) && regularises(guarded.mesh(), e, &ideal) {
            flips += usize::from(guarded.flip(e, Gain::Keep(FLOOR)).is_ok());
        }
    }
    Ok(flips)
}

/// Whether the flip lowers the sum of squared deviations from the ideal valences.
fn regularises(mesh: &HalfedgeMesh, e: EdgeId, ideal: &IdVec<Vertex, f32>) -> bool {
    let Ok(plan) = check_flip(mesh, e) else { return false };
    let change = |v: VertexId, step: f32| {
        let off = mesh.valence(v) as f32 - ideal[v];
        (off + step) * (off + step) - off * off
    };
    let [[a, b], [c, d]] = [plan.ends, plan.apexes];
    change(a, -1.0) + change(b, -1.0) + change(c, 1.0) + change(d, 1.0) < -0.5
}

/// The edges that each vertex would have among equilateral faces.
fn ideal_valences(mesh: &HalfedgeMesh) -> IdVec<Vertex, f32> {
    let mut turn: IdVec<Vertex, f32> = IdVec::filled(0.0, mesh.vertex_slots());
    for f in mesh.faces() {
        let corners = mesh.corners(f);
        let points = mesh.corner_points(f);
        for at in 0..3 {
            let [a, b, c] = [points[at], points[(at + 1) % 3], points[(at + 2) % 3]];
            turn[corners[at]] += angle(b - a, c - a) as f32;
        }
    }
    for v in mesh.vertices() {
        let sixths = turn[v] / std::f32::consts::FRAC_PI_3;
        turn[v] = sixths.round().max(1.0) + f32::from(u8::from(mesh.is_boundary_vertex(v)));
    }
    turn
}
