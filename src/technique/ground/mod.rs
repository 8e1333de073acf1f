//! A surface as the ground of another mesh: its curves, the regions between them, and the way back onto both.
//!
//! The network of curves is made of all marked edges, all rims, and all edges where the region label changes. It is cut
//! at nodes: where not exactly two of its edges meet, at kept vertices, and where it turns sharply; a curve without any
//! gets one. The rest of the surface falls into regions, each with a box hierarchy of its own, so that a point of one
//! sheet of a thin wall is never put onto the other.
//!
//! # Cost
//! O(F log F) to build; O(log F) a projection.

mod choose;
mod curve;
mod sample;

use std::collections::BTreeSet;

use glam::DVec3;
use rustc_hash::FxHashMap;

pub use choose::Choice;
pub use curve::Curve;
pub(crate) use sample::respread;
pub use sample::sample;

use super::mixed::{Mixed, NONE, Place};
use crate::mesh::bvh::{Closest, TriangleBvh};
use crate::mesh::geometry::triangle_normal;
use crate::mesh::topology::EdgeTable;
use crate::mesh::{FaceId, Freedom, Surface, VertexId};

/// A turn of the network above this many degrees is a node.
const CORNER: f64 = 40.0;

/// One region's faces.
#[derive(Debug)]
struct Sheet {
    tree: TriangleBvh,
    faces: Vec<FaceId>,
}

/// A point put onto the surface.
#[derive(Clone, Copy, Debug)]
pub struct Foot {
    /// Where.
    pub point: DVec3,
    /// The unit normal of the face there, zero where it has none.
    pub normal: DVec3,
    /// The face.
    pub face: FaceId,
    /// The squared distance moved.
    pub distance_squared: f64,
}

/// The surface, its curves and its regions.
#[derive(Debug)]
pub struct Ground<'a> {
    /// The surface.
    pub surface: &'a Surface,
    /// The curves.
    pub curves: Vec<Curve>,
    /// The region of each face.
    pub regions: Vec<u32>,
    /// What each vertex of the surface is bound to.
    pub places: Vec<Place>,
    arcs: FxHashMap<[VertexId; 2], u32>,
    sheets: Vec<Sheet>,
    /// The regions on both sides of each curve, [`NONE`] beyond a rim.
    pub beside: Vec<[u32; 2]>,
    /// Borders that are not followed.
    pub left_out: usize,
}

impl<'a> Ground<'a> {
    /// Finds curves and regions of a surface.
    pub fn new(surface: &'a Surface) -> Self {
        Self::following(surface, None)
    }

    /// The same without the borders of regions that `choice` speaks against.
    pub fn following(surface: &'a Surface, choice: Option<&Choice>) -> Self {
        let edges = EdgeTable::new(surface);
        let mut network = curve::network(surface, &edges);
        let (left_out, released) =
            choice.map(|choice| choose::leave_out(surface, &edges, &mut network, CORNER, choice)).unwrap_or_default();
        let is_node = curve::nodes(surface, &network, CORNER, &released);
        let curves = curve::curves(surface, &network, is_node);
        let mut arcs = FxHashMap::default();
        for (arc, curve) in curves.iter().enumerate() {
            for pair in curve.vertices.windows(2) {
                arcs.insert(crate::mesh::edge_key(pair[0], pair[1]), arc as u32);
            }
        }
        let (regions, count) = flood(surface, &edges, &arcs);
        let places = places(surface, &curves, &regions, &released);
        let beside = beside(&edges, &curves, &regions);
        let mut of: Vec<Vec<FaceId>> = vec![Vec::new(); count];
        for f in surface.faces.ids() {
            of[regions[f.index()] as usize].push(f);
        }
        let sheet = |faces: Vec<FaceId>| Sheet {
            tree: TriangleBvh::new(faces.iter().map(|&f| surface.corners(f)).collect()),
            faces,
        };
        Self { surface, curves, regions, places, arcs, sheets: of.into_iter().map(sheet).collect(), beside, left_out }
    }

    /// Where the ends of an edge on a curve are on it.
    pub fn ends_on(&self, mesh: &Mixed, h: u32) -> [f64; 2] {
        let arc = mesh.arc(h);
        let curve = &self.curves[arc as usize];
        let ends = [mesh.origin(h), mesh.target(h)];
        let known = ends.map(|v| match mesh.place(v) {
            Place::Arc { arc: other, at } if other == arc => Some(at),
            _ => None,
        });
        let length = curve.length();
        let off = |v: u32, end: f64| curve.at(end).distance_squared(mesh.point(v));
        match known {
            [Some(a), Some(b)] => [a, b],
            [Some(at), None] | [None, Some(at)] => {
                let node = ends[usize::from(known[0].is_some())];
                // Of the ends of a closed curve, which are one point, the one on this side.
                let is_first = if curve.is_closed() { 2.0 * at < length } else { off(node, 0.0) < off(node, length) };
                known.map(|known| known.unwrap_or(if is_first { 0.0 } else { length }))
            }
            [None, None] if off(ends[0], 0.0) <= off(ends[0], length) => [0.0, length],
            [None, None] => [length, 0.0],
        }
    }

