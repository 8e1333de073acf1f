//! What a front is worth as a mesh: thresholds are inherited, fold-over and distance are measured.

use std::collections::BTreeSet;

use schemars::JsonSchema;
use serde::Serialize;

use super::polish::{PolishReport, Shape, polish};
use crate::mesh::geometry::triangle_normal;
use crate::mesh::hierarchy::NodeId;
use crate::mesh::topology::EdgeTable;
use crate::mesh::transfer::inherit_fields;
use crate::mesh::{EdgeKey, Hierarchy, ResolvedFreedom, Surface, VertexId, edge_key};
use crate::metric::distance::{Target, two_sided};
use crate::technique::guarded::{Limits, Recount, SizeField, recount};
use crate::technique::hierarchy::{Front, extract};
use crate::watch::{Cancelled, Watch};

/// Neighbouring faces are folded over where the cosine between their normals is less: 143 degrees.
const FOLDED: f64 = -0.8;

/// An extracted front, measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct FrontReport {
    /// Vertices.
    pub vertices: usize,
    /// Faces.
    pub faces: usize,
    /// Faces of the finest mesh of the hierarchy.
    pub finest_faces: usize,
    /// Least stretch.
    pub min_stretch: f64,
    /// Mean stretch.
    pub mean_stretch: f64,
    /// Longest side, in mesh units.
    pub max_size: f64,
    /// Most edges at a vertex.
    pub max_valence: usize,
    /// Edges whose faces are folded over onto each other, where those of the finest mesh are not.
    pub fold_overs: usize,
    /// Certified upper bound of the two-sided distance to the finest mesh, in mesh units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance_bound: Option<f64>,
    /// What polishing did, where it was asked for; the figures above are those after it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub polish: Option<PolishReport>,
}

/// A hierarchy, measured at its finest end. Thresholds that hold there hold on every front.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct HierarchyReport {
    /// Faces of the finest mesh.
    pub finest_faces: usize,
    /// Faces of the coarsest front.
    pub coarsest_faces: usize,
    /// Least stretch of the finest mesh.
    pub finest_min_stretch: f64,
    /// Mean stretch of the finest mesh.
    pub finest_mean_stretch: f64,
    /// Longest side of the finest mesh, in mesh units.
    pub finest_max_size: f64,
    /// Most edges at a vertex of the finest mesh.
    pub finest_max_valence: usize,
}

impl HierarchyReport {
    /// Measures a hierarchy.
    pub fn of(hierarchy: &Hierarchy) -> Self {
        let counted = shape(&hierarchy.finest);
        Self {
            finest_faces: hierarchy.finest.faces.len(),
            coarsest_faces: Front::coarsest(hierarchy).face_count(),
            finest_min_stretch: counted.min_stretch,
            finest_mean_stretch: counted.mean_stretch,
            finest_max_size: counted.max_size,
            finest_max_valence: counted.max_valence,
        }
    }
}

fn shape(mesh: &Surface) -> Shape {
    let no_limits = Limits { min_stretch: 0.0, max_size: SizeField::Uniform(f64::INFINITY), max_valence: usize::MAX };
    let Recount { min_stretch, mean_stretch, max_size, max_valence, .. } =
        recount(mesh, &ResolvedFreedom::free(mesh), &no_limits);
    Shape { min_stretch, mean_stretch, max_size, max_valence }
}

/// The mesh of a front with the fields of the finest one, polished where asked, and its report.
pub fn extract_measured(
    front: &Front<'_>,
    is_polished: bool,
    watch: &Watch,
) -> Result<(Surface, FrontReport), Cancelled> {
    watch.phase("extract", None);
    let finest = &front.hierarchy().finest;
    let mut mesh = extract(front);
    watch.check()?;
    let (mut counted, mut bound) = (shape(&mesh), distance_bound(&mesh, front, watch)?);
    let mut polished = None;
    if let Some(reach) = bound.filter(|&reach| is_polished && reach > 0.0) {
        watch.phase("polish", None);
        if let Some((better, report)) = polish(&mesh, finest, counted, reach, watch)? {
            (mesh, polished) = (better, Some(report));
            (counted, bound) = (shape(&mesh), distance_bound(&mesh, front, watch)?);
        }
    }
    inherit_fields(finest, &mut mesh);
    let Shape { min_stretch, mean_stretch, max_size, max_valence } = counted;
    let report = FrontReport {
        vertices: mesh.points.len(),
        faces: mesh.faces.len(),
        finest_faces: finest.faces.len(),
        min_stretch,
        mean_stretch,
        max_size,
        max_valence,
        fold_overs: fold_overs(front, &mesh),
        distance_bound: bound,
        polish: polished,
    };
    Ok((mesh, report))
}

/// The certified distance to the finest mesh; 0 for the finest mesh itself.
fn distance_bound(mesh: &Surface, front: &Front<'_>, watch: &Watch) -> Result<Option<f64>, Cancelled> {
    let finest = &front.hierarchy().finest;
    if front.face_count() == finest.faces.len() {
        return Ok(Some(0.0));
    }
    watch.phase("distance to the finest mesh", None);
    Ok(two_sided(&Target::of(&mesh.to_soup()), &Target::of(&finest.to_soup()), watch)?.map(|both| both.upper()))
}

/// Folded edges of the front's mesh that no folded edge of the finest mesh has become.
fn fold_overs(front: &Front<'_>, mesh: &Surface) -> usize {
    let folded = folded_edges(mesh);
    if folded.is_empty() {
        return 0;
    }
    let stands = front.representatives();
    let nodes: Vec<NodeId> = front.nodes().collect();
    let vertex = |v: VertexId| {
        let node = stands[NodeId::from_raw(v.raw())]?;
        nodes.binary_search(&node).ok().map(VertexId::new)
    };
    let known = |[a, b]: EdgeKey| Some(edge_key(vertex(a)?, vertex(b)?));
    let known: BTreeSet<EdgeKey> = folded_edges(&front.hierarchy().finest).into_iter().filter_map(known).collect();
    folded.iter().filter(|key| !known.contains(*key)).count()
}

/// Edges between two faces that lie on each other.
fn folded_edges(surface: &Surface) -> Vec<EdgeKey> {
    let edges = EdgeTable::new(surface);
    let is_folded = |sides: &[crate::mesh::topology::SideRef]| match sides {
        [one, other] => {
            let normal = |face| triangle_normal(surface.corners(face));
            matches!((normal(one.face), normal(other.face)), (Some(m), Some(n)) if m.dot(n) < FOLDED)
        }
        _ => false,
    };
    edges.iter().filter(|(_, _, sides)| is_folded(sides)).map(|(_, key, _)| key).collect()
}
