//! Smooth lines: where a flat face of the part runs tangentially into a fillet.
//!
//! No dihedral angle finds them: the bend there is half of the one between two facets of the fillet. But a flat face of
//! the part is much larger than a facet beside it. So coplanar regions are grown, and one that is at least twice as
//! large as all its smooth neighbours is a flat face, whose smooth edges are curves for the time of the simplification:
//! flat faces stay exactly flat, and vertices on fillets do not leave them. Strips hardly wider than the tolerance are
//! no flat faces: between two curves so near nothing could be done but cutting them into ever smaller triangles. Cost:
//! O(F log F).

use crate::mesh::geometry::{Aabb, angle, area_vector};
use crate::mesh::{EdgeKey, EdgeMark, FaceId, Freedom, MarkCause, Surface, edge_key};

/// A face belongs to a plane when its corners lie within this part of the diagonal of it.
const COPLANAR: f64 = 1e-6;

/// And when its normal differs by less than this from the plane's, in radians.
const ALIKE: f64 = 0.02;

/// A smooth line bends at least this much, in radians: one degree.
const LEAST_BEND: f64 = 0.017_5;

/// How many times larger than each of its smooth neighbours a flat face is.
const LARGER: f64 = 2.0;

/// Faces that make a flat face of the part.
const LEAST_FACES: u32 = 2;

/// Tolerances that a flat face is wide: twice its area by its perimeter.
const WIDE: f64 = 2.0;

/// The edge group that tells smooth lines from marks; no file can bring this name.
const GROUP: &str = "\u{1}smooth-lines";

/// The surface with its smooth lines as marked curves, and their number.
pub(super) fn with_smooth_lines(surface: &Surface, tolerance: f64) -> (Surface, usize) {
    let lines = smooth_lines(surface, WIDE * tolerance);
    let mut marked = surface.clone();
    for &line in &lines {
        marked.carried.mark(line, EdgeMark { freedom: Freedom::OnCurve, cause: MarkCause::Feature });
    }
    let count = lines.len();
    if count > 0 {
        marked.carried.groups.edges.insert(GROUP.to_owned(), lines);
    }
    (marked, count)
}

/// Takes the marks of smooth lines away again.
pub(super) fn without_smooth_lines(surface: &mut Surface) {
    for line in surface.carried.groups.edges.remove(GROUP).unwrap_or_default() {
        surface.carried.marks.remove(&line);
    }
}

/// Coplanar regions of faces.
struct Regions {
    of_face: Vec<u32>,
    area: Vec<f64>,
    faces: Vec<u32>,
    normal: Vec<glam::DVec3>,
}

fn smooth_lines(surface: &Surface, wide: f64) -> Vec<EdgeKey> {
    let pairs = inner_edges(surface);
    let regions = grow(surface, &pairs);
    let mut largest_beside = vec![0.0_f64; regions.area.len()];
    let bends = |[f, g]: [FaceId; 2]| {
        let [r, s] = [f, g].map(|f| regions.of_face[f.index()] as usize);
        // Between two single faces no line is sought.
        (r != s
            && regions.faces[r].max(regions.faces[s]) >= LEAST_FACES
            && angle(regions.normal[r], regions.normal[s]) > LEAST_BEND)
            .then_some([r, s])
    };
    for (_, [r, s]) in pairs.iter().filter_map(|&(key, sides)| Some((key, bends(sides)?))) {
        largest_beside[r] = largest_beside[r].max(regions.area[s]);
        largest_beside[s] = largest_beside[s].max(regions.area[r]);
    }
    let perimeter = perimeters(surface, &regions, &pairs);
    // Areas are those of parallelograms, twice those of the faces.
    let is_flat = |r: usize| {
        let is_large = regions.area[r] >= LARGER * largest_beside[r] && largest_beside[r] > 0.0;
        regions.faces[r] >= LEAST_FACES && is_large && regions.area[r] >= wide * perimeter[r]
    };
    let lines = pairs.iter().filter(|&&(_, sides)| bends(sides).is_some_and(|[r, s]| is_flat(r) || is_flat(s)));
    lines.map(|&(key, _)| key).collect()
}

