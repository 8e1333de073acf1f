//! Face normals freed of noise, with jumps kept: normal vector voting, then a watershed of normals.
//!
//! Every face within the geodesic radius `g` of a vertex votes with its normal, mirrored so that all votes of a round
//! surface agree: `N' = N − 2 (N·u) u`, where `u` points from the vertex to the face. Votes weigh
//! `A / A_max · exp(−3 d / g)`, and the eigenvalues `λ1 ≥ λ2 ≥ λ3` of `Σ w N' N'ᵀ` classify the vertex: smooth where
//! `λ1 − λ2` is the largest of `λ1 − λ2`, `ε (λ2 − λ3)` and `ε η λ3`, else crease or corner, with `ε = η = 2`.
//!
//! Based on: D. L. Page, Y. Sun, A. F. Koschan, J. Paik, M. A. Abidi. *Normal vector voting: crease detection and
//! curvature estimation on large, noisy meshes*, Graphical Models 64, 2002.
//!
//! Departure: the votes mark a band of several faces along a crease, and we need mesh edges. So the normals are
//! denoised (a bilateral mean over the faces that share a vertex: normals that differ much do not mix), and faces of
//! the band take the normal of the smooth face from which a front of the least turn reaches them. Fronts meet where the
//! normals jump, so the band shrinks to one line of edges, and a crease that fades out just ends. Faces that no front
//! fits, as on ribs narrower than the radius, keep their own normal.
//!
//! A vertex also belongs to the band where votes that are not mirrored say so: mirrored votes agree on a rounded edge
//! as they do on any cylinder, and scans round all edges. Slivers, whose normals mean nothing, take the mean around
//! them.
//!
//! Geodesic distances are those along edges, and from the nearest corner to a face's centroid.
//!
//! # Cost
//! O(V · faces in reach), in parallel over vertices, each with a result of its own; the fronts are O(F log F).

#[cfg(test)]
mod tests;

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::DVec3;
use rayon::prelude::*;

use crate::mesh::geometry::{angle, centroid, triangle_area};
use crate::mesh::id::{Face, Vertex};
use crate::mesh::topology::{EdgeTable, VertexFaces};
use crate::mesh::{FaceId, IdVec, Surface, VertexId};
use crate::technique::eigen::{Symmetric, symmetric_eigen};
use crate::watch::{Cancelled, Watch};

/// `ε` and `η` of the paper.
const EPSILON: f64 = 2.0;
const ETA: f64 = 2.0;

/// Rounds of the bilateral mean; each reaches one ring further.
const ROUNDS: usize = 4;
/// Normals at this distance (chord; 20 degrees) still mix with a weight of 0.6.
const MIXING: f64 = 0.35;
/// A front does not enter a face whose normal differs by more, in degrees.
const MOST_TURN: f64 = 60.0;
/// A face smaller than this share of its neighbours' mean has no normal worth keeping.
const SLIVER: f64 = 0.2;
/// Vertices a task; the scratch space of a task is as large as the mesh, but only touched where it works.
const CHUNK: usize = 8192;

/// The normals of the faces, equal on both sides of edges that are not sharp but for the bend of the surface.
pub(super) fn normals(
    surface: &Surface,
    edges: &EdgeTable,
    raw: IdVec<Face, DVec3>,
    radius: f64,
    watch: &Watch,
) -> Result<IdVec<Face, DVec3>, Cancelled> {
    watch.phase("voting", None);
    let fans = VertexFaces::new(surface);
    let areas: IdVec<Face, f64> = surface.faces.ids().map(|f| triangle_area(surface.corners(f))).collect();
    let smooth = smooth_vertices(surface, &fans, &areas, &raw, radius, watch)?;
    let mut normals = raw;
    for _ in 0..ROUNDS {
        watch.check()?;
        normals = denoised(surface, &fans, &areas, &normals);
    }
    Ok(fronts(surface, edges, &smooth, &normals))
}

/// One task's distances: valid where the stamp is the vertex's own number.
struct Reach {
    stamp: Vec<u32>,
    distance: Vec<f64>,
    face_stamp: Vec<u32>,
    queue: BinaryHeap<Reverse<(u64, VertexId)>>,
    faces: Vec<(FaceId, f64)>,
}

impl Reach {
    fn new(surface: &Surface) -> Self {
        Self {
            stamp: vec![0; surface.points.len()],
            distance: vec![0.0; surface.points.len()],
            face_stamp: vec![0; surface.faces.len()],
            queue: BinaryHeap::new(),
            faces: Vec::new(),
        }
    }

    fn visit(&mut self, v: VertexId, distance: f64, stamp: u32) {
        let at = v.index();
        if self.stamp[at] != stamp || distance < self.distance[at] {
            self.stamp[at] = stamp;
            self.distance[at] = distance;
            // Bits of non-negative numbers have their order.
            self.queue.push(Reverse((distance.to_bits(), v)));
        }
    }

    /// Finds the faces within `radius` of `centre` with their distances, nearest corner first.
    fn search(&mut self, surface: &Surface, fans: &VertexFaces, centre: VertexId, radius: f64) {
        let stamp = centre.raw() + 1;
        self.faces.clear();
        self.visit(centre, 0.0, stamp);
        while let Some(Reverse((bits, v))) = self.queue.pop() {
            let here = f64::from_bits(bits);
            if here > self.distance[v.index()] {
                continue;
            }
            for &f in fans.of(v) {
                if std::mem::replace(&mut self.face_stamp[f.index()], stamp) != stamp {
                    let there = here + surface.points[v].distance(centroid(surface.corners(f)));
                    if there <= radius {
                        self.faces.push((f, there));
                    }
                }
                for w in surface.faces[f] {
                    let there = here + surface.points[v].distance(surface.points[w]);
                    if w != v && there < radius {
                        self.visit(w, there, stamp);
                    }
                }
            }
        }
    }
}

