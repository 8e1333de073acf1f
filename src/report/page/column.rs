//! What a mesh can be coloured by: one number, or one name, for each face or vertex.

use rayon::prelude::*;

use crate::mesh::bvh::TriangleBvh;
use crate::mesh::geometry;
use crate::mesh::geometry::triangle_angles;
use crate::mesh::{FaceId, Facet, Soup, Support, Surface};
use crate::metric::quad_shape::quad_shape;
use crate::metric::summary::percentile;
use crate::technique::curvature::{mean_edge, principal_curvatures};
use crate::watch::Watch;

/// How values become colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Ramp {
    /// From bad to good.
    Quality,
    /// From little to much.
    Sequential,
    /// From negative over nothing to positive.
    Diverging,
    /// One colour a name.
    Names,
}

/// Which values stand for several elements that are shown as one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Merge {
    /// The least, because low values are bad.
    Least,
    /// The largest, because high values are bad.
    Largest,
    /// The mean.
    Mean,
}

/// Numbers to colour by.
#[derive(Clone, Debug)]
pub(super) struct Column {
    /// Unique within a mesh.
    pub(super) key: String,
    /// What people call it.
    pub(super) title: String,
    /// Unit, empty for a ratio.
    pub(super) unit: &'static str,
    /// Faces or vertices.
    pub(super) support: Support,
    /// How values become colours.
    pub(super) ramp: Ramp,
    /// Values at the ends of the ramp.
    pub(super) range: [f64; 2],
    /// What stands for several elements.
    pub(super) merge: Merge,
    /// By element; not a number where undefined. For names the index of the name.
    pub(super) values: Vec<f64>,
    /// The names, where values are names.
    pub(super) names: Vec<String>,
}

/// What distances are measured to.
pub(super) struct Reference {
    /// The step.
    pub(super) step: String,
    /// Content hash of its result.
    pub(super) content: String,
    /// Its triangles.
    pub(super) tree: TriangleBvh,
}

/// All columns of a mesh, those of its shape first.
pub(super) fn columns(mesh: &Soup, surface: Option<&Surface>, reference: Option<&Reference>) -> Vec<Column> {
    let mut columns = shape(mesh);
    if let Some(reference) = reference {
        columns.push(distance(mesh, reference));
    }
    columns.extend(regions(mesh));
    columns.extend(fields(mesh));
    let has_curvature = columns.iter().any(|column| column.key.contains("curvature"));
    columns.extend(surface.filter(|_| !has_curvature).and_then(curvature));
    columns
}

fn shape(mesh: &Soup) -> Vec<Column> {
    let of = |facet: &Facet| match facet {
        Facet::Tri(corners) => {
            let corners = corners.map(|v| mesh.points[v]);
            let least = triangle_angles(corners).into_iter().fold(f64::INFINITY, f64::min).to_degrees();
            [geometry::stretch(corners), f64::NAN, geometry::triangle_size(corners), least]
        }
        Facet::Quad(corners) => {
            let quad = quad_shape(corners.map(|v| mesh.points[v]));
            [quad.stretch, quad.scaled_jacobian, quad.longest, quad.min_angle]
        }
    };
    let figures: Vec<[f64; 4]> = mesh.faces.as_slice().par_iter().map(of).collect();
    let column = |index: usize, key: &str, title: &str, unit, ramp, range: Option<[f64; 2]>, merge| {
        let values: Vec<f64> = figures.iter().map(|figures| figures[index]).collect();
        let range = range.unwrap_or_else(|| extent(&values));
        Column { ramp, range, merge, ..face_column(key, title, unit, values) }
    };
    let mut columns = vec![
        column(0, "stretch", "Stretch", "", Ramp::Quality, Some([0.0, 1.0]), Merge::Least),
        column(2, "size", "Size (longest edge)", "length", Ramp::Sequential, None, Merge::Largest),
        column(3, "min-angle", "Least angle", "degrees", Ramp::Quality, Some([0.0, 60.0]), Merge::Least),
    ];
    if mesh.faces.iter().any(|facet| matches!(facet, Facet::Quad(_))) {
        columns[2].range = [0.0, 90.0];
        let jacobian =
            column(1, "scaled-jacobian", "Scaled Jacobian", "", Ramp::Quality, Some([0.0, 1.0]), Merge::Least);
        columns.insert(0, jacobian);
    }
    columns
}

pub(super) fn face_column(key: &str, title: &str, unit: &'static str, values: Vec<f64>) -> Column {
    Column {
        key: key.to_owned(),
        title: title.to_owned(),
        unit,
        support: Support::Face,
        ramp: Ramp::Sequential,
        range: extent(&values),
        merge: Merge::Mean,
        values,
        names: Vec::new(),
    }
}