/// The length of the border of each region.
fn perimeters(surface: &Surface, regions: &Regions, pairs: &[(EdgeKey, [FaceId; 2])]) -> Vec<f64> {
    let mut perimeter = vec![0.0; regions.area.len()];
    for f in surface.faces.ids() {
        let [a, b, c] = surface.corners(f);
        perimeter[regions.of_face[f.index()] as usize] += a.distance(b) + b.distance(c) + c.distance(a);
    }
    for ([a, b], [f, g]) in pairs {
        let [r, s] = [f, g].map(|f| regions.of_face[f.index()] as usize);
        if r == s {
            perimeter[r] -= 2.0 * surface.points[*a].distance(surface.points[*b]);
        }
    }
    perimeter
}

/// Inner edges without a mark, in order, each with its two faces.
fn inner_edges(surface: &Surface) -> Vec<(EdgeKey, [FaceId; 2])> {
    let mut sides: Vec<(EdgeKey, FaceId)> = Vec::with_capacity(3 * surface.faces.len());
    for f in surface.faces.ids() {
        let [a, b, c] = surface.faces[f];
        sides.extend([edge_key(a, b), edge_key(b, c), edge_key(c, a)].map(|key| (key, f)));
    }
    sides.sort_unstable();
    let inner = sides.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() == 2);
    inner
        .map(|same| (same[0].0, [same[0].1, same[1].1]))
        .filter(|(key, _)| !surface.carried.marks.contains_key(key))
        .collect()
}

/// Grows regions from the largest face on, each within the plane of its seed.
fn grow(surface: &Surface, pairs: &[(EdgeKey, [FaceId; 2])]) -> Regions {
    const NONE: u32 = u32::MAX;
    let count = surface.faces.len();
    let neighbours = neighbours(count, pairs);
    let vectors: Vec<_> = surface.faces.ids().map(|f| area_vector(surface.corners(f))).collect();
    let mut order: Vec<(f64, FaceId)> = surface.faces.ids().map(|f| (vectors[f.index()].length_squared(), f)).collect();
    order.sort_unstable_by(|f, g| g.0.total_cmp(&f.0).then(f.1.cmp(&g.1)));
    let near = COPLANAR * Aabb::of(surface.points.iter().copied()).diagonal();
    let mut regions = Regions { of_face: vec![NONE; count], area: Vec::new(), faces: Vec::new(), normal: Vec::new() };
    let mut stack = Vec::new();
    for (_, seed) in order {
        if regions.of_face[seed.index()] != NONE {
            continue;
        }
        let normal = vectors[seed.index()].normalize_or_zero();
        let foot = surface.corners(seed)[0];
        let number = regions.area.len() as u32;
        let (mut area, mut faces) = (0.0, 0);
        regions.of_face[seed.index()] = number;
        stack.push(seed);
        while let Some(f) = stack.pop() {
            area += vectors[f.index()].length();
            faces += 1;
            for &g in neighbours.of(f) {
                let is_new = regions.of_face[g.index()] == NONE;
                let in_plane = || surface.corners(g).iter().all(|&p| normal.dot(p - foot).abs() <= near);
                let alike = || {
                    let other = vectors[g.index()];
                    other.length() <= near * near || angle(normal, other) <= ALIKE
                };
                if is_new && in_plane() && alike() {
                    regions.of_face[g.index()] = number;
                    stack.push(g);
                }
            }
        }
        regions.area.push(area);
        regions.faces.push(faces);
        regions.normal.push(normal);
    }
    regions
}

/// The neighbours of each face, as one list.
struct Neighbours {
    start: Vec<u32>,
    faces: Vec<FaceId>,
}

impl Neighbours {
    fn of(&self, f: FaceId) -> &[FaceId] {
        &self.faces[self.start[f.index()] as usize..self.start[f.index() + 1] as usize]
    }
}

fn neighbours(count: usize, pairs: &[(EdgeKey, [FaceId; 2])]) -> Neighbours {
    let both = || pairs.iter().flat_map(|&(_, [f, g])| [[f, g], [g, f]]);
    let mut start = vec![0_u32; count + 1];
    for [f, _] in both() {
        start[f.index() + 1] += 1;
    }
    for i in 0..count {
        start[i + 1] += start[i];
    }
    let mut room = start.clone();
    let mut faces = vec![FaceId::from_raw(0); start[count] as usize];
    for [f, g] in both() {
        faces[room[f.index()] as usize] = g;
        room[f.index()] += 1;
    }
    for i in 0..count {
        faces[start[i] as usize..start[i + 1] as usize].sort_unstable();
    }
    Neighbours { start, faces }
}
