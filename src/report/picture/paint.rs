//! Triangles on a canvas with a depth buffer.

use glam::DVec3;

/// The colour of edges.
const INK: [f64; 3] = [24.0, 28.0, 36.0];
/// How much ink thin edges take.
const THIN_INK: f64 = 0.55;

/// A triangle to fill.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    /// On the canvas; z grows towards the eye.
    pub(super) corners: [DVec3; 3],
    /// Width of the line along the side opposite to each corner, in samples; 0 for none.
    pub(super) pens: [f64; 3],
    /// The colour, 0 to 255.
    pub(super) colour: [f64; 3],
}

/// Samples with depth.
#[derive(Clone, Debug)]
pub(super) struct Canvas {
    pub(super) width: usize,
    pub(super) height: usize,
    depth: Vec<f32>,
    colour: Vec<[u8; 3]>,
}

impl Canvas {
    pub(super) fn new(width: usize, height: usize) -> Self {
        Self { width, height, depth: vec![f32::NEG_INFINITY; width * height], colour: vec![[0; 3]; width * height] }
    }

    /// Fills a triangle where nothing is nearer.
    pub(super) fn fill(&mut self, patch: &Patch) {
        let [a, b, c] = patch.corners;
        let doubled = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
        if doubled == 0.0 || !doubled.is_finite() {
            return;
        }
        let heights = [(b, c), (c, a), (a, b)].map(|(p, q)| doubled.abs() / (q - p).truncate().length().max(1e-9));
        let range = |low: f64, high: f64, size: usize| {
            (low.floor().max(0.0) as usize)..(high.ceil().clamp(0.0, size as f64) as usize)
        };
        let rows = range(a.y.min(b.y).min(c.y), a.y.max(b.y).max(c.y), self.height);
        let columns = range(a.x.min(b.x).min(c.x), a.x.max(b.x).max(c.x), self.width);
        for row in rows {
            for column in columns.clone() {
                let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
                let weight = |p: DVec3, q: DVec3| ((p.x - x) * (q.y - y) - (p.y - y) * (q.x - x)) / doubled;
                let weights = [weight(b, c), weight(c, a), weight(a, b)];
                if weights.iter().all(|w| *w >= 0.0) {
                    let depth = weights[0] * a.z + weights[1] * b.z + weights[2] * c.z;
                    self.sample(row * self.width + column, depth as f32, inked(patch, weights, heights));
                }
            }
        }
    }

    fn sample(&mut self, index: usize, depth: f32, colour: [f64; 3]) {
        if depth > self.depth[index] {
            self.depth[index] = depth;
            self.colour[index] = colour.map(|c| c.round().clamp(0.0, 255.0) as u8);
        }
    }

    /// Pixels of `samples` by `samples` samples each: red, green, blue and cover.
    pub(super) fn average(&self, samples: usize) -> Vec<u8> {
        let (width, height) = (self.width / samples, self.height / samples);
        let mut pixels = Vec::with_capacity(4 * width * height);
        for row in 0..height {
            for column in 0..width {
                let (mut sum, mut covered) = ([0_u32; 3], 0_u32);
                for index in (0..samples * samples)
                    .map(|s| (row * samples + s / samples) * self.width + column * samples + s % samples)
                    .filter(|index| self.depth[*index] > f32::NEG_INFINITY)
                {
                    covered += 1;
                    (0..3).for_each(|i| sum[i] += u32::from(self.colour[index][i]));
                }
                pixels.extend(sum.map(|total| (total / covered.max(1)) as u8));
                pixels.push((255 * covered / (samples * samples) as u32) as u8);
            }
        }
        pixels
    }
}

/// The colour of a sample: ink where it lies on an edge that is drawn.
fn inked(patch: &Patch, weights: [f64; 3], heights: [f64; 3]) -> [f64; 3] {
    let on_edge = |i: &usize| patch.pens[*i] > 0.0 && weights[*i] * heights[*i] < patch.pens[*i];
    let widest = (0..3).filter(on_edge).map(|i| patch.pens[i]).fold(0.0, f64::max);
    if widest == 0.0 {
        return patch.colour;
    }
    let ink = if widest > 2.0 { 1.0 } else { THIN_INK };
    std::array::from_fn(|i| patch.colour[i] + ink * (INK[i] - patch.colour[i]))
}
