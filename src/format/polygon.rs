//! Cuts a polygon with more than four corners into triangles by ear clipping.
//!
//! G. H. Meisters, "Polygons have ears", American Mathematical Monthly, 1975; only reflex corners can lie in an ear
//! (D. Eberly, "Triangulation by ear clipping", Geometric Tools, 2002), which makes convex polygons linear in their
//! corners and others corners times reflex corners. The polygon is projected along the largest component of its
//! Newell normal, so that it need not be exactly plane; signs are exact.
//!
//! Invariant: always `n - 2` triangles over the corners given, whatever the polygon. Where it crosses itself and no
//! ear is left, the next convex corner is cut off instead: nothing is lost, and `repair` sees the overlap.

use glam::{DVec2, DVec3};
use robust::{Coord, orient2d};

use crate::mesh::{Facet, VertexId};

/// A quad, or the triangle that is left when two neighbouring corners are one node.
pub(super) fn quad(c: [VertexId; 4]) -> Facet {
    for i in 0..4 {
        if c[i] == c[(i + 1) % 4] {
            let rest = [c[(i + 1) % 4], c[(i + 2) % 4], c[(i + 3) % 4]];
            if rest[0] != rest[1] && rest[1] != rest[2] && rest[2] != rest[0] {
                return Facet::Tri(rest);
            }
        }
    }
    Facet::Quad(c)
}

/// The triangles of `polygon`, oriented like it. Fewer than three corners give none.
pub(super) fn triangulate(points: &[DVec3], polygon: &[VertexId]) -> Vec<[VertexId; 3]> {
    let n = polygon.len();
    if n < 3 {
        return Vec::new();
    }
    let mut clipper = Clipper::new(project(points, polygon));
    let mut triangles = Vec::with_capacity(n - 2);
    let mut corner = 0;
    for left in (4..=n).rev() {
        let ear = clipper.find_ear(corner, left);
        let (before, after) = (clipper.before[ear], clipper.after[ear]);
        triangles.push([before, ear, after].map(|i| polygon[i]));
        clipper.cut(ear);
        // Going on two corners later spreads the triangles, where staying would make a fan of slivers.
        corner = clipper.after[after];
    }
    triangles.push([clipper.before[corner], corner, clipper.after[corner]].map(|i| polygon[i]));
    triangles
}

/// Drops the axis along which the polygon's normal is largest; counter-clockwise is kept.
fn project(points: &[DVec3], polygon: &[VertexId]) -> Vec<DVec2> {
    let at = |i: usize| points[polygon[i % polygon.len()].index()];
    let origin = at(0);
    let normal: DVec3 = (0..polygon.len()).map(|i| (at(i) - origin).cross(at(i + 1) - origin)).sum();
    let size = normal.abs();
    let flat = |p: DVec3| {
        if size.z >= size.x && size.z >= size.y {
            DVec2::new(p.x, if normal.z < 0.0 { -p.y } else { p.y })
        } else if size.y >= size.x {
            DVec2::new(p.z, if normal.y < 0.0 { -p.x } else { p.x })
        } else {
            DVec2::new(p.y, if normal.x < 0.0 { -p.z } else { p.z })
        }
    };
    polygon.iter().map(|v| flat(points[v.index()])).collect()
}

/// The corners that are left, as a ring.
struct Clipper {
    flat: Vec<DVec2>,
    before: Vec<usize>,
    after: Vec<usize>,
    /// Corners that may lie in an ear, some of them cut off or no longer reflex.
    reflex: Vec<usize>,
    is_reflex: Vec<bool>,
}

impl Clipper {
    fn new(flat: Vec<DVec2>) -> Self {
        let n = flat.len();
        let before = (0..n).map(|i| (i + n - 1) % n).collect();
        let after = (0..n).map(|i| (i + 1) % n).collect();
        let mut clipper = Self { flat, before, after, reflex: Vec::new(), is_reflex: vec![false; n] };
        for corner in 0..n {
            clipper.is_reflex[corner] = clipper.turn(corner) <= 0.0;
        }
        clipper.reflex = (0..n).filter(|&i| clipper.is_reflex[i]).collect();
        clipper
    }

    /// The first ear from `corner` on; without one, the first convex corner; without that, `corner`.
    fn find_ear(&self, corner: usize, left: usize) -> usize {
        let mut convex = None;
        let mut candidate = corner;
        for _ in 0..left {
            if !self.is_reflex[candidate] {
                if self.is_ear(candidate) {
                    return candidate;
                }
                convex.get_or_insert(candidate);
            }
            candidate = self.after[candidate];
        }
        convex.unwrap_or(corner)
    }

