//! Flips of flat pairs of faces between rounds of halving.

use glam::DVec3;

use super::{MaxEdge, RefineError, Refinement};
use crate::mesh::geometry::{Aabb, area_vector, triangle_angles};
use crate::mesh::id::Face;
use crate::mesh::{FaceId, Field, IdVec, LockRules, Support, Surface, VertexId};
use crate::technique::flat_flips::{Pair, flip_where, raises};

/// A pair of faces counts as flat where its diagonals are nearer than this share of the largest coordinate: four
/// roundings of single precision, which files such as STL have.
const ROUNDING: f64 = 2.4e-7;
/// And nearer than this share of the diagonal, however far from the origin the surface lies.
const SHARE: f64 = 1e-6;
/// Most flips in a round, as a multiple of the faces; the worst fans would need the square of their faces.
const FLIPS: usize = 8;

/// Flips edges where the surface stays, each for a larger least angle.
pub(super) struct Flattener<'a> {
    tolerance: f64,
    locks: &'a LockRules<'a>,
}

impl<'a> Flattener<'a> {
    pub(super) fn new(surface: &Surface, locks: &'a LockRules<'a>) -> Self {
        let extent = surface.points.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
        let diagonal = Aabb::of(surface.points.iter().copied()).diagonal();
        Self { tolerance: (ROUNDING * extent).min(SHARE * diagonal), locks }
    }

    /// Flips at vertices from number `first` on. After the first round no edge gets longer than both the one it
    /// replaces and its limit, so the longest edge halves in each round as if nothing were flipped.
    pub(super) fn flip(
        &self,
        surface: &mut Surface,
        limit: &mut MaxEdge,
        first: usize,
        report: &mut Refinement,
    ) -> Result<(), RefineError> {
        let fields = FaceFields::of(surface);
        let mut left = surface.faces.len().saturating_mul(FLIPS);
        let mut limits = Limits { faces: surface.faces.clone(), limit };
        let gains = |pair: &Pair| {
            let shift = shift(pair);
            let flips = left > 0
                && shift <= self.tolerance
                && fields.agree(pair.faces)
                && keeps_sides(pair)
                && (first == 0 || limits.allow(pair))
                && raises(pair, least_angle);
            if flips {
                left -= 1;
                report.largest_shift = report.largest_shift.max(shift);
                limits.flip(pair);
            }
            flips
        };
        report.flips += flip_where(surface, self.locks, first, gains)?;
        limits.follow(surface);
        Ok(())
    }
}

/// The limits of faces, which follow them through flips.
struct Limits<'a> {
    /// The faces, with corners in the order of their limits.
    faces: IdVec<Face, [VertexId; 3]>,
    limit: &'a mut MaxEdge,
}

impl Limits<'_> {
    /// Whether the new diagonal is no longer than the old one or than its limit.
    fn allow(&self, pair: &Pair) -> bool {
        let [i, j, c, d] = pair.corners;
        let limit = match &*self.limit {
            MaxEdge::Uniform(length) => *length,
            MaxEdge::Corners(lengths) => pair.faces.into_iter().flat_map(|f| lengths[f]).fold(f64::INFINITY, f64::min),
        };
        c.distance(d) <= limit.max(i.distance(j))
    }

    /// A corner of both faces has the smaller limit from then on.
    fn flip(&mut self, pair: &Pair) {
        let MaxEdge::Corners(lengths) = &mut *self.limit else { return };
        let old = pair.faces.map(|f| (self.faces[f], lengths[f]));
        let of = |v: VertexId| {
            let at = old.iter().flat_map(|(corners, lengths)| corners.iter().zip(lengths));
            at.filter(|(w, _)| **w == v).map(|(_, length)| *length).fold(f64::INFINITY, f64::min)
        };
        for (f, corners) in pair.faces.into_iter().zip(pair.new) {
            (self.faces[f], lengths[f]) = (corners, corners.map(of));
        }
    }

    /// Brings the limits into the order that the corners of the surface have.
    fn follow(self, surface: &Surface) {
        let MaxEdge::Corners(lengths) = self.limit else { return };
        for (f, corners) in surface.faces.enumerate() {
            let first = self.faces[f].iter().position(|v| *v == corners[0]).unwrap_or(0);
            lengths[f].rotate_left(first);
        }
    }
}

/// The fields on faces: where two faces differ, the edge between them stays.
struct FaceFields(Vec<Field>);

impl FaceFields {
    fn of(surface: &Surface) -> Self {
        Self(surface.carried.fields.iter().filter(|field| field.support == Support::Face).cloned().collect())
    }

    fn agree(&self, [f, g]: [FaceId; 2]) -> bool {
        self.0.iter().all(|field| {
            let n = field.components;
            let of = |face: FaceId| &field.values[n * face.index()..n * (face.index() + 1)];
            of(f) == of(g)
        })
    }
}

/// How far the surface moves: the distance between the diagonals.
fn shift(pair: &Pair) -> f64 {
    let [i, j, c, d] = pair.corners;
    let across = (j - i).cross(d - c);
    let area = across.length();
    if area > 0.0 { ((c - i).dot(across) / area).abs() } else { f64::INFINITY }
}

