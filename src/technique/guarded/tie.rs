//! Edges tied in groups: what is done to one is done to all alike, or to none.
//!
//! The copies of a seam edge are one edge of the model, so that splitting one alone would open the model. They are kept
//! by everything else; tied, they may be split together. Ties pass on to the halves.
//! Cost: O(1) for an edge that is not tied.

use glam::DVec3;
use smallvec::SmallVec;

use super::mesh::GuardedMesh;
use super::refused::Refused;
use super::ties::Copies;
use crate::mesh::carried::SeamId;
use crate::mesh::edit::{SplitPlan, check_split_of_copy, split_copies};
use crate::mesh::halfedge::{HalfedgeMesh, edge_of};
use crate::mesh::{EdgeId, Freedom, VertexId, edge_key};

impl GuardedMesh<'_> {
    /// Ties edges that nothing may change alone: each from the end that corresponds to the first of the others.
    ///
    /// # Errors
    /// Edges that are not there, are tied already, or are kept for another reason than a seam: nothing is tied then.
    pub fn tie(&mut self, copies: &[[VertexId; 2]]) -> Result<(), Refused> {
        for &[a, b] in copies {
            let edge = find_edge(&self.mesh, [a, b])?;
            let is_kept = self.mesh.edge_freedom(edge) == Freedom::Keep;
            if !is_kept || !self.mesh.is_on_seam_only(edge) || self.ties.of([a, b]).is_some() {
                return Err(Refused::Features);
            }
        }
        self.ties.add(copies.iter().copied().collect());
        Ok(())
    }

    /// Ties the copies of each seam edge of which all may be split. Returns how many groups that makes.
    pub fn tie_seams(&mut self) -> usize {
        let mesh = &self.mesh;
        let mut sides: Vec<([SeamId; 2], [VertexId; 2])> = Vec::new();
        for [a, b] in mesh.edges().map(|e| mesh.ends(e)) {
            let (Some(s), Some(t)) = (mesh.seam(a), mesh.seam(b)) else { continue };
            if s != t {
                sides.push(if s < t { ([s, t], [a, b]) } else { ([t, s], [b, a]) });
            }
        }
        sides.sort_unstable();
        let groups: Vec<Copies> = sides
            .chunk_by(|a, b| a.0 == b.0)
            .filter(|same| same.len() > 1)
            .map(|same| same.iter().map(|&(_, ends)| ends).collect())
            .collect();
        groups.into_iter().filter(|copies| self.tie(copies).is_ok()).count()
    }

    /// Splits all copies of a tied edge at the same share of their lengths, where all tests admit the outcome as one
    /// edit; gives the new vertex of `edge`.
    pub(super) fn split_tied(&mut self, group: usize, edge: EdgeId, wish: DVec3) -> Result<VertexId, Refused> {
        let copies = self.ties.copies(group);
        let asked = self.mesh.ends(edge);
        let own = copies.iter().position(|&[a, b]| edge_key(a, b) == edge_key(asked[0], asked[1]));
        let own = own.ok_or(Refused::Topology)?;
        let [p, q] = copies[own].map(|v| self.mesh.point(v));
        let share = (wish - p).dot(q - p) / (q - p).length_squared();
        if !(0.0..=1.0).contains(&share) {
            return Err(Refused::Shape);
        }
        let mut plans: SmallVec<[(SplitPlan, DVec3); 3]> = SmallVec::new();
        for &ends in &copies {
            let [p, q] = ends.map(|v| self.mesh.point(v));
            let plan = check_split_of_copy(&self.mesh, find_edge(&self.mesh, ends)?)?;
            // The same ends give the same point, to the last bit.
            plans.push((plan, p + share * (q - p)));
        }
        self.fill_split(&plans)?;
        self.admit_split()?;
        let made = split_copies(&mut self.mesh, &plans);
        self.follow_split(&made);
        self.ties.halve(group, &made);
        Ok(made[own])
    }
}

fn find_edge(mesh: &HalfedgeMesh, [a, b]: [VertexId; 2]) -> Result<EdgeId, Refused> {
    mesh.find_halfedge(a, b).map(edge_of).ok_or(Refused::Topology)
}

