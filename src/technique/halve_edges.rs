//! Halves chosen edges of a surface at their midpoints and cuts the faces to match.
//!
//! A face with one, two or three halved sides becomes two, three or four faces, as in H. Date, S. Kanai, T. Kishinami,
//! I. Nishigaki and T. Dohi, *High-quality and property controlled finite element mesh generation from triangular
//! meshes using the multiresolution technique*, Journal of Computing and Information Science in Engineering, 2005,
//! section 4.1. Its figure leaves the diagonal of the three-face case open: the one with the larger least angle is
//! taken, of equals the shorter one, of equals the one with the smaller vertex.
//!
//! Invariants: shape, area, volume, Euler characteristic and rims; every face lies in its parent, every vertex stays.
//! Midpoints are rounded, so where two sides of a sheet are nearer than the rounding of their coordinates, faces may
//! come to intersect. Groups, regions and marks are inherited; a midpoint joins the vertex groups of both its ends;
//! vertex fields are linear, face fields constant in the parent. Copies of a seam edge get one new seam id. O(F log F).

use glam::DVec3;
use rustc_hash::FxHashMap;

use crate::mesh::geometry::triangle_angles;
use crate::mesh::id::{Edge, Face};
use crate::mesh::topology::EdgeTable;
use crate::mesh::{
    Carried, EdgeId, EdgeKey, FaceId, Field, Groups, IdVec, Regions, SeamId, Support, Surface, VertexId, edge_key,
};

/// A surface with halved edges.
#[derive(Clone, Debug)]
pub struct Halved {
    /// The surface.
    pub surface: Surface,
    /// The face each face was cut from.
    pub parents: IdVec<Face, FaceId>,
    /// The ends of the edges that were halved; midpoint `k` is the vertex `first_midpoint + k`.
    pub midpoints: Vec<EdgeKey>,
    /// The number of old vertices.
    pub first_midpoint: usize,
}

/// The number of faces after halving these edges.
pub fn predict_faces(edges: &EdgeTable, faces: usize, halve: &IdVec<Edge, bool>) -> usize {
    let cuts = edges.iter().filter(|(edge, _, _)| halve[*edge]).map(|(_, _, sides)| sides.len());
    faces.saturating_add(cuts.sum())
}

/// Halves the chosen edges.
pub fn halve_edges(surface: &Surface, edges: &EdgeTable, halve: &IdVec<Edge, bool>) -> Halved {
    let first = surface.points.len();
    let mut midpoint: IdVec<Edge, Option<VertexId>> = IdVec::filled(None, edges.len());
    let mut midpoints = Vec::new();
    for edge in edges.keys().ids().filter(|&e| halve[e]) {
        midpoint[edge] = Some(VertexId::new(first + midpoints.len()));
        midpoints.push(edges.key(edge));
    }
    let mut points = surface.points.clone();
    for &[a, b] in &midpoints {
        points.push(surface.points[a] * 0.5 + surface.points[b] * 0.5);
    }
    let mut result = Halved {
        surface: Surface { points, ..Surface::default() },
        parents: IdVec::new(),
        midpoints,
        first_midpoint: first,
    };
    for (f, sides) in edges.edges_of_triangles(surface.faces.len()).enumerate() {
        cut_face(&mut result, f, surface.faces[f], sides.map(|e| midpoint[e]));
    }
    result.surface.carried = inherit(surface, &result, edges, &midpoint);
    result
}

/// Cuts a face; side `k` runs from corner `k` to the next.
fn cut_face(result: &mut Halved, parent: FaceId, [a, b, c]: [VertexId; 3], midpoints: [Option<VertexId>; 3]) {
    let mut add = |corners: [VertexId; 3]| {
        result.surface.faces.push(corners);
        result.parents.push(parent);
    };
    match midpoints {
        [None, None, None] => add([a, b, c]),
        [Some(m), None, None] => [[a, m, c], [m, b, c]].into_iter().for_each(add),
        [None, Some(m), None] => [[b, m, a], [m, c, a]].into_iter().for_each(add),
        [None, None, Some(m)] => [[c, m, b], [m, a, b]].into_iter().for_each(add),
        [Some(m), Some(n), None] => cut_in_three(&result.surface.points, [a, m, b, n, c]).into_iter().for_each(add),
        [None, Some(m), Some(n)] => cut_in_three(&result.surface.points, [b, m, c, n, a]).into_iter().for_each(add),
        [Some(n), None, Some(m)] => cut_in_three(&result.surface.points, [c, m, a, n, b]).into_iter().for_each(add),
        [Some(m), Some(n), Some(o)] => {
            [[a, m, o], [m, b, n], [o, n, c], [m, n, o]].into_iter().for_each(add);
        }
    }
}

/// The face `a b c` with the midpoints `m` of `ab` and `n` of `bc`.
fn cut_in_three(points: &IdVec<crate::mesh::id::Vertex, DVec3>, [a, m, b, n, c]: [VertexId; 5]) -> [[VertexId; 3]; 3] {
    let least_angle = |faces: [[VertexId; 3]; 2]| {
        faces.into_iter().flat_map(|f| triangle_angles(f.map(|v| points[v]))).fold(f64::INFINITY, f64::min)
    };
    let (from_a, from_c) = ([[a, m, n], [a, n, c]], [[a, m, c], [m, n, c]]);
    let (angle_a, angle_c) = (least_angle(from_a), least_angle(from_c));
    let (length_a, length_c) = (points[a].distance_squared(points[n]), points[m].distance_squared(points[c]));
    let takes_a = match angle_a.partial_cmp(&angle_c) {
        Some(std::cmp::Ordering::Greater) => true,
        Some(std::cmp::Ordering::Less) => false,
        _ => (length_a, a.min(n)) < (length_c, c.min(m)),
    };
    let [x, y] = if takes_a { from_a } else { from_c };
    [x, [m, b, n], y]
}

