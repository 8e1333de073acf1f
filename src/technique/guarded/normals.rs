//! When a face has turned too far in one edit, and which faces have a normal to be held against.

use glam::DVec3;

/// Faces may turn by at most 45 degrees in one edit.
pub(super) const LEAST_TURN_COSINE: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// A face below this stretch has no normal that other faces should be held against.
pub(super) const HAS_NORMAL: f64 = 0.05;

/// Whether one normal turns little against another; they need no length.
pub(super) fn agree(m: DVec3, n: DVec3) -> bool {
    let scale = (m.length_squared() * n.length_squared()).sqrt();
    scale > 0.0 && m.dot(n) >= LEAST_TURN_COSINE * scale
}
