//! Cuts a surface into flat regions whose borders follow its shape.
//!
//! # Algorithm
//! Variational shape approximation with barriers, insertion, teleports and cuts into disks; the work is done by
//! [`vsa`]. The borders are chains of mesh edges; `straighten` and `split` smooth them.
//!
//! Based on: D. Cohen-Steiner, P. Alliez, M. Desbrun. Variational shape approximation. ACM SIGGRAPH 2004; R. Miyazaki,
//! K. Harada. Transformation of a closed 3D triangular mesh to a quadrilateral mesh based on feature edges, section
//! 3.1.
//!
//! # Invariants
//! - Points and faces stay as they are.
//! - Every face has a region; each region is connected over edges, has a border, and touches itself at no vertex; with
//!   `disk` each is a disk.
//! - With `barriers` no region crosses a marked edge.
//!
//! # Cost
//! O(iterations · F log F).
//!
//! # Departures
//! The paper inserts a seed wherever a face turns by 60 degrees from its proxy, and so stops at two regions on a cube;
//! marked edges are barriers here, and the angle is 45 degrees. A region is excused the hundredth of its area that
//! turns farther, because on scans some face always does. Of faces that fit alike the nearer one is taken first, which
//! keeps regions of a plane compact.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::topology::EdgeTable;
use crate::mesh::{EdgeMark, Field, Freedom, MarkCause, Regions, Support, Surface, edge_key};
use crate::step::{
    Angle, Artifact, InputDef, Inputs, Locks, OutPort, OutputDef, Port, Produced, Step as StepContract, StepFailure,
};
use crate::technique::arcs::{self, Arcs, arcs};
use crate::technique::vsa::{self, Partition, Rules, Wanted};
use crate::watch::{Cancelled, Watch};

/// The field with the normal of each face's region.
pub const NORMAL_FIELD: &str = "region-normal";

/// Cuts a surface into regions that are each as flat as can be, with borders along the shape.
///
/// Use it after `features`, before `straighten`, `split` and `q-morph`. Regions that the surface had are replaced; to
/// keep them, let `features` mark their borders.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct PartitionParams {
    /// How many regions. Default: as many as `max-angle` needs. Barriers, closed parts and `disk` may force more.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 1_000_000))]
    pub regions: Option<usize>,
    /// Without `regions`: a region gets another seed while more than a hundredth of its area turns from its normal by
    /// more than this angle. Degrees, default 45; the paper's 60 makes fewer and less even regions.
    pub max_angle: Angle,
    /// What makes a face fit a region: `"l21"` (default) compares normals and cuts along the shape, `"l2"` measures
    /// distances from the region's plane.
    pub metric: Metric,
    /// Whether marked edges (features, rims of groups, seams) are barriers that no region crosses. Default true.
    pub barriers: bool,
    /// Whether regions are cut on until each is a disk: connected, with one border that touches itself nowhere.
    /// Default false: then a region may have several borders.
    pub disk: bool,
    /// Most rounds of flooding and fitting after the last insertion. Default 20; usually 8 suffice.
    #[schemars(range(min = 1, max = 1000))]
    pub iterations: usize,
    /// Where the first seeds are; another number gives other regions on smooth shapes. Default 0.
    pub seed: u64,
    /// Whether the borders of regions are marked, so that later steps keep them as they are. Default false, because
    /// `straighten` keeps marked edges as well.
    pub mark_borders: bool,
    /// Whether the normals of the regions go along as the face field `region-normal`. Default true.
    pub proxies: bool,
}

impl Default for PartitionParams {
    fn default() -> Self {
        Self {
            regions: None,
            max_angle: Angle(45.0),
            metric: Metric::L21,
            barriers: true,
            disk: false,
            iterations: 20,
            seed: 0,
            mark_borders: false,
            proxies: true,
        }
    }
}

/// What makes a face fit a region.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Metric {
    /// The squared difference of the normals, times the area.
    #[default]
    L21,
    /// The squared distance from the region's plane, over the area.
    L2,
}