    fn is_ear(&self, corner: usize) -> bool {
        let (before, after) = (self.before[corner], self.after[corner]);
        let triangle = [before, corner, after].map(|i| self.flat[i]);
        self.reflex.iter().filter(|&&i| self.is_reflex[i]).all(|&i| {
            // Corners at the same place as one of the ear's occur where a hole is joined to the outline by a bridge.
            let p = self.flat[i];
            triangle.contains(&p) || !holds(triangle, p)
        })
    }

    fn cut(&mut self, ear: usize) {
        let (before, after) = (self.before[ear], self.after[ear]);
        self.after[before] = after;
        self.before[after] = before;
        self.is_reflex[ear] = false;
        let known = self.reflex.len();
        for corner in [before, after] {
            let reflex = self.turn(corner) <= 0.0;
            if reflex && !self.is_reflex[corner] && !self.reflex[..known].contains(&corner) {
                self.reflex.push(corner);
            }
            self.is_reflex[corner] = reflex;
        }
    }

    fn turn(&self, corner: usize) -> f64 {
        turn(self.flat[self.before[corner]], self.flat[corner], self.flat[self.after[corner]])
    }
}

/// Positive when `a`, `b`, `c` turn left; the sign is exact.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let coord = |p: DVec2| Coord { x: p.x, y: p.y };
    orient2d(coord(a), coord(b), coord(c))
}

/// Whether the counter-clockwise triangle, its rim included, holds `p`.
fn holds([a, b, c]: [DVec2; 3], p: DVec2) -> bool {
    turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(outline: &[[f64; 2]]) -> Vec<[DVec3; 3]> {
        let points: Vec<DVec3> = outline.iter().map(|&[x, y]| DVec3::new(x, y, 0.25 * x)).collect();
        let polygon: Vec<VertexId> = (0..points.len()).map(VertexId::new).collect();
        triangulate(&points, &polygon).iter().map(|t| t.map(|v| points[v.index()])).collect()
    }

    fn areas(triangles: &[[DVec3; 3]]) -> Vec<f64> {
        triangles.iter().map(|&[a, b, c]| 0.5 * (b - a).cross(c - a).z).collect()
    }

    #[test]
    fn a_concave_polygon_is_covered_once_and_keeps_its_orientation() {
        let comb = [[0., 0.], [5., 0.], [5., 3.], [4., 1.], [3., 3.], [2., 1.], [1., 3.], [0.5, 1.], [0., 3.]];
        let triangles = cut(&comb);
        let areas = areas(&triangles);
        assert_eq!(triangles.len(), comb.len() - 2);
        assert!(areas.iter().all(|&a| a > 0.0), "{areas:?}");
        let shoelace: f64 = (0..comb.len())
            .map(|i| (comb[i], comb[(i + 1) % comb.len()]))
            .map(|(p, q)| 0.5 * (p[0] * q[1] - p[1] * q[0]))
            .sum();
        assert!((areas.iter().sum::<f64>() - shoelace).abs() < 1e-12);
    }

    #[test]
    fn straight_corners_make_no_flat_triangle() {
        let square = [[0., 0.], [1., 0.], [2., 0.], [2., 1.], [2., 2.], [1., 2.], [0., 2.], [0., 1.]];
        assert!(areas(&cut(&square)).iter().all(|&a| a > 0.0));
    }

    #[test]
    fn a_hole_on_a_bridge_is_left_open() {
        let ring = [[0., 0.], [4., 0.], [4., 4.], [0., 4.], [0., 0.], [1., 1.], [1., 3.], [3., 3.], [3., 1.], [1., 1.]];
        let areas = areas(&cut(&ring));
        assert!((areas.iter().sum::<f64>() - 12.0).abs() < 1e-12);
        assert!(areas.iter().all(|&a| a >= 0.0), "{areas:?}");
    }

    #[test]
    fn any_polygon_gives_two_triangles_fewer_than_corners() {
        let star = [[0., 3.], [2., -3.], [-3., 1.], [3., 1.], [-2., -3.]];
        assert_eq!(cut(&star).len(), 3);
        assert_eq!(cut(&[[1., 1.]; 7]).len(), 5);
        assert_eq!(cut(&[[0., 0.], [1., 0.]]).len(), 0);
    }
}
