//! Finite elements as the solver formats name them: what a reader keeps of each, and mid-side nodes for writers.
//!
//! Reading: [`Elements`] takes the elements of a file one by one. Triangles and quads become faces, of a second-order
//! element only the corners are used, lines and points become group members, volumes are left out, except where there
//! is nothing else: then their skin is the mesh; the counts of what was left out are kept. Nodes that only mid-side
//! positions or volumes used are dropped at the end.
//!
//! Writing: [`elevate`] adds a node in the middle of each edge, once an edge, so that neighbours share it. Where the
//! caller gives a projector, the node is moved onto that surface. An element stays valid when the Jacobian determinant
//! of its map, taken along the normal of its corners, is positive everywhere. For six-node triangles this is decided by
//! the Bernstein coefficients of the determinant (Johnen, Remacle, Geuzaine: Geometrical validity of curvilinear finite
//! elements, Journal of Computational Physics 233, 2013), which is sufficient; for eight-node quads it is sampled on a
//! lattice of 5 by 5 positions. The nodes of an element that fails go back to their edges' midpoints, until none fails.
//!
//! Invariants: corners keep their order; a face of the file is one face of the soup, except polygons of five and more
//! corners; mid-side nodes are numbered by the first face, then the first side that has them.
//!
//! Cost: linear in the number of elements and sides.

use std::collections::BTreeMap;

use glam::DVec3;
use rustc_hash::FxHashMap;

use super::error::{FormatError, Place, Reason};
use super::polygon::{quad, triangulate};
use super::skin::{Own, Volumes, volume_corners};
use super::{Element, ReadCounts, WriteOptions};
use crate::mesh::{EdgeKey, Facet, Field, Soup, Support, VertexId, edge_key};

/// The shape of an element. Corner nodes come first in all formats we read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    /// One node.
    Point,
    /// Two ends, then nodes between.
    Line,
    /// Three corners.
    Triangle,
    /// Four corners.
    Quad,
    /// As many corners as nodes.
    Polygon,
    /// Tetrahedra, bricks, wedges, pyramids.
    Volume,
}

impl Shape {
    /// How many of `nodes` nodes are corners.
    pub(super) fn corners(self, nodes: usize) -> usize {
        match self {
            Self::Point => 1,
            Self::Line => 2,
            Self::Triangle => 3,
            Self::Quad => 4,
            Self::Polygon | Self::Volume => nodes,
        }
    }
}

/// What became of an element.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Placed {
    /// It is these faces, one except for large polygons.
    Faces(std::ops::Range<usize>),
    /// It is an edge.
    Edge(EdgeKey),
    /// It is a vertex.
    Vertex(VertexId),
    /// It is a volume with these faces of the skin; a bit for each of its sides, in order, tells which sides those are.
    Skin(std::ops::Range<usize>, u8),
    /// It is this volume, counted in the order of the file; its skin may be asked for.
    Volume(u32),
    /// It was left out.
    Nothing,
}

const CORNER: u8 = 1;
const DROPPABLE: u8 = 2;

/// Gathers the elements of a file into faces, edges and vertices; ids are positions in the file's node list.
#[derive(Debug, Default)]
pub(super) struct Elements {
    /// Faces in file order.
    pub(super) faces: Vec<Facet>,
    roles: Vec<u8>,
    /// What was done besides reading.
    pub(super) counts: ReadCounts,
    volumes: Volumes,
}

impl Elements {
    /// For a file of `nodes` nodes.
    pub(super) fn new(nodes: usize) -> Self {
        Self { roles: vec![0; nodes], ..Self::default() }
    }

    /// Makes room for more nodes of the file, `nodes` in all.
    pub(super) fn make_room(&mut self, nodes: usize) {
        self.roles.resize(nodes, 0);
    }

    /// Adds one element; `nodes` are positions that the caller has checked, at least as many as the shape has corners.
    pub(super) fn add(&mut self, shape: Shape, nodes: &[u32], points: &[DVec3]) -> Placed {
        let corners = &nodes[..shape.corners(nodes.len())];
        if shape == Shape::Volume {
            return self.volume(nodes, volume_corners(nodes.len()));
        }
        for &n in corners {
            self.roles[n as usize] |= CORNER;
        }
        for &n in &nodes[corners.len()..] {
            self.roles[n as usize] |= DROPPABLE;
        }
        let id = |i: usize| VertexId::from_raw(corners[i]);
        match shape {
            Shape::Point => Placed::Vertex(id(0)),
            Shape::Line => Placed::Edge(edge_key(id(0), id(1))),
            Shape::Triangle => self.face(Facet::Tri([id(0), id(1), id(2)])),
            Shape::Quad => self.face(quad([id(0), id(1), id(2), id(3)])),
            Shape::Polygon => self.polygon(corners, points),
            Shape::Volume => Placed::Nothing,
        }
    }

