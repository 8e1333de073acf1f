//! Edge collapse: two neighbours become one vertex.
//!
//! Topology: the link condition `Lk(i) ∩ Lk(j) = Lk(ij)`, with one virtual vertex joined to every rim edge, on the
//! surface and on the 1-complex of its curves; T. K. Dey, H. Edelsbrunner, S. Guha and D. V. Nekhayev, *Topology
//! preserving edge contraction*, Publications de l'Institut Mathématique, 1999.
//! Freedom: `Keep` vertices neither move nor vanish; an on-curve vertex merges only along an on-curve edge, and the
//! merged vertex stays on that edge; a free vertex merges into anything and takes its place.
//! Invariants: Euler characteristic, rims, curves, kept elements, and at least one element of each group.
//! Cost: O(valence), no allocation below valence 16.

use glam::DVec3;
use smallvec::SmallVec;

use super::Refusal;
use crate::mesh::carried::Freedom;
use crate::mesh::halfedge::{HalfedgeMesh, NONE, edge_of, halfedge_of, twin};
use crate::mesh::id::{EdgeId, FaceId, HalfedgeId, VertexId};

/// Vertices of a star.
pub type Ring = SmallVec<[VertexId; 16]>;

/// Where the merged vertex may lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Placement {
    /// Anywhere.
    Anywhere,
    /// On the edge that collapses, between its ends.
    Segment(DVec3, DVec3),
    /// Here and nowhere else.
    Fixed(DVec3),
}

impl Placement {
    /// The admitted position nearest to `wish`.
    pub fn nearest(&self, wish: DVec3) -> DVec3 {
        match *self {
            Self::Anywhere => wish,
            Self::Fixed(point) => point,
            Self::Segment(a, b) => {
                let along = b - a;
                let length_squared = along.length_squared();
                if length_squared == 0.0 {
                    return a;
                }
                let t = ((wish - a).dot(along) / length_squared).clamp(0.0, 1.0);
                if t == 1.0 { b } else { a + along * t }
            }
        }
    }
}

/// A collapse that topology and freedom admit. Valid until the stars of its ends change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CollapsePlan {
    /// From the vertex that vanishes to the one that stays.
    pub halfedge: HalfedgeId,
    /// The vertex that vanishes.
    pub removed: VertexId,
    /// The vertex that stays: the stricter one, of equals the one on a rim, of equals the lower id.
    pub kept: VertexId,
    /// Where the merged vertex may lie.
    pub placement: Placement,
}

/// Whether the edge may collapse, and how.
///
/// # Errors
/// The first reason against it; cheap reasons first.
pub fn check_collapse(mesh: &HalfedgeMesh, edge: EdgeId) -> Result<CollapsePlan, Refusal> {
    let plan = orient(mesh, edge)?;
    check_link(mesh, plan.halfedge)?;
    check_curves(mesh, plan.halfedge)?;
    check_groups(mesh, plan.halfedge)?;
    Ok(plan)
}

/// Which end vanishes, and where the other may go: decided by freedom.
fn orient(mesh: &HalfedgeMesh, edge: EdgeId) -> Result<CollapsePlan, Refusal> {
    let mut halfedge = halfedge_of(edge);
    let rank = |v: VertexId| (mesh.vertex_freedom(v), mesh.is_boundary_vertex(v), std::cmp::Reverse(v));
    if rank(mesh.origin(halfedge)) > rank(mesh.target(halfedge)) {
        halfedge = twin(halfedge);
    }
    let (removed, kept) = (mesh.origin(halfedge), mesh.target(halfedge));
    let at = mesh.point(kept);
    let along_curve = mesh.edge_freedom(edge) == Freedom::OnCurve;
    let placement = match (mesh.vertex_freedom(removed), mesh.vertex_freedom(kept)) {
        (Freedom::Free, Freedom::Free) => Placement::Anywhere,
        (Freedom::Free, Freedom::OnCurve | Freedom::Keep) => Placement::Fixed(at),
        (Freedom::OnCurve, Freedom::OnCurve) if along_curve => Placement::Segment(mesh.point(removed), at),
        (Freedom::OnCurve, Freedom::Keep) if along_curve => Placement::Fixed(at),
        (Freedom::OnCurve | Freedom::Keep, _) => return Err(Refusal::Freedom { vertex: kept }),
    };
    Ok(CollapsePlan { halfedge, removed, kept, placement })
}

