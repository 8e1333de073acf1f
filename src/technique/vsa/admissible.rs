//! Regions that a mesher can fill from their borders: each has a border, touches itself nowhere, and on demand is a
//! disk.
//!
//! Whether a region is a disk is a count: `V − E + F` of the closed set of its faces is 1 for a connected region only
//! if it has one border that meets no vertex twice. A vertex met twice is a pinch; it opens when one of the fans there
//! goes to a neighbour, face by face, if neither region's count falls. What that does not mend is cut.

use super::dual::{NONE, euler_characteristic, members};
use super::grow::State;
use super::halve::Halver;
use crate::mesh::id::{FaceId, VertexId};
use crate::mesh::topology::VertexFaces;
use crate::watch::{Cancelled, Watch};

/// Rounds over all pinches; each opens most of those there are.
const PINCH_ROUNDS: usize = 4;

impl State<'_> {
    pub(super) fn make_admissible(&mut self, disk: bool, watch: &Watch) -> Result<(), Cancelled> {
        let at = VertexFaces::new(self.shape.surface());
        for _ in 0..PINCH_ROUNDS {
            watch.check()?;
            if self.open_pinches(&at) == 0 {
                break;
            }
        }
        let mut waiting: Vec<Vec<u32>> = members(&self.labels, self.seeds.len());
        let mut halver = Halver::new(self.shape.surface(), self.dual);
        while let Some(faces) = waiting.pop() {
            watch.check()?;
            let kind = euler_characteristic(self.shape.surface(), &faces);
            let parts = if kind == 1 {
                None
            } else if disk || kind == 2 {
                halver.halve(&faces)
            } else {
                let pinch = self.pinch_of(&faces, &at);
                pinch.and_then(|seeds| halver.between(&faces, seeds)).or_else(|| halver.without_border(&faces))
            };
            if let Some([stays, leaves]) = parts {
                let label = self.seeds.len() as u32;
                self.seeds.push(leaves[0]);
                for &f in &leaves {
                    self.labels[f as usize] = label;
                }
                self.report.cuts += 1;
                waiting.extend([stays, leaves]);
            }
        }
        self.fit();
        Ok(())
    }

    /// The fans of each region at a vertex: runs of its faces that share sides there.
    fn fans(&self, v: VertexId, at: &VertexFaces) -> Vec<(u32, Vec<u32>)> {
        let mut left: Vec<u32> = at.of(v).iter().map(|f| f.raw()).collect();
        let mut fans = Vec::new();
        while let Some(first) = left.pop() {
            let label = self.labels[first as usize];
            let mut fan = vec![first];
            let mut next = 0;
            while let Some(&f) = fan.get(next) {
                next += 1;
                for n in self.dual.all[f as usize] {
                    if let Some(place) = left.iter().position(|&g| g == n && self.labels[g as usize] == label) {
                        fan.push(left.swap_remove(place));
                    }
                }
            }
            fan.sort_unstable();
            fans.push((label, fan));
        }
        fans.sort_by(|a, b| (a.0, a.1.len(), &a.1).cmp(&(b.0, b.1.len(), &b.1)));
        fans
    }

    /// Gives the smaller fans at pinches to neighbours, where that harms nothing; returns how many faces moved.
    fn open_pinches(&mut self, at: &VertexFaces) -> usize {
        let mut moved = 0;
        for v in self.shape.surface().points.ids() {
            // A pinch needs four runs round the vertex, or three and a rim.
            let mut regions: Vec<u32> = at.of(v).iter().map(|f| self.labels[f.index()]).collect();
            regions.dedup();
            if regions.len() < 2 {
                continue;
            }
            let fans = self.fans(v, at);
            for same in fans.chunk_by(|a, b| a.0 == b.0) {
                for (_, fan) in &same[..same.len() - 1] {
                    moved += fan.iter().filter(|&&f| self.move_face(f, at)).count();
                }
            }
        }
        self.report.moved_faces += moved;
        moved
    }

    /// Gives a face to a neighbouring region if its own stays connected and no count falls.
    fn move_face(&mut self, f: u32, at: &VertexFaces) -> bool {
        let own = self.labels[f as usize];
        let sides = self.dual.all[f as usize];
        let shared = |r: u32| sides.iter().filter(|&&n| n != NONE && self.labels[n as usize] == r).count() as i64;
        if shared(own) != 1 {
            return false;
        }
        let met = |r: u32| {
            let other = |g: &FaceId| g.raw() != f && self.labels[g.index()] == r;
            let corners = self.shape.surface().faces[FaceId::from_raw(f)];
            corners.into_iter().filter(|&v| at.of(v).iter().any(other)).count() as i64
        };
        let mut candidates: Vec<u32> =
            self.dual.open[f as usize].into_iter().filter(|&n| n != NONE).map(|n| self.labels[n as usize]).collect();
        candidates.sort_unstable();
        candidates.dedup();
        let fits = |&r: &u32| r != own && shared(r) + 1 == met(r) && met(own) - shared(own) > 0;
        let Some(to) = candidates.into_iter().find(fits) else { return false };
        self.labels[f as usize] = to;
        true
    }

    /// A face of each of two fans of a region at a vertex that it meets twice.
    fn pinch_of(&self, faces: &[u32], at: &VertexFaces) -> Option<[u32; 2]> {
        let label = self.labels[*faces.first()? as usize];
        let corners = faces.iter().flat_map(|&f| self.shape.surface().faces[FaceId::from_raw(f)]);
        let mut border: Vec<VertexId> = corners.collect();
        border.sort_unstable();
        border.dedup();
        border.into_iter().find_map(|v| {
            let fans = self.fans(v, at);
            let mut own = fans.iter().filter(|(r, _)| *r == label);
            Some([own.next()?.1[0], own.next()?.1[0]])
        })
    }
}
