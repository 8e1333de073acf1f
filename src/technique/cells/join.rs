//! Parts that have changed, put together again: the faces that stayed first, then cell by cell.

use rustc_hash::FxHashSet;

use super::cut::Cutting;
use super::part::{Part, fill, names_of};
use crate::mesh::{Carried, EdgeKey, FaceId, Groups, IdVec, Regions, Surface, VertexId, edge_key};
use crate::technique::guarded::{Counts, Gathered, GuardedMesh};

/// A part after its collapses.
#[derive(Debug)]
pub(super) struct Done {
    surface: Surface,
    /// Its own faces; those that stayed follow.
    inside: usize,
    /// Which vertex of the whole each one is that stays.
    still: Vec<Option<VertexId>>,
    /// What vertices have gathered that lie in the cell, where all their faces are known.
    gathered: Vec<Option<Gathered>>,
    pub(super) counts: Counts,
}

impl Done {
    pub(super) fn new(guarded: GuardedMesh<'_>, part: &Part, cutting: &Cutting, cell: usize) -> Self {
        let live: Vec<VertexId> = guarded.mesh().vertices().collect();
        let still = live.iter().map(|v| part.vertices[v.index()]).map(|v| cutting.is_still(v).then_some(v)).collect();
        let is_in = |v: VertexId| cutting.cell(part.vertices[v.index()]) == cell;
        let gathered = live.iter().map(|&v| is_in(v).then(|| guarded.gathered(v))).collect();
        let counts = guarded.counts();
        let surface = guarded.into_mesh().leave().surface;
        let inside = surface.faces.len() - (part.surface.faces.len() - part.inside);
        Self { surface, inside, still, gathered, counts }
    }
}

/// The whole, and what its vertices have gathered, where that is known; `before` is that of the vertices before.
pub(super) fn join(
    whole: &Surface,
    cutting: &Cutting,
    before: &[Option<Gathered>],
    parts: &[Done],
) -> (Surface, Vec<Option<Gathered>>) {
    let mut joined = Joined::new(whole, cutting, before);
    for part in parts {
        joined.add(part);
    }
    joined.finish()
}

struct Joined {
    points: IdVec<crate::mesh::id::Vertex, glam::DVec3>,
    faces: Vec<[VertexId; 3]>,
    labels: Vec<u32>,
    carried: Carried,
    gathered: Vec<Option<Gathered>>,
    /// The new number of each vertex of the whole that stays.
    number: Vec<Option<VertexId>>,
    /// Members that parts add to the groups, by the place of the group's name.
    in_faces: Vec<(usize, FaceId)>,
    in_edges: Vec<(usize, EdgeKey)>,
    in_vertices: Vec<(usize, VertexId)>,
}

impl Joined {
    /// The faces that stay, with what they carry.
    fn new(whole: &Surface, cutting: &Cutting, before: &[Option<Gathered>]) -> Self {
        let mut this = Self {
            points: IdVec::default(),
            faces: Vec::new(),
            labels: Vec::new(),
            carried: Carried { groups: names_of(&whole.carried.groups), ..Carried::default() },
            gathered: Vec::new(),
            number: vec![None; whole.points.len()],
            in_faces: Vec::new(),
            in_edges: Vec::new(),
            in_vertices: Vec::new(),
        };
        for v in whole.points.ids().filter(|&v| cutting.is_still(v)) {
            this.number[v.index()] = Some(this.points.push(whole.points[v]));
            this.gathered.push(before.get(v.index()).copied().flatten());
        }
        let number = |v: VertexId| this.number[v.index()];
        this.faces = cutting.still.iter().filter_map(|&f| all(whole.faces[f].map(number))).collect();
        if let Some(regions) = &whole.carried.regions {
            this.labels = cutting.still.iter().map(|&f| regions.labels[f]).collect();
            this.carried.regions = Some(Regions { labels: IdVec::default(), names: regions.names.clone() });
        }
        this.keep(whole, cutting);
        this
    }