    /// Adds a volume whose first `corners` nodes are its corners; 0 where that is not known.
    pub(super) fn volume(&mut self, nodes: &[u32], corners: usize) -> Placed {
        for &n in nodes {
            self.roles[n as usize] |= DROPPABLE;
        }
        self.counts.elements_dropped += 1;
        Placed::Volume(self.volumes.push(&nodes[..corners.min(nodes.len())]))
    }

    /// Where the file has volumes and no faces, their skin becomes the faces. The faces of each volume, by its number,
    /// with a bit for each side that is one; `None` where there is no skin.
    pub(super) fn skin(&mut self, points: &[DVec3]) -> Option<Vec<Own>> {
        if !self.faces.is_empty() {
            return None;
        }
        let (faces, ranges) = self.volumes.skin(points)?;
        for corner in faces.iter().flat_map(Facet::corners) {
            self.roles[corner.index()] |= CORNER;
        }
        self.faces = faces;
        let inside = std::mem::take(&mut self.counts.elements_dropped);
        self.counts.note(&format!("the inside of {inside} volume elements, of which the mesh is the skin"));
        Some(ranges)
    }

    /// As [`Self::skin`]; elements that are volumes become their faces of it.
    pub(super) fn skin_of(&mut self, points: &[DVec3], placed: &mut [Placed]) {
        let Some(ranges) = self.skin(points) else { return };
        for element in placed {
            if let Placed::Volume(volume) = element {
                *element = ranges
                    .get(*volume as usize)
                    .map_or(Placed::Nothing, |(range, sides)| Placed::Skin(range.clone(), *sides));
            }
        }
    }

    /// Takes these nodes for such that may be dropped where nothing uses them.
    pub(super) fn drop_nodes(&mut self, nodes: std::ops::Range<usize>) {
        for role in &mut self.roles[nodes] {
            *role |= DROPPABLE;
        }
    }

    /// Counts an element that is no face, edge or vertex.
    pub(super) fn leave_out(&mut self) -> Placed {
        self.counts.elements_dropped += 1;
        Placed::Nothing
    }

    fn face(&mut self, facet: Facet) -> Placed {
        self.faces.push(facet);
        Placed::Faces(self.faces.len() - 1..self.faces.len())
    }

    fn polygon(&mut self, corners: &[u32], points: &[DVec3]) -> Placed {
        let id = |i: usize| VertexId::from_raw(corners[i]);
        match corners.len() {
            0..3 => {
                self.counts.faces_dropped += 1;
                Placed::Nothing
            }
            3 => self.face(Facet::Tri([id(0), id(1), id(2)])),
            4 => self.face(quad([id(0), id(1), id(2), id(3)])),
            _ => {
                self.counts.polygons_triangulated += 1;
                let first = self.faces.len();
                let corners: Vec<VertexId> = corners.iter().map(|&c| VertexId::from_raw(c)).collect();
                self.faces.extend(triangulate(points, &corners).into_iter().map(Facet::Tri));
                Placed::Faces(first..self.faces.len())
            }
        }
    }

    /// Finishes `soup`, whose points are all nodes of the file and whose groups and fields name them: sets the faces
    /// and drops the nodes that no face, line or point has as a corner but some element had otherwise. A file without
    /// faces is refused.
    pub(super) fn finish(mut self, soup: &mut Soup) -> Result<ReadCounts, FormatError> {
        if self.faces.is_empty() {
            return Err(match self.counts.elements_dropped {
                0 => FormatError::new(Place::File, Reason::Nothing("triangles or quads")),
                _ => FormatError::new(Place::File, Reason::Nothing("surface elements, only volume elements"))
                    .with_remedy("their skin is not known: export it as triangles or quads"),
            });
        }
        soup.faces = self.faces.into();
        let keep: Vec<bool> = self.roles.iter().map(|&r| r & CORNER != 0 || r & DROPPABLE == 0).collect();
        self.counts.nodes_dropped = keep.iter().filter(|&&k| !k).count();
        if self.counts.nodes_dropped > 0 {
            keep_vertices(soup, &keep);
        }
        Ok(self.counts)
    }
}