/// The distance of each vertex to the reference, 0 for a mesh that is the reference itself.
fn distance(mesh: &Soup, reference: &Reference) -> Column {
    let query = |p: &glam::DVec3| reference.tree.closest(*p).map_or(f64::NAN, |closest| closest.distance());
    let values: Vec<f64> = mesh.points.as_slice().par_iter().map(query).collect();
    let largest = values.iter().copied().fold(0.0, f64::max);
    let title = format!("Distance to {}", reference.step);
    Column {
        support: Support::Vertex,
        range: [0.0, largest],
        merge: Merge::Largest,
        ..face_column("distance", &title, "length", values)
    }
}

fn regions(mesh: &Soup) -> Option<Column> {
    let regions = mesh.carried.regions.as_ref()?;
    let values: Vec<f64> = regions.labels.iter().map(|label| f64::from(*label)).collect();
    let names = regions.names.clone();
    Some(Column { ramp: Ramp::Names, names, ..face_column("region", "Region", "", values) })
}

fn fields(mesh: &Soup) -> Vec<Column> {
    let column = |field: &crate::mesh::Field| {
        let values: Vec<f64> = match field.components {
            0 => return None,
            1 => field.values.clone(),
            n => field.values.chunks_exact(n).map(|v| v.iter().map(|x| x * x).sum::<f64>().sqrt()).collect(),
        };
        let support = field.support;
        let (kind, elements) = match support {
            Support::Vertex => ("vertex", mesh.points.len()),
            Support::Face => ("face", mesh.faces.len()),
        };
        if values.len() != elements {
            return None;
        }
        let (ramp, range) = range_of_field(&values);
        let key = format!("field-{kind}-{}", field.name);
        Some(Column { support, ramp, range, ..face_column(&key, &title_of_field(&field.name), "", values) })
    };
    mesh.carried.fields.iter().filter_map(column).collect()
}

/// `fit-radius` as `Fit radius`.
fn title_of_field(name: &str) -> String {
    let words = name.replace(['-', '_'], " ");
    let mut letters = words.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

/// Fields have outliers, so the ramp ends at the second and the 98th percentile.
fn range_of_field(values: &[f64]) -> (Ramp, [f64; 2]) {
    let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let [least, largest] = extent(&finite);
    let (low, high) = (percentile(&finite, 2.0).unwrap_or(0.0), percentile(&finite, 98.0).unwrap_or(0.0));
    let (low, high) = if high > low { (low, high) } else { (least, largest) };
    if low < 0.0 && high > 0.0 {
        let reach = high.max(-low);
        (Ramp::Diverging, [-reach, reach])
    } else {
        (Ramp::Sequential, [low, high])
    }
}

/// The larger principal curvature at each vertex.
fn curvature(surface: &Surface) -> Option<Column> {
    // Larger meshes would make people wait for a colour that few ask for; `features` computes it where it matters.
    const MOST_FACES: usize = 300_000;
    if surface.faces.len() > MOST_FACES {
        return None;
    }
    let radius = 2.0 * mean_edge(surface);
    let all = principal_curvatures(surface, radius, &Watch::default()).ok()?;
    let values: Vec<f64> = all.iter().map(|principal| principal.max.0).collect();
    let (ramp, range) = range_of_field(&values);
    let column = face_column("curvature", "Curvature (largest principal)", "1/length", values);
    Some(Column { support: Support::Vertex, ramp, range, ..column })
}

/// Least and largest finite value.
fn extent(values: &[f64]) -> [f64; 2] {
    let finite = values.iter().copied().filter(|v| v.is_finite());
    let [low, high] = finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)]);
    if low <= high { [low, high] } else { [0.0, 1.0] }
}

/// The triangles of a mesh for distances, quads cut in two.
pub(super) fn tree_of(mesh: &Soup) -> Option<TriangleBvh> {
    let triangles: Vec<[glam::DVec3; 3]> =
        mesh.faces.iter().flat_map(cut).map(|corners| corners.map(|v| mesh.points[v])).collect();
    (!triangles.is_empty()).then(|| TriangleBvh::new(triangles))
}

/// The triangles of a face.
pub(super) fn cut(facet: &Facet) -> impl Iterator<Item = [crate::mesh::VertexId; 3]> + use<> {
    let (first, second) = match *facet {
        Facet::Tri(corners) => (corners, None),
        Facet::Quad([a, b, c, d]) => ([a, b, c], Some([a, c, d])),
    };
    std::iter::once(first).chain(second)
}

/// The corners of a face.
pub(super) fn corners_of(mesh: &Soup, face: FaceId) -> Vec<glam::DVec3> {
    mesh.faces.get(face).map(|facet| facet.corners().iter().map(|&v| mesh.points[v]).collect()).unwrap_or_default()
}
