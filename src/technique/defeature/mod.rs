//! Removes small round features: through holes, blind holes and bosses below a diameter.
//!
//! Marked edges cut the surface into patches. A ring of faces between two circles whose normals are perpendicular to
//! its axis is the side of a hole, if they point to the axis, or of a boss; see `cavity` for steps, chamfers and
//! floors. The faces of a feature are taken out, its rims are filled without new vertices by the triangulation of the
//! least bend ([`triangulate_loop`](super::triangulate_loop)), and the fill is refined and improved while its rim stays
//! as it is. A feature is left alone if a lock holds any of its vertices or if its fill would meet something. After a
//! round the marks of vanished rims are gone, so that a boss with a hole is a boss in the next one.
//!
//! When no ring between marks is left, edges that are sharp without a mark cut as well, because marks leave gaps where
//! rims nearly touch; then what lies behind the openings of flat faces is looked at as a whole (see `compound`), which
//! finds bores that cross, and once more with the openings that a rounding has left without a sharp edge. What stays is
//! listed once, by the first search that came upon it; the pieces of bores and bosses that break out at their side come
//! last (see `open_side`).
//!
//! Based on: H. Date, S. Kanai, T. Kishinami, I. Nishigaki, T. Dohi. *High-Quality and Property Controlled Finite
//! Element Mesh Generation From Triangular Meshes using the Multiresolution Technique*, JCISE 5(4), 2005, section
//! 6.3.2. Departure: the paper refines a fill to the mean size of the mesh; where the edges of its rim are shorter, we
//! refine to 1.5 times their mean, because a fan over a fine rim would be all slivers.
//!
//! # Invariants
//! Faces that belong to no removed feature, and all vertices of rims, are identical in the result; the surface stays an
//! oriented manifold; no new self-intersection; a flat rim gets a flat fill.
//!
//! # Cost
//! O(F log F) a round, and O(n³) for a rim of n ≤ 500 edges.

mod cavity;
mod compound;
mod fill;
mod open_side;
mod openings;
mod patches;
mod rebuild;
mod round;
mod surgery;
#[cfg(test)]
mod tests;

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::geometry::triangle_size;
use crate::mesh::id::Face;
use crate::mesh::topology::EdgeTable;
use crate::mesh::{FaceId, FreedomError, IdVec, LockRules, Surface};
use crate::technique::feature::reliable_normals;
use crate::watch::{Cancelled, Watch};
use cavity::{Cavity, Finder, Found};
use compound::Compounds;
use open_side::OpenSides;
use openings::Rims;
use patches::Patches;
use rebuild::rebuild;
use surgery::Surgery;

/// Rounds at most: each removes what the round before has laid open, one storey of a stack of bosses at least.
const MOST_ROUNDS: usize = 100;

/// Sorts of features.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Open at both ends; with counterbores and countersinks.
    ThroughHoles,
    /// With a floor.
    BlindHoles,
    /// Round and standing out.
    Bosses,
}

/// Why something that looks like a feature stays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Reason {
    /// Its diameter is above the limit.
    TooLarge,
    /// One of its steps is above the limit.
    StepTooLarge,
    /// A rim is no circle: a slot, an ellipse, bores that overlap.
    NotRound,
    /// Other features, or the outside, open into its side.
    CutByOthers,
    /// It opens into something above the limit, or is wider inside than at its rims.
    OpensWider,
    /// It lies on the border of an open surface.
    OpenRim,
    /// A lock or a seam holds it.
    Locked,
    /// No fill of its rims does without repeating an edge of the surface or folding back.
    NoFill,
    /// Its fill would meet the surface.
    Obstructed,
}

impl Reason {
    /// Whether the size alone is the reason.
    pub fn is_size(self) -> bool {
        match self {
            Self::TooLarge | Self::StepTooLarge => true,
            Self::NotRound
            | Self::CutByOthers
            | Self::OpensWider
            | Self::OpenRim
            | Self::Locked
            | Self::NoFill
            | Self::Obstructed => false,
        }
    }

