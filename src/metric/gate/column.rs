//! Metrics that are the least or the largest of many values: the values, and the elements they belong to.

use super::super::Subject;
use super::super::quad_shape::QuadShape;
use super::{Fault, FaultKind};
use crate::mesh::{FaceId, Soup, VertexId};

/// Which of the values is the metric.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Extreme {
    /// The least one.
    Least,
    /// The largest one.
    Largest,
}

/// The values of a metric, an element each.
pub(super) struct Column {
    pub(super) extreme: Extreme,
    pub(super) kind: FaultKind,
    pub(super) ids: Vec<u32>,
    pub(super) values: Vec<f64>,
}

/// The values of metric `name`; `None` where it is not an extreme.
pub(super) fn column(subject: &Subject<'_>, name: &str) -> Option<Column> {
    use Extreme::{Largest, Least};
    let triangles = |extreme, values: &[f64]| {
        let ids = subject.triangles().faces.iter().map(|f| f.raw()).collect();
        Some(Column { extreme, kind: FaultKind::Face, ids, values: values.to_vec() })
    };
    let quads = |extreme, figure: fn(&QuadShape) -> f64| {
        let ids = subject.quads().faces.iter().map(|f| f.raw()).collect();
        Some(Column { extreme, kind: FaultKind::Face, ids, values: subject.quads().column(figure) })
    };
    match name {
        "min-stretch" => triangles(Least, &subject.triangles().stretch),
        "max-stretch" => triangles(Largest, &subject.triangles().stretch),
        "min-size" => triangles(Least, &subject.triangles().size),
        "max-size" => triangles(Largest, &subject.triangles().size),
        "min-edge" => triangles(Least, &subject.triangles().shortest),
        "min-aspect-ratio" => triangles(Least, &subject.triangles().aspect),
        "max-aspect-ratio" => triangles(Largest, &subject.triangles().aspect),
        "min-angle" => triangles(Least, &subject.triangles().min_angle),
        "max-angle" => triangles(Largest, &subject.triangles().max_angle),
        "min-scaled-jacobian" => quads(Least, |q| q.scaled_jacobian),
        "min-quad-angle" => quads(Least, |q| q.min_angle),
        "max-quad-angle" => quads(Largest, |q| q.max_angle),
        "max-quad-aspect" => quads(Largest, |q| q.aspect),
        "min-warpage" => quads(Least, |q| q.warpage),
        "max-warp-angle" => quads(Largest, |q| q.warp_angle),
        "max-skew" => quads(Largest, |q| q.skew),
        "max-taper" => quads(Largest, |q| q.taper),
        "min-quad-stretch" => quads(Least, |q| q.stretch),
        "min-valence" => Some(valences(subject, Least)),
        "max-valence" => Some(valences(subject, Largest)),
        _ => None,
    }
}

fn valences(subject: &Subject<'_>, extreme: Extreme) -> Column {
    let valence = &subject.topology().valence;
    let ids: Vec<u32> = (0..valence.len() as u32).filter(|&v| valence[v as usize] > 0).collect();
    let values = ids.iter().map(|&v| f64::from(valence[v as usize])).collect();
    Column { extreme, kind: FaultKind::Vertex, ids, values }
}

/// The fault at an element of the mesh.
pub(super) fn fault_at(mesh: &Soup, kind: FaultKind, id: u32, value: f64) -> Fault {
    let at = match kind {
        FaultKind::Face | FaultKind::ReferenceFace => mesh.faces.get(FaceId::from_raw(id)).map(|face| {
            let corners = face.corners();
            corners.iter().map(|&v| mesh.points[v]).sum::<glam::DVec3>() / corners.len() as f64
        }),
        FaultKind::Vertex => mesh.points.get(VertexId::from_raw(id)).copied(),
    };
    Fault { kind, id, at: at.unwrap_or_default().to_array(), value }
}
