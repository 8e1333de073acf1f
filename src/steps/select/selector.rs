//! The selectors: which vertices lie inside, which faces face where, which rims are meant.

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Combine, Of, SelectError, SelectParams};
use crate::mesh::geometry::{Aabb, angle};
use crate::mesh::id::{Face, IdVec, Vertex};
use crate::mesh::topology::{EdgeTable, Faces, boundary_loops};
use crate::mesh::{Carried, EdgeKey, FaceId, VertexId, edge_key};
use crate::step::{Angle, Length};

/// A box along the axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
#[schemars(example = Self { min: [0.0; 3], max: [20.0, 20.0, 5.0] })]
pub struct SelectBox {
    /// The corner with the smallest coordinates, in mesh units.
    pub min: [f64; 3],
    /// The corner with the largest coordinates, in mesh units.
    pub max: [f64; 3],
}

/// A ball.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
#[schemars(example = Self { centre: [10.0, 0.0, 0.0], radius: Length::Percent(5.0) })]
pub struct Sphere {
    /// The centre, in mesh units.
    pub centre: [f64; 3],
    /// The radius; percents refer to the diagonal of `from`.
    pub radius: Length,
}

/// A solid cylinder from one point of its axis to another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
#[schemars(example = Self { start: [0.0; 3], end: [0.0, 0.0, 20.0], radius: Length::Absolute(4.0) })]
pub struct Cylinder {
    /// Where the axis begins, in mesh units.
    pub start: [f64; 3],
    /// Where the axis ends, in mesh units.
    pub end: [f64; 3],
    /// The radius; percents refer to the diagonal of `from`.
    pub radius: Length,
}

/// A plane with a thickness.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
#[schemars(example = Self { point: [0.0; 3], normal: [0.0, 0.0, 1.0], distance: Length::Percent(0.1) })]
pub struct Plane {
    /// A point of the plane, in mesh units.
    pub point: [f64; 3],
    /// Its normal, of any length above 0.
    pub normal: [f64; 3],
    /// How far from the plane is still on it. Default 0.001 % of the diagonal of `from`.
    #[serde(default = "thickness")]
    pub distance: Length,
}

fn thickness() -> Length {
    Length::Percent(0.001)
}

/// Directions within an angle of one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
#[schemars(example = Self { direction: [0.0, 0.0, 1.0], angle: Angle(10.0) })]
pub struct NormalCone {
    /// The direction, of any length above 0.
    pub direction: [f64; 3],
    /// How far a face's normal may differ, in degrees. Default 10.
    #[serde(default = "cone")]
    pub angle: Angle,
}

fn cone() -> Angle {
    Angle(10.0)
}

/// Rims of an open surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
#[schemars(example = Self { rank: Some(1) })]
pub struct BoundaryLoop {
    /// Which one, by length: 1 is the longest. Default: all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1))]
    pub rank: Option<usize>,
}

/// The members, of one kind; the other kinds are empty.
pub(super) struct Selection {
    pub(super) faces: Vec<FaceId>,
    pub(super) edges: Vec<EdgeKey>,
    pub(super) vertices: Vec<VertexId>,
    /// How many elements of the kind there are.
    pub(super) elements: usize,
}

impl Selection {
    pub(super) fn len(&self) -> usize {
        self.faces.len() + self.edges.len() + self.vertices.len()
    }
}

/// One selector, evaluated: by the vertices inside, by the faces meant, or by the edges meant.
enum Chosen {
    Vertices(IdVec<Vertex, bool>),
    Faces(IdVec<Face, bool>),
    Rims(Vec<EdgeKey>),
}

