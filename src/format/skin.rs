//! The skin of a volume mesh: the faces that one volume alone has.
//!
//! Corners of tetrahedra, pyramids, wedges and bricks come in the order that Abaqus, Nastran, Gmsh and VTK share: the
//! bottom, then the top above it. Sides are numbered as in Abaqus. A side counts as inner when another volume has the
//! same corners. Faces of the skin keep the order of the file, by element and side, and look outwards, away from the
//! middle of their element.
//!
//! Linear in the number of volumes.

use std::ops::Range;

use glam::DVec3;
use rustc_hash::FxHashMap;

use super::polygon::quad;
use crate::mesh::{Facet, VertexId};

const TETRAHEDRON: &[&[usize]] = &[&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[0, 3, 2]];
const PYRAMID: &[&[usize]] = &[&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]];
const WEDGE: &[&[usize]] = &[&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]];
const BRICK: &[&[usize]] = &[&[0, 3, 2, 1], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[3, 0, 4, 7]];

/// The corners of a volume of so many nodes, of first or second order; 0 where that is not known.
pub(super) fn volume_corners(nodes: usize) -> usize {
    match nodes {
        4 | 10 | 11 => 4,
        5 | 13 | 14 => 5,
        6 | 15 | 18 => 6,
        8 | 20 | 27 => 8,
        _ => 0,
    }
}

/// The sides of a volume of so many corners.
fn sides(corners: usize) -> &'static [&'static [usize]] {
    match corners {
        4 => TETRAHEDRON,
        5 => PYRAMID,
        6 => WEDGE,
        8 => BRICK,
        _ => &[],
    }
}

/// The corners of all volumes of a file, one after another.
#[derive(Debug, Default)]
pub(super) struct Volumes {
    corners: Vec<u32>,
    ends: Vec<usize>,
}

/// The faces of the skin that a volume has, and a bit for each of its sides that is one.
pub(super) type Own = (Range<usize>, u8);

/// The faces of a skin, and which of them each volume has.
type Skin = (Vec<Facet>, Vec<Own>);

impl Volumes {
    /// Adds a volume and gives its number.
    pub(super) fn push(&mut self, corners: &[u32]) -> u32 {
        self.corners.extend_from_slice(corners);
        self.ends.push(self.corners.len());
        self.ends.len() as u32 - 1
    }

    /// The skin; `None` where there is none, or a volume whose sides are not known, so that it would have holes.
    pub(super) fn skin(&self, points: &[DVec3]) -> Option<Skin> {
        if self.all().any(|corners| sides(corners.len()).is_empty()) {
            return None;
        }
        let mut users: FxHashMap<[u32; 4], u32> = FxHashMap::default();
        for corners in self.all() {
            for side in sides(corners.len()) {
                *users.entry(key(corners, side)).or_default() += 1;
            }
        }
        let (mut faces, mut ranges) = (Vec::new(), Vec::with_capacity(self.ends.len()));
        for corners in self.all() {
            let first = faces.len();
            let at = |&corner: &u32| points[corner as usize];
            let middle = corners.iter().map(at).sum::<DVec3>() / corners.len() as f64;
            let mut own = 0;
            for (number, side) in sides(corners.len()).iter().enumerate() {
                // A brick whose corners fall together has sides that are edges.
                let key = key(corners, side);
                if users.get(&key) == Some(&1) && key[2] != u32::MAX {
                    own |= 1 << number;
                    faces.push(outward(side.iter().map(|&i| corners[i]).collect(), middle, points));
                }
            }
            ranges.push((first..faces.len(), own));
        }
        (!faces.is_empty()).then_some((faces, ranges))
    }

    fn all(&self) -> impl Iterator<Item = &[u32]> {
        let begins = std::iter::once(0).chain(self.ends.iter().copied());
        begins.zip(&self.ends).map(|(begin, &end)| &self.corners[begin..end])
    }
}

/// What tells a side from others: its corners in order, each once.
fn key(corners: &[u32], side: &[usize]) -> [u32; 4] {
    let mut own = [u32::MAX; 4];
    for (slot, &corner) in own.iter_mut().zip(side) {
        *slot = corners[corner];
    }
    own.sort_unstable();
    for i in (1..4).rev() {
        if own[i] == own[i - 1] {
            own[i] = u32::MAX;
        }
    }
    own.sort_unstable();
    own
}

/// The face of these corners that looks away from `middle`.
fn outward(mut corners: Vec<u32>, middle: DVec3, points: &[DVec3]) -> Facet {
    let at: Vec<DVec3> = corners.iter().map(|&corner| points[corner as usize]).collect();
    let normal: DVec3 = (0..at.len()).map(|i| (at[i] - middle).cross(at[(i + 1) % at.len()] - middle)).sum();
    let centre = at.iter().sum::<DVec3>() / at.len() as f64;
    if normal.dot(centre - middle) < 0.0 {
        corners.reverse();
    }
    let id = |i: usize| VertexId::from_raw(corners[i]);
    if corners.len() == 3 { Facet::Tri([id(0), id(1), id(2)]) } else { quad([id(0), id(1), id(2), id(3)]) }
}
