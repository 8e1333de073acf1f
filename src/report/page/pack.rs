//! Arrays as short text: small differences, deflated, in base64; equal arrays once.
//!
//! Everything here is lossy on purpose and says how much: coordinates are whole multiples of the longest side of the
//! box / 65535; a column of values keeps at most 255 levels, half of them even in the values and half even in their
//! ranks, with the least and the largest value among them.

use std::collections::BTreeMap;
use std::io::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use glam::DVec3;
use serde::Serialize;

use crate::mesh::geometry::Aabb;

/// The code of an element without a value.
pub(super) const UNDEFINED: u8 = 255;
const MOST_LEVELS: usize = 255;

/// The arrays of a page by name.
#[derive(Clone, Debug, Default)]
pub(super) struct Blobs {
    texts: BTreeMap<String, String>,
}

impl Blobs {
    /// Adds an array and gives its name, which depends on its bytes only.
    pub(super) fn add(&mut self, bytes: &[u8]) -> String {
        let name = format!("b{}", &blake3::hash(bytes).to_hex()[..16]);
        self.texts.entry(name.clone()).or_insert_with(|| {
            let mut encoder = ZlibEncoder::new(Vec::new(), Compression::new(9));
            // Writing to memory cannot fail.
            let _ = encoder.write_all(bytes);
            STANDARD.encode(encoder.finish().unwrap_or_default())
        });
        name
    }

    /// Characters of all arrays.
    pub(super) fn len(&self) -> usize {
        self.texts.values().map(String::len).sum()
    }

    /// Names and texts, in the order of the names.
    pub(super) fn into_texts(self) -> BTreeMap<String, String> {
        self.texts
    }
}

/// Coordinates on a grid.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Grid {
    /// Coordinates of the first grid point.
    pub(super) origin: [f64; 3],
    /// The width of the grid.
    pub(super) step: f64,
}

/// Coordinates as numbers of grid points; per axis all low bytes, then all high bytes of the differences.
pub(super) fn positions(points: &[DVec3]) -> (Grid, Vec<u8>) {
    let bounds = Aabb::of(points.iter().copied());
    let (origin, extent) =
        if bounds.is_empty() { (DVec3::ZERO, 0.0) } else { (bounds.min, (bounds.max - bounds.min).max_element()) };
    let step = if extent > 0.0 { extent / 65_535.0 } else { 1.0 };
    let mut bytes = Vec::with_capacity(6 * points.len());
    for axis in 0..3 {
        let grid = points.iter().map(|p| ((p[axis] - origin[axis]) / step).round() as i32);
        let mut before = 0;
        let differences: Vec<u16> = grid
            .map(|at| {
                // Modulo 2^16 every difference fits, and the reader's sums come out right.
                let difference = (at - before) as i16;
                before = at;
                zigzag(difference)
            })
            .collect();
        bytes.extend(differences.iter().map(|d| *d as u8));
        bytes.extend(differences.iter().map(|d| (d >> 8) as u8));
    }
    (Grid { origin: origin.to_array(), step }, bytes)
}

fn zigzag(difference: i16) -> u16 {
    ((difference << 1) ^ (difference >> 15)) as u16
}

/// Numbers, most of them small, seven bits a byte.
pub(super) fn varints(numbers: impl IntoIterator<Item = u32>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for mut number in numbers {
        while number >= 128 {
            bytes.push(number as u8 | 128);
            number >>= 7;
        }
        bytes.push(number as u8);
    }
    bytes
}

/// Corners of faces whose vertices are numbered by first use: how far each lies below the next new number.
pub(super) fn corners(corners: impl IntoIterator<Item = u32>) -> Vec<u8> {
    let mut next = 0;
    varints(corners.into_iter().map(|corner| {
        let below = next - corner.min(next);
        next = next.max(corner + 1);
        below
    }))
}

/// Pairs of numbers in rising order of the first: differences of the firsts, and of each second to its first.
pub(super) fn pairs(pairs: &[[u32; 2]]) -> Vec<u8> {
    let mut before = 0;
    varints(pairs.iter().flat_map(|&[a, b]| {
        let first = a - before;
        before = a;
        [first, b - a]
    }))
}

/// A column as levels and the number of the level of each element.
pub(super) fn levels(values: &[f64]) -> (Vec<f32>, Vec<u8>) {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let mut levels = sorted.clone();
    levels.dedup();
    if levels.len() > MOST_LEVELS {
        let (least, largest) = (sorted[0], sorted[sorted.len() - 1]);
        let even = (0..=126).map(|i| least + (largest - least) * f64::from(i) / 126.0);
        let ranked = (0..128).map(|i| sorted[(sorted.len() - 1) * i / 127]);
        levels = even.chain(ranked).collect();
        levels.sort_unstable_by(f64::total_cmp);
        levels.dedup();
    }
    let nearest = |value: f64| {
        let above = levels.partition_point(|level| *level < value).min(levels.len() - 1);
        let below = above.saturating_sub(1);
        if value - levels[below] < levels[above] - value { below } else { above }
    };
    let codes = values.iter().map(|v| if v.is_finite() { nearest(*v) as u8 } else { UNDEFINED }).collect();
    (levels.iter().map(|level| *level as f32).collect(), codes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_values_stay_exact_and_many_keep_their_ends() {
        let (few, codes) = levels(&[0.5, f64::NAN, 0.25, 0.5]);
        assert_eq!((few, codes), (vec![0.25, 0.5], vec![1, UNDEFINED, 0, 1]));
        let many: Vec<f64> = (0..10_000).map(|i| f64::from(i) * f64::from(i)).collect();
        let (kept, codes) = levels(&many);
        assert!(kept.len() <= MOST_LEVELS && kept[0] == 0.0 && kept[kept.len() - 1] == 9999.0_f32 * 9999.0);
        let worst = many.iter().zip(&codes).map(|(v, c)| (v - f64::from(kept[*c as usize])).abs()).fold(0.0, f64::max);
        assert!(worst <= 9999.0 * 9999.0 / 252.0 + 1.0, "{worst}");
        assert_eq!(levels(&[]), (vec![], vec![]));
    }

    #[test]
    fn numbers_are_packed_as_the_reader_expects() {
        assert_eq!(varints([0, 127, 128, 300]), [0, 127, 128, 1, 172, 2]);
        assert_eq!(corners([0, 1, 2, 2, 1, 3]), [0, 0, 0, 1, 2, 0]);
        assert_eq!(pairs(&[[1, 4], [3, 5]]), [1, 3, 2, 2]);
        let (grid, bytes) = positions(&[DVec3::new(1.0, 0.0, 0.0), DVec3::new(3.0, 1.0, 0.0)]);
        assert_eq!((grid.origin, grid.step), ([1.0, 0.0, 0.0], 2.0 / 65_535.0));
        // 65535 is -1 modulo 2^16, zigzag 1.
        assert_eq!(&bytes[..4], [0, 1, 0, 0]);
        assert_eq!(bytes.len(), 12);
    }

    #[test]
    fn equal_arrays_are_kept_once() {
        let mut blobs = Blobs::default();
        assert_eq!(blobs.add(b"abc"), blobs.add(b"abc"));
        let length = blobs.len();
        blobs.add(b"abd");
        assert!(blobs.len() > length && blobs.into_texts().len() == 2);
    }
}
