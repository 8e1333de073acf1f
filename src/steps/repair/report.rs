//! What repair tells: every change counted, every loop and component listed, and why it refused.

use glam::DVec3;
use schemars::JsonSchema;
use serde::Serialize;

use crate::mesh::FaceId;
use crate::metric::number::number_text;
use crate::step::{ElementRef, StepFailure};
use crate::watch::Cancelled;

/// Lists in the statistics end after this many entries; the counts beside them are complete.
pub(super) const LISTED: usize = 100;

/// What repair found and changed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct RepairStats {
    /// Quads that were split into two triangles each.
    pub quads_split: u64,
    /// Vertices merged into another one at exactly the same place.
    pub vertices_merged: u64,
    /// Vertices merged into another one within the weld length.
    pub vertices_welded: u64,
    /// Faces dropped because they had a vertex twice, from the start or after welding.
    pub collapsed_faces: u64,
    /// Faces dropped because another one has the same three vertices.
    pub repeated_faces: u64,
    /// Faces dropped in pairs that looked in opposite directions and enclosed nothing.
    pub cancelled_faces: u64,
    /// Vertices that were put on an open edge they lay beside.
    pub t_junctions: u64,
    /// Vertices of borders beside each other that were joined, or put on the edge across, to close gaps.
    #[serde(skip_serializing_if = "is_zero")]
    pub vertices_zipped: u64,
    /// Edges with more than two faces before welding within a tolerance.
    pub non_manifold_edges_read: u64,
    /// Edges with more than two faces after it: a higher number means that the weld length is too large.
    pub non_manifold_edges_welded: u64,
    /// Rounds of joining and cutting that it took until nothing changed.
    pub rounds: u64,
    /// Edges with more than two faces that were cut.
    pub non_manifold_edges_cut: u64,
    /// Vertices that were cut because more than one fan of faces met there.
    pub vertices_cut: u64,
    /// Copies of vertices made by cutting.
    pub vertex_copies: u64,
    /// Edges split in the middle because another edge runs between the same vertices.
    pub double_edges_split: u64,
    /// Edges cut because their faces cannot agree on a side, as in a Möbius strip.
    pub one_sided_edges_cut: u64,
    /// Faces turned round to agree with their neighbours.
    pub faces_turned: u64,
    /// Closed components turned round as a whole to look outward.
    pub components_turned: u64,
    /// Closed components inside another one: they look inward.
    pub cavities: u64,
    /// Faces found whose height is below a millionth of their longest edge.
    pub degenerate_faces: u64,
    /// Edges collapsed to remove them.
    pub edges_collapsed: u64,
    /// Edges flipped to remove them.
    pub edges_flipped: u64,
    /// Degenerate faces at the border that were taken away.
    pub slivers_dropped: u64,
    /// Degenerate faces that could not be removed without moving the surface too far or tearing it.
    pub degenerate_faces_left: u64,
    /// Boundary loops before filling.
    pub boundary_loops: u64,
    /// The first loops, longest first.
    pub loops: Vec<LoopStats>,
    /// Holes filled.
    pub holes_filled: u64,
    /// Faces added by filling.
    pub faces_filled: u64,
    /// Connected components before the choice of `keep-components`.
    pub components: u64,
    /// Components dropped by that choice.
    pub components_dropped: u64,
    /// The first components, in the order of their faces.
    pub component_list: Vec<ComponentStats>,
    /// Pairs of faces that run through or touch each other in the input.
    pub self_intersections_before: u64,
    /// Pairs of faces that run through or touch each other in the result.
    pub self_intersections: u64,
    /// Those among these pairs that only touch, or lie against each other as touching bodies do.
    #[serde(skip_serializing_if = "is_zero")]
    pub contacts: u64,
    /// Whether there were more pairs than are counted, so that the counts are lower bounds.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub counting_stopped: bool,
    /// The first faces of the result that run through others.
    pub self_intersecting_faces: Vec<u32>,
    /// What removing faces that run through each other did; absent where that was not asked for, or there were none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub removal: Option<RemovalStats>,
    /// What is certain of the result; absent where removing faces that run through each other was not asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub certificate: Option<Certificate>,
    /// How far the surface may have moved outside filled holes at most: a bound, in mesh units.
    pub max_move: f64,
    /// Borders that lie beside each other and are not joined; a run says it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes references")]
fn is_zero(number: &u64) -> bool {
    *number == 0
}