/// Whether both new faces look to the side to which the old ones look together.
fn keeps_sides(pair: &Pair) -> bool {
    let whole = pair.area_vector();
    pair.after().into_iter().all(|face| area_vector(face).dot(whole) > 0.0)
}

fn least_angle(corners: [DVec3; 3]) -> f64 {
    triangle_angles(corners).into_iter().fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::geometry::triangle_area;
    use crate::mesh::halfedge::tests::surface;
    use crate::mesh::validate::validate_surface;
    use crate::mesh::{EdgeMark, Freedom, MarkCause, edge_key};
    use crate::technique::refine::{Flips, refine};
    use crate::watch::Watch;

    /// A half disk of needles, all from one corner, tilted, with coordinates in single precision.
    fn fan(n: usize) -> Surface {
        let at = |k: usize| {
            let angle = std::f64::consts::PI * k as f64 / n as f64;
            let (x, y) = (libm::cos(angle), libm::sin(angle));
            [0.6 * x - 0.3 * y, 0.8 * x + 0.1 * y, 0.2 * x + 0.7 * y].map(|c| f64::from(c as f32))
        };
        let points: Vec<[f64; 3]> = (0..=n).map(at).collect();
        surface(&points, &(1..n as u32).map(|k| [0, k, k + 1]).collect::<Vec<_>>())
    }

    fn refined(mesh: &Surface, limit: &MaxEdge, flips: Flips) -> (Surface, Refinement) {
        let made = refine(mesh, limit, 1_000_000, flips, &LockRules::default(), &Watch::silent()).expect("refined");
        assert_eq!(validate_surface(&made.0), []);
        made
    }

    fn area(mesh: &Surface) -> f64 {
        mesh.faces.ids().map(|f| triangle_area(mesh.corners(f))).sum()
    }

    #[test]
    fn needles_give_way_to_fewer_and_better_faces() {
        let mesh = fan(200);
        let limit = MaxEdge::Uniform(0.02);
        let [(plain, _), (flat, report)] = [Flips::None, Flips::Flat].map(|flips| refined(&mesh, &limit, flips));
        assert!(flat.faces.len() * 4 < plain.faces.len(), "{} and {}", flat.faces.len(), plain.faces.len());
        assert!(report.flips > 0 && report.longest <= 0.02 && report.largest_shift < 2.4e-7);
        assert!((area(&flat) - area(&mesh)).abs() < 1e-6);
        let median = |mesh: &Surface| {
            let mut angles: Vec<f64> = mesh.faces.ids().map(|f| least_angle(mesh.corners(f))).collect();
            angles.sort_by(f64::total_cmp);
            angles[angles.len() / 2].to_degrees()
        };
        assert!(median(&flat) > 5.0 * median(&plain), "{} and {}", median(&flat), median(&plain));
    }

    #[test]
    fn bent_pairs_marks_and_fields_of_faces_keep_their_edge() {
        let points = [[0.0; 3], [2.0, 0.0, 0.0], [1.0, 0.3, 0.0], [1.0, -0.3, 0.0]];
        let flat = surface(&points, &[[0, 1, 2], [1, 0, 3]]);
        let limit = MaxEdge::Uniform(9.0);
        let flips = |mesh: &Surface| refined(mesh, &limit, Flips::Flat).1.flips;
        assert_eq!(flips(&flat), 1);
        let mut bent = flat.clone();
        bent.points[VertexId::new(3)].z = 1e-5;
        assert_eq!(flips(&bent), 0);
        let mut marked = flat.clone();
        let mark = EdgeMark { freedom: Freedom::OnCurve, cause: MarkCause::Feature };
        marked.carried.mark(edge_key(VertexId::new(0), VertexId::new(1)), mark);
        assert_eq!(flips(&marked), 0);
        let mut valued = flat;
        let values = vec![1.0, 2.0];
        valued.carried.set_field(Field { name: "load".into(), support: Support::Face, components: 1, values });
        assert_eq!(flips(&valued), 0);
    }

    #[test]
    fn limits_stay_with_the_corners() {
        let points = [[0.0; 3], [2.0, 0.0, 0.0], [1.0, 0.3, 0.0], [1.0, -0.3, 0.0]];
        let mesh = surface(&points, &[[0, 1, 2], [1, 0, 3]]);
        // Short edges at the first vertex.
        let limit = MaxEdge::Corners(vec![[0.1, 2.0, 1.0], [2.0, 0.1, 1.0]].into());
        let (made, report) = refined(&mesh, &limit, Flips::Flat);
        let near = |x: f64| {
            let middles = made.faces.ids().map(|f| made.corners(f).into_iter().sum::<DVec3>() / 3.0);
            middles.filter(|middle| (middle.x - x).abs() < 0.4).count()
        };
        assert!(report.flips > 0 && near(0.4) > 3 * near(1.6), "{} and {}", near(0.4), near(1.6));
    }
}