    /// Whether the feature is not to be tried again as a part of another one.
    fn is_final(self) -> bool {
        match self {
            Self::StepTooLarge | Self::Locked | Self::NoFill | Self::Obstructed => true,
            Self::TooLarge | Self::NotRound | Self::CutByOthers | Self::OpensWider | Self::OpenRim => false,
        }
    }
}

/// A feature that was removed.
#[derive(Clone, Debug, PartialEq)]
pub struct Removed {
    /// What it was.
    pub kind: Kind,
    /// The middle of its rims' centres.
    pub centre: DVec3,
    /// The direction of its axis.
    pub axis: DVec3,
    /// The diameter of its widest side.
    pub diameter: f64,
    /// Bores that it consisted of: several where they crossed.
    pub bores: usize,
    /// Faces taken out.
    pub faces_removed: usize,
    /// Faces of its fills.
    pub faces_added: usize,
}

/// What looked like a feature and stays.
#[derive(Clone, Debug, PartialEq)]
pub struct Rejected {
    /// The middle of its rims' centres.
    pub centre: DVec3,
    /// The largest diameter of its rims, or of the circles nearest to them; the narrowest width of an opening that is
    /// nowhere near round.
    pub diameter: f64,
    /// Why it stays.
    pub reason: Reason,
}

/// What was done.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// In the order of removal.
    pub removed: Vec<Removed>,
    /// What was left after the last round.
    pub rejected: Vec<Rejected>,
}

/// Why features could not be removed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DefeatureError {
    /// The locks name a group that the surface does not have.
    #[error(transparent)]
    Locks(#[from] FreedomError),
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Removes the features of these kinds up to a diameter; the surface's marks say where faces end.
///
/// # Errors
/// See [`DefeatureError`].
pub fn remove_features(
    surface: &Surface,
    most: f64,
    kinds: &[Kind],
    locks: &LockRules<'_>,
    watch: &Watch,
) -> Result<(Surface, Report), DefeatureError> {
    let sizes: f64 = surface.faces.ids().map(|f| triangle_size(surface.corners(f))).sum();
    let wishes = Wishes { most, kinds, mean_size: sizes / surface.faces.len().max(1) as f64, locks };
    let mut report = Report::default();
    let mut current = surface.clone();
    let mut is_fill = IdVec::filled(false, current.faces.len());
    for _ in 0..MOST_ROUNDS {
        watch.check()?;
        report.rejected.clear();
        let known = IdVec::filled(None, current.faces.len());
        let mut round = Round { surface: &current, wishes, known, is_fill: &mut is_fill, report: &mut report };
        let Some(next) = round.run(watch)? else { break };
        current = next;
    }
    Ok((current, report))
}

/// What is asked for.
#[derive(Clone, Copy)]
struct Wishes<'a> {
    most: f64,
    kinds: &'a [Kind],
    /// The mean size of the surface's faces.
    mean_size: f64,
    locks: &'a LockRules<'a>,
}

/// One search and what it removes.
struct Round<'a> {
    surface: &'a Surface,
    wishes: Wishes<'a>,
    /// Why the feature stays that a face is known to belong to.
    known: IdVec<Face, Option<Reason>>,
    /// What earlier rounds filled in: a fill that bulges is no feature, or it would be replaced for ever.
    is_fill: &'a mut IdVec<Face, bool>,
    report: &'a mut Report,
}

