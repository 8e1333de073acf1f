//! Lays the vertices that an element covers flat in the unit square: the rim by length, the inside by Tutte's barycentric
//! map with equal weights. That is where the search for their true parameters begins.

use rustc_hash::FxHashMap;

use super::frame::Frame;
use crate::mesh::VertexId;

/// The vertices inside an element and where they lie in the unit square.
pub(super) fn flatten(frame: &Frame<'_>, element: usize) -> (Vec<VertexId>, Vec<[f64; 2]>) {
    /// Sweeps of overrelaxation; enough for patches of some thousand faces, whose parameters are corrected later anyway.
    const SWEEPS: usize = 120;
    const OVER: f64 = 1.7;
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
    let neighbours: Vec<Vec<usize>> =
        inside.iter().map(|&v| ground.leaving(v).filter_map(|(w, _, _)| place.get(&w).copied()).collect()).collect();
    for _ in 0..SWEEPS {
        for (k, list) in neighbours.iter().enumerate() {
            let n = list.len().max(1) as f64;
            let now = at[on_rim + k];
            let sum = list.iter().fold([0.0; 2], |sum, &w| [sum[0] + at[w][0], sum[1] + at[w][1]]);
            at[on_rim + k] = [0, 1].map(|c| (now[c] + OVER * (sum[c] / n - now[c])).clamp(0.0, 1.0));
        }
    }
    let places = at.split_off(on_rim);
    (inside, places)
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