pub(super) fn evaluate(
    mesh: &impl Faces,
    points: &IdVec<Vertex, DVec3>,
    carried: &Carried,
    params: &SelectParams,
) -> Result<Selection, SelectError> {
    let chosen = chosen(mesh, points, carried, params)?;
    if chosen.is_empty() {
        return Err(SelectError::NoSelector);
    }
    let faces = || (0..mesh.face_count()).map(FaceId::new);
    let mut selection = Selection { faces: Vec::new(), edges: Vec::new(), vertices: Vec::new(), elements: 0 };
    match params.of {
        Of::Faces => {
            let verdicts: Vec<Vec<bool>> = chosen.iter().map(|c| c.of_faces(mesh)).collect();
            selection.elements = mesh.face_count();
            selection.faces = faces().filter(|f| combined(&verdicts, f.index(), params.combine)).collect();
        }
        Of::Edges => {
            let table = EdgeTable::new(mesh);
            let verdicts: Vec<Vec<bool>> = chosen.iter().map(|c| c.of_edges(&table)).collect();
            selection.elements = table.len();
            let kept = table.keys().enumerate().filter(|(e, _)| combined(&verdicts, e.index(), params.combine));
            selection.edges = kept.map(|(_, &key)| key).collect();
        }
        Of::Vertices => {
            let verdicts: Vec<Vec<bool>> = chosen.iter().map(|c| c.of_vertices(mesh)).collect();
            selection.elements = points.len();
            selection.vertices = points.ids().filter(|v| combined(&verdicts, v.index(), params.combine)).collect();
        }
    }
    Ok(selection)
}

fn combined(verdicts: &[Vec<bool>], element: usize, combine: Combine) -> bool {
    match combine {
        Combine::All => verdicts.iter().all(|v| v[element]),
        Combine::Any => verdicts.iter().any(|v| v[element]),
    }
}

impl Chosen {
    fn of_faces(&self, mesh: &impl Faces) -> Vec<bool> {
        let corners = (0..mesh.face_count()).map(|f| mesh.corners(FaceId::new(f)));
        match self {
            Self::Vertices(inside) => corners.map(|c| c.iter().all(|&v| inside[v])).collect(),
            Self::Faces(meant) => meant.iter().copied().collect(),
            Self::Rims(edges) => corners
                .map(|c| (0..c.len()).any(|k| edges.binary_search(&edge_key(c[k], c[(k + 1) % c.len()])).is_ok()))
                .collect(),
        }
    }

    fn of_edges(&self, table: &EdgeTable) -> Vec<bool> {
        match self {
            Self::Vertices(inside) => table.keys().iter().map(|key| key.iter().all(|&v| inside[v])).collect(),
            Self::Faces(meant) => table.iter().map(|(_, _, sides)| sides.iter().any(|s| meant[s.face])).collect(),
            Self::Rims(edges) => table.keys().iter().map(|key| edges.binary_search(key).is_ok()).collect(),
        }
    }

    fn of_vertices(&self, mesh: &impl Faces) -> Vec<bool> {
        let mut verdict = vec![false; mesh.vertex_count()];
        match self {
            Self::Vertices(inside) => return inside.iter().copied().collect(),
            Self::Faces(meant) => {
                for (f, _) in meant.enumerate().filter(|(_, meant)| **meant) {
                    mesh.corners(f).iter().for_each(|v| verdict[v.index()] = true);
                }
            }
            Self::Rims(edges) => edges.iter().flatten().for_each(|v| verdict[v.index()] = true),
        }
        verdict
    }
}

fn chosen(
    mesh: &impl Faces,
    points: &IdVec<Vertex, DVec3>,
    carried: &Carried,
    params: &SelectParams,
) -> Result<Vec<Chosen>, SelectError> {
    let diagonal = Aabb::of(points.iter().copied()).diagonal();
    let inside = |test: &dyn Fn(DVec3) -> bool| Chosen::Vertices(points.iter().map(|&p| test(p)).collect());
    let mut chosen = Vec::new();
    if let Some(b) = params.in_box {
        let [min, max] = finite("box", [b.min, b.max])?;
        chosen.push(inside(&|p| p.cmpge(min).all() && p.cmple(max).all()));
    }
    if let Some(s) = params.sphere {
        let ([centre], radius) = (finite("sphere", [s.centre])?, s.radius.resolve(diagonal));
        chosen.push(inside(&|p| p.distance(centre) <= radius));
    }
    if let Some(c) = params.cylinder {
        let ([start, end], radius) = (finite("cylinder", [c.start, c.end])?, c.radius.resolve(diagonal));
        let axis = (end - start).try_normalize().ok_or(SelectError::NoDirection("cylinder"))?;
        let length = start.distance(end);
        chosen.push(inside(&|p| {
            let along = (p - start).dot(axis);
            (0.0..=length).contains(&along) && (p - start - along * axis).length() <= radius
        }));
    }
    if let Some(plane) = params.plane {
        let [point, normal] = finite("plane", [plane.point, plane.normal])?;
        let normal = normal.try_normalize().ok_or(SelectError::NoDirection("plane"))?;
        let distance = plane.distance.resolve(diagonal);
        chosen.push(inside(&|p| (p - point).dot(normal).abs() <= distance));
    }
    if let Some(cone) = params.normal {
        let [direction] = finite("normal", [cone.direction])?;
        let direction = direction.try_normalize().ok_or(SelectError::NoDirection("normal"))?;
        chosen.push(Chosen::Faces(facing(mesh, points, direction, cone.angle.radians())));
    }
    if let Some(name) = &params.region {
        chosen.push(Chosen::Faces(in_region(carried, name, mesh.face_count())?));
    }
    if let Some(rims) = params.boundary_loop {
        chosen.push(Chosen::Rims(rim_edges(mesh, points, rims)?));
    }
    Ok(chosen)
}

