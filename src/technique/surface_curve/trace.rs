//! Draws an edge of an intrinsic triangulation on the surface: a straight line from vertex to vertex across faces.
//!
//! Faces are unfolded into the plane of the first one along the direction in which the edge leaves its origin, until
//! the far end comes up at the edge's length. The crossings are then those of the line to that very point, so that
//! rounding of the direction does not show in them.

use glam::DVec2;

use super::intrinsic::first_to_last;
use super::network::Place;
use crate::mesh::halfedge::{edge_of, halfedge_of, twin};
use crate::mesh::{HalfedgeId, HalfedgeMesh, VertexId};

/// How far the far end may lie from where direction and length put it, in lengths of the edge.
const SLACK: f64 = 1e-5;
/// A line that crosses more faces is given up.
const MOST_FACES: usize = 100_000;
/// Crossings keep this share of an edge from its ends.
const END_MARGIN: f64 = 1e-6;

/// An edge crossed: its right and left end in the plane.
struct Gate {
    halfedge: HalfedgeId,
    right: DVec2,
    left: DVec2,
}

/// The places between the ends of the line from `from` in this direction to `to`; `None` where it does not arrive.
pub(super) fn trace(
    mesh: &HalfedgeMesh,
    from: VertexId,
    direction: f64,
    length: f64,
    to: VertexId,
) -> Option<Vec<Place>> {
    let (mut gate, is_edge) = first_gate(mesh, from, direction, length, to)?;
    if is_edge {
        return Some(Vec::new());
    }
    let mut gates: Vec<Gate> = Vec::new();
    let goal = DVec2::new(length, 0.0);
    for _ in 0..MOST_FACES {
        let back = twin(gate.halfedge);
        mesh.face(back)?;
        let (along, beside) = (mesh.next(back), mesh.prev(back));
        let apex = unfolded(mesh, &gate, back);
        let vertex = mesh.target(along);
        let (right, left) = (gate.right, gate.left);
        gates.push(gate);
        if vertex == to && apex.distance(goal) <= SLACK * length {
            return Some(crossings(mesh, &gates, apex));
        }
        if right.x.min(left.x) > (1.0 + SLACK) * length {
            return None;
        }
        gate = if apex.y > 0.0 {
            Gate { halfedge: along, right, left: apex }
        } else {
            Gate { halfedge: beside, right: apex, left }
        };
    }
    None
}

/// The side opposite `from` in the face that the line enters, or whether the line is an edge of the surface.
fn first_gate(mesh: &HalfedgeMesh, from: VertexId, direction: f64, length: f64, to: VertexId) -> Option<(Gate, bool)> {
    let ring = first_to_last(mesh, from);
    let at = |h: HalfedgeId| mesh.point(mesh.target(h)) - mesh.point(from);
    let mut angle = 0.0;
    let mut best = None;
    for &h in &ring {
        let reach = at(h).length();
        let off = (direction - angle).abs();
        if mesh.target(h) == to && off < 1e-6 && (reach - length).abs() <= SLACK * length {
            let gate = Gate { halfedge: h, right: DVec2::ZERO, left: DVec2::ZERO };
            return Some((gate, true));
        }
        if mesh.face(h).is_none() {
            break;
        }
        let beyond = mesh.prev(h);
        let sector = crate::mesh::geometry::angle(at(h), at(twin(beyond)));
        if direction >= angle - 1e-9 {
            let polar = |radius: f64, angle: f64| radius * DVec2::new(libm::cos(angle), libm::sin(angle));
            let right = polar(reach, angle - direction);
            let left = polar(at(twin(beyond)).length(), angle + sector - direction);
            best = Some(Gate { halfedge: mesh.next(h), right, left });
        }
        angle += sector;
    }
    best.map(|gate| (gate, false))
}

/// Where the corner beyond a gate comes to lie.
fn unfolded(mesh: &HalfedgeMesh, gate: &Gate, back: HalfedgeId) -> DVec2 {
    let [right, left] = [mesh.target(back), mesh.origin(back)].map(|v| mesh.point(v));
    let apex = mesh.point(mesh.target(mesh.next(back)));
    let side = left - right;
    let base = side.length();
    let x = (apex - right).dot(side) / base;
    let y = (apex - right - x * side / base).length();
    let axis = (gate.left - gate.right) / base;
    gate.right + x * axis + y * DVec2::new(axis.y, -axis.x)
}

fn crossings(mesh: &HalfedgeMesh, gates: &[Gate], end: DVec2) -> Vec<Place> {
    let place = |gate: &Gate| {
        let (right, left) = (end.perp_dot(gate.right).abs(), end.perp_dot(gate.left).abs());
        let share = (right / (right + left)).clamp(END_MARGIN, 1.0 - END_MARGIN);
        let e = edge_of(gate.halfedge);
        debug_assert!(mesh.edge_is_live(e));
        Place::Edge(e, if gate.halfedge == halfedge_of(e) { share } else { 1.0 - share })
    };
    gates.iter().map(place).collect()
}
