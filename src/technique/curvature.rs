//! Principal curvatures at the vertices, from the bending of the edges nearby.
//!
//! The curvature tensor of a vertex is averaged over the ball `B` of a given radius about it:
//! `T = 1/|B| · Σ β(e) · |e ∩ B| · ē ēᵀ`, where `β` is the signed bend of an edge (positive where convex), `ē` its unit
//! direction and `|e ∩ B|` its length inside the ball. The eigenvector of the eigenvalue nearest to zero is close to
//! the normal; the other two values are the principal curvatures, each with the direction of the *other* eigenvector,
//! because an edge bends the surface across itself.
//!
//! Based on: D. Cohen-Steiner, J.-M. Morvan. *Restricted Delaunay triangulations and normal cycle*, SoCG 2003;
//! P. Alliez, D. Cohen-Steiner, O. Devillers, B. Lévy, M. Desbrun. *Anisotropic polygonal remeshing*, SIGGRAPH 2003.
//! We walk only to what is connected with the vertex inside the ball, so that the other side of a thin wall does not
//! count; and `|B|` is the sum of the areas that belong to the edges (a third of their faces), each taken in the
//! proportion in which its edge lies inside, which needs no clipping of triangles and makes the ratio exact on regular
//! tessellations.
//!
//! # Cost
//! O(V · edges in a ball), in parallel over vertices; a vertex's result depends on nothing else.

use glam::DVec3;
use rayon::prelude::*;
use rustc_hash::FxHashSet;

use super::eigen::{Symmetric, symmetric_eigen};
use crate::mesh::geometry::{triangle_area, triangle_normal};
use crate::mesh::id::{EdgeId, IdVec, Vertex, VertexId};
use crate::mesh::surface::Surface;
use crate::mesh::topology::EdgeTable;
use crate::watch::{Cancelled, Watch};

/// The curvatures at one vertex, in 1/length; positive where the surface is convex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Principal {
    /// The curvature of larger magnitude, and its unit direction.
    pub max: (f64, DVec3),
    /// The curvature of smaller magnitude, and its unit direction.
    pub min: (f64, DVec3),
}

impl Principal {
    const FLAT: Self = Self { max: (0.0, DVec3::X), min: (0.0, DVec3::Y) };

    /// The larger magnitude of the two.
    pub fn largest(&self) -> f64 {
        self.max.0.abs()
    }
}

/// What one edge adds to the tensor of a ball that holds all of it.
struct Bend {
    ends: [DVec3; 2],
    direction: DVec3,
    /// Signed bend times length.
    weight: f64,
    /// The area that belongs to the edge.
    area: f64,
}

/// Mean edge length: balls of 2 to 3 times that suit most meshes.
pub fn mean_edge(surface: &Surface) -> f64 {
    let edges = EdgeTable::new(surface);
    let sum: f64 = edges.keys().iter().map(|&[a, b]| (surface.points[a] - surface.points[b]).length()).sum();
    sum / edges.len().max(1) as f64
}

/// Principal curvatures at every vertex, averaged over balls of `radius`.
pub fn principal_curvatures(
    surface: &Surface,
    radius: f64,
    watch: &Watch,
) -> Result<IdVec<Vertex, Principal>, Cancelled> {
    let edges = EdgeTable::new(surface);
    let bends: IdVec<crate::mesh::id::Edge, Bend> = edges.keys().ids().map(|e| bend(surface, &edges, e)).collect();
    let spokes = Spokes::new(surface.points.len(), &edges);
    let at = |vertex: usize| {
        watch.check()?;
        Ok(tensor_at(surface, &edges, &bends, &spokes, VertexId::new(vertex), radius)
            .map_or(Principal::FLAT, principal))
    };
    let all: Result<Vec<Principal>, Cancelled> = (0..surface.points.len()).into_par_iter().map(at).collect();
    Ok(all?.into())
}

/// The edges at each vertex.
struct Spokes {
    start: Vec<u32>,
    edges: Vec<EdgeId>,
}

impl Spokes {
    fn new(vertices: usize, edges: &EdgeTable) -> Self {
        let mut start = vec![0_u32; vertices + 1];
        for v in edges.keys().iter().flatten() {
            start[v.index() + 1] += 1;
        }
        for i in 0..vertices {
            start[i + 1] += start[i];
        }
        let mut fill = start.clone();
        let mut list = vec![EdgeId::from_raw(0); 2 * edges.len()];
        for (edge, ends) in edges.keys().enumerate() {
            for v in ends {
                list[fill[v.index()] as usize] = edge;
                fill[v.index()] += 1;
            }
        }
        Self { start, edges: list }
    }

    fn of(&self, v: VertexId) -> &[EdgeId] {
        &self.edges[self.start[v.index()] as usize..self.start[v.index() + 1] as usize]
    }
}

fn bend(surface: &Surface, edges: &EdgeTable, edge: EdgeId) -> Bend {
    let [a, b] = edges.key(edge);
    let ends = [surface.points[a], surface.points[b]];
    let along = ends[1] - ends[0];
    let direction = along.try_normalize().unwrap_or(DVec3::ZERO);
    let sides = edges.sides(edge);
    let area = sides.iter().map(|s| triangle_area(surface.corners(s.face))).sum::<f64>() / 3.0;
    let angle = match sides {
        [s, t] => signed_bend(surface, s.face, t.face),
        _ => 0.0,
    };
    Bend { ends, direction, weight: angle * along.length(), area }
}

