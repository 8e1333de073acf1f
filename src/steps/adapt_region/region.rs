//! Which vertices of the finest mesh are meant, and the sizes that a field asks for.

use glam::DVec3;

use super::{AdaptRegionError, AdaptRegionParams, RegionName};
use crate::mesh::bvh::TriangleBvh;
use crate::mesh::geometry::Aabb;
use crate::mesh::id::{IdVec, Vertex};
use crate::mesh::{FaceId, Field, Soup, Support, Surface, VertexId};
use crate::metric::distance::Target;
use crate::step::Length;

/// The diagonal that percents refer to.
pub(super) fn diagonal(finest: &Surface) -> f64 {
    Aabb::of(finest.points.iter().copied()).diagonal()
}

/// The vertices in the region; `None` where none is given.
pub(super) fn vertices(
    finest: &Surface,
    params: &AdaptRegionParams,
) -> Result<Option<IdVec<Vertex, bool>>, AdaptRegionError> {
    let AdaptRegionParams { spheres, boxes, half_spaces, groups, regions, points, elements, .. } = params;
    let lists = [spheres.len(), boxes.len(), half_spaces.len(), groups.len(), regions.len()];
    if lists.iter().sum::<usize>() + points.len() + elements.len() == 0 {
        return Ok(None);
    }
    if let Some(value) = params.ratio.filter(|ratio| !(*ratio > 0.0 && *ratio <= 1.0)) {
        return Err(AdaptRegionError::OutOfRange { name: "ratio", range: "above 0, at most 1", value });
    }
    let mut inside = by_place(finest, params)?;
    for f in faces_meant(finest, params)? {
        for v in finest.faces[f] {
            inside[v] = true;
        }
    }
    if !points.is_empty() {
        let tree = TriangleBvh::of_surface(finest);
        for &point in points {
            let p = vector("points", point)?;
            if let Some(v) = nearest_corner(finest, &tree, p) {
                inside[v] = true;
            }
        }
    }
    Ok(Some(inside))
}

fn by_place(finest: &Surface, params: &AdaptRegionParams) -> Result<IdVec<Vertex, bool>, AdaptRegionError> {
    let diagonal = diagonal(finest);
    let mut inside: IdVec<Vertex, bool> = IdVec::filled(false, finest.points.len());
    let mut add = |test: &dyn Fn(DVec3) -> bool| {
        for (is_in, &p) in inside.iter_mut().zip(finest.points.iter()) {
            *is_in |= test(p);
        }
    };
    for ball in &params.spheres {
        let (centre, radius) = (vector("spheres", ball.centre)?, ball.radius.resolve(diagonal));
        add(&|p| p.distance(centre) <= radius);
    }
    for region in &params.boxes {
        let (min, max) = (vector("boxes", region.min)?, vector("boxes", region.max)?);
        add(&|p| p.cmpge(min).all() && p.cmple(max).all());
    }
    for half in &params.half_spaces {
        let (point, normal) = (vector("half-spaces", half.point)?, vector("half-spaces", half.normal)?);
        let normal = normal.try_normalize().ok_or(AdaptRegionError::BadVector("half-spaces"))?;
        add(&|p| (p - point).dot(normal) >= 0.0);
    }
    Ok(inside)
}

fn vector(name: &'static str, coordinates: [f64; 3]) -> Result<DVec3, AdaptRegionError> {
    let vector = DVec3::from_array(coordinates);
    if vector.is_finite() { Ok(vector) } else { Err(AdaptRegionError::BadVector(name)) }
}

/// Faces of the groups, regions and elements named.
fn faces_meant(finest: &Surface, params: &AdaptRegionParams) -> Result<Vec<FaceId>, AdaptRegionError> {
    let mut meant = Vec::new();
    let known = &finest.carried.groups.faces;
    for name in &params.groups {
        let members = known.get(name).ok_or_else(|| AdaptRegionError::Unknown {
            kind: "face group",
            name: name.clone(),
            known: list(known.keys()),
        })?;
        meant.extend(members.iter().copied().filter(|f| f.index() < finest.faces.len()));
    }
    for region in &params.regions {
        let regions = finest.carried.regions.as_ref();
        let names = regions.map_or(&[][..], |regions| &regions.names);
        let (label, name) = match region {
            RegionName::Number(number) => (Some(*number as usize), number.to_string()),
            RegionName::Name(name) => {
                (names.iter().position(|known| known == name).or_else(|| name.parse().ok()), name.clone())
            }
        };
        let members: Vec<FaceId> = match (regions, label) {
            (Some(regions), Some(label)) => {
                let labels = regions.labels.enumerate().take(finest.faces.len());
                labels.filter(|(_, l)| **l as usize == label).map(|(f, _)| f).collect()
            }
            _ => Vec::new(),
        };
        if members.is_empty() {
            let known = list(names.iter());
            return Err(AdaptRegionError::Unknown { kind: "region", name, known });
        }
        meant.extend(members);
    }
    for &face in &params.elements {
        let faces = finest.faces.len();
        if face as usize >= faces {
            return Err(AdaptRegionError::NoSuchFace { face, faces });
        }
        meant.push(FaceId::from_raw(face));
    }
    Ok(meant)
}

