//! Passes over all edges or all vertices: long edges halved, edges flipped, vertices moved.
//!
//! What was refused is remembered with the age of its surroundings, and not tried again before they have changed: late
//! passes cost what still changes, not what is there.

use glam::DVec3;

use crate::mesh::geometry::area_vector;
use crate::mesh::halfedge::{HalfedgeMesh, halfedge_of, twin};
use crate::mesh::{EdgeId, Freedom, VertexId};
use crate::technique::guarded::{Gain, GuardedMesh};
use crate::watch::{Cancelled, Watch};

/// What was refused, each with one gain in mind.
#[derive(Debug, Default)]
pub struct Refusals {
    flips: Ages,
    moves: Ages,
}

/// The age at which the edit of each slot was refused, plus 1; 0 where it was not.
#[derive(Debug, Default)]
struct Ages(Vec<u32>);

impl Ages {
    fn knows(&self, slot: usize, age: u32) -> bool {
        self.0.get(slot).is_some_and(|&known| known == age.wrapping_add(1))
    }

    fn note(&mut self, slot: usize, age: u32) {
        if slot >= self.0.len() {
            self.0.resize(slot + 1, 0);
        }
        self.0[slot] = age.wrapping_add(1);
    }
}

/// Halves edges above the size limit, longest first.
pub(super) fn split_long_edges(guarded: &mut GuardedMesh<'_>, watch: &Watch) -> Result<(), Cancelled> {
    if guarded.limits().max_size.is_unlimited() {
        return Ok(());
    }
    let mesh = guarded.mesh();
    let mut long: Vec<(f64, EdgeId)> = Vec::new();
    for e in mesh.edges() {
        let [a, b] = mesh.ends(e).map(|v| mesh.point(v));
        let length = (b - a).length();
        if length > guarded.limits().max_size.at(0.5 * (a + b)) {
            long.push((length, e));
        }
    }
    long.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
    for (place, (_, e)) in long.into_iter().enumerate() {
        if place.is_multiple_of(64) {
            watch.check()?;
        }
        let [a, b] = guarded.mesh().ends(e).map(|v| guarded.mesh().point(v));
        // Refused ones are told by the recount.
        let _ = guarded.split(e, 0.5 * (a + b));
    }
    Ok(())
}

/// Flips every edge that gains, past those refused before. Returns how many.
pub fn flip_edges(guarded: &mut GuardedMesh<'_>, refusals: &mut Refusals, watch: &Watch) -> Result<usize, Cancelled> {
    let mut flips = 0;
    for e in (0..guarded.mesh().edge_slots()).map(EdgeId::new) {
        if e.index().is_multiple_of(256) {
            watch.check()?;
        }
        if !guarded.mesh().edge_is_live(e) || refusals.flips.knows(e.index(), edge_age(guarded, e)) {
            continue;
        }
        if guarded.flip(e, Gain::LeastStretch).is_ok() {
            flips += 1;
        } else {
            refusals.flips.note(e.index(), edge_age(guarded, e));
        }
    }
    Ok(flips)
}

/// Changes when a face at an edge, or the valence of one of their corners, changes.
fn edge_age(guarded: &GuardedMesh<'_>, e: EdgeId) -> u32 {
    let mesh = guarded.mesh();
    let h = halfedge_of(e);
    let corners = [Some(mesh.origin(h)), Some(mesh.target(h)), mesh.apex(h), mesh.apex(twin(h))];
    corners.into_iter().flatten().fold(0, |age, v| age.wrapping_add(mesh.version(v)))
}

/// Moves every vertex that gains, past those refused before. Returns how many.
pub fn relax_vertices(
    guarded: &mut GuardedMesh<'_>,
    refusals: &mut Refusals,
    watch: &Watch,
    relax: impl Fn(&mut GuardedMesh<'_>, VertexId) -> bool,
) -> Result<usize, Cancelled> {
    let mut moves = 0;
    for v in (0..guarded.mesh().vertex_slots()).map(VertexId::new) {
        if v.index().is_multiple_of(256) {
            watch.check()?;
        }
        if !guarded.mesh().vertex_is_live(v) || refusals.moves.knows(v.index(), guarded.mesh().version(v)) {
            continue;
        }
        if relax(guarded, v) {
            moves += 1;
        } else {
            refusals.moves.note(v.index(), guarded.mesh().version(v));
        }
    }
    Ok(moves)
}

/// Relaxation of a vertex: a free one tangentially, one on a curve along it.
pub(super) fn relax(guarded: &mut GuardedMesh<'_>, v: VertexId, gain: Gain) -> bool {
    match guarded.mesh().vertex_freedom(v) {
        Freedom::Free => relax_tangentially(guarded, v, gain),
        Freedom::OnCurve => relax_along_curve(guarded, v, gain),
        Freedom::Keep => false,
    }
}

/// The way of a vertex to the area-weighted centroid of its star within the star's tangent plane, and the unit normal
/// of that; `None` where the star has no area.
pub fn towards_centroid(mesh: &HalfedgeMesh, v: VertexId) -> Option<(DVec3, DVec3)> {
    let at = mesh.point(v);
    let (mut centre, mut normal, mut weight) = (DVec3::ZERO, DVec3::ZERO, 0.0);
    for f in mesh.faces_around(v) {
        let corners = mesh.corner_points(f);
        let vector = area_vector(corners);
        let area = vector.length();
        centre += area * ((corners[0] - at) + (corners[1] - at) + (corners[2] - at)) / 3.0;
        normal += vector;
        weight += area;
    }
    let normal = normal.try_normalize().filter(|_| weight > 0.0)?;
    let step = centre / weight;
    Some((step - normal * normal.dot(step), normal))
}

/// Towards the area-weighted centroid of the star, back onto the reference.
fn relax_tangentially(guarded: &mut GuardedMesh<'_>, v: VertexId, gain: Gain) -> bool {
    let at = guarded.mesh().point(v);
    let Some((tangential, _)) = towards_centroid(guarded.mesh(), v) else { return false };
    for share in [1.0, 0.4] {
        let wish = at + share * tangential;
        let to = guarded.project(wish).unwrap_or(wish);
        if guarded.relocate(v, to, gain).is_ok() {
            return true;
        }
    }
    false
}

/// Towards the middle between the neighbours on the curve, back onto the reference's curve.
fn relax_along_curve(guarded: &mut GuardedMesh<'_>, v: VertexId, gain: Gain) -> bool {
    let Some([a, b]) = guarded.curve_neighbours(v) else { return false };
    let mesh = guarded.mesh();
    let (at, middle) = (mesh.point(v), 0.5 * (mesh.point(a) + mesh.point(b)));
    for share in [1.0, 0.5, 0.2] {
        let Some(to) = guarded.project_to_curve(at + share * (middle - at)) else { return false };
        if guarded.relocate(v, to, gain).is_ok() {
            return true;
        }
    }
    false
}