/// Drops the vertices that are not kept, and renumbers everything that names vertices. No face names a dropped one.
fn keep_vertices(soup: &mut Soup, keep: &[bool]) {
    const GONE: u32 = u32::MAX;
    let mut next = 0;
    let new: Vec<u32> = keep
        .iter()
        .map(|&k| {
            if k {
                next += 1;
                next - 1
            } else {
                GONE
            }
        })
        .collect();
    let map = |v: VertexId| VertexId::from_raw(new[v.index()]);
    soup.points = soup.points.enumerate().filter(|(v, _)| keep[v.index()]).map(|(_, &p)| p).collect();
    for face in &mut soup.faces {
        face.corners_mut().iter_mut().for_each(|c| *c = map(*c));
    }
    for members in soup.carried.groups.vertices.values_mut() {
        members.retain(|v| keep[v.index()]);
        for vertex in members.iter_mut() {
            *vertex = map(*vertex);
        }
    }
    for members in soup.carried.groups.edges.values_mut() {
        for edge in members.iter_mut() {
            *edge = edge.map(map);
        }
    }
    for field in soup.carried.fields.iter_mut().filter(|f| f.support == Support::Vertex) {
        let rows = field.values.chunks_exact(field.components);
        field.values = rows.zip(keep).filter(|(_, k)| **k).flat_map(|(row, _)| row.iter().copied()).collect();
    }
}

/// A mesh with a node in the middle of each side.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Elevated {
    /// The mid-side nodes; their numbers go on after the soup's points.
    pub(super) points: Vec<DVec3>,
    /// For each face, the number of the node on each side, in corner order; the fourth is unused for triangles.
    pub(super) sides: Vec<[u32; 4]>,
    /// Nodes left on their edge's midpoint because an element would not have been valid otherwise.
    pub(super) kept_straight: usize,
}

impl Elevated {
    /// The mid-side nodes of face `face` with this many corners.
    pub(super) fn of(&self, face: usize, corners: usize) -> &[u32] {
        &self.sides[face][..corners]
    }

    /// The rows of a vertex field on the mid-side nodes: the mean of the ends of each.
    pub(super) fn means(&self, soup: &Soup, field: &Field) -> Vec<f64> {
        let width = field.components;
        let mut rows = vec![0.0; self.points.len() * width];
        for (i, face) in soup.faces.iter().enumerate() {
            let corners = face.corners();
            for (side, &node) in self.of(i, corners.len()).iter().enumerate() {
                let ends = [corners[side], corners[(side + 1) % corners.len()]].map(|v| v.index() * width);
                let row = (node as usize - soup.points.len()) * width;
                for k in 0..width {
                    rows[row + k] = 0.5 * (field.values[ends[0] + k] + field.values[ends[1] + k]);
                }
            }
        }
        rows
    }
}

/// The mid-side nodes that `options` ask for.
pub(super) fn elevate_for(soup: &Soup, options: &WriteOptions<'_>) -> Option<Elevated> {
    options.element.is_some_and(Element::is_quadratic).then(|| elevate(soup, options.midside))
}

/// Puts a node in the middle of each side, moved by `project` where it is given.
pub(super) fn elevate(soup: &Soup, project: Option<&(dyn Fn(DVec3) -> DVec3 + Sync)>) -> Elevated {
    let first = soup.points.len() as u32;
    let mut ends: Vec<EdgeKey> = Vec::new();
    let mut numbers: FxHashMap<EdgeKey, u32> = FxHashMap::default();
    let mut sides = Vec::with_capacity(soup.faces.len());
    for face in &soup.faces {
        let corners = face.corners();
        let mut row = [0; 4];
        for (i, slot) in row.iter_mut().enumerate().take(corners.len()) {
            let edge = edge_key(corners[i], corners[(i + 1) % corners.len()]);
            *slot = *numbers.entry(edge).or_insert_with(|| {
                ends.push(edge);
                first + ends.len() as u32 - 1
            });
        }
        sides.push(row);
    }
    let straight: Vec<DVec3> = ends.iter().map(|&[a, b]| (soup.points[a] + soup.points[b]) * 0.5).collect();
    let Some(project) = project else {
        return Elevated { points: straight, sides, kept_straight: 0 };
    };
    let moved = straight.iter().map(|&p| Some(project(p)).filter(|q| q.is_finite()).unwrap_or(p)).collect();
    let mut elevated = Elevated { points: moved, sides, kept_straight: 0 };
    straighten_invalid(soup, &straight, &mut elevated);
    elevated
}

