//! Joins what triangles are left to quads: neighbours first, then any two along a path through the faces between them.
//!
//! A pair at a distance is joined by putting a vertex into the middle of every edge on a path between the two: each
//! triangle becomes a quad, a quad crossed straight becomes two quads, one crossed round a corner three. So any even
//! number of triangles in a region can be turned into quads, and no face outside the path changes.
//!
//! Based on: the pairing is that of graph matching on the dual mesh; the path rule is folklore of quad meshing.
//!
//! # Cost
//! O(E log E) for neighbours; a breadth-first search a pair for the rest.

use smallvec::{SmallVec, smallvec};

use super::ground::Ground;
use super::mixed::{Corners, Mixed, NONE, Place, quad_quality};

/// Pairs of neighbours below this quality are not joined directly.
const LEAST: f64 = 0.15;

/// What was joined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JoinReport {
    /// Pairs of neighbouring triangles.
    pub neighbours: usize,
    /// Pairs joined along a path.
    pub paths: usize,
    /// Triangles that no partner was found for.
    pub left: usize,
}

/// The quality of the quad made of the two triangles at an edge; `None` where they may not be joined.
pub fn pair_quality(mesh: &Mixed, h: u32) -> Option<f64> {
    let corners = pair(mesh, h)?;
    Some(quad_quality([0, 1, 2, 3].map(|i| mesh.point(corners[i]))))
}

/// The corners of the quad made of the two triangles at an edge inside a region.
fn pair(mesh: &Mixed, h: u32) -> Option<[u32; 4]> {
    let (f, g) = (mesh.face(h), mesh.face(h ^ 1));
    if f == NONE || g == NONE || mesh.arc(h) != NONE || !mesh.is_triangle(f) || !mesh.is_triangle(g) {
        return None;
    }
    let (c, d) = (mesh.origin(mesh.prev(h)), mesh.origin(mesh.prev(h ^ 1)));
    (c != d).then_some([mesh.origin(h), d, mesh.target(h), c])
}

/// Makes a quad of the two triangles at an edge.
pub fn merge_pair(mesh: &mut Mixed, h: u32) -> bool {
    let Some(corners) = pair(mesh, h) else { return false };
    mesh.begin();
    let old = [mesh.face(h), mesh.face(h ^ 1)];
    if mesh.replace(&old, &[Corners::from_slice(&corners)], None).is_some() {
        mesh.commit();
        return true;
    }
    mesh.rollback();
    false
}

/// Joins neighbouring triangles, the best pairs first; the lone ones then with others along alternating choices.
pub fn join_neighbours(mesh: &mut Mixed) -> usize {
    let mut pairs: Vec<(f64, u32)> = Vec::new();
    for h in mesh.edges() {
        if let Some(quality) = pair_quality(mesh, h)
            && quality > LEAST
        {
            pairs.push((quality, h));
        }
    }
    pairs.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
    let mut joined = 0;
    for (_, h) in pairs {
        if mesh.is_halfedge(h) && merge_pair(mesh, h) {
            joined += 1;
        }
    }
    joined
}

/// Joins the triangles left in each region in pairs along the shortest paths between them.
pub fn join_along_paths(mesh: &mut Mixed, ground: &Ground<'_>) -> JoinReport {
    let mut report = JoinReport::default();
    let waiting: Vec<u32> = mesh.faces().filter(|&f| mesh.is_triangle(f)).collect();
    for f in waiting {
        if !mesh.is_face(f) || !mesh.is_triangle(f) {
            continue;
        }
        match path(mesh, f) {
            Some(way) if cut_along(mesh, ground, &way) => report.paths += 1,
            _ => report.left += 1,
        }
    }
    report
}

/// The half-edges to cross from `start` to the nearest other triangle of its region; each belongs to the face left.
fn path(mesh: &Mixed, start: u32) -> Option<Vec<u32>> {
    let mut came: rustc_hash::FxHashMap<u32, u32> = rustc_hash::FxHashMap::default();
    came.insert(start, NONE);
    let mut queue = std::collections::VecDeque::from([start]);
    while let Some(f) = queue.pop_front() {
        if f != start && mesh.is_triangle(f) {
            let mut way = Vec::new();
            let mut at = f;
            while at != start {
                let h = came[&at];
                way.push(h);
                at = mesh.face(h);
            }
            way.reverse();
            return Some(way);
        }
        for h in mesh.sides(f) {
            let across = mesh.face(h ^ 1);
            if across != NONE && mesh.arc(h) == NONE && !came.contains_key(&across) {
                came.insert(across, h);
                queue.push_back(across);
            }
        }
    }
    None
}

/// Puts a vertex on each crossed edge and makes quads of the faces on the way.
fn cut_along(mesh: &mut Mixed, ground: &Ground<'_>, way: &[u32]) -> bool {
    let (first, last) = (mesh.face(way[0]), mesh.face(way[way.len() - 1] ^ 1));
    let region = mesh.region(first);
    mesh.begin();
    let mut middles = Vec::new();
    for &h in way {
        let point = 0.5 * (mesh.point(mesh.origin(h)) + mesh.point(mesh.target(h)));
        middles.push(add_inner(mesh, ground, region, point, mesh.size(mesh.origin(h))));
    }
    let mut old = vec![first];
    let mut new: Vec<Corners> = vec![with_side_split(mesh, way[0], middles[0])];
    for i in 1..way.len() {
        let face = mesh.face(way[i]);
        old.push(face);
        let centre = mesh.centre(face);
        let size = mesh.size(mesh.origin(way[i]));
        let (entry, exit) = (way[i - 1] ^ 1, way[i]);
        let (m, n) = (middles[i - 1], middles[i]);
        // The corners from the entry on: a, b are its ends.
        let at = |k: u32| mesh.origin(k);
        let (k1, k2, k3) = (mesh.next(entry), mesh.next(mesh.next(entry)), mesh.prev(entry));
        let (a, b, c, d) = (at(entry), at(k1), at(k2), at(k3));
        if exit == k2 {
            new.push(smallvec![a, m, n, d]);
            new.push(smallvec![m, b, c, n]);
            continue;
        }
        let x = add_inner(mesh, ground, region, centre, size);
        if exit == k1 {
            new.extend([smallvec![m, b, n, x], smallvec![x, n, c, d], smallvec![d, a, m, x]]);
        } else {
            new.extend([smallvec![n, a, m, x], smallvec![x, m, b, c], smallvec![c, d, n, x]]);
        }
    }
    old.push(last);
    new.push(with_side_split(mesh, way[way.len() - 1] ^ 1, middles[middles.len() - 1]));
    if mesh.replace(&old, &new, None).is_some() {
        mesh.commit();
        return true;
    }
    mesh.rollback();
    false
}

/// The corners of the triangle on the left of `h` with a vertex more on that side.
fn with_side_split(mesh: &Mixed, h: u32, middle: u32) -> Corners {
    let corners: SmallVec<[u32; 4]> = smallvec![mesh.origin(h), middle, mesh.target(h), mesh.origin(mesh.prev(h))];
    corners
}

fn add_inner(mesh: &mut Mixed, ground: &Ground<'_>, region: u32, point: glam::DVec3, size: f64) -> u32 {
    let foot = ground.project(region, point);
    mesh.add_vertex(foot.point, foot.normal, Place::Region(region), size)
}