impl Round<'_> {
    /// The surface without what was found first: by marks; by sharp edges, where marks have gaps; behind sharp
    /// openings; behind rounded ones.
    fn run(&mut self, watch: &Watch) -> Result<Option<Surface>, DefeatureError> {
        let Wishes { most, kinds, .. } = self.wishes;
        let edges = EdgeTable::new(self.surface);
        let marked = patches::marked(self.surface, &edges);
        let patches = Patches::new(self.surface, &edges, &marked);
        let found = Finder::new(self.surface, &patches, most).find(kinds);
        if let Some(next) = self.operate(&patches, found, watch)? {
            return Ok(Some(next));
        }
        let normals = reliable_normals(self.surface, &edges);
        let Some(sharp) = patches::sharp(self.surface, &edges, &normals) else { return Ok(None) };
        watch.check()?;
        let patches = Patches::new(self.surface, &edges, &sharp);
        if sharp != marked {
            let found = Finder::new(self.surface, &patches, most).find(kinds);
            if let Some(next) = self.operate(&patches, found, watch)? {
                return Ok(Some(next));
            }
        }
        let compounds = Compounds::new(self.surface, &edges, &normals, &patches, most, Rims::Sharp);
        if let Some(next) = self.operate(&compounds.pieces, compounds.find(kinds), watch)? {
            return Ok(Some(next));
        }
        let flat = Patches::new(self.surface, &edges, &patches::bent(&edges, &normals));
        let compounds = Compounds::new(self.surface, &edges, &normals, &flat, most, Rims::Any);
        if let Some(next) = self.operate(&compounds.pieces, compounds.find(kinds), watch)? {
            return Ok(Some(next));
        }
        for (faces, rejected) in OpenSides::new(self.surface, &edges, &normals, &patches).find(most, kinds) {
            self.reject(&faces, vec![rejected]);
        }
        Ok(None)
    }

    /// Notes what stays and removes the rest; `None` where nothing could be removed.
    fn operate(&mut self, patches: &Patches, found: Found, watch: &Watch) -> Result<Option<Surface>, DefeatureError> {
        for (faces, rejected) in found.rejected {
            self.reject(&faces, vec![rejected]);
        }
        if found.cavities.is_empty() {
            return Ok(None);
        }
        let before = self.report.removed.len();
        let mut surgery = Surgery::new(self.surface, patches, self.wishes.locks)?;
        watch.phase("removing features", Some(found.cavities.len() as u64));
        for (i, cavity) in found.cavities.iter().enumerate() {
            watch.check()?;
            self.take_out(&mut surgery, patches, cavity, watch)?;
            watch.advance(i as u64 + 1, || format!("{} removed", self.report.removed.len()));
        }
        if self.report.removed.len() == before {
            return Ok(None);
        }
        let next = rebuild(self.surface, &surgery.goes, &surgery.fills, &surgery.tree);
        let old = self.surface.faces.ids().filter(|&f| !surgery.goes[f]).map(|f| self.is_fill[f]);
        // What was filled in comes after all faces that stay.
        let is_fill = old.chain(std::iter::repeat(true)).take(next.faces.len()).collect();
        *self.is_fill = is_fill;
        Ok(Some(next))
    }

    /// Removes one feature, or notes why it stays.
    fn take_out(
        &mut self,
        surgery: &mut Surgery<'_>,
        patches: &Patches,
        cavity: &Cavity,
        watch: &Watch,
    ) -> Result<(), Cancelled> {
        let faces: Vec<FaceId> = cavity.patches.iter().flat_map(|&p| &patches.all[p as usize].faces).copied().collect();
        let why = |reason: Reason| {
            let of = |&(centre, diameter): &(DVec3, f64)| Rejected { centre, diameter, reason };
            cavity.bores.iter().map(of).collect::<Vec<_>>()
        };
        if faces.iter().all(|&f| self.is_fill[f]) {
            return Ok(());
        }
        if faces.iter().any(|&f| self.known[f].is_some_and(Reason::is_final)) {
            if cavity.bores.len() > 1 {
                let rest: Vec<FaceId> = faces.into_iter().filter(|&f| self.known[f].is_none()).collect();
                self.reject(&rest, why(Reason::CutByOthers));
            }
            return Ok(());
        }
        match surgery.remove(cavity, self.wishes.mean_size, watch)? {
            Ok(removed) => self.report.removed.push(removed),
            Err(reason) => self.reject(&faces, why(reason)),
        }
        Ok(())
    }

    /// Lists the bores of a feature that stays, unless it is listed already.
    fn reject(&mut self, faces: &[FaceId], bores: Vec<Rejected>) {
        let Some(reason) = bores.first().map(|bore| bore.reason) else { return };
        let is_new = !faces.is_empty() && faces.iter().all(|&f| self.known[f].is_none());
        for &f in faces {
            self.known[f].get_or_insert(reason);
        }
        if is_new {
            self.report.rejected.extend(bores);
        }
    }
}
