//! What a mesh carries besides points and faces: groups, regions, freedom, seams, fields and curves.
//!
//! All members are stored sorted and without repeats, so that equal content is equal bytes.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::id::{FaceId, IdVec, VertexId};

/// How far an edit may change a vertex or an edge. Ordered from loosest to strictest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Freedom {
    /// May move on the surface, may vanish.
    #[default]
    Free,
    /// May be split or collapsed along its curve, never leaves it.
    OnCurve,
    /// Identical in the result.
    Keep,
}

/// Why an edge is marked. One edge has one mark: the strictest freedom, then the first cause in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MarkCause {
    /// A copy of a non-manifold edge; all copies share their seam ids.
    Seam,
    /// The rim of an open surface.
    Boundary,
    /// A sharp edge.
    Feature,
    /// The border between two regions or face groups.
    RegionBorder,
    /// Locked by the user.
    Locked,
}

/// The ends of an undirected edge, smaller id first.
pub type EdgeKey = [VertexId; 2];

/// The key of the edge between `a` and `b`.
#[inline]
pub fn edge_key(a: VertexId, b: VertexId) -> EdgeKey {
    if a <= b { [a, b] } else { [b, a] }
}

/// What is said of a marked edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct EdgeMark {
    /// How far edits may change it.
    pub freedom: Freedom,
    /// Why it is marked.
    pub cause: MarkCause,
}

/// Vertices with one seam id are one point of the model; writers weld them again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct SeamId(pub u32);

/// Named sets of elements. Names keep their case; members are sorted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Groups {
    /// Face sets.
    pub faces: BTreeMap<String, Vec<FaceId>>,
    /// Edge sets.
    pub edges: BTreeMap<String, Vec<EdgeKey>>,
    /// Vertex sets.
    pub vertices: BTreeMap<String, Vec<VertexId>>,
}

impl Groups {
    /// Whether a group of any kind has this name.
    pub fn contains(&self, name: &str) -> bool {
        self.faces.contains_key(name) || self.edges.contains_key(name) || self.vertices.contains_key(name)
    }

    /// All names with their kind and size, faces first, each kind in name order.
    pub fn list(&self) -> impl Iterator<Item = (&'static str, &str, usize)> {
        let faces = self.faces.iter().map(|(n, m)| ("faces", n.as_str(), m.len()));
        let edges = self.edges.iter().map(|(n, m)| ("edges", n.as_str(), m.len()));
        let vertices = self.vertices.iter().map(|(n, m)| ("vertices", n.as_str(), m.len()));
        faces.chain(edges).chain(vertices)
    }

    /// Whether there is no group at all.
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty() && self.edges.is_empty() && self.vertices.is_empty()
    }
}

/// One label a face, with the regions' names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Regions {
    /// The label of each face: an index into `names`.
    pub labels: IdVec<super::id::Face, u32>,
    /// Names in label order.
    pub names: Vec<String>,
}

/// Where a field's values sit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Support {
    /// One value a vertex.
    Vertex,
    /// One value a face.
    Face,
}

/// Numbers on the vertices or faces.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Field {
    /// Name, unique together with the support.
    pub name: String,
    /// Where the values sit.
    pub support: Support,
    /// Numbers an element, at least 1.
    pub components: usize,
    /// `components` numbers for each element in id order.
    pub values: Vec<f64>,
}

/// A place on the surface: on a vertex, or inside an edge.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SurfacePoint {
    /// On a vertex.
    Vertex(VertexId),
    /// Inside an edge.
    Edge {
        /// The edge.
        edge: EdgeKey,
        /// Where: above 0 at the first end, below 1 at the second.
        t: f64,
    },
}

/// A polyline on the surface. Neighbouring points lie in one face, corners and sides counted in.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// The points in order; the first is not repeated at the end of a closed curve.
    pub points: Vec<SurfacePoint>,
    /// Whether the last point joins the first.
    pub is_closed: bool,
    /// The regions on the left and on the right, looking along the curve from outside.
    pub sides: [u32; 2],
}

impl Curve {
    /// The segments in order.
    pub fn segments(&self) -> impl Iterator<Item = [SurfacePoint; 2]> + '_ {
        let closing = if self.is_closed { self.points.last().zip(self.points.first()) } else { None };
        self.points.windows(2).map(|pair| [pair[0], pair[1]]).chain(closing.map(|(&last, &first)| [last, first]))
    }
}

/// Everything a mesh carries.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Carried {
    /// Named sets.
    pub groups: Groups,
    /// The region of each face, where there are regions.
    pub regions: Option<Regions>,
    /// Marked edges.
    pub marks: BTreeMap<EdgeKey, EdgeMark>,
    /// Vertices that are less free than their edges say: corners and locked vertices.
    pub pins: BTreeMap<VertexId, Freedom>,
    /// Vertices on a seam.
    pub seams: BTreeMap<VertexId, SeamId>,
    /// Fields, sorted by support and name.
    pub fields: Vec<Field>,
    /// Curves on the surface; whoever changes faces or vertices drops them.
    pub curves: Vec<Curve>,
}

impl Carried {
    /// The field of this name and support.
    pub fn field(&self, support: Support, name: &str) -> Option<&Field> {
        self.fields.iter().find(|f| f.support == support && f.name == name)
    }

    /// Adds a field or replaces the one of the same name and support.
    pub fn set_field(&mut self, field: Field) {
        self.fields.retain(|f| (f.support, &f.name) != (field.support, &field.name));
        self.fields.push(field);
        self.fields.sort_by(|a, b| (a.support, &a.name).cmp(&(b.support, &b.name)));
    }

    /// Marks an edge; of two marks the stricter stays, then the first cause.
    pub fn mark(&mut self, edge: EdgeKey, mark: EdgeMark) {
        let entry = self.marks.entry(edge).or_insert(mark);
        if mark.freedom > entry.freedom || (mark.freedom == entry.freedom && mark.cause < entry.cause) {
            *entry = mark;
        }
    }

    /// Pins a vertex; of two pins the stricter stays.
    pub fn pin(&mut self, vertex: VertexId, freedom: Freedom) {
        let entry = self.pins.entry(vertex).or_insert(freedom);
        *entry = (*entry).max(freedom);
    }
}
