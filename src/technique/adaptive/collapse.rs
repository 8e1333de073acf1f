//! Short edges collapsed.

use glam::DVec3;
use smallvec::SmallVec;

use super::order::scattered;
use super::work::{Care, Corners, Faces, Work, stretch};
use crate::mesh::edit::{CollapsePlan, Placement, check_collapse, collapse};
use crate::mesh::halfedge::{edge_of, twin};
use crate::mesh::{EdgeId, FaceId, Freedom, VertexId};

/// Edges shorter than so many times the size collapse. Less than half of what is split: else the halves would collapse
/// again.
const SHORT: f64 = 0.66;
/// No collapse makes an edge longer than so many times the size.
const LONG: f64 = 1.3;
/// Passes; all but the first look only next to what the one before did.
const PASSES: usize = 24;
/// New faces need not be better than this.
const GOOD: f64 = 0.3;

/// Longer edges, up to so many times the size, collapse where that leaves good faces near the reference, and no edge
/// gets longer than the second.
const COARSE: f64 = 1.3;
const STRETCHED: f64 = 2.0;

/// What the faces of a collapse must reach: a least and a mean stretch.
pub(super) type Comfort = [f64; 2];

impl Work<'_> {
    /// Collapses short edges. Returns how many.
    pub(super) fn collapse_short(&mut self) -> usize {
        let mut done = 0;
        let mut waiting = self.awake_edges();
        for _ in 0..PASSES {
            let mut kept = Vec::new();
            self.collapse_in_turn(&scattered(waiting), SHORT, None, |v| kept.push(v));
            if kept.is_empty() {
                break;
            }
            done += kept.len();
            kept.retain(|&v| self.mesh.vertex_is_live(v));
            waiting = kept.into_iter().flat_map(|v| self.mesh.outgoing(v).map(edge_of)).collect();
            waiting.sort_unstable();
            waiting.dedup();
        }
        self.tally.collapses += done;
        done
    }

    /// Collapses edges up to the size where that leaves faces of this comfort, shortest first.
    pub(super) fn coarsen(&mut self, comfort: Comfort) {
        let part = |work: &Self, e: EdgeId| work.length(e) / work.size_of(e);
        let mut short: Vec<(f64, EdgeId)> = self.awake_edges().into_iter().map(|e| (part(self, e), e)).collect();
        short.retain(|&(part, _)| part < COARSE);
        short.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        let short: Vec<EdgeId> = short.into_iter().map(|(_, e)| e).collect();
        let mut done = 0;
        self.collapse_in_turn(&short, COARSE, Some(comfort), |_| done += 1);
        self.tally.collapses += done;
    }

    /// Collapses those of the edges that are shorter than `part` of their size, as far as the cheap tests admit it.
    /// Tells the vertices that stay.
    fn collapse_in_turn(
        &mut self,
        edges: &[EdgeId],
        part: f64,
        comfort: Option<Comfort>,
        mut tell: impl FnMut(VertexId),
    ) {
        let look = |work: &Self, e: EdgeId| {
            let is_short = work.mesh.edge_is_live(e) && work.length(e) < part * work.size_of(e);
            is_short.then(|| work.plan_collapse(e, comfort)).flatten()
        };
        self.in_turn(edges, Self::near_edge, look, |work, _, (plan, end)| {
            work.collapse_to(&plan, end);
            tell(plan.kept);
        });
    }

    /// The collapse of an edge, and the better of its ends as the place to collapse to.
    fn plan_collapse(&self, e: EdgeId, comfort: Option<Comfort>) -> Option<(CollapsePlan, VertexId)> {
        let plan = check_collapse(&self.mesh, e).ok()?;
        let ends = [plan.kept, plan.removed];
        let is_pinned = ends.iter().any(|v| self.pinned[v.index()]);
        if is_pinned || plan.new_valence(&self.mesh) > self.most_edges(plan.kept) {
            return None;
        }
        let count = if matches!(plan.placement, Placement::Fixed(_)) { 1 } else { 2 };
        let mut best: Option<(f64, VertexId)> = None;
        for &end in &ends[..count] {
            if let Some(least) = self.rate(&plan, self.point(end), comfort)
                && best.is_none_or(|(before, _)| least > before)
            {
                best = Some((least, end));
            }
        }
        best.map(|(_, end)| (plan, end))
    }

    pub(super) fn collapse_to(&mut self, plan: &CollapsePlan, end: VertexId) {
        let (at, foot) = (self.point(end), self.feet[end.index()]);
        collapse(&mut self.mesh, plan, at);
        self.sizing.merged(plan.kept, plan.removed);
        self.feet[plan.kept.index()] = foot;
        self.wake(plan.kept);
    }

    /// The least stretch after a collapse to `at`; `None` where a test refuses it.
    fn rate(&self, plan: &CollapsePlan, at: DVec3, comfort: Option<Comfort>) -> Option<f64> {
        if !self.curve_admits(plan, at) || !self.keeps_lengths(plan, at, comfort.is_some()) {
            return None;
        }
        let mut old: Faces = plan.removed_faces(&self.mesh).into_iter().flatten().collect();
        let mut new: SmallVec<[(FaceId, Corners); 16]> = SmallVec::new();
        for (f, corners) in plan.new_star(&self.mesh) {
            old.push(f);
            new.push((f, corners.map(|v| if v == plan.kept { at } else { self.point(v) })));
        }
        let before = old.iter().map(|&f| self.quality(f)).fold(1.0, f64::min);
        let shapes: SmallVec<[f64; 16]> = new.iter().map(|&(_, corners)| stretch(corners)).collect();
        let least = shapes.iter().copied().fold(f64::INFINITY, f64::min);
        let is_uncomfortable = comfort
            .is_some_and(|[floor, mean]| least < floor || shapes.iter().sum::<f64>() < mean * shapes.len() as f64);
        if is_uncomfortable || least < before.min(GOOD) || new.iter().any(|&(f, corners)| self.folds(f, &old, corners))
        {
            return None;
        }
        let faces: SmallVec<[Corners; 16]> = new.iter().map(|&(_, corners)| corners).collect();
        self.is_near(&old, &faces, plan.kept).then_some(least)
    }

    /// Whether no edge at the merged vertex gets too long.
    fn keeps_lengths(&self, plan: &CollapsePlan, at: DVec3, may_stretch: bool) -> bool {
        let size = self.sizing.at(plan.kept).min(self.sizing.at(plan.removed));
        let most = if self.care == Care::Needles { self.longest_spoke(plan) } else { 0.0 };
        // Past the size there is a hard limit only where it is the same everywhere.
        let factor = if may_stretch && self.rules.size.is_uniform() { STRETCHED } else { LONG };
        let ring = [plan.removed, plan.kept].into_iter().flat_map(|v| self.mesh.neighbours(v));
        ring.filter(|&v| v != plan.kept && v != plan.removed).all(|v| {
            let limit = (0.5 * factor * (size + self.sizing.at(v))).min(self.rules.longest);
            at.distance(self.point(v)) <= limit.max(most)
        })
    }

    /// The longest edge at both ends of the edge that collapses.
    fn longest_spoke(&self, plan: &CollapsePlan) -> f64 {
        let spokes = |v: VertexId| self.mesh.neighbours(v).map(move |w| self.point(v).distance(self.point(w)));
        spokes(plan.kept).chain(spokes(plan.removed)).fold(0.0, f64::max)
    }

    /// Whether the curve through the edge stays near the reference's.
    pub(super) fn curve_admits(&self, plan: &CollapsePlan, at: DVec3) -> bool {
        let edge = edge_of(plan.halfedge);
        if self.mesh.edge_freedom(edge) != Freedom::OnCurve {
            return true;
        }
        let is_curve = |e: EdgeId| e != edge && self.mesh.edge_freedom(e) != Freedom::Free;
        [plan.halfedge, twin(plan.halfedge)].into_iter().all(|h| {
            self.mesh.outgoing_from(h).filter(|&out| is_curve(edge_of(out))).all(|out| {
                let is_unmoved = self.point(self.mesh.origin(out)) == at;
                is_unmoved || self.reference.curves.admit([at, self.point(self.mesh.target(out))])
            })
        })
    }
}