/// The link condition on the surface with the virtual rim vertex.
fn check_link(mesh: &HalfedgeMesh, h: HalfedgeId) -> Result<(), Refusal> {
    let t = twin(h);
    let (i, j) = (mesh.origin(h), mesh.target(h));
    let is_rim_edge = mesh.face(h).is_none() || mesh.face(t).is_none();
    if !is_rim_edge && mesh.is_boundary_vertex(i) && mesh.is_boundary_vertex(j) {
        return Err(Refusal::Boundary);
    }
    let apexes = [mesh.apex(h), mesh.apex(t)];
    let mut ring: Ring = mesh.neighbours(i).collect();
    // Long rings are searched sorted, so that a fan of thousands of faces stays affordable.
    let is_long = ring.len() > 24;
    if is_long {
        ring.sort_unstable();
    }
    for v in mesh.neighbours(j) {
        let is_common = if is_long { ring.binary_search(&v).is_ok() } else { ring.contains(&v) };
        if is_common && !apexes.contains(&Some(v)) {
            return Err(Refusal::LinkCondition { common: v });
        }
    }
    let is_minimal = match apexes {
        // Both apexes joined to both ends by faces: the four faces are a closed tetrahedron.
        [Some(c), Some(d)] => [c, d].iter().any(|&v| !mesh.is_boundary_vertex(v) && mesh.outgoing(v).nth(3).is_none()),
        // Both other sides of the only triangle on the rim: it is alone.
        [Some(_), None] => mesh.face(twin(mesh.next(h))).is_none() && mesh.face(twin(mesh.prev(h))).is_none(),
        [None, Some(_)] => mesh.face(twin(mesh.next(t))).is_none() && mesh.face(twin(mesh.prev(t))).is_none(),
        [None, None] => true,
    };
    if is_minimal { Err(Refusal::FourFaces) } else { Ok(()) }
}

/// The link condition on the curves: of the two edges that become one in a triangle only one may be marked.
fn check_curves(mesh: &HalfedgeMesh, h: HalfedgeId) -> Result<(), Refusal> {
    for side in [h, twin(h)] {
        if mesh.face(side).is_none() {
            continue;
        }
        let edges = [edge_of(mesh.next(side)), edge_of(mesh.prev(side))];
        let is_curve = |e: &EdgeId| mesh.edge_freedom(*e) != Freedom::Free || mesh.edge_mark(*e).is_some();
        if edges.iter().all(is_curve) {
            return Err(Refusal::CurveLink { edge: edges[0] });
        }
    }
    // A closed curve of three sides whose triangle is no face would become a doubled edge; the surface's link condition
    // has refused it, because its third corner is joined to both ends.
    Ok(())
}

/// No group or region may lose its last element.
fn check_groups(mesh: &HalfedgeMesh, h: HalfedgeId) -> Result<(), Refusal> {
    let faces: SmallVec<[u32; 2]> =
        [h, twin(h)].into_iter().filter_map(|s| mesh.face(s)).map(|f| mesh.face_class[f]).collect();
    let vertex = [mesh.vertex_class[mesh.origin(h)]];
    let edge = [mesh.edge_class[edge_of(h)]];
    let vanishes = mesh.face_classes.vanishing(&faces).is_some()
        || mesh.vertex_classes.vanishing(&vertex).is_some()
        || mesh.edge_classes.vanishing(&edge).is_some();
    if vanishes { Err(Refusal::GroupVanishes) } else { Ok(()) }
}

