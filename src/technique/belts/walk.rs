//! Straight walks over a triangle mesh: the faces beyond each side are unfolded into the plane of the one before.

use glam::DVec3;

use crate::mesh::VertexId;
use crate::technique::layout::{Ground, Side};

/// A walk at the moment when it enters a face.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    /// The side of the face just left that the walk crosses.
    pub(super) exit: Side,
    /// Where it crosses.
    pub(super) point: DVec3,
}

/// A straight walk from a vertex.
pub(super) struct Walk<'a> {
    ground: &'a Ground<'a>,
    at: Side,
    point: DVec3,
    direction: DVec3,
    is_first: bool,
}

impl<'a> Walk<'a> {
    /// A walk from `v` along `direction`, which begins in that face at `v` among those `inside` whose corner holds the
    /// direction best.
    pub(super) fn new(
        ground: &'a Ground<'a>,
        v: VertexId,
        direction: DVec3,
        inside: impl Fn(crate::mesh::FaceId) -> bool,
    ) -> Option<Self> {
        let mut best: Option<(f64, Side, DVec3)> = None;
        for &face in ground.faces_at.of(v).iter().filter(|&&f| inside(f)) {
            let corner = ground.corner_of(face, v)?;
            let normal = ground.normal(face);
            let [a, b, c] = [0, 1, 2].map(|k| ground.point(ground.surface.faces[face][(usize::from(corner) + k) % 3]));
            let (left, right) = ((c - a).normalize_or_zero(), (b - a).normalize_or_zero());
            let flat = (direction - normal * normal.dot(direction)).normalize_or_zero();
            // Positive when the direction lies between the two sides; else how far it lies beside.
            let between = normal.dot(right.cross(flat)).min(normal.dot(flat.cross(left)));
            let score = if flat.dot(right + left) > 0.0 { between } else { -2.0 };
            if best.is_none_or(|b| score > b.0) {
                best = Some((score, Side { face, corner }, flat));
            }
        }
        let (_, at, flat) = best.filter(|b| b.2 != DVec3::ZERO)?;
        Some(Self { ground, at, point: ground.point(v), direction: flat, is_first: true })
    }

    /// Where the walk leaves its face.
    pub(super) fn leave(&mut self) -> Step {
        let normal = self.ground.normal(self.at.face);
        let across = normal.cross(self.direction);
        let sides = [1, 2].map(|k| Side { face: self.at.face, corner: (self.at.corner + k) % 3 });
        let first: &[Side] = if self.is_first { &sides[..1] } else { &sides };
        // The corner between both sides left: it lies on the left of the line where the walk leaves on its right.
        let apex = self.ground.point(self.ground.origin(sides[1]));
        let exit = if first.len() == 1 || across.dot(apex - self.point) > 0.0 { sides[0] } else { sides[1] };
        let (a, b) = (self.ground.point(self.ground.origin(exit)), self.ground.point(self.ground.target(exit)));
        let (da, db) = (across.dot(a - self.point), across.dot(b - self.point));
        let share = if da == db { 0.5 } else { (da / (da - db)).clamp(0.001, 0.999) };
        self.point = a + (b - a) * share;
        Step { exit, point: self.point }
    }

    /// Goes on beyond the side just crossed; `None` at the rim.
    pub(super) fn enter(&mut self, step: Step) -> Option<()> {
        let edge = self.ground.point(self.ground.target(step.exit)) - self.ground.point(self.ground.origin(step.exit));
        let edge = edge.normalize_or_zero();
        let next = self.ground.twin(step.exit)?;
        let along = self.direction.dot(edge).clamp(-1.0, 1.0);
        // Into the new face, at a right angle to the edge: the twin runs against it.
        let inward = self.ground.normal(next.face).cross(-edge).normalize_or_zero();
        self.direction = edge * along + inward * (1.0 - along * along).sqrt();
        self.at = next;
        self.is_first = false;
        (self.direction != DVec3::ZERO).then_some(())
    }
}
