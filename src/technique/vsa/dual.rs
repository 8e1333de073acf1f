//! The faces of a surface as a graph, and how many disks, rings and handles a set of faces is.

use std::collections::BTreeSet;

use crate::mesh::topology::EdgeTable;
use crate::mesh::{FaceId, Surface, VertexId};

/// Stands for "no face" and "no region".
pub(super) const NONE: u32 = u32::MAX;

/// The neighbours of each face; side `k` runs from corner `k` to the next.
pub(super) struct Dual {
    /// Beyond each side, [`NONE`] at rims.
    pub(super) all: Vec<[u32; 3]>,
    /// The same without the sides that regions may not grow across.
    pub(super) open: Vec<[u32; 3]>,
}

impl Dual {
    pub(super) fn new(surface: &Surface, edges: &EdgeTable, barriers: bool) -> Self {
        let mut all = vec![[NONE; 3]; surface.faces.len()];
        for (_, _, sides) in edges.iter() {
            if let [a, b] = sides {
                all[a.face.index()][usize::from(a.side)] = b.face.raw();
                all[b.face.index()][usize::from(b.side)] = a.face.raw();
            }
        }
        let mut open = all.clone();
        if barriers {
            for edge in surface.carried.marks.keys().filter_map(|&key| edges.find(key)) {
                for side in edges.sides(edge) {
                    open[side.face.index()][usize::from(side.side)] = NONE;
                }
            }
        }
        Self { all, open }
    }

    pub(super) fn len(&self) -> usize {
        self.all.len()
    }

    /// The sets of faces that open sides connect, each in order of its faces, sets by their lowest face.
    pub(super) fn cells(&self) -> Vec<Vec<u32>> {
        let mut seen = vec![false; self.len()];
        let mut cells = Vec::new();
        for first in 0..self.len() as u32 {
            if seen[first as usize] {
                continue;
            }
            seen[first as usize] = true;
            let mut members = vec![first];
            let mut at = 0;
            while let Some(&f) = members.get(at) {
                at += 1;
                for n in self.open[f as usize] {
                    if n != NONE && !std::mem::replace(&mut seen[n as usize], true) {
                        members.push(n);
                    }
                }
            }
            members.sort_unstable();
            cells.push(members);
        }
        cells
    }
}

/// `V − E + F` of the closed set of these faces: 1 for a disk that touches itself nowhere, if the set is connected.
pub(super) fn euler_characteristic(surface: &Surface, faces: &[u32]) -> i64 {
    let corners = || faces.iter().map(|&f| surface.faces[FaceId::from_raw(f)]);
    let mut vertices: Vec<u32> = corners().flatten().map(VertexId::raw).collect();
    vertices.sort_unstable();
    vertices.dedup();
    let mut edges: Vec<[u32; 2]> = corners()
        .flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]])
        .map(|[a, b]| [a.raw().min(b.raw()), a.raw().max(b.raw())])
        .collect();
    edges.sort_unstable();
    edges.dedup();
    vertices.len() as i64 - edges.len() as i64 + faces.len() as i64
}

/// The faces of each region, in order.
pub(super) fn members(labels: &[u32], regions: usize) -> Vec<Vec<u32>> {
    let mut members = vec![Vec::new(); regions];
    for (f, &label) in labels.iter().enumerate() {
        members[label as usize].push(f as u32);
    }
    members
}

/// Pairs of regions that share a side which is no barrier, the lower label first.
pub(super) fn adjacent(dual: &Dual, labels: &[u32]) -> BTreeSet<[u32; 2]> {
    let mut pairs = Vec::new();
    for (f, sides) in dual.open.iter().enumerate() {
        let own = labels[f];
        pairs.extend(
            sides.iter().filter(|&&n| n != NONE && labels[n as usize] > own).map(|&n| [own, labels[n as usize]]),
        );
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs.into_iter().collect()
}