impl CollapsePlan {
    /// The corners of the faces round the merged vertex, each with the face's number; faces of the vanishing vertex
    /// first, both parts clockwise.
    pub fn new_star<'a>(&self, mesh: &'a HalfedgeMesh) -> impl Iterator<Item = (FaceId, [VertexId; 3])> + 'a {
        let h = self.halfedge;
        let kept = self.kept;
        let gone = [mesh.face(h), mesh.face(twin(h))];
        let of_removed = mesh.outgoing_from(h);
        let of_kept = mesh.outgoing_from(twin(h));
        of_removed.chain(of_kept).filter_map(move |out| {
            let face = mesh.face(out)?;
            let next = mesh.next(out);
            (!gone.contains(&Some(face))).then(|| (face, [kept, mesh.origin(next), mesh.target(next)]))
        })
    }

    /// The faces that vanish: one at a rim, else two.
    pub fn removed_faces(&self, mesh: &HalfedgeMesh) -> [Option<FaceId>; 2] {
        [mesh.face(self.halfedge), mesh.face(twin(self.halfedge))]
    }

    /// The corners opposite the edge, whose valence falls by one.
    pub fn apexes(&self, mesh: &HalfedgeMesh) -> [Option<VertexId>; 2] {
        [mesh.apex(self.halfedge), mesh.apex(twin(self.halfedge))]
    }

    /// Fills `ring` with the neighbours of the two ends in order round the edge, without the ends.
    pub fn ring(&self, mesh: &HalfedgeMesh, ring: &mut Ring) {
        ring.clear();
        let apexes = self.apexes(mesh);
        ring.extend(mesh.outgoing_from(self.halfedge).skip(1).map(|out| mesh.target(out)));
        let of_kept = mesh.outgoing_from(twin(self.halfedge)).skip(1).map(|out| mesh.target(out));
        ring.extend(of_kept.filter(|v| !apexes.contains(&Some(*v))));
    }

    /// The valence of the merged vertex.
    pub fn new_valence(&self, mesh: &HalfedgeMesh) -> usize {
        let shared = self.apexes(mesh).iter().flatten().count();
        mesh.valence(self.removed) + mesh.valence(self.kept) - 2 - shared
    }
}

/// Collapses as planned; the merged vertex goes to the admitted position nearest to `wish`, which is returned.
pub fn collapse(mesh: &mut HalfedgeMesh, plan: &CollapsePlan, wish: DVec3) -> DVec3 {
    debug_assert_eq!(check_collapse(mesh, edge_of(plan.halfedge)).as_ref(), Ok(plan), "the plan is out of date");
    let position = plan.placement.nearest(wish);
    mesh.merge_ends(plan.halfedge);
    mesh.points[plan.kept] = position;
    mesh.bump_star(plan.kept);
    position
}

impl HalfedgeMesh {
    /// Merges the origin of `h` into its target.
    fn merge_ends(&mut self, h: HalfedgeId) {
        let t = twin(h);
        let (i, j) = (self.origin(h), self.target(h));
        let first = self.vertex_halfedge(i);
        let mut out = first;
        loop {
            let following = self.next(twin(out));
            self.origin[out] = j.raw();
            out = following;
            if out == first {
                break;
            }
        }
        let sides = [h, t];
        // Neighbouring loops are read before any of them changes.
        let folds = [self.fold(h, true), self.fold(t, false)];
        let rim_before = sides.map(|s| (self.halfedge_face[s] == NONE).then(|| self.prev(s)));
        for (side, before) in sides.into_iter().zip(rim_before) {
            if let Some(before) = before {
                self.next[before] = self.next[side];
            }
        }
        for mut fold in folds.into_iter().flatten() {
            if let (true, Some(before)) = (fold.before == t, rim_before[1]) {
                fold.before = before;
            }
            self.close_fold(fold);
        }
        self.delete_edge(edge_of(h));
        self.delete_vertex(i);
        self.settle_halfedge(j, folds);
    }