/// How the partition went.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct PartitionStats {
    /// Regions.
    pub regions: usize,
    /// Parts of the surface that barriers separate; there are at least as many regions.
    pub cells: usize,
    /// Borders between two regions, from junction to junction or closed.
    pub arcs: usize,
    /// Where borders end.
    pub junctions: usize,
    /// Rounds of flooding and fitting in all.
    pub iterations: usize,
    /// Whether the last rounds changed the error by less than a thousandth.
    pub settled: bool,
    /// Seeds inserted.
    pub inserted: usize,
    /// Merges with an insertion elsewhere that lowered the error.
    pub teleports: usize,
    /// Merges of regions that are one plane, or small.
    pub merged: usize,
    /// Faces moved across a border to straighten it, or to part a region from itself.
    pub moved_faces: usize,
    /// Cuts that made regions disks, or gave them a border.
    pub cuts: usize,
    /// The error: squared difference of normals times area, or squared distance times area, in mesh units.
    pub error: f64,
    /// The largest angle between the normals of a face and of its region, in degrees.
    pub worst_angle: f64,
    /// Regions that are no disks; 0 with `disk`.
    pub non_disks: usize,
}

/// Partitions `surface`.
///
/// # Errors
/// The run was interrupted.
pub fn partition(
    surface: &Surface,
    params: &PartitionParams,
    watch: &Watch,
) -> Result<(Surface, PartitionStats), Cancelled> {
    let made = vsa::partition(surface, &rules(params), watch)?;
    let network = arcs(surface, &EdgeTable::new(surface), &made.labels);
    let mut result = surface.clone();
    // Curves bound the regions that there were.
    result.carried.curves.clear();
    if params.proxies {
        let values = made.labels.iter().flat_map(|&label| made.proxies[label as usize].normal.to_array()).collect();
        let name = NORMAL_FIELD.to_owned();
        result.carried.set_field(Field { name, support: Support::Face, components: 3, values });
    }
    if params.mark_borders {
        mark(&mut result, &network);
    }
    let stats = stats(&made, &network);
    let names = (1..=made.proxies.len()).map(|number| format!("region-{number}")).collect();
    result.carried.regions = Some(Regions { labels: made.labels, names });
    Ok((result, stats))
}

fn rules(params: &PartitionParams) -> Rules {
    Rules {
        metric: match params.metric {
            Metric::L21 => vsa::Metric::L21,
            Metric::L2 => vsa::Metric::L2,
        },
        wanted: params.regions.map_or(Wanted::Angle(params.max_angle.radians()), Wanted::Regions),
        barriers: params.barriers,
        iterations: params.iterations,
        disk: params.disk,
        seed: params.seed,
    }
}

/// Marks the arcs as curves and pins their junctions.
fn mark(surface: &mut Surface, network: &Arcs) {
    let mark = EdgeMark { freedom: Freedom::OnCurve, cause: MarkCause::RegionBorder };
    for [a, b] in network.arcs.iter().flat_map(arcs::Arc::edges) {
        surface.carried.mark(edge_key(a, b), mark);
    }
    for &v in &network.junctions {
        surface.carried.pin(v, Freedom::Keep);
    }
}

fn stats(made: &Partition, network: &Arcs) -> PartitionStats {
    let report = &made.report;
    PartitionStats {
        regions: made.proxies.len(),
        cells: report.cells,
        arcs: network.arcs.len(),
        junctions: network.junctions.len(),
        iterations: report.iterations,
        settled: report.has_settled,
        inserted: report.inserted,
        teleports: report.teleports,
        merged: report.merged,
        moved_faces: report.moved_faces,
        cuts: report.cuts,
        error: report.error,
        worst_angle: report.worst_angle,
        non_disks: report.non_disks,
    }
}

/// The room's entry in the catalog.
#[derive(Debug)]
pub struct Step;

impl StepContract for Step {
    const NAME: &'static str = "partition";
    const REVISION: u32 = 2;
    const INPUTS: &'static [InputDef] =
        &[InputDef { name: "from", accepts: &[Port::Surface], required: true, doc: "the surface to cut into regions" }];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::Is(Port::Surface), derive: None }];
    const CARRIES: &'static str = "everything but curves; regions are replaced";
    const EXAMPLE: &'static str = "use = \"partition\"\nfrom = \"marked\"\nmax-angle = 45\n";

    type Params = PartitionParams;
    type Stats = PartitionStats;

    fn run(
        inputs: &Inputs,
        _output: &str,
        params: &PartitionParams,
        _locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<PartitionStats>, StepFailure> {
        let surface = inputs.surface("from")?;
        watch.check()?;
        let (result, stats) = partition(surface, params, watch)?;
        Ok(Produced { artifact: Artifact::Surface(Arc::new(result)), stats })
    }
}
