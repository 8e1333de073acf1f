//! The one edit of connectivity: new faces in the place of old ones.

use smallvec::SmallVec;

use super::journal::Column;
use super::{Corners, Mixed, NONE};

/// A directed edge and the half-edge that is it.
type Directed = (u32, u32, u32);

/// Where a directed edge is, in a list short enough to be searched.
fn position(list: &[Directed], a: u32, b: u32) -> Option<usize> {
    list.iter().position(|&(from, to, _)| from == a && to == b)
}

/// The parts of an edit.
#[derive(Default)]
struct Patch {
    /// Half-edges of old faces that stay: another face is on their other side.
    rim: Vec<Directed>,
    /// Half-edges of old faces on the border of the mesh.
    open: Vec<Directed>,
    /// Half-edges between two old faces.
    inner: Vec<Directed>,
    /// New half-edges that no face has taken yet.
    fresh: Vec<Directed>,
}

impl Mixed {
    /// Puts the faces `new` in the place of `old`; they get the region of the first old face.
    ///
    /// `moved` says that a vertex was replaced by another one, so that curves through it stay curves. Returns the new
    /// faces, or `None` where the new ones do not fit into the gap; then the mesh is left torn, and the transaction
    /// must be rolled back. Vertices that lose all faces die.
    pub fn replace(&mut self, old: &[u32], new: &[Corners], moved: Option<(u32, u32)>) -> Option<SmallVec<[u32; 8]>> {
        let region = self.region(*old.first()?);
        let mut patch = self.patch(old);
        let lost: SmallVec<[u32; 16]> = {
            let mut all: SmallVec<[u32; 16]> = SmallVec::new();
            for &f in old {
                all.extend(self.sides(f).map(|h| self.origin(h)));
            }
            all.sort_unstable();
            all.dedup();
            all
        };
        for &f in old {
            self.set(Column::First, f, NONE);
        }
        let mut made = SmallVec::new();
        for corners in new {
            made.push(self.make_face(corners, region, &mut patch, moved)?);
        }
        if !patch.rim.is_empty() {
            return None;
        }
        let dropped: SmallVec<[Directed; 16]> = patch.inner.iter().copied().collect();
        for (_, _, h) in dropped {
            self.kill_edge(h);
        }
        self.mend_border(&patch)?;
        self.settle(&lost, new);
        Some(made)
    }

    /// Marks the old faces and sorts their sides.
    fn patch(&mut self, old: &[u32]) -> Patch {
        self.epoch += 1;
        for &f in old {
            self.stamps[f as usize] = self.epoch;
        }
        let mut patch = Patch::default();
        for &f in old {
            for h in self.sides(f) {
                let across = self.face(h ^ 1);
                let entry = (self.origin(h), self.target(h), h);
                if across == NONE {
                    patch.open.push(entry);
                } else if self.stamps[across as usize] == self.epoch {
                    patch.inner.push(entry);
                } else {
                    patch.rim.push(entry);
                }
            }
        }
        patch
    }

    fn make_face(&mut self, corners: &[u32], region: u32, patch: &mut Patch, moved: Option<(u32, u32)>) -> Option<u32> {
        let n = corners.len();
        let distinct = (0..n).all(|i| (0..i).all(|j| corners[i] != corners[j]));
        if !(3..=4).contains(&n) || !distinct {
            return None;
        }
        let face = self.add_face(NONE, region);
        let mut sides: SmallVec<[u32; 4]> = SmallVec::new();
        for i in 0..n {
            sides.push(self.take_side(corners[i], corners[(i + 1) % n], patch, moved));
        }
        for i in 0..n {
            self.link(sides[i], sides[(i + 1) % n]);
            self.set(Column::Face, sides[i], face);
        }
        self.set(Column::First, face, sides[0]);
        Some(face)
    }