fn finite<const N: usize>(name: &'static str, vectors: [[f64; 3]; N]) -> Result<[DVec3; N], SelectError> {
    let vectors = vectors.map(DVec3::from_array);
    if vectors.iter().all(|v| v.is_finite()) { Ok(vectors) } else { Err(SelectError::NotFinite(name)) }
}

/// The faces whose normal is within `limit` of `direction`; faces without a normal face nowhere.
fn facing(mesh: &impl Faces, points: &IdVec<Vertex, DVec3>, direction: DVec3, limit: f64) -> IdVec<Face, bool> {
    let faces = |corners: &[VertexId]| {
        // The sum over the sides is the normal of polygons that are not flat, too.
        let at = |k: usize| points[corners[k % corners.len()]] - points[corners[0]];
        let normal: DVec3 = (0..corners.len()).map(|k| at(k).cross(at(k + 1))).sum();
        normal.length_squared() > 0.0 && angle(normal, direction) <= limit
    };
    (0..mesh.face_count()).map(|f| faces(mesh.corners(FaceId::new(f)))).collect()
}

fn in_region(carried: &Carried, name: &str, faces: usize) -> Result<IdVec<Face, bool>, SelectError> {
    let known = carried.regions.as_ref().map_or(&[][..], |regions| &regions.names);
    let label = known.iter().position(|known| known == name);
    let (Some(regions), Some(label)) = (&carried.regions, label) else {
        return Err(SelectError::UnknownRegion { name: name.to_owned(), known: known.to_vec() });
    };
    let is_in = |f| regions.labels.get(FaceId::new(f)).is_some_and(|&l| l as usize == label);
    Ok((0..faces).map(is_in).collect())
}

/// The edges of the rims meant, sorted. Of rims of equal length the one with the lowest vertex comes first.
fn rim_edges(
    mesh: &impl Faces,
    points: &IdVec<Vertex, DVec3>,
    rims: BoundaryLoop,
) -> Result<Vec<EdgeKey>, SelectError> {
    let loops = boundary_loops(&EdgeTable::new(mesh));
    let edges = |rim: &Vec<VertexId>| -> Vec<EdgeKey> {
        (0..rim.len()).map(|k| edge_key(rim[k], rim[(k + 1) % rim.len()])).collect()
    };
    let mut by_length: Vec<(f64, Vec<EdgeKey>)> = loops
        .iter()
        .map(edges)
        .map(|edges| (edges.iter().map(|&[a, b]| points[a].distance(points[b])).sum(), edges))
        .collect();
    by_length.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut chosen: Vec<EdgeKey> = match rims.rank {
        None => by_length.into_iter().flat_map(|(_, edges)| edges).collect(),
        Some(rank) => {
            let found = rank.checked_sub(1).and_then(|k| by_length.get(k));
            let (_, edges) = found.ok_or(SelectError::NoSuchRim { rank, rims: by_length.len() })?;
            edges.clone()
        }
    };
    chosen.sort_unstable();
    Ok(chosen)
}
