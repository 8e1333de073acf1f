//! Into the workshop and out of it.

use glam::DVec3;

use super::{Mixed, NONE, Place};
use crate::mesh::topology::EdgeTable;
use crate::mesh::{Facet, Soup, VertexId};

impl Mixed {
    /// The workshop of oriented manifold faces. `arc` gives the curve of an edge, by its ends, or [`NONE`].
    ///
    /// Returns `None` where an edge has more than two faces, or two that run the same way.
    pub fn new(
        soup: &Soup,
        places: Vec<Place>,
        regions: Vec<u32>,
        mut arc: impl FnMut(VertexId, VertexId) -> u32,
    ) -> Option<Self> {
        let table = EdgeTable::new(soup);
        let mut mesh = Self {
            points: soup.points.as_slice().to_vec(),
            normals: vec![DVec3::ZERO; soup.points.len()],
            sizes: vec![1.0; soup.points.len()],
            out: vec![NONE; soup.points.len()],
            places,
            first: vec![NONE; soup.faces.len()],
            stamps: vec![0; soup.faces.len()],
            region: regions,
            ..Self::default()
        };
        let mut of: Vec<[u32; 4]> = vec![[NONE; 4]; soup.faces.len()];
        for (_, [a, b], sides) in table.iter() {
            let h = mesh.add_edge(a.raw(), b.raw(), arc(a, b));
            for side in sides {
                let half = if side.is_forward { h } else { h + 1 };
                if mesh.face[half as usize] != NONE || sides.len() > 2 {
                    return None;
                }
                mesh.face[half as usize] = side.face.raw();
                of[side.face.index()][side.side as usize] = half;
            }
        }
        for (f, facet) in soup.faces.enumerate() {
            let n = facet.corners().len();
            for i in 0..n {
                mesh.link(of[f.index()][i], of[f.index()][(i + 1) % n]);
                let v = facet.corners()[i];
                mesh.out[v.index()] = of[f.index()][i];
            }
            mesh.first[f.index()] = of[f.index()][0];
        }
        mesh.link_borders();
        Some(mesh)
    }

    fn link_borders(&mut self) {
        let mut start = vec![NONE; self.out.len()];
        let border: Vec<u32> = (0..self.halfedge_slots()).filter(|&h| self.face(h) == NONE).collect();
        for &h in &border {
            start[self.origin(h) as usize] = h;
        }
        for &h in &border {
            let next = start[self.target(h) as usize];
            self.link(h, next);
        }
    }

    /// The live mesh without holes in its numbering; what it carries is left empty. Also the place of each vertex, and
    /// the region of each face.
    pub fn leave(&self) -> (Soup, Vec<Place>, Vec<u32>) {
        let mut number = vec![NONE; self.out.len()];
        let (mut soup, mut places, mut regions) = (Soup::default(), Vec::new(), Vec::new());
        for v in self.vertices() {
            number[v as usize] = soup.points.push(self.point(v)).raw();
            places.push(self.place(v));
        }
        for f in self.faces() {
            let corners: Vec<VertexId> =
                self.corners(f).iter().map(|&v| VertexId::from_raw(number[v as usize])).collect();
            let facet = match corners[..] {
                [a, b, c] => Facet::Tri([a, b, c]),
                [a, b, c, d] => Facet::Quad([a, b, c, d]),
                _ => continue,
            };
            soup.faces.push(facet);
            regions.push(self.region(f));
        }
        (soup, places, regions)
    }

    /// Some faces as a soup, in their order; what they carry is left empty.
    pub fn soup_of(&self, faces: &[u32]) -> Soup {
        let mut number = rustc_hash::FxHashMap::default();
        let mut soup = Soup::default();
        for &f in faces {
            let corners = self.corners(f);
            let mut ids = [VertexId::from_raw(0); 4];
            for (id, &v) in ids.iter_mut().zip(&corners) {
                *id = *number.entry(v).or_insert_with(|| soup.points.push(self.point(v)));
            }
            let [a, b, c, d] = ids;
            soup.faces.push(if corners.len() == 3 { Facet::Tri([a, b, c]) } else { Facet::Quad([a, b, c, d]) });
        }
        soup
    }