impl RepairStats {
    /// What went without a parameter that asked for it, and holes that were to be filled and are not: the surface is
    /// compared with this one from here on, so that no gate sees it.
    pub(super) fn taken_away(&self) -> Vec<String> {
        let mut said = Vec::new();
        if self.cancelled_faces > 0 {
            let count = self.cancelled_faces;
            said.push(format!("{count} faces that lay on each other back to back and enclosed nothing were dropped"));
        }
        if self.slivers_dropped > 0 {
            said.push(format!("{} faces without height were taken away at borders", self.slivers_dropped));
        }
        let reasons = [
            (LoopFate::FoldsBack, "would fold back, as for the outline of a sheet"),
            (LoopFate::Blocked, "would repeat an edge or a face"),
            (LoopFate::Obstructed, "would run through the surface"),
            (LoopFate::Slit, "would have no area, which a larger weld length closes"),
        ];
        for (fate, reason) in reasons {
            let count = self.loops.iter().filter(|border| border.fate == fate).count();
            if count > 0 {
                let more = if self.boundary_loops as usize > self.loops.len() { "at least " } else { "" };
                said.push(format!("{more}{count} of {} holes stay open: every fill {reason}", self.boundary_loops));
            }
        }
        said
    }

    /// Adds what a further round did to the result of the rounds before.
    pub(super) fn go_on(&mut self, more: Self) {
        self.rounds += more.rounds;
        self.vertices_welded += more.vertices_welded;
        self.collapsed_faces += more.collapsed_faces;
        self.repeated_faces += more.repeated_faces;
        self.cancelled_faces += more.cancelled_faces;
        self.t_junctions += more.t_junctions;
        self.vertices_zipped += more.vertices_zipped;
        self.double_edges_split += more.double_edges_split;
        self.faces_turned += more.faces_turned;
        self.components_turned += more.components_turned;
        self.degenerate_faces = self.degenerate_faces.max(more.degenerate_faces);
        self.edges_collapsed += more.edges_collapsed;
        self.edges_flipped += more.edges_flipped;
        self.slivers_dropped += more.slivers_dropped;
        self.holes_filled += more.holes_filled;
        self.faces_filled += more.faces_filled;
        self.components_dropped += more.components_dropped;
        self.max_move += more.max_move;
        // What a round found and did not change is true of the last one.
        self.vertices_cut = more.vertices_cut;
        self.vertex_copies = more.vertex_copies;
        self.one_sided_edges_cut = more.one_sided_edges_cut;
        self.cavities = more.cavities;
        self.degenerate_faces_left = more.degenerate_faces_left;
    }
}

/// What is certain of a result, beside that it is manifold and oriented.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct Certificate {
    /// Whether it has no border.
    pub closed: bool,
    /// Parts that share no vertex with others.
    pub bodies: u64,
    /// Vertices − edges + faces.
    pub euler_characteristic: i64,
    /// What it encloses; absent where it has a border.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume: Option<f64>,
    /// Pairs of faces that run through each other or overlap, decided exactly; at least as many where counting stopped.
    pub crossing_pairs: u64,
    /// Pairs that only touch.
    pub contacts: u64,
    /// No point of it lies farther from the input than this, but in filled holes; nor a point of the input from it, but
    /// inside of bodies and in what was taken away otherwise.
    pub farthest: f64,
}

/// What removing faces that run through each other did.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct RemovalStats {
    /// Pairs of faces that ran through or touched each other, when all else was repaired.
    pub pairs: u64,
    /// Rounds of cutting and rounding.
    pub rounds: u64,
    /// Faces that met others, or were beside such; of the round with the most.
    pub faces_cut: u64,
    /// Pieces that were inside of bodies, or further ones of those that lie on each other.
    pub pieces_removed: u64,
    /// Their area.
    pub area_removed: f64,
    /// How far a vertex went at most when it was rounded.
    pub largest_move: f64,
    /// Pairs that are left.
    pub pairs_left: u64,
    /// Where the first faces are that still meet others.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub left_at: Vec<[f64; 3]>,
    /// Why removing stopped before its end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stopped: Option<String>,
}

/// A boundary loop.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct LoopStats {
    /// Number of its edges.
    pub edges: u64,
    /// Its length.
    pub length: f64,
    /// The mean of its vertices.
    pub centre: [f64; 3],
    /// What became of it.
    pub fate: LoopFate,
}

/// What became of a boundary loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LoopFate {
    /// It is as it was, because no filling was asked for or it is too long.
    Open,
    /// It was filled.
    Filled,
    /// Every fill would fold back onto the surface, as for the outline of a plate; it is as it was.
    FoldsBack,
    /// Every fill would repeat an edge or a face of the surface; it is as it was.
    Blocked,
    /// Every fill found would run through the surface, or bury an island in the hole; it is as it was.
    Obstructed,
    /// Every fill would have faces without area, as for a slit; it is as it was. A larger weld length closes it.
    Slit,
}

/// A connected component.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct ComponentStats {
    /// Number of its faces.
    pub faces: u64,
    /// Its area.
    pub area: f64,
    /// Whether it has no border.
    pub closed: bool,
    /// Whether it is part of the result.
    pub kept: bool,
}