fn inherit(surface: &Surface, halved: &Halved, edges: &EdgeTable, midpoint: &IdVec<Edge, Option<VertexId>>) -> Carried {
    let old = &surface.carried;
    let halves = |key: EdgeKey| -> [Option<EdgeKey>; 2] {
        match edges.find(key).and_then(|e| midpoint[e]) {
            Some(m) => [Some(edge_key(key[0], m)), Some(edge_key(key[1], m))],
            None => [Some(key), None],
        }
    };
    let mut carried = Carried {
        groups: inherit_groups(&old.groups, halved, halves),
        regions: old.regions.as_ref().map(|regions| Regions {
            labels: halved.parents.iter().map(|&p| regions.labels[p]).collect(),
            names: regions.names.clone(),
        }),
        pins: old.pins.clone(),
        seams: old.seams.clone(),
        fields: old.fields.iter().map(|field| inherit_field(field, halved)).collect(),
        ..Carried::default()
    };
    for (&key, &mark) in &old.marks {
        for half in halves(key).into_iter().flatten() {
            carried.marks.insert(half, mark);
        }
    }
    let mut next = old.seams.values().map(|seam| seam.0 + 1).max().unwrap_or(0);
    for copies in seam_copies(surface, edges) {
        let ends: Vec<VertexId> = copies.iter().filter_map(|&e| midpoint[e]).collect();
        for m in &ends {
            carried.seams.insert(*m, SeamId(next));
        }
        next += u32::from(!ends.is_empty());
    }
    carried
}

fn inherit_groups(old: &Groups, halved: &Halved, halves: impl Fn(EdgeKey) -> [Option<EdgeKey>; 2]) -> Groups {
    let faces = old.faces.iter().map(|(name, members)| {
        let inside = |p: &FaceId| members.binary_search(p).is_ok();
        let children = halved.parents.enumerate().filter(|(_, p)| inside(p)).map(|(f, _)| f);
        (name.clone(), children.collect())
    });
    let edges = old.edges.iter().map(|(name, members)| {
        let mut children: Vec<EdgeKey> = members.iter().flat_map(|&key| halves(key)).flatten().collect();
        children.sort_unstable();
        (name.clone(), children)
    });
    let vertices = old.vertices.iter().map(|(name, members)| {
        let inside = |v: &VertexId| members.binary_search(v).is_ok();
        let both = halved.midpoints.iter().enumerate().filter(|(_, ends)| ends.iter().all(inside));
        let joined = both.map(|(k, _)| VertexId::new(halved.first_midpoint + k));
        (name.clone(), members.iter().copied().chain(joined).collect())
    });
    Groups { faces: faces.collect(), edges: edges.collect(), vertices: vertices.collect() }
}

fn inherit_field(field: &Field, halved: &Halved) -> Field {
    let n = field.components;
    let mut values = Vec::new();
    match field.support {
        Support::Face => {
            for p in &halved.parents {
                values.extend_from_slice(&field.values[n * p.index()..n * (p.index() + 1)]);
            }
        }
        Support::Vertex => {
            values.extend_from_slice(&field.values);
            for [a, b] in &halved.midpoints {
                let at = |v: &VertexId, k: usize| field.values[n * v.index() + k];
                values.extend((0..n).map(|k| at(a, k) * 0.5 + at(b, k) * 0.5));
            }
        }
    }
    Field { values, ..field.clone() }
}

/// The edges that are copies of one another: both ends on the same two seams. Sorted by their first copy.
pub fn seam_copies(surface: &Surface, edges: &EdgeTable) -> Vec<Vec<EdgeId>> {
    let seams = &surface.carried.seams;
    if seams.is_empty() {
        return Vec::new();
    }
    let mut place: FxHashMap<[SeamId; 2], usize> = FxHashMap::default();
    let mut copies: Vec<Vec<EdgeId>> = Vec::new();
    for (edge, [a, b], _) in edges.iter() {
        let (Some(&s), Some(&t)) = (seams.get(&a), seams.get(&b)) else { continue };
        let slot = *place.entry([s.min(t), s.max(t)]).or_insert(copies.len());
        if slot == copies.len() {
            copies.push(Vec::new());
        }
        copies[slot].push(edge);
    }
    copies.retain(|group| group.len() > 1);
    copies
}

/// Makes all copies of a seam edge alike: none is halved where one may not be, all are where one shall be.
pub fn agree_on_seams(copies: &[Vec<EdgeId>], may: &IdVec<Edge, bool>, halve: &mut IdVec<Edge, bool>) {
    for group in copies {
        let all_may = group.iter().all(|&e| may[e]);
        let one_shall = group.iter().any(|&e| halve[e]);
        for &e in group {
            halve[e] = all_may && one_shall;
        }
    }
}