    /// The edges on curves with the numbers that [`leave`](Self::leave) gives: ends and curve.
    pub fn arcs_left(&self) -> Vec<([VertexId; 2], u32)> {
        let mut number = vec![NONE; self.out.len()];
        for (at, v) in self.vertices().enumerate() {
            number[v as usize] = at as u32;
        }
        let id = |v: u32| VertexId::from_raw(number[v as usize]);
        let on_arc = self.edges().filter(|&h| self.arc(h) != NONE);
        let mut list: Vec<_> =
            on_arc.map(|h| (crate::mesh::edge_key(id(self.origin(h)), id(self.target(h))), self.arc(h))).collect();
        list.sort_unstable();
        list
    }

    /// Gives dead slots back where they are the greater part. Whether it did; then all numbers are new.
    pub fn compact(&mut self) -> bool {
        let dead = |column: &[u32]| column.iter().filter(|&&x| x == NONE).count();
        if 2 * dead(&self.first) < self.first.len() {
            return false;
        }
        let mut halfedge = vec![NONE; self.next.len()];
        let mut vertex = vec![NONE; self.out.len()];
        let mut face = vec![NONE; self.first.len()];
        let (mut v, mut f, mut h) = (0, 0, 0);
        for (i, slot) in vertex.iter_mut().enumerate() {
            if self.out[i] != NONE {
                *slot = v;
                v += 1;
            }
        }
        for (i, slot) in face.iter_mut().enumerate() {
            if self.first[i] != NONE {
                *slot = f;
                f += 1;
            }
        }
        for (i, slot) in halfedge.iter_mut().enumerate() {
            if self.origin[i] != NONE {
                *slot = h;
                h += 1;
            }
        }
        let to = |map: &[u32], x: u32| if x == NONE { NONE } else { map[x as usize] };
        let keep = |map: &[u32], column: &[u32], values: &[u32]| -> Vec<u32> {
            (0..column.len()).filter(|&i| map[i] != NONE).map(|i| to(values, column[i])).collect()
        };
        self.arc = (0..self.arc.len()).filter(|&e| halfedge[2 * e] != NONE).map(|e| self.arc[e]).collect();
        self.next = keep(&halfedge, &self.next, &halfedge);
        self.prev = keep(&halfedge, &self.prev, &halfedge);
        self.face = keep(&halfedge, &self.face, &face);
        self.origin = keep(&halfedge, &self.origin, &vertex);
        self.out = keep(&vertex, &self.out, &halfedge);
        self.region = (0..self.region.len()).filter(|&i| face[i] != NONE).map(|i| self.region[i]).collect();
        self.first = keep(&face, &self.first, &halfedge);
        self.points = (0..vertex.len()).filter(|&i| vertex[i] != NONE).map(|i| self.points[i]).collect();
        self.normals = (0..vertex.len()).filter(|&i| vertex[i] != NONE).map(|i| self.normals[i]).collect();
        self.places = (0..vertex.len()).filter(|&i| vertex[i] != NONE).map(|i| self.places[i]).collect();
        self.sizes = (0..vertex.len()).filter(|&i| vertex[i] != NONE).map(|i| self.sizes[i]).collect();
        self.stamps = vec![0; self.first.len()];
        self.epoch = 0;
        true
    }

    /// What is wrong with the structure, for tests: links that do not fit, faces of other sizes, stars that break.
    pub fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        for h in (0..self.halfedge_slots()).filter(|&h| self.is_halfedge(h)) {
            let n = self.next(h);
            if n == NONE || self.prev(n) != h || self.origin(n) != self.target(h) || self.face(n) != self.face(h) {
                faults.push(format!("half-edge {h} and its next do not fit"));
            }
        }
        for f in self.faces() {
            let n = self.sides(f).take(6).count();
            if !(3..=4).contains(&n) || self.sides(f).take(6).any(|h| self.face(h) != f) {
                faults.push(format!("face {f} has {n} sides"));
            }
        }
        for v in self.vertices() {
            let out = self.out(v);
            if self.origin(out) != v || !self.is_proper(v, 2) {
                faults.push(format!("the star of vertex {v} is torn"));
            }
        }
        faults
    }

    /// A workshop of plain polygons in one region without curves, for tests and small uses.
    pub fn of_faces(points: &[DVec3], faces: &[&[u32]]) -> Option<Self> {
        let mut soup = Soup { points: points.to_vec().into(), ..Soup::default() };
        for corners in faces {
            let id = |i: usize| VertexId::from_raw(corners[i]);
            soup.faces.push(match corners.len() {
                3 => Facet::Tri([id(0), id(1), id(2)]),
                _ => Facet::Quad([id(0), id(1), id(2), id(3)]),
            });
        }
        let places = vec![Place::Region(0); points.len()];
        Self::new(&soup, places, vec![0; faces.len()], |_, _| NONE)
    }
}