    /// Number of regions.
    pub fn region_count(&self) -> usize {
        self.sheets.len()
    }

    /// The point of a region nearest to `p`.
    pub fn project(&self, region: u32, p: DVec3) -> Foot {
        let sheet = &self.sheets[region as usize];
        self.foot(sheet, p, sheet.tree.closest(p))
    }

    /// The same, quicker where `from` is a point of the region not far away: nothing farther than it is looked at.
    pub fn project_from(&self, region: u32, p: DVec3, from: DVec3) -> Foot {
        let sheet = &self.sheets[region as usize];
        let bound = p.distance_squared(from) * (1.0 + 1e-6);
        match sheet.tree.closest_within(p, bound) {
            None => self.project(region, p),
            found => self.foot(sheet, p, found),
        }
    }

    fn foot(&self, sheet: &Sheet, p: DVec3, found: Option<Closest>) -> Foot {
        match found {
            Some(closest) => {
                let face = sheet.faces[closest.index as usize];
                Foot {
                    point: closest.nearest.point,
                    normal: triangle_normal(self.surface.corners(face)).unwrap_or(DVec3::ZERO),
                    face,
                    distance_squared: closest.nearest.distance_squared,
                }
            }
            None => Foot { point: p, normal: DVec3::ZERO, face: FaceId::from_raw(0), distance_squared: 0.0 },
        }
    }

    /// The surface as a workshop, bound to this ground; `None` where it is no manifold.
    pub fn workshop(&self) -> Option<Mixed> {
        let mut soup = self.surface.to_soup();
        soup.carried = crate::mesh::Carried::default();
        let arc = |a, b| self.arcs.get(&crate::mesh::edge_key(a, b)).copied().unwrap_or(NONE);
        Mixed::new(&soup, self.places.clone(), self.regions.clone(), arc)
    }
}

/// Faces joined across edges that are on no curve; regions are numbered by their lowest face.
fn flood(surface: &Surface, edges: &EdgeTable, arcs: &FxHashMap<[VertexId; 2], u32>) -> (Vec<u32>, usize) {
    let mut beside: Vec<[u32; 3]> = vec![[NONE; 3]; surface.faces.len()];
    for (_, key, sides) in edges.iter() {
        if let [s, t] = sides
            && !arcs.contains_key(&key)
        {
            beside[s.face.index()][s.side as usize] = t.face.raw();
            beside[t.face.index()][t.side as usize] = s.face.raw();
        }
    }
    let mut regions = vec![NONE; surface.faces.len()];
    let mut count = 0;
    let mut waiting = Vec::new();
    for f in 0..surface.faces.len() as u32 {
        if regions[f as usize] != NONE {
            continue;
        }
        waiting.push(f);
        regions[f as usize] = count;
        while let Some(g) = waiting.pop() {
            for next in beside[g as usize] {
                if next != NONE && regions[next as usize] == NONE {
                    regions[next as usize] = count;
                    waiting.push(next);
                }
            }
        }
        count += 1;
    }
    (regions, count as usize)
}

/// The regions on both sides of each curve's first edge, and so of all its edges.
fn beside(edges: &EdgeTable, curves: &[Curve], regions: &[u32]) -> Vec<[u32; 2]> {
    let of = |curve: &Curve| {
        let mut sides = [NONE; 2];
        if let Some(e) = edges.find(crate::mesh::edge_key(curve.vertices[0], curve.vertices[1])) {
            for (slot, side) in sides.iter_mut().zip(edges.sides(e)) {
                *slot = regions[side.face.index()];
            }
        }
        sides
    };
    curves.iter().map(of).collect()
}

fn places(surface: &Surface, curves: &[Curve], regions: &[u32], released: &BTreeSet<VertexId>) -> Vec<Place> {
    let mut places = vec![Place::Node; surface.points.len()];
    for (f, corners) in surface.faces.enumerate() {
        for v in corners {
            places[v.index()] = Place::Region(regions[f.index()]);
        }
    }
    for (v, freedom) in &surface.carried.pins {
        if *freedom == Freedom::Keep && v.index() < places.len() && !released.contains(v) {
            places[v.index()] = Place::Node;
        }
    }
    for (arc, curve) in curves.iter().enumerate() {
        let last = curve.vertices.len() - 1;
        for (i, v) in curve.vertices.iter().enumerate() {
            let inside = 0 < i && i < last;
            places[v.index()] = if inside { Place::Arc { arc: arc as u32, at: curve.along[i] } } else { Place::Node };
        }
    }
    places
}