/// Moves the mid-side nodes of invalid elements back to their edges until no moved node belongs to an invalid element.
/// Each round straightens at least one node, so it ends.
fn straighten_invalid(soup: &Soup, straight: &[DVec3], elevated: &mut Elevated) {
    let first = soup.points.len();
    let mut users: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    let mut suspects: Vec<u32> = (0..soup.faces.len() as u32).collect();
    while let Some(face) = suspects.pop() {
        let facet = &soup.faces.as_slice()[face as usize];
        let corners: Vec<DVec3> = facet.corners().iter().map(|&v| soup.points[v]).collect();
        let own = elevated.of(face as usize, corners.len()).to_vec();
        let moved: Vec<u32> = own
            .iter()
            .copied()
            .filter(|&n| elevated.points[n as usize - first] != straight[n as usize - first])
            .collect();
        let mids: Vec<DVec3> = own.iter().map(|&n| elevated.points[n as usize - first]).collect();
        if moved.is_empty() || is_valid(&corners, &mids) {
            continue;
        }
        if users.is_empty() {
            users = users_of(elevated, soup);
        }
        for node in moved {
            elevated.points[node as usize - first] = straight[node as usize - first];
            elevated.kept_straight += 1;
            suspects.extend(users[&node].iter().copied().filter(|&f| f != face));
        }
    }
}

fn users_of(elevated: &Elevated, soup: &Soup) -> BTreeMap<u32, Vec<u32>> {
    let mut users: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (i, facet) in soup.faces.iter().enumerate() {
        for &node in elevated.of(i, facet.corners().len()) {
            users.entry(node).or_default().push(i as u32);
        }
    }
    users
}

/// Whether the Jacobian determinant along the normal of the corners is positive everywhere in the element.
fn is_valid(corners: &[DVec3], mids: &[DVec3]) -> bool {
    match (corners, mids) {
        ([a, b, c], [ab, bc, ca]) => {
            let normal = (b - a).cross(c - a);
            let at = |u: f64, v: f64| triangle_jacobian(&[*a, *b, *c, *ab, *bc, *ca], u, v).dot(normal);
            let [at_a, at_b, at_c] = [at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0)];
            // Bernstein coefficients of the quadratic: its corner values, and for each side 2 f(mid) less their mean.
            let between = |mid: f64, s: f64, e: f64| 2.0 * mid - 0.5 * (s + e);
            let coefficients = [
                at_a,
                at_b,
                at_c,
                between(at(0.5, 0.0), at_a, at_b),
                between(at(0.5, 0.5), at_b, at_c),
                between(at(0.0, 0.5), at_c, at_a),
            ];
            coefficients.iter().all(|&b| b > 0.0)
        }
        ([a, b, c, d], [ab, bc, cd, da]) => {
            let normal = (c - a).cross(d - b);
            let nodes = [*a, *b, *c, *d, *ab, *bc, *cd, *da];
            let steps = [-1.0, -0.5, 0.0, 0.5, 1.0];
            steps.iter().all(|&u| steps.iter().all(|&v| quad_jacobian(&nodes, u, v).dot(normal) > 0.0))
        }
        _ => true,
    }
}

/// The cross product of the derivatives of the six-node triangle's map at the barycentric position (1 - u - v, u, v).
fn triangle_jacobian(n: &[DVec3; 6], u: f64, v: f64) -> DVec3 {
    let w = 1.0 - u - v;
    let du =
        n[0] * (1.0 - 4.0 * w) + n[1] * (4.0 * u - 1.0) + n[3] * (4.0 * (w - u)) + n[4] * (4.0 * v) - n[5] * (4.0 * v);
    let dv =
        n[0] * (1.0 - 4.0 * w) + n[2] * (4.0 * v - 1.0) - n[3] * (4.0 * u) + n[4] * (4.0 * u) + n[5] * (4.0 * (w - v));
    du.cross(dv)
}

/// The cross product of the derivatives of the eight-node serendipity quad's map at (u, v) in [-1, 1] squared.
fn quad_jacobian(n: &[DVec3; 8], u: f64, v: f64) -> DVec3 {
    let signs = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let (mut du, mut dv) = (DVec3::ZERO, DVec3::ZERO);
    for (i, (su, sv)) in signs.into_iter().enumerate() {
        du += n[i] * (0.25 * su * (1.0 + v * sv) * (2.0 * u * su + v * sv));
        dv += n[i] * (0.25 * sv * (1.0 + u * su) * (2.0 * v * sv + u * su));
    }
    du += n[4] * (-u * (1.0 - v)) + n[6] * (-u * (1.0 + v)) + (n[5] - n[7]) * (0.5 * (1.0 - v * v));
    dv += (n[6] - n[4]) * (0.5 * (1.0 - u * u)) + n[5] * (-v * (1.0 + u)) + n[7] * (-v * (1.0 - u));
    du.cross(dv)
}
