//! Improves the connectivity of a layout: no triangles, four patches round inner nodes, two at smooth borders.
//!
//! Triangles walk through quads along shortest dual paths until two meet and become a quad; then local edits are made
//! and cavities filled anew wherever that lowers the cost: the squared excess of patches at each node, more on borders.
//! This is the objective of the clean-up in advancing-front quad meshing. Every edit is carried out in the mesh at
//! once, so that the layout stays embedded.
//!
//! Based on: P. Kinney. CleanUp: Improving Quadrilateral Finite Element Meshes. 6th International Meshing Roundtable,
//! 1997. S. Owen, M. Staten, S. Canann, S. Saigal. Q-Morph: An Indirect Approach to Advancing Front Quad Meshing.
//! IJNME 44, 1999.

mod cavity;
mod local;
mod relax;
mod triangles;
mod untangle;

use rustc_hash::{FxHashMap, FxHashSet};

use super::Layout;
use super::proposal::Proposal;
use crate::mesh::VertexId;
use crate::watch::{Cancelled, Watch};

/// What optimisation did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OptimiseReport {
    /// Pairs of triangles that met.
    pub pairs: usize,
    /// Nodes put on borders to make the number of their edges even.
    pub parity_nodes: usize,
    /// Local edits.
    pub edits: usize,
    /// Cavities filled anew.
    pub cavities: usize,
}

/// What was tried in vain, and need not be tried again while the cells are the same.
#[derive(Clone, Debug, Default)]
struct Memory {
    /// Proposals that could not be embedded, or not well.
    refused: FxHashSet<Proposal>,
    /// Faces of cavities that may still be filled in vain, so that there is an end on shapes that refuse.
    patience: usize,
    /// New cells may be so large on average; square of the mesh's unit.
    largest: f64,
    /// Nodes with the cells round them when they were last moved to their middle.
    relaxed: FxHashMap<VertexId, Vec<u32>>,
}

/// So many times all faces of the surface may be filled in vain.
const PATIENCE: usize = 12;

/// How many times as large as the first ones the cells of a cavity filled anew may be: what is coarser follows no
/// shape.
const LARGEST: f64 = 2.5;

/// New cells of less quality are refused, unless the old ones were worse.
const LEAST: f64 = 0.03;

/// Makes triangles and quads of all cells. Where the mesh has no room for a cut, nodes move apart before another try;
/// the cells that could not be cut.
///
/// # Errors
/// The run was interrupted.
pub fn polygonise(layout: &mut Layout<'_>, watch: &Watch) -> Result<Vec<u32>, Cancelled> {
    /// What a round does not free needs a finer mesh.
    const ROUNDS: usize = 1;
    watch.phase("cut cells", None);
    let mut stuck = layout.make_polygons();
    for _ in 0..ROUNDS {
        if stuck.is_empty() {
            break;
        }
        layout.relax(1, &mut Memory::default(), watch)?;
        stuck = layout.make_polygons();
    }
    Ok(stuck)
}

/// Optimises a layout of triangles and quads.
///
/// # Errors
/// The run was interrupted.
pub fn optimise(layout: &mut Layout<'_>, watch: &Watch) -> Result<OptimiseReport, Cancelled> {
    /// Later rounds hardly find anything.
    const ROUNDS: usize = 10;
    let mut report = OptimiseReport::default();
    let patience = PATIENCE * layout.ground.surface.faces.len();
    let cells: Vec<f64> = layout.cells().map(|c| layout.area(c).length()).collect();
    let largest = LARGEST * cells.iter().sum::<f64>() / cells.len().max(1) as f64;
    let memory = &mut Memory { patience, largest, ..Memory::default() };
    watch.phase("optimise", Some(ROUNDS as u64));
    layout.relax(1, memory, watch)?;
    for round in 0..ROUNDS {
        let before = report;
        watch.check()?;
        watch.advance(round as u64, || format!("{} edits", report.edits + report.cavities));
        triangles::remove(layout, &mut report, watch)?;
        report.edits += local::improve(layout, memory, watch)?;
        report.cavities += cavity::improve(layout, memory, watch)?;
        layout.relax(1, memory, watch)?;
        if report == before {
            break;
        }
    }
    layout.relax(2, memory, watch)?;
    report.edits += layout.untangle(watch)?;
    Ok(report)
}