    fn keep(&mut self, whole: &Surface, cutting: &Cutting) {
        let sides: FxHashSet<EdgeKey> = cutting
            .still
            .iter()
            .map(|&f| whole.faces[f])
            .flat_map(|[a, b, c]| [edge_key(a, b), edge_key(b, c), edge_key(c, a)])
            .collect();
        let number = |v: VertexId| self.number[v.index()];
        let edge = |key: &EdgeKey| {
            let [a, b] = all(key.map(number)).filter(|_| sides.contains(key))?;
            Some(edge_key(a, b))
        };
        let groups = &whole.carried.groups;
        for (label, members) in groups.faces.values().enumerate() {
            let places = members.iter().filter_map(|f| cutting.still.binary_search(f).ok());
            self.in_faces.extend(places.map(|place| (label, FaceId::new(place))));
        }
        for (label, members) in groups.edges.values().enumerate() {
            self.in_edges.extend(members.iter().filter_map(edge).map(|e| (label, e)));
        }
        for (label, members) in groups.vertices.values().enumerate() {
            self.in_vertices.extend(members.iter().filter_map(|&v| number(v)).map(|v| (label, v)));
        }
        self.carried.marks = whole.carried.marks.iter().filter_map(|(key, &mark)| Some((edge(key)?, mark))).collect();
        self.carried.pins = whole.carried.pins.iter().filter_map(|(&v, &pin)| Some((number(v)?, pin))).collect();
    }

    /// A part's own faces, with what they carry.
    fn add(&mut self, part: &Done) {
        let surface = &part.surface;
        let own = || surface.faces.iter().take(part.inside);
        let mut number: Vec<Option<VertexId>> = vec![None; surface.points.len()];
        for v in own().flatten() {
            let at = v.index();
            if number[at].is_none() {
                let kept = part.still[at].and_then(|whole| self.number[whole.index()]);
                let new = kept.unwrap_or_else(|| self.points.push(surface.points[*v]));
                self.gathered.resize(self.points.len(), None);
                self.gathered[new.index()] = part.gathered[at].or(self.gathered[new.index()]);
                number[at] = Some(new);
            }
        }
        let first = self.faces.len();
        let of = |v: VertexId| number[v.index()];
        let edge = |key: EdgeKey| all(key.map(of)).map(|[a, b]| edge_key(a, b));
        self.faces.extend(own().filter_map(|corners| all(corners.map(of))));
        let Carried { groups, regions, marks, pins, .. } = &surface.carried;
        self.labels.extend(regions.iter().flat_map(|regions| regions.labels.iter().take(part.inside)));
        for (label, members) in groups.faces.values().enumerate() {
            let members = members.iter().filter(|f| f.index() < part.inside);
            self.in_faces.extend(members.map(|f| (label, FaceId::new(first + f.index()))));
        }
        for (label, members) in groups.edges.values().enumerate() {
            self.in_edges.extend(members.iter().filter_map(|&key| edge(key)).map(|e| (label, e)));
        }
        for (label, members) in groups.vertices.values().enumerate() {
            self.in_vertices.extend(members.iter().filter_map(|&v| of(v)).map(|v| (label, v)));
        }
        self.carried.marks.extend(marks.iter().filter_map(|(&key, &mark)| Some((edge(key)?, mark))));
        self.carried.pins.extend(pins.iter().filter_map(|(&v, &pin)| Some((of(v)?, pin))));
    }

    fn finish(mut self) -> (Surface, Vec<Option<Gathered>>) {
        let Groups { faces, edges, vertices } = &mut self.carried.groups;
        fill(faces.values_mut(), self.in_faces.into_iter());
        fill(edges.values_mut(), self.in_edges.into_iter());
        fill(vertices.values_mut(), self.in_vertices.into_iter());
        if let Some(regions) = &mut self.carried.regions {
            regions.labels = IdVec::from(self.labels);
        }
        let surface = Surface { points: self.points, faces: IdVec::from(self.faces), carried: self.carried };
        (surface, self.gathered)
    }
}

/// All of them, or none.
fn all<const N: usize>(items: [Option<VertexId>; N]) -> Option<[VertexId; N]> {
    let mut found = [VertexId::new(0); N];
    for (place, item) in found.iter_mut().zip(items) {
        *place = item?;
    }
    Some(found)
}
