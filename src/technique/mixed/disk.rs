//! Faces that form a disk, while it grows.

use rustc_hash::{FxHashMap, FxHashSet};
use smallvec::SmallVec;

use super::Mixed;
use super::NONE;

/// Faces that are a disk whose rim touches itself nowhere, and within which no vertex and no edge is bound to a curve
/// unless it may go across.
#[derive(Clone, Debug)]
pub struct Disk {
    /// The faces, in the order in which they came.
    pub faces: Vec<u32>,
    inside: FxHashSet<u32>,
    vertices: FxHashSet<u32>,
    /// Whether it may go across curves.
    goes_across: bool,
}

impl Disk {
    /// One face.
    pub fn of(mesh: &Mixed, face: u32) -> Self {
        let vertices = mesh.corners(face).into_iter().collect();
        Self { faces: vec![face], inside: FxHashSet::from_iter([face]), vertices, goes_across: false }
    }

    /// One face of a disk that may go across curves.
    pub fn across(mesh: &Mixed, face: u32) -> Self {
        Self { goes_across: true, ..Self::of(mesh, face) }
    }

    /// Whether a face is one of the disk's.
    pub fn contains(&self, face: u32) -> bool {
        self.inside.contains(&face)
    }

    /// Adds those of the faces that leave it a disk, in their order, until none does. Returns how many it has then.
    pub fn grow(&mut self, mesh: &Mixed, mut ring: Vec<u32>) -> usize {
        loop {
            let before = self.faces.len();
            ring.retain(|f| !self.inside.contains(f));
            for &f in &ring {
                if self.may_add(mesh, f) {
                    self.add(mesh, f);
                }
            }
            if self.faces.len() == before {
                return before;
            }
        }
    }

    /// Adds a face.
    pub fn add(&mut self, mesh: &Mixed, f: u32) {
        if self.inside.insert(f) {
            self.faces.push(f);
            self.vertices.extend(mesh.corners(f));
        }
    }

    /// Whether a face is new and meets the disk in one chain of sides, which has no vertex within that must stay on the
    /// rim.
    pub fn may_add(&self, mesh: &Mixed, f: u32) -> bool {
        if self.inside.contains(&f) {
            return false;
        }
        let sides: SmallVec<[(u32, bool); 4]> = mesh.sides(f).map(|h| (h, self.contains(mesh.face(h ^ 1)))).collect();
        let before = |i: usize| sides[(i + sides.len() - 1) % sides.len()].1;
        let is_one_chain = (0..sides.len()).filter(|&i| sides[i].1 && !before(i)).count() == 1;
        is_one_chain
            && sides.iter().enumerate().all(|(i, &(h, joins))| {
                let v = mesh.origin(h);
                match (before(i), joins) {
                    (false, false) => !self.vertices.contains(&v),
                    _ if self.goes_across => true,
                    (true, true) => mesh.place(v).is_free() && mesh.arc(h) == NONE,
                    (_, joins) => !joins || mesh.arc(h) == NONE,
                }
            })
    }

    /// The vertices of its rim, counter-clockwise from the lowest.
    pub fn rim(&self, mesh: &Mixed) -> Vec<u32> {
        let sides = self.faces.iter().flat_map(|&f| mesh.sides(f));
        let is_rim = |h: &u32| !self.contains(mesh.face(h ^ 1));
        let next: FxHashMap<u32, u32> = sides.filter(is_rim).map(|h| (mesh.origin(h), mesh.target(h))).collect();
        let Some(&start) = next.keys().min() else { return Vec::new() };
        let mut rim = vec![start];
        while let Some(&v) = next.get(&rim[rim.len() - 1]).filter(|&&v| v != start && rim.len() <= next.len()) {
            rim.push(v);
        }
        rim
    }
}
