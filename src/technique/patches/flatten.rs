//! Lays the vertices that an element covers flat in the unit square: the rim by length, the inside by the barycentric
//! map with mean value weights, which keeps angles about as they are whatever the triangles are like. That is where the
//! search for their true parameters begins.
//!
//! Based on: M. S. Floater. Mean Value Coordinates. CAGD 20, 2003.

use rustc_hash::FxHashMap;

use super::frame::Frame;
use super::solve::Samples;
use crate::mesh::geometry::triangle_area;
use crate::mesh::{FaceId, VertexId};
use crate::technique::layout::Ground;

/// The vertices inside an element, where they lie in the unit square, each with a third of the area around it.
pub(super) fn flatten(frame: &Frame<'_>, element: usize) -> Samples {
    let ground = frame.layout.ground;
    let mut place: FxHashMap<VertexId, usize> = FxHashMap::default();
    let mut at: Vec<[f64; 2]> = Vec::new();
    for (v, uv) in rim(frame, element) {
        place.insert(v, at.len());
        at.push(uv);
    }
    let on_rim = at.len();
    let mut inside: Vec<VertexId> = Vec::new();
    for &v in frame.layout.faces(element as u32).iter().flat_map(|&f| &ground.surface.faces[f]) {
        place.entry(v).or_insert_with(|| {
            inside.push(v);
            at.push([0.5; 2]);
            at.len() - 1
        });
    }
    let rows: Vec<Vec<(usize, f64)>> = inside.iter().map(|&v| mean_values(ground, v, &place)).collect();
    relax(&rows, &mut at, on_rim);
    let area = |f: FaceId| triangle_area(ground.surface.corners(f));
    let around = |&v: &VertexId| ground.faces_at.of(v).iter().map(|&f| area(f)).sum::<f64>() / 3.0;
    let points = inside.iter().map(|&v| ground.point(v)).collect();
    Samples { points, places: at.split_off(on_rim), weights: inside.iter().map(around).collect() }
}

/// The neighbours of a vertex with their mean value weights, which sum to one.
fn mean_values(ground: &Ground<'_>, v: VertexId, place: &FxHashMap<VertexId, usize>) -> Vec<(usize, f64)> {
    /// Of what a face without area would make endless.
    const MOST: f64 = 1e6;
    let half_tangent = |f: FaceId| {
        let corners = ground.surface.faces[f];
        let k = corners.iter().position(|&w| w == v).unwrap_or(0);
        let [a, b] = [1, 2].map(|s| ground.point(corners[(k + s) % 3]) - ground.point(v));
        // tan(x / 2) = (1 - cos x) / sin x, of lengths times the cosine and the sine.
        ((a.length() * b.length() - a.dot(b)) / a.cross(b).length().max(f64::MIN_POSITIVE)).clamp(0.0, MOST)
    };
    let weight = |(w, left, right): (VertexId, FaceId, FaceId)| {
        let length = ground.point(w).distance(ground.point(v)).max(f64::MIN_POSITIVE);
        Some((*place.get(&w)?, (half_tangent(left) + half_tangent(right)) / length))
    };
    let mut row: Vec<(usize, f64)> = ground.leaving(v).filter_map(weight).collect();
    let sum: f64 = row.iter().map(|&(_, w)| w).sum();
    let is_sound = sum > 0.0 && sum.is_finite();
    let count = row.len().max(1) as f64;
    for (_, w) in &mut row {
        *w = if is_sound { *w / sum } else { 1.0 / count };
    }
    row
}

/// Puts every place from `first` on into the mean of its row, by overrelaxation.
fn relax(rows: &[Vec<(usize, f64)>], at: &mut [[f64; 2]], first: usize) {
    const SWEEPS: usize = 1_000;
    /// A sweep that moves nothing farther ends it; parameters are corrected later anyway.
    const STILL: f64 = 1e-6;
    let across = (rows.len() as f64).sqrt() + 2.0;
    // The best factor for a square grid of as many places.
    let over = 2.0 / (1.0 + libm::sin(std::f64::consts::PI / across));
    for _ in 0..SWEEPS {
        let mut moved = 0.0_f64;
        for (k, row) in rows.iter().enumerate() {
            let now = at[first + k];
            let mean = row.iter().fold([0.0; 2], |sum, &(w, a)| [sum[0] + a * at[w][0], sum[1] + a * at[w][1]]);
            let next = [0, 1].map(|c| (now[c] + over * (mean[c] - now[c])).clamp(0.0, 1.0));
            moved = moved.max((next[0] - now[0]).abs()).max((next[1] - now[1]).abs());
            at[first + k] = next;
        }
        if moved < STILL {
            break;
        }
    }
}

/// The vertices of the rim in order with their places; a triangle's last corner lies in the middle of the side v = 1.
fn rim(frame: &Frame<'_>, element: usize) -> Vec<(VertexId, [f64; 2])> {
    let ground = frame.layout.ground;
    let sides = &frame.sides[element];
    let mut all = Vec::new();
    for (k, &(arc, is_along)) in sides.iter().enumerate() {
        let mut path = frame.arcs[arc].path.clone();
        if !is_along {
            path.reverse();
        }
        let mut at = vec![0.0];
        for w in path.windows(2) {
            at.push(at[at.len() - 1] + ground.point(w[0]).distance(ground.point(w[1])));
        }
        let total = at[at.len() - 1].max(f64::MIN_POSITIVE);
        for (&v, s) in path.iter().zip(&at).take(path.len() - 1) {
            let t = s / total;
            let uv = match (k, sides.len()) {
                (0, _) => [t, 0.0],
                (1, _) => [1.0, t],
                (2, 4) => [1.0 - t, 1.0],
                (2, _) if t == 0.0 => [0.5, 1.0],
                _ => [0.0, 1.0 - t],
            };
            all.push((v, uv));
        }
    }
    all
}
