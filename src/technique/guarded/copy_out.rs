//! A few faces copied out of a half-edge mesh, so that every check of [`crate::mesh::edit`] answers on the copy as it
//! would on the mesh, for edits at the inner vertices. Cost: O(faces in the copy).

use smallvec::SmallVec;

use crate::mesh::halfedge::{HalfedgeMesh, edge_of};
use crate::mesh::{EdgeMark, FaceId, Freedom, LockRules, MarkCause, Rim, Surface, VertexId, edge_key, resolve_freedom};

/// What was copied, and the copy.
#[derive(Debug)]
pub(super) struct Copied {
    pub(super) mesh: HalfedgeMesh,
    /// The mesh's numbers of the copy's vertices and faces.
    pub(super) vertices: Vec<VertexId>,
    pub(super) faces: Vec<FaceId>,
    /// Whether a face may change.
    pub(super) core: Vec<bool>,
}

/// What a copy of the surroundings of some vertices would hold.
#[derive(Debug)]
pub(super) struct Extent {
    inner: Vec<VertexId>,
    changing: Vec<FaceId>,
    /// The corners of the faces that may change.
    pub(super) known: Vec<VertexId>,
    /// All faces at those.
    pub(super) faces: Vec<FaceId>,
}

impl Extent {
    /// About `inner`, whose faces may change.
    pub(super) fn of(mesh: &HalfedgeMesh, inner: impl Iterator<Item = VertexId>) -> Self {
        let inner = sorted(inner);
        let changing = sorted(inner.iter().flat_map(|&v| mesh.faces_around(v)));
        let known = sorted(changing.iter().flat_map(|&f| mesh.corners(f)));
        let faces = sorted(known.iter().flat_map(|&v| mesh.faces_around(v)));
        Self { inner, changing, known, faces }
    }

    /// Copies it; `None` where what the mesh carries does not fit the copy.
    pub(super) fn copy(self, mesh: &HalfedgeMesh) -> Option<Copied> {
        let Self { inner, changing, known, faces } = self;
        let (surface, vertices) = surface_of(mesh, &faces, &known);
        let rules = LockRules { rim: Rim::Free, ..LockRules::default() };
        let mut freedom = resolve_freedom(&surface, &rules).ok()?;
        for (v, &at) in surface.points.ids().zip(&vertices) {
            let may_change = inner.binary_search(&at).is_ok();
            freedom.vertices[v] = if may_change { mesh.vertex_freedom(at) } else { Freedom::Keep };
        }
        let core = faces.iter().map(|f| changing.binary_search(f).is_ok()).collect();
        let mesh = HalfedgeMesh::new(&surface, &freedom).ok()?;
        Some(Copied { mesh, vertices, faces, core })
    }
}

fn sorted<T: Ord>(items: impl Iterator<Item = T>) -> Vec<T> {
    let mut all: Vec<T> = items.collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// A surface of the faces, and the mesh's number of each of its vertices. Vertices that are not `known` appear once
/// for each fan of the faces round them, so that the surface has fans only.
fn surface_of(mesh: &HalfedgeMesh, faces: &[FaceId], known: &[VertexId]) -> (Surface, Vec<VertexId>) {
    let mut vertices = known.to_vec();
    let mut surface = Surface::default();
    let mut fans: Vec<(VertexId, FaceId, VertexId)> = Vec::new();
    for &f in faces {
        let corners = mesh.corners(f).map(|v| match known.binary_search(&v) {
            Ok(place) => VertexId::new(place),
            Err(_) => fan_of(mesh, faces, v, f, &mut fans, &mut vertices),
        });
        surface.faces.push(corners);
    }
    surface.points = vertices.iter().map(|&v| mesh.point(v)).collect();
    for (local, &f) in faces.iter().enumerate() {
        let first = mesh.face_halfedge(f);
        for h in [first, mesh.next(first), mesh.prev(first)] {
            let freedom = mesh.edge_freedom(edge_of(h));
            if freedom != Freedom::Free {
                let corners = surface.faces[FaceId::new(local)];
                let local = |v| corners.into_iter().find(|c| vertices[c.index()] == v);
                if let (Some(a), Some(b)) = (local(mesh.origin(h)), local(mesh.target(h))) {
                    surface.carried.mark(edge_key(a, b), EdgeMark { freedom, cause: MarkCause::Feature });
                }
            }
        }
        let class = mesh.face_class(f).to_string();
        surface.carried.groups.faces.entry(class).or_default().push(FaceId::new(local));
    }
    (surface, vertices)
}

/// The copy's number of `v` in the fan of the faces that `f` belongs to.
fn fan_of(
    mesh: &HalfedgeMesh,
    faces: &[FaceId],
    v: VertexId,
    f: FaceId,
    fans: &mut Vec<(VertexId, FaceId, VertexId)>,
    vertices: &mut Vec<VertexId>,
) -> VertexId {
    if let Some(place) = fans.iter().position(|&(w, g, _)| (w, g) == (v, f)) {
        return fans[place].2;
    }
    let number = VertexId::new(vertices.len());
    vertices.push(v);
    let is_in = |g: FaceId| faces.binary_search(&g).is_ok();
    // Outgoing half-edges run round the vertex; from `f` both ways until a face is not in the copy.
    let around: SmallVec<[Option<FaceId>; 16]> = mesh.outgoing(v).map(|h| mesh.face(h).filter(|&g| is_in(g))).collect();
    let start = around.iter().position(|&g| g == Some(f)).unwrap_or(0);
    let count = around.len();
    let onwards = (1..count).map(|k| around[(start + k) % count]).take_while(Option::is_some).flatten();
    let backwards = (1..count).map(|k| around[(start + count - k) % count]).take_while(Option::is_some).flatten();
    let fan = sorted(onwards.chain(backwards));
    fans.push((v, f, number));
    fans.extend(fan.into_iter().map(|g| (v, g, number)));
    number
}