/// Diagonals between which no product of six lengths that a step computes leaves the range of floats.
pub(super) const SMALLEST: f64 = 1e-30;
/// See [`SMALLEST`].
pub(super) const LARGEST: f64 = 1e30;
/// How many times its extent a part may lie away: beyond, coordinates have less than six digits for its shape.
pub(super) const FARTHEST: f64 = 1e9;

/// Why repair gave no surface.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RepairError {
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// There is nothing to repair.
    #[error("the input has no faces")]
    Empty,
    /// Every face was degenerate or dropped.
    #[error("no face is left: {collapsed} were degenerate, {dropped} belonged to dropped components")]
    NothingLeft {
        /// Degenerate faces.
        collapsed: u64,
        /// Faces of components that `keep-components` dropped.
        dropped: u64,
    },
    /// Every face that is left is degenerate.
    #[error("none of the {faces} faces has an area: all their corners lie on one line, or nearly so")]
    NoArea {
        /// Faces left.
        faces: usize,
    },
    /// Coordinates that products of lengths would overflow or underflow with, or that are too coarse for the shape.
    #[error(
        "the part has an extent of {extent:e} and lies {offset:e} from the origin: computing with that loses its shape \
         (extents from {SMALLEST:e} to {LARGEST:e} can be held, and offsets of up to {FARTHEST:e} times the extent)"
    )]
    BeyondArithmetic {
        /// The diagonal of the bounding box.
        extent: f64,
        /// The largest coordinate.
        offset: f64,
    },
    /// Bodies run through each other.
    #[error(
        "faces run through each other in {pairs} places, along {} in all, more than `crossing-length` = {}: this is no \
         solid, and no finer mesh would keep to the same crossings",
        number_text(*.length),
        number_text(*.longest)
    )]
    RunsThrough {
        /// Pairs of faces.
        pairs: u64,
        /// Length of all intersections.
        length: f64,
        /// The length allowed.
        longest: f64,
        /// The faces that have most in common with others, and the middle of that.
        worst: Vec<(u32, DVec3)>,
    },
    /// A corner names a vertex that does not exist, or a coordinate is not finite.
    #[error("face {face} has a corner that is missing or not finite")]
    BadFace {
        /// The face.
        face: FaceId,
    },
    /// The surface would move too far.
    #[error("the surface would move by up to {moved}, more than `max-move` = {allowed}")]
    MovedTooFar {
        /// The bound on the movement.
        moved: f64,
        /// The bound allowed.
        allowed: f64,
    },
    /// The result is still no manifold.
    #[error("the faces near ({at}) could not be made a manifold")]
    NotManifold {
        /// A face at fault, in the input's numbering.
        face: FaceId,
        /// A corner of it.
        at: DVec3,
    },
}

impl From<RepairError> for StepFailure {
    fn from(error: RepairError) -> Self {
        let message = error.to_string();
        let element = |face: FaceId, at| ElementRef { kind: "face".to_owned(), id: u64::from(face.raw()), at };
        match error {
            RepairError::Cancelled(cancelled) => cancelled.into(),
            RepairError::Empty => Self::bad_input(message).with_help("name a file that holds triangles or quads"),
            RepairError::NothingLeft { .. } => Self::failed(message).with_help("reduce `weld`, or keep all components"),
            RepairError::NoArea { .. } => {
                Self::failed(message).with_help("look at the file in a viewer: it may hold curves written as faces")
            }
            RepairError::BeyondArithmetic { .. } => Self::bad_input(message)
                .with_help("move the part to the origin, and write it in another unit of length"),
            RepairError::RunsThrough { worst, .. } => Self::failed(message)
                .with_help(
                    "join the bodies in the program that made them, or mesh each by itself; \
                     a larger `crossing-length` lets them through, and gates see to it that they cross nowhere else",
                )
                .with_elements(worst.into_iter().map(|(f, at)| element(FaceId::from_raw(f), Some(at))).collect()),
            RepairError::BadFace { face } => Self::bad_input(message).with_elements(vec![element(face, None)]),
            RepairError::MovedTooFar { .. } => Self::failed(message).with_help("reduce `weld`, or raise `max-move`"),
            RepairError::NotManifold { face, at } => Self::failed(message)
                .with_help("look at the faces named, and remove or separate them in the program that made the mesh")
                .with_elements(vec![element(face, Some(at))]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_went_unasked_and_what_stays_open_is_told() {
        let border = |fate| LoopStats { edges: 4, length: 1.0, centre: [0.0; 3], fate };
        let stats = RepairStats {
            cancelled_faces: 2,
            boundary_loops: 3,
            loops: [LoopFate::Filled, LoopFate::Slit, LoopFate::Open].map(border).into(),
            ..RepairStats::default()
        };
        let said = stats.taken_away();
        assert!(said.len() == 2 && said[0].starts_with("2 faces") && said[1].starts_with("1 of 3 holes"), "{said:?}");
        assert_eq!(RepairStats::default().taken_away(), [""; 0]);
    }
}
