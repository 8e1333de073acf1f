//! A parallel view from above the corner, z upwards, that shows all of a mesh.

use glam::DVec3;

/// The part of the canvas that stays free at each side.
const MARGIN: f64 = 0.04;

/// A parallel projection.
#[derive(Clone, Copy, Debug)]
pub(super) struct Camera {
    /// Unit vectors to the right, upwards and towards the eye.
    axes: [DVec3; 3],
    centre: DVec3,
    scale: f64,
    middle: [f64; 2],
}

impl Camera {
    /// The view of these points on a canvas of this size.
    pub(super) fn isometric(points: impl Iterator<Item = DVec3> + Clone, [width, height]: [f64; 2]) -> Self {
        let eye = DVec3::new(0.55, -0.7, 0.46).normalize();
        let right = DVec3::Z.cross(eye).normalize();
        let axes = [right, eye.cross(right), eye];
        // About the first point, so that coordinates far away cost no digits.
        let first = points.clone().next().unwrap_or_default();
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in points {
            let at = turned(axes, p - first);
            (low, high) = (low.min(at), high.max(at));
        }
        if low.x > high.x {
            (low, high) = (DVec3::ZERO, DVec3::ZERO);
        }
        let size = high - low;
        let fit =
            |room: f64, extent: f64| if extent > 0.0 { room * (1.0 - 2.0 * MARGIN) / extent } else { f64::INFINITY };
        let scale = fit(width, size.x).min(fit(height, size.y));
        let scale = if scale.is_finite() { scale } else { 1.0 };
        let middle = 0.5 * (low + high);
        let centre = first + axes[0] * middle.x + axes[1] * middle.y + axes[2] * middle.z;
        Self { axes, centre, scale, middle: [0.5 * width, 0.5 * height] }
    }

    /// A point on the canvas: right, downwards, and depth that grows towards the eye, all in pixels.
    pub(super) fn project(&self, p: DVec3) -> DVec3 {
        let at = self.scale * turned(self.axes, p - self.centre);
        DVec3::new(self.middle[0] + at.x, self.middle[1] - at.y, at.z)
    }

    /// A direction in the axes of the view.
    pub(super) fn turn(&self, direction: DVec3) -> DVec3 {
        turned(self.axes, direction)
    }
}

fn turned(axes: [DVec3; 3], v: DVec3) -> DVec3 {
    DVec3::new(axes[0].dot(v), axes[1].dot(v), axes[2].dot(v))
}
