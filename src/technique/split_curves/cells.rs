//! Cuts faces into cells along their chords, and cells into triangles.

use std::collections::BTreeMap;

use glam::DVec3;

use super::SplitError;
use super::sites::{Chord, Layout};
use crate::mesh::geometry::stretch;
use crate::mesh::id::{Face, Vertex};
use crate::mesh::topology::EdgeTable;
use crate::mesh::{FaceId, IdVec, Surface, VertexId};

/// Cells of more corners are halved first, or the search for the best triangles would take too long.
const MOST_CORNERS: usize = 48;

/// A corner of a cell, with a bit for each side of the face that it lies on.
#[derive(Clone, Copy)]
struct Corner {
    vertex: VertexId,
    sides: u8,
}

/// The faces of the cut surface, with the face that each comes from.
pub(super) type Faces = (IdVec<Face, [VertexId; 3]>, IdVec<Face, FaceId>);

/// Cuts all faces that have crossings on their sides or chords inside.
pub(super) fn cut_faces(
    surface: &Surface,
    edges: &EdgeTable,
    points: &IdVec<Vertex, DVec3>,
    layout: &Layout,
    chords: &BTreeMap<FaceId, Vec<Chord>>,
) -> Result<Faces, SplitError> {
    let (mut faces, mut parents) = (IdVec::new(), IdVec::new());
    let sides = edges.edges_of_triangles(surface.faces.len());
    for (f, &corners) in surface.faces.enumerate() {
        let mut perimeter: Vec<Corner> = Vec::with_capacity(3);
        for k in 0..3 {
            let before = 1 << ((k + 2) % 3);
            perimeter.push(Corner { vertex: corners[k], sides: 1 << k | before });
            let Some(inner) = layout.on_edge.get(&sides[f][k]) else { continue };
            let corner = |&vertex: &VertexId| Corner { vertex, sides: 1 << k };
            if edges.key(sides[f][k])[0] == corners[k] {
                perimeter.extend(inner.iter().map(corner));
            } else {
                perimeter.extend(inner.iter().rev().map(corner));
            }
        }
        let own = chords.get(&f).map_or(&[][..], Vec::as_slice);
        if perimeter.len() == 3 && own.is_empty() {
            faces.push(corners);
            parents.push(f);
            continue;
        }
        for cell in cells(f, points[corners[0]], perimeter, own.iter().collect())? {
            for triangle in triangles(points, &cell) {
                faces.push(triangle);
                parents.push(f);
            }
        }
    }
    Ok((faces, parents))
}

/// The cells of a face: its loop cut by one chord after the other.
fn cells(face: FaceId, at: DVec3, perimeter: Vec<Corner>, chords: Vec<&Chord>) -> Result<Vec<Vec<Corner>>, SplitError> {
    let mut waiting = vec![(perimeter, chords)];
    let mut done = Vec::new();
    while let Some((cell, mut chords)) = waiting.pop() {
        let Some(chord) = chords.pop() else {
            done.push(cell);
            continue;
        };
        let place = |v: VertexId| cell.iter().position(|corner| corner.vertex == v);
        let [Some(a), Some(b)] = chord.ends.map(place) else {
            return Err(SplitError::LeavesTheSurface { curve: chord.curve, point: 0 });
        };
        let (i, j) = (a.min(b), a.max(b));
        let (mut inner, mut outer) = (Vec::new(), Vec::new());
        for other in chords {
            let places = other.ends.map(place);
            let within = |k: Option<usize>| k.is_some_and(|k| (i..=j).contains(&k));
            let beyond = |k: Option<usize>| k.is_some_and(|k| k <= i || k >= j);
            if places.into_iter().all(within) {
                inner.push(other);
            } else if places.into_iter().all(beyond) {
                outer.push(other);
            } else {
                // The ends of the two alternate round the cell.
                return Err(SplitError::Crossing { curves: [other.curve, chord.curve], face, at });
            }
        }
        let rest = cell[j..].iter().chain(&cell[..=i]).copied().collect();
        waiting.push((rest, outer));
        waiting.push((cell[i..=j].to_vec(), inner));
    }
    Ok(done)
}

/// A convex cell as triangles, the worst of which is as good as can be; none has all corners on one side of the face,
/// unless the cell itself has.
fn triangles(points: &IdVec<Vertex, DVec3>, cell: &[Corner]) -> Vec<[VertexId; 3]> {
    let n = cell.len();
    if n > MOST_CORNERS {
        // A diagonal across splits the cell into two of which neither is a line.
        let half = n / 2;
        if let Some(i) = (0..n).find(|&i| cell[i].sides & cell[(i + half) % n].sides == 0) {
            let turned: Vec<Corner> = cell[i..].iter().chain(&cell[..i]).copied().collect();
            let rest: Vec<Corner> = turned[half..].iter().chain(&turned[..1]).copied().collect();
            return [triangles(points, &turned[..=half]), triangles(points, &rest)].concat();
        }
    }
    let quality = |i: usize, j: usize, k: usize| {
        if cell[i].sides & cell[j].sides & cell[k].sides != 0 {
            return -1.0;
        }
        stretch([i, j, k].map(|c| points[cell[c].vertex]))
    };
    // The best worst triangle of the corners from i to j, and the corner that makes a triangle with both.
    let mut best = vec![(f64::INFINITY, 0); n * n];
    for width in 2..n {
        for i in 0..n - width {
            let j = i + width;
            let choice = (i + 1..j)
                .map(|k| (quality(i, k, j).min(best[i * n + k].0).min(best[k * n + j].0), k))
                .reduce(|a, b| if b.0 > a.0 { b } else { a });
            best[i * n + j] = choice.unwrap_or((f64::INFINITY, 0));
        }
    }
    let mut made = Vec::with_capacity(n.saturating_sub(2));
    let mut waiting = vec![(0, n - 1)];
    while let Some((i, j)) = waiting.pop() {
        if j - i >= 2 {
            let k = best[i * n + j].1;
            made.push([i, k, j].map(|c| cell[c].vertex));
            waiting.extend([(k, j), (i, k)]);
        }
    }
    made
}