/// The angle between the normals of two faces, positive where the edge between them is convex.
fn signed_bend(surface: &Surface, f: crate::mesh::FaceId, g: crate::mesh::FaceId) -> f64 {
    let (p, q) = (surface.corners(f), surface.corners(g));
    let (Some(m), Some(n)) = (triangle_normal(p), triangle_normal(q)) else { return 0.0 };
    let angle = libm::atan2(m.cross(n).length(), m.dot(n));
    // Convex: the other face lies below the plane of this one.
    let rise = (q[0] + q[1] + q[2] - p[0] - p[1] - p[2]).dot(m);
    if rise <= 0.0 { angle } else { -angle }
}

/// The averaged tensor of a vertex; `None` where the ball holds no edge.
fn tensor_at(
    surface: &Surface,
    edges: &EdgeTable,
    bends: &IdVec<crate::mesh::id::Edge, Bend>,
    spokes: &Spokes,
    vertex: VertexId,
    radius: f64,
) -> Option<Symmetric> {
    let centre = surface.points[vertex];
    let mut seen: FxHashSet<EdgeId> = FxHashSet::default();
    let mut reached: FxHashSet<VertexId> = FxHashSet::default();
    let mut queue = vec![vertex];
    reached.insert(vertex);
    let (mut tensor, mut area, mut at) = ([0.0; 6], 0.0, 0);
    // The order of this walk is that of the edges' numbers, so the sum is always the same.
    while let Some(&v) = queue.get(at) {
        at += 1;
        for &edge in spokes.of(v) {
            if !seen.insert(edge) {
                continue;
            }
            let bend = &bends[edge];
            let share = share_inside(bend.ends, centre, radius);
            let [x, y, z] = bend.direction.to_array();
            for (sum, product) in tensor.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z]) {
                *sum += share * bend.weight * product;
            }
            area += share * bend.area;
            for end in edges.key(edge) {
                if surface.points[end].distance_squared(centre) < radius * radius && reached.insert(end) {
                    queue.push(end);
                }
            }
        }
    }
    (area > 0.0).then(|| tensor.map(|t| t / area))
}

/// Which share of a segment lies inside a ball.
fn share_inside([a, b]: [DVec3; 2], centre: DVec3, radius: f64) -> f64 {
    let (along, from) = (b - a, a - centre);
    let (aa, ab, bb) = (along.length_squared(), along.dot(from), from.length_squared() - radius * radius);
    let discriminant = ab * ab - aa * bb;
    if aa <= 0.0 || discriminant <= 0.0 {
        return 0.0;
    }
    let root = discriminant.sqrt();
    let (enter, leave) = ((-ab - root) / aa, (-ab + root) / aa);
    (leave.min(1.0) - enter.max(0.0)).max(0.0)
}

fn principal(tensor: Symmetric) -> Principal {
    let mut pairs = symmetric_eigen(&tensor);
    // The flattest direction is the normal; of the others the larger magnitude comes last.
    pairs.sort_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
    let [_, small, large] = pairs;
    Principal { max: (large.0, small.1), min: (small.0, large.1) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Carried;

    /// A surface over a grid in `u` (round, `m` steps) and `v` (`n` steps).
    fn tube(m: u32, n: u32, place: impl Fn(f64, f64) -> DVec3) -> Surface {
        let points = (0..=n)
            .flat_map(|j| (0..m).map(move |i| (i, j)))
            .map(|(i, j)| place(f64::from(i) / f64::from(m), f64::from(j) / f64::from(n)))
            .collect();
        let at = |i: u32, j: u32| VertexId::from_raw(i % m + m * j);
        let mut faces = Vec::new();
        for j in 0..n {
            for i in 0..m {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                faces.extend([[a, b, c], [a, c, d]]);
            }
        }
        Surface { points, faces: faces.into(), carried: Carried::default() }
    }

    fn around(u: f64) -> (f64, f64) {
        libm::sincos(u * std::f64::consts::TAU)
    }

    #[test]
    fn a_cylinder_bends_once_round_its_axis() {
        let radius = 2.0;
        let surface = tube(64, 24, |u, v| {
            let (s, c) = around(u);
            DVec3::new(radius * c, radius * s, 5.0 * v)
        });
        let all = principal_curvatures(&surface, 0.6, &Watch::silent()).expect("not cancelled");
        let middle = all[VertexId::new(64 * 12 + 5)];
        assert!((middle.max.0 - 1.0 / radius).abs() < 0.01, "{middle:?}");
        assert!(middle.min.0.abs() < 0.03, "{middle:?}");
        assert!(middle.min.1.z.abs() > 0.99, "the flat direction is the axis: {middle:?}");
    }

    #[test]
    fn a_sphere_bends_alike_everywhere_and_its_inside_the_other_way() {
        let radius = 3.0;
        let sphere = |sign: f64| {
            tube(64, 48, |u, v| {
                let ((s, c), (sv, cv)) = (around(sign * u), around(0.05 + 0.4 * v));
                DVec3::new(radius * sv * c, radius * sv * s, -radius * cv)
            })
        };
        for (sign, curvature) in [(1.0, 1.0 / radius), (-1.0, -1.0 / radius)] {
            let all = principal_curvatures(&sphere(sign), 0.9, &Watch::silent()).expect("not cancelled");
            let middle = all[VertexId::new(64 * 24 + 9)];
            assert!((middle.max.0 - curvature).abs() < 0.02, "{middle:?}");
            assert!((middle.min.0 - curvature).abs() < 0.02, "{middle:?}");
        }
    }

    #[test]
    fn a_plane_is_flat() {
        let surface = tube(8, 8, |u, v| {
            let (s, c) = around(u);
            DVec3::new((0.5 + v) * c, (0.5 + v) * s, 0.0)
        });
        let all = principal_curvatures(&surface, 0.4, &Watch::silent()).expect("not cancelled");
        assert!(all.iter().all(|p| p.largest() < 1e-12));
    }
}