/// Whether each vertex is smooth by the votes of the faces in reach.
fn smooth_vertices(
    surface: &Surface,
    fans: &VertexFaces,
    areas: &IdVec<Face, f64>,
    normals: &IdVec<Face, DVec3>,
    radius: f64,
    watch: &Watch,
) -> Result<IdVec<Vertex, bool>, Cancelled> {
    let all: Vec<VertexId> = surface.points.ids().collect();
    let of_chunk = |chunk: &[VertexId]| -> Result<Vec<bool>, Cancelled> {
        let mut reach = Reach::new(surface);
        let mut found = Vec::with_capacity(chunk.len());
        for &v in chunk {
            if found.len() % 256 == 0 {
                watch.check()?;
            }
            reach.search(surface, fans, v, radius);
            let of = |mirrored| is_smooth(&votes(surface, v, &reach.faces, (areas, normals), radius, mirrored));
            found.push(of(true) && of(false));
        }
        Ok(found)
    };
    let parts: Result<Vec<Vec<bool>>, Cancelled> = all.par_chunks(CHUNK).map(of_chunk).collect();
    Ok(parts?.concat().into())
}

/// The vote tensor of a vertex.
fn votes(
    surface: &Surface,
    v: VertexId,
    faces: &[(FaceId, f64)],
    (areas, normals): (&IdVec<Face, f64>, &IdVec<Face, DVec3>),
    radius: f64,
    mirrored: bool,
) -> Symmetric {
    let here = surface.points[v];
    let largest = faces.iter().map(|&(f, _)| areas[f]).fold(f64::MIN_POSITIVE, f64::max);
    let mut tensor = [0.0; 6];
    for &(f, distance) in faces {
        let u = (centroid(surface.corners(f)) - here).normalize_or_zero();
        let normal = normals[f];
        let vote = if mirrored { normal - 2.0 * normal.dot(u) * u } else { normal };
        let [x, y, z] = vote.to_array();
        let weight = areas[f] / largest * libm::exp(-3.0 * distance / radius);
        for (sum, product) in tensor.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z]) {
            *sum += weight * product;
        }
    }
    tensor
}

fn is_smooth(tensor: &Symmetric) -> bool {
    let [(third, _), (second, _), (first, _)] = symmetric_eigen(tensor);
    let smooth = first - second;
    smooth >= EPSILON * (second - third) && smooth >= EPSILON * ETA * third
}

/// One round of the bilateral mean over the faces that share a vertex.
fn denoised(
    surface: &Surface,
    fans: &VertexFaces,
    areas: &IdVec<Face, f64>,
    normals: &IdVec<Face, DVec3>,
) -> IdVec<Face, DVec3> {
    let all: Vec<FaceId> = surface.faces.ids().collect();
    let of = |&f: &FaceId| {
        let own = normals[f];
        let around = || surface.faces[f].iter().flat_map(|&v| fans.of(v));
        let is_sliver = areas[f] * (around().count() as f64) < SLIVER * around().map(|&g| areas[g]).sum::<f64>();
        let mut sum = DVec3::ZERO;
        for &g in around() {
            let weight =
                if is_sliver { 1.0 } else { libm::exp(-normals[g].distance_squared(own) / (2.0 * MIXING * MIXING)) };
            sum += areas[g] * weight * normals[g];
        }
        sum.try_normalize().unwrap_or(own)
    };
    all.par_iter().map(of).collect::<Vec<_>>().into()
}

/// Lets the normals of smooth faces enter the band, in the order of the least turn.
fn fronts(
    surface: &Surface,
    edges: &EdgeTable,
    smooth: &IdVec<Vertex, bool>,
    normals: &IdVec<Face, DVec3>,
) -> IdVec<Face, DVec3> {
    let sides = edges.edges_of_triangles(surface.faces.len());
    let neighbours = |f: FaceId| sides[f].into_iter().flat_map(|e| edges.sides(e)).map(|s| s.face);
    let mut settled: IdVec<Face, bool> = surface.faces.iter().map(|c| c.iter().all(|&v| smooth[v])).collect();
    let mut result = normals.clone();
    let mut queue: BinaryHeap<Reverse<(u64, FaceId, FaceId)>> = BinaryHeap::new();
    let enter = |queue: &mut BinaryHeap<_>, settled: &IdVec<Face, bool>, result: &IdVec<Face, DVec3>, from: FaceId| {
        for g in neighbours(from).filter(|&g| !settled[g]) {
            let turn = angle(normals[g], result[from]).to_degrees();
            if turn <= MOST_TURN {
                queue.push(Reverse((turn.to_bits(), g, from)));
            }
        }
    };
    for f in surface.faces.ids().filter(|&f| settled[f]) {
        enter(&mut queue, &settled, &result, f);
    }
    while let Some(Reverse((_, f, from))) = queue.pop() {
        if !std::mem::replace(&mut settled[f], true) {
            result[f] = result[from];
            enter(&mut queue, &settled, &result, f);
        }
    }
    result
}