fn list<'a>(names: impl Iterator<Item = &'a String>) -> String {
    let names: Vec<&str> = names.map(String::as_str).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// The corner closest to `p` of the face closest to it.
fn nearest_corner(finest: &Surface, tree: &TriangleBvh, p: DVec3) -> Option<VertexId> {
    let corners = finest.faces[tree.closest(p)?.face()];
    let squared = |v: &VertexId| finest.points[*v].distance_squared(p);
    corners.into_iter().min_by(|a, b| squared(a).total_cmp(&squared(b)).then(a.cmp(b)))
}

/// Lowers the sizes wanted to those that the field at the closest point of `values` asks for.
pub(super) fn apply_field(
    finest: &Surface,
    values: &Soup,
    name: &str,
    sizes: &[(f64, Length)],
    wishes: &mut IdVec<Vertex, f64>,
) -> Result<(), AdaptRegionError> {
    let diagonal = diagonal(finest);
    let steps: Vec<(f64, f64)> = sizes.iter().map(|(value, size)| (*value, size.resolve(diagonal))).collect();
    let falls = steps.windows(2).find(|pair| pair[0].0 >= pair[1].0).map(|pair| pair[1].0);
    if let Some(value) = falls.or_else(|| steps.iter().map(|s| s.0).find(|value| !value.is_finite())) {
        return Err(AdaptRegionError::OutOfRange { name: "field-sizes", range: "finite, by rising value", value });
    }
    let carried = &values.carried;
    let of = |support| carried.field(support, name).filter(|field| field.components == 1);
    let field = of(Support::Vertex).or_else(|| of(Support::Face)).ok_or_else(|| AdaptRegionError::NoField {
        name: name.to_owned(),
        known: list(carried.fields.iter().map(|field| &field.name)),
    })?;
    let nearest = Nearest::of(values, field);
    for (wish, &p) in wishes.iter_mut().zip(finest.points.iter()) {
        *wish = wish.min(size_at(&steps, nearest.value(p)));
    }
    Ok(())
}

/// Looks up a field at the closest point of a mesh, or at the closest of points without faces.
struct Nearest<'a> {
    values: &'a Soup,
    field: &'a Field,
    target: Option<Target>,
    points: TriangleBvh,
}

impl<'a> Nearest<'a> {
    fn of(values: &'a Soup, field: &'a Field) -> Self {
        let has_faces = !values.faces.is_empty();
        // A point is a triangle with its three corners in one place.
        let points = if has_faces { Vec::new() } else { values.points.iter().map(|&p| [p; 3]).collect() };
        Self { values, field, target: has_faces.then(|| Target::of(values)), points: TriangleBvh::new(points) }
    }

    fn value(&self, p: DVec3) -> f64 {
        let at = match &self.target {
            Some(target) => self.element(target, p),
            None => self.points.closest(p).map(|found| found.index as usize),
        };
        at.and_then(|at| self.field.values.get(at)).copied().unwrap_or(f64::NAN)
    }

    /// The closest face, or its corner closest to the point.
    fn element(&self, target: &Target, p: DVec3) -> Option<usize> {
        let found = target.bvh().closest(p)?;
        let face = target.face(found.index);
        match self.field.support {
            Support::Face => Some(face.index()),
            Support::Vertex => {
                let squared = |v: &VertexId| self.values.points[*v].distance_squared(found.nearest.point);
                let corners = self.values.faces[face].corners().iter().copied();
                corners.min_by(|a, b| squared(a).total_cmp(&squared(b)).then(a.cmp(b))).map(VertexId::index)
            }
        }
    }
}

/// The size for a value; infinite below the first step and where there is no value.
fn size_at(steps: &[(f64, f64)], value: f64) -> f64 {
    let above = steps.partition_point(|(at, _)| *at <= value);
    match (above.checked_sub(1).and_then(|k| steps.get(k)), steps.get(above)) {
        (Some((low, from)), Some((high, to))) => from + (to - from) * (value - low) / (high - low),
        (Some((_, last)), None) => *last,
        (None, _) => f64::INFINITY,
    }
}
