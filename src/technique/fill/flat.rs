//! Where the nodes of a new pattern should lie on a cavity that is bent: what it holds is laid flat in the unit disk,
//! the pattern too, and each new node is found among the old faces and taken back with them.

use glam::{DVec2, DVec3};

use super::Pattern;

/// The faces of a cavity laid flat, as triangles with their corners in the disk and in space.
#[derive(Debug)]
pub struct Flat {
    rim: Vec<DVec3>,
    triangles: Vec<([DVec2; 3], [DVec3; 3])>,
}

impl Flat {
    /// Lays a pattern flat whose nodes are at `points`, those on the rim first: the rim on the circle by length, the
    /// nodes inside by Tutte's map.
    pub fn new(points: &[DVec3], rim: usize, faces: Vec<Vec<usize>>) -> Self {
        let (mut at, mut length) = (Vec::with_capacity(rim), 0.0);
        for (k, p) in points[..rim].iter().enumerate() {
            at.push(length);
            length += p.distance(points[(k + 1) % rim]);
        }
        let turn = std::f64::consts::TAU / length.max(f64::MIN_POSITIVE);
        let circle: Vec<DVec3> = at.iter().map(|s| DVec3::new(libm::cos(s * turn), libm::sin(s * turn), 0.0)).collect();
        let mut pattern = Pattern { rim, inner: vec![DVec3::ZERO; points.len() - rim], faces };
        pattern.relax(&circle);
        let flat = |k: usize| (if k < rim { circle[k] } else { pattern.inner[k - rim] }).truncate();
        let cut = pattern.faces.iter().flat_map(|face| (2..face.len()).map(move |k| [face[0], face[k - 1], face[k]]));
        let triangles = cut.map(|corners| (corners.map(flat), corners.map(|k| points[k]))).collect();
        Self { rim: circle, triangles }
    }

    /// Puts the inner nodes of a pattern over the same rim where they should lie.
    pub fn place(&self, pattern: &mut Pattern) {
        pattern.relax(&self.rim);
        for p in &mut pattern.inner {
            *p = self.lifted(p.truncate()).unwrap_or(*p);
        }
    }

    /// The point of the faces that lies over a place in the disk.
    fn lifted(&self, p: DVec2) -> Option<DVec3> {
        let mut best: Option<(f64, DVec3)> = None;
        for ([a, b, c], corners) in &self.triangles {
            let area = (*b - *a).perp_dot(*c - *a);
            if area.abs() < 1e-15 {
                continue;
            }
            let (v, w) = ((p - *a).perp_dot(*c - *a) / area, (*b - *a).perp_dot(p - *a) / area);
            let shares = [1.0 - v - w, v, w];
            let inside = shares.iter().copied().fold(f64::INFINITY, f64::min);
            if best.is_none_or(|b| inside > b.0) {
                let held = shares.map(|s| s.max(0.0));
                let total: f64 = held.iter().sum();
                best = Some((inside, (0..3).map(|k| corners[k] * (held[k] / total)).sum()));
            }
        }
        best.map(|b| b.1)
    }
}