    /// The half-edge from `a` to `b` for a new face: one that stays, or a new one.
    fn take_side(&mut self, a: u32, b: u32, patch: &mut Patch, moved: Option<(u32, u32)>) -> u32 {
        let lists = [&mut patch.rim, &mut patch.open, &mut patch.fresh];
        let kept = lists.into_iter().find_map(|list| position(list, a, b).map(|at| list.swap_remove(at).2));
        if let Some(h) = kept {
            self.inherit_arc(h, patch, moved);
            return h;
        }
        // An edge between old faces lives on where both its sides are taken again; that is settled by ends alone.
        let arc = self.arc_between(a, b, patch, moved);
        let h = self.add_edge(a, b, arc);
        patch.fresh.push((b, a, h ^ 1));
        h
    }

    /// A curve through a vertex that went may now run along an edge that was there before.
    fn inherit_arc(&mut self, h: u32, patch: &Patch, moved: Option<(u32, u32)>) {
        if moved.is_some() && self.arc(h) == NONE {
            let arc = self.arc_between(self.origin(h), self.target(h), patch, moved);
            if arc != NONE {
                self.set_arc(h, arc);
            }
        }
    }

    /// The curve of the old edge between these vertices, or of the one that `moved` made it from.
    fn arc_between(&self, a: u32, b: u32, patch: &Patch, moved: Option<(u32, u32)>) -> u32 {
        let renamed = |v: u32| match moved {
            Some((from, to)) if v == from => to,
            _ => v,
        };
        for &(p, q, h) in patch.inner.iter().chain(&patch.open) {
            let (p, q) = (renamed(p), renamed(q));
            if ((p, q) == (a, b) || (q, p) == (a, b)) && self.arc(h) != NONE {
                return self.arc(h);
            }
        }
        NONE
    }

    pub(super) fn link(&mut self, a: u32, b: u32) {
        self.set(Column::Next, a, b);
        self.set(Column::Prev, b, a);
    }

    fn kill_edge(&mut self, h: u32) {
        self.set(Column::Origin, h, NONE);
        self.set(Column::Origin, h ^ 1, NONE);
    }

    /// Removes border edges that no new face took, and makes new edges with one face border edges.
    fn mend_border(&mut self, patch: &Patch) -> Option<()> {
        if patch.open.is_empty() && patch.fresh.is_empty() {
            return Some(());
        }
        if patch.open.is_empty() {
            return None;
        }
        let gone: SmallVec<[u32; 8]> = patch.open.iter().map(|&(_, _, h)| h ^ 1).collect();
        // What is left of the border on both sides of the gap: half-edges with the vertex where they end or start.
        let ends: SmallVec<[(u32, u32); 8]> =
            gone.iter().map(|&b| self.prev(b)).filter(|p| !gone.contains(p)).map(|p| (self.target(p), p)).collect();
        let starts: SmallVec<[(u32, u32); 8]> =
            gone.iter().map(|&b| self.next(b)).filter(|n| !gone.contains(n)).map(|n| (self.origin(n), n)).collect();
        for &(_, _, h) in &patch.fresh {
            self.set(Column::Face, h, NONE);
        }
        for &(from, _, h) in &patch.fresh {
            let before = ends.iter().find(|&&(v, _)| v == from).map(|&(_, p)| p);
            let before = before.or_else(|| patch.fresh.iter().find(|&&(_, to, _)| to == from).map(|&(_, _, p)| p))?;
            self.link(before, h);
        }
        for &(v, n) in &starts {
            let before = patch.fresh.iter().find(|&&(_, to, _)| to == v).map(|&(_, _, p)| p);
            let before = before.or_else(|| ends.iter().find(|&&(w, _)| w == v).map(|&(_, p)| p))?;
            self.link(before, n);
        }
        for &(_, _, h) in &patch.open {
            self.kill_edge(h);
        }
        Some(())
    }

    /// Gives the vertices of new faces an outgoing half-edge and buries those that lost all faces.
    fn settle(&mut self, lost: &[u32], new: &[Corners]) {
        for &v in lost {
            let out = self.out(v);
            if out != NONE && self.origin(out) != v {
                self.set(Column::Out, v, NONE);
            }
        }
        let first = self.face_slots() - new.len() as u32;
        for f in first..self.face_slots() {
            let sides: SmallVec<[u32; 4]> = self.sides(f).collect();
            for h in sides {
                let v = self.origin(h);
                if self.out(v) != h {
                    self.set(Column::Out, v, h);
                }
            }
        }
    }
}