    /// What closes the triangle left of `side`, one of whose ends is `removed`'s.
    fn fold(&self, side: HalfedgeId, is_forward: bool) -> Option<Fold> {
        let face = self.face(side)?;
        let (next, prev) = (self.next(side), self.prev(side));
        let (stay, gone) = if is_forward { (next, prev) } else { (prev, next) };
        let outer = twin(gone);
        Some(Fold { face, stay, gone, outer, before: self.prev(outer), is_forward })
    }

    /// Takes the triangle out: its side at the kept vertex replaces the neighbour's side at the other.
    fn close_fold(&mut self, fold: Fold) {
        let Fold { face, stay, gone, outer, before, is_forward } = fold;
        self.next[stay] = self.next[outer];
        self.next[before] = stay.raw();
        self.halfedge_face[stay] = self.halfedge_face[outer];
        if let Some(neighbour) = self.face(stay)
            && self.face_halfedge[neighbour] == outer.raw()
        {
            self.face_halfedge[neighbour] = stay.raw();
        }
        let (dead, alive) = if is_forward { (gone, twin(stay)) } else { (outer, stay) };
        let apex = self.origin(dead);
        if self.vertex_halfedge[apex] == dead.raw() {
            self.vertex_halfedge[apex] = alive.raw();
        }
        self.merge_edge(edge_of(gone), edge_of(stay));
        self.face_classes.remove(self.face_class[face]);
        self.face_halfedge[face] = NONE;
        self.live_faces -= 1;
    }

    /// The edge `stay` takes over what `gone` carries; `gone` is deleted.
    fn merge_edge(&mut self, gone: EdgeId, stay: EdgeId) {
        self.edge_state[stay] = self.edge_state[stay].merge(self.edge_state[gone]);
        let (old, other) = (self.edge_class[stay], self.edge_class[gone]);
        let class = self.edge_classes.union(old, other);
        if class != old {
            self.edge_classes.remove(old);
            self.edge_classes.add(class);
            self.edge_class[stay] = class;
        }
        self.delete_edge(gone);
    }

    fn delete_edge(&mut self, edge: EdgeId) {
        let h = halfedge_of(edge);
        self.edge_classes.remove(self.edge_class[edge]);
        for side in [h, twin(h)] {
            self.origin[side] = NONE;
            self.halfedge_face[side] = NONE;
        }
        self.live_edges -= 1;
    }

    fn delete_vertex(&mut self, v: VertexId) {
        self.vertex_classes.remove(self.vertex_class[v]);
        self.vertex_halfedge[v] = NONE;
        self.bump(v);
        self.live_vertices -= 1;
    }

    /// Gives the merged vertex a live half-edge, the boundary one where there is one.
    fn settle_halfedge(&mut self, v: VertexId, folds: [Option<Fold>; 2]) {
        let Some(fold) = folds.into_iter().flatten().next() else { return };
        let first = if fold.is_forward { fold.stay } else { twin(fold.stay) };
        let rim = self.outgoing_from(first).find(|&out| self.halfedge_face[out] == NONE);
        self.vertex_halfedge[v] = rim.unwrap_or(first).raw();
    }
}

/// A triangle that a collapse takes out.
#[derive(Clone, Copy, Debug)]
struct Fold {
    face: FaceId,
    /// The side that stays, in the triangle.
    stay: HalfedgeId,
    /// The side that goes, in the triangle.
    gone: HalfedgeId,
    /// The twin of the side that goes.
    outer: HalfedgeId,
    /// The half-edge before `outer`.
    before: HalfedgeId,
    /// Whether the triangle lies left of the half-edge from the vanishing vertex to the kept one.
    is_forward: bool,
}