#[cfg(test)]
mod tests {
    use super::super::keeper::Keeper;
    use super::super::limits::{Limits, SizeField};
    use super::super::open::{Setup, open, reference_tree};
    use super::*;
    use crate::mesh::halfedge::tests::surface;
    use crate::mesh::validate::{validate_surface, validate_workshop};
    use crate::mesh::{EdgeMark, LockRules, MarkCause, Surface, resolve_freedom};
    use crate::metric::ToleranceMode;

    /// Three sheets that meet in an edge: one runs through, of the other two one has a rim there.
    fn joint() -> Surface {
        let edge = [[0.0; 3], [1.0, 0.0, 0.0]];
        let points = [edge[0], edge[1], [0.5, 1.0, 0.0], [0.5, -1.0, 0.0], edge[0], edge[1], [0.5, 0.0, 1.0]];
        let mut joint = surface(&points, &[[0, 1, 2], [1, 0, 3], [4, 5, 6]]);
        for (v, seam) in [(0, 0), (4, 0), (1, 1), (5, 1)] {
            joint.carried.seams.insert(VertexId::new(v), SeamId(seam));
        }
        for [a, b] in [[0, 1], [4, 5]] {
            let seam = EdgeMark { freedom: Freedom::Keep, cause: MarkCause::Seam };
            joint.carried.mark(edge_key(VertexId::new(a), VertexId::new(b)), seam);
        }
        joint
    }

    fn limits() -> Limits {
        Limits { min_stretch: 0.1, max_size: SizeField::Uniform(f64::INFINITY), max_valence: 12 }
    }

    #[test]
    fn copies_of_a_seam_edge_are_split_alike_and_again() {
        let joint = joint();
        let freedom = resolve_freedom(&joint, &LockRules::default()).expect("no locks");
        let tree = reference_tree(ToleranceMode::Distance, &joint);
        let (mode, tolerance) = (ToleranceMode::Distance, 0.01);
        let setup = Setup {
            mode,
            tolerance,
            feature_tolerance: tolerance,
            feature_weight: 1.0,
            limits: limits(),
            may_merge_corners: false,
        };
        let mut guarded = open(&joint, &freedom, &joint, &tree, setup).expect("a surface");
        let seam = |guarded: &GuardedMesh<'_>, ends| find_edge(&guarded.mesh, ends).expect("an edge");
        let [a, b] = [VertexId::new(4), VertexId::new(5)];
        let whole = seam(&guarded, [a, b]);
        let wish = DVec3::new(0.3, 0.0, 0.0);
        assert_eq!(guarded.split(whole, wish), Err(Refused::Features), "not alone");
        assert_eq!(guarded.tie_seams(), 1);
        let m = guarded.split(whole, wish).expect("all tests admit it");
        let half = seam(&guarded, [m, b]);
        guarded.split(half, DVec3::new(0.65, 0.0, 0.0)).expect("halves are tied again");
        assert_eq!((guarded.counts().splits, guarded.mesh().face_count()), (4, 9));
        assert_eq!(guarded.certified_distance(tolerance), Some(tolerance));
        assert_eq!(validate_workshop(guarded.mesh()), []);
        let left = guarded.into_mesh().leave().surface;
        assert_eq!(validate_surface(&left), []);
        let seams = &left.carried.seams;
        assert_eq!(seams.len(), 8);
        for (v, id) in seams {
            let same = seams.iter().filter(|(w, other)| *other == id && left.points[**w] == left.points[*v]);
            assert_eq!(same.count(), 2, "one point of the model on both sheets");
        }
        assert_eq!(left.carried.marks.values().filter(|mark| mark.cause == MarkCause::Seam).count(), 6);
    }

    #[test]
    fn what_is_kept_for_another_reason_is_not_tied() {
        let mut joint = joint();
        let [a, b] = [VertexId::new(4), VertexId::new(5)];
        joint.carried.groups.edges.insert("kept".into(), vec![edge_key(a, b)]);
        let keep = ["kept".to_owned()];
        let freedom = resolve_freedom(&joint, &LockRules { keep: &keep, ..LockRules::default() }).expect("a lock");
        let mesh = HalfedgeMesh::new(&joint, &freedom).expect("a surface");
        let mut guarded = GuardedMesh::new(mesh, Keeper::QuadricRms { most: 1.0 }, limits(), 1.0, None);
        assert_eq!(guarded.tie_seams(), 0);
    }
}
