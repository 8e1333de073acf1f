//! Rough quads of an open surface: belts along its borders, cut across.
//!
//! See the step `rough-quads` for the method; this is the part that both of its modes share.

mod attempt;
mod connect;
mod draft;
mod even;
mod mend;
mod sample;
mod spine;
mod strips;
mod walk;

pub use attempt::{Attempt, Narrow, attempt};
pub use strips::Thickness;

use crate::mesh::carried::edge_key;
use crate::mesh::id::Face;
use crate::mesh::{FaceId, IdVec};
use crate::technique::layout::{Ground, Layout, NotADisk, Side, components};
use crate::watch::{Cancelled, Watch};

/// How belts are made and cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeltRules {
    /// How thick belts are.
    pub thickness: Thickness,
    /// How far apart nodes lie on outer loops; mesh units.
    pub interval: f64,
    /// The area that an element made by optimisation may hold; square of the mesh's unit.
    pub largest: f64,
    /// Connectors start where the angle is at least this; degrees.
    pub min_angle: f64,
    /// Which belts come first.
    pub order: Order,
    /// A connector ends at a node within this share of the interval of where its walk arrives, if there is one.
    pub snap: f64,
}

/// In which order belts are cut. A loop between two belts gets its nodes from the one that is cut first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// A belt waits until all beyond its outer loop are cut, so that rows run through from the outside to the holes.
    FromOutside,
    /// From all borders inwards, so that nodes lie evenly on every border.
    FromBorders,
}

/// What was made on the way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BeltReport {
    /// Strips of triangles.
    pub strips: usize,
    /// Belts after merging.
    pub belts: usize,
    /// Connectors laid.
    pub connectors: usize,
}

/// The complex of polygons that the belts give, with the cells that are no disks.
///
/// # Errors
/// The run was interrupted.
pub fn cut_belts<'g>(
    ground: &'g Ground<'g>,
    rules: &BeltRules,
    watch: &Watch,
) -> Result<(Layout<'g>, Vec<NotADisk>, BeltReport), Cancelled> {
    let belts = strips::belts(ground, rules.thickness, mean_edge(ground));
    let (strips, count) = (belts.strips, belts.count);
    let mut draft = draft::Draft::new(ground, belts, rules);
    draft.run(rules.order, watch)?;
    let report = BeltReport { strips, belts: count, connectors: draft.connectors };
    loop {
        let (cell, count) = cells(&draft);
        let (layout, bad) = Layout::new(ground, cell, count, draft.node.clone(), draft.fixed.clone());
        watch.check()?;
        // Each round lays a wall or makes a node, so that there is an end.
        if bad.is_empty() || !draft.mend(&layout.cell, &bad) {
            return Ok((layout, bad, report));
        }
    }
}

/// The mean length of an edge, each counted once a face.
pub fn mean_edge(ground: &Ground<'_>) -> f64 {
    let faces = ground.surface.faces.ids();
    let perimeter = |f| crate::mesh::geometry::side_lengths(ground.surface.corners(f)).iter().sum::<f64>();
    let total = crate::metric::summary::sum(faces.map(perimeter));
    total / (3 * ground.surface.faces.len()).max(1) as f64
}

/// Faces that no wall and no border of a belt divides.
fn cells(draft: &draft::Draft<'_>) -> (IdVec<Face, u32>, usize) {
    let ground = draft.ground;
    let wall = |f: FaceId, g: FaceId| {
        let corner = (0..3).find(|&corner| ground.beyond(Side { face: f, corner }) == Some(g));
        corner.is_some_and(|corner| {
            let side = Side { face: f, corner };
            draft.walls.contains_key(&edge_key(ground.origin(side), ground.target(side)))
        })
    };
    components(&ground.across, |f, g| draft.belts.of[f] == draft.belts.of[g] && !wall(f, g))
}
