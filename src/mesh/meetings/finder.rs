//! Which triangles may meet: boxes, and what tells those apart whose boxes cannot.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use glam::DVec3;
use rayon::prelude::*;

use crate::mesh::bvh::{Bvh, Triangle, TriangleBvh};
use crate::mesh::geometry::Aabb;

/// Triangles at a corner or edge from which on they are told apart by direction; fewer are compared by twos.
const MANY: usize = 48;
/// No corner, edge or label of this number.
const NONE: u32 = u32::MAX;
/// Rounding of directions, far above what a difference and a division lose.
const NOISE: f64 = 1e-9;

/// Triangles of different corners, and hierarchies over them.
pub(super) struct Finder {
    /// The triangles of each set of corners, in order; sets in the order of their first triangle.
    copies: Vec<Vec<u32>>,
    boxes: TriangleBvh,
    /// The corner of very many that each node of the boxes has to itself.
    labels: Vec<u32>,
    /// The corner of very many that a triangle is at, the edge of very many at that corner, and its places there.
    stars: Vec<Place>,
    edges: Vec<Place>,
    star_fans: BTreeMap<u32, Fan>,
    edge_fans: BTreeMap<(u32, u32), Fan>,
}

#[derive(Clone, Copy)]
struct Place {
    /// Which corner; [`NONE`] for none.
    of: u32,
    /// The position in its fan.
    slot: u32,
}

impl Place {
    const NOWHERE: Self = Self { of: NONE, slot: 0 };

    fn is_with(self, other: Self) -> bool {
        self.of != NONE && self.of == other.of
    }
}

/// Triangles at one corner or edge, by boxes in the space of directions.
struct Fan {
    members: Vec<u32>,
    boxes: Vec<Aabb>,
    tree: Bvh<Aabb>,
    labels: Vec<u32>,
}

impl Fan {
    fn new(members: Vec<u32>, boxes: Vec<Aabb>, label: impl Fn(u32) -> u32) -> Self {
        let tree = Bvh::new(boxes.clone());
        let labels = tree.labels(|slot| label(members[slot as usize]));
        Self { members, boxes, tree, labels }
    }

    fn visit(&self, slot: u32, own: u32, visit: &mut dyn FnMut(u32) -> ControlFlow<()>) -> ControlFlow<()> {
        let area = &self.boxes[slot as usize];
        self.tree.for_each_in_but(area, (&self.labels, own), |other, _| visit(self.members[other as usize]))
    }
}

impl Finder {
    pub(super) fn new(triangles: &[Triangle]) -> Self {
        let (points, ids) = numbered(triangles);
        let copies = copies(&ids);
        let corners: Vec<[u32; 3]> = copies.iter().map(|same| ids[same[0] as usize]).collect();
        let unique: Vec<Triangle> = copies.iter().map(|same| triangles[same[0] as usize]).collect();
        let mut stars = vec![Place::NOWHERE; corners.len()];
        let mut edges = stars.clone();
        let all: Vec<u32> = (0..corners.len() as u32).collect();
        let fans = fans(&all, &corners, NONE, &mut stars);
        let (mut star_fans, mut edge_fans) = (BTreeMap::new(), BTreeMap::new());
        for (star, members) in fans {
            let centre = points[star as usize];
            for (edge, at_edge) in self::fans(&members, &corners, star, &mut edges) {
                let along = points[edge as usize] - centre;
                let tip = |t: u32| corners[t as usize].into_iter().find(|&c| c != star && c != edge).unwrap_or(star);
                let boxes = at_edge.iter().map(|&t| leaving(points[tip(t) as usize] - centre, along)).collect();
                edge_fans.insert((star, edge), Fan::new(at_edge, boxes, |_| NONE));
            }
            let rim = |t: u32| corners[t as usize].map(|c| points[c as usize] - centre);
            let boxes = members.iter().map(|&t| arc(rim(t))).collect();
            star_fans.insert(star, Fan::new(members, boxes, |t| edges[t as usize].of));
        }
        let boxes = TriangleBvh::new(unique);
        let labels = boxes.labels(|t| stars[t as usize].of);
        Self { copies, boxes, labels, stars, edges, star_fans, edge_fans }
    }

    /// How many triangles of different corners there are.
    pub(super) fn len(&self) -> usize {
        self.copies.len()
    }

    /// The first triangle with these corners.
    pub(super) fn original(&self, i: u32) -> u32 {
        self.copies[i as usize][0]
    }

    /// How many pairs of triangles one pair stands for.
    pub(super) fn copies(&self, a: u32, b: u32) -> u64 {
        self.copies[a as usize].len() as u64 * self.copies[b as usize].len() as u64
    }

    /// The triangles with the same corners, where there are several.
    pub(super) fn into_copies(self) -> Vec<Vec<u32>> {
        self.copies.into_iter().filter(|same| same.len() > 1).collect()
    }

    /// Calls `add` with these pairs, the lower triangle first.
    pub(super) fn expand(&self, a: u32, b: u32, add: &mut dyn FnMut(u32, u32)) {
        for &i in &self.copies[a as usize] {
            for &j in &self.copies[b as usize] {
                add(i.min(j), i.max(j));
            }
        }
    }

    /// Which search decides about a pair; others may come upon it too.
    fn level(&self, i: u32, j: u32) -> u8 {
        let with = |places: &[Place]| places[i as usize].is_with(places[j as usize]);
        if !with(&self.stars) {
            0
        } else if !with(&self.edges) {
            1
        } else {
            2
        }
    }

    /// Calls `visit` with every triangle that may meet triangle `i`, and with others, until it breaks. For those
    /// that it comes upon where another search is the one to find them, it calls with `i`.
    pub(super) fn for_each_near(
        &self,
        i: u32,
        bounds: Aabb,
        visit: &mut dyn FnMut(u32) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let (star, edge) = (self.stars[i as usize], self.edges[i as usize]);
        let mut on_level = |level: u8, j: u32| visit(if self.level(i, j) == level { j } else { i });
        self.boxes.for_each_in_but(&bounds, (&self.labels, star.of), |j, _| on_level(0, j))?;
        if let Some(fan) = self.star_fans.get(&star.of) {
            fan.visit(star.slot, edge.of, &mut |j| on_level(1, j))?;
        }
        if let Some(fan) = self.edge_fans.get(&(star.of, edge.of)) {
            fan.visit(edge.slot, NONE, &mut |j| on_level(2, j))?;
        }
        ControlFlow::Continue(())
    }
}

/// Points of different coordinates, in order, and the numbers of each triangle's corners among them.
fn numbered(triangles: &[Triangle]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    // Both zeros are one coordinate.
    let key = |p: DVec3| p.to_array().map(|x| (x + 0.0).to_bits());
    let mut order: Vec<([u64; 3], u32)> =
        triangles.as_flattened().iter().enumerate().map(|(at, &p)| (key(p), at as u32)).collect();
    order.par_sort_unstable();
    let (mut points, mut ids) = (Vec::new(), vec![[0_u32; 3]; triangles.len()]);
    for same in order.chunk_by(|a, b| a.0 == b.0) {
        for &(_, at) in same {
            ids[at as usize / 3][at as usize % 3] = points.len() as u32;
        }
        points.push(triangles[same[0].1 as usize / 3][same[0].1 as usize % 3]);
    }
    (points, ids)
}

/// The triangles of each set of corners.
fn copies(ids: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let sorted = |mut corners: [u32; 3]| {
        corners.sort_unstable();
        corners
    };
    let mut order: Vec<([u32; 3], u32)> = ids.iter().enumerate().map(|(i, &c)| (sorted(c), i as u32)).collect();
    order.par_sort_unstable();
    let mut copies: Vec<Vec<u32>> =
        order.chunk_by(|a, b| a.0 == b.0).map(|same| same.iter().map(|&(_, i)| i).collect()).collect();
    copies.sort_unstable_by_key(|same| same[0]);
    copies
}

/// The triangles at each corner of very many, apart from `but`. A triangle goes to its corner with the most; its place
/// is noted.
fn fans(members: &[u32], corners: &[[u32; 3]], but: u32, places: &mut [Place]) -> BTreeMap<u32, Vec<u32>> {
    let mut all: Vec<u32> = members.iter().flat_map(|&t| corners[t as usize]).filter(|&c| c != but).collect();
    all.par_sort_unstable();
    let crowded: BTreeMap<u32, usize> =
        all.chunk_by(|a, b| a == b).filter(|at| at.len() > MANY).map(|at| (at[0], at.len())).collect();
    let mut fans: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    if crowded.is_empty() {
        return fans;
    }
    for &t in members {
        let counted = corners[t as usize].into_iter().filter_map(|c| Some((*crowded.get(&c)?, std::cmp::Reverse(c))));
        let Some((_, std::cmp::Reverse(of))) = counted.max() else { continue };
        let fan = fans.entry(of).or_default();
        places[t as usize] = Place { of, slot: fan.len() as u32 };
        fan.push(t);
    }
    fans
}

/// Everything: where directions cannot be told.
const ALL: Aabb = Aabb { min: DVec3::splat(-2.0), max: DVec3::splat(2.0) };

/// A box around the directions of a triangle's points from one corner, which is at the origin.
fn arc(corners: [DVec3; 3]) -> Aabb {
    let mut rim = corners.into_iter().filter(|&p| p != DVec3::ZERO).map(DVec3::normalize);
    let (Some(a), Some(b)) = (rim.next(), rim.next()) else { return ALL };
    let middle = 0.5 * (a + b);
    let height = middle.length();
    if height.is_nan() || height < 1e-3 {
        return ALL;
    }
    // The arc between two directions bulges beyond its chord, towards the middle, by what this lacks.
    let bulge = middle * ((1.0 - height) / height);
    Aabb::of([a, b, a + bulge, b + bulge]).grown(NOISE)
}

/// A box around the direction in which a triangle leaves an edge, across it.
fn leaving(tip: DVec3, along: DVec3) -> Aabb {
    let along = along.normalize();
    let across = tip - along * tip.dot(along);
    let blur = NOISE * (1.0 + tip.length() / across.length());
    let bounds = Aabb::of([across.normalize()]).grown(blur);
    if bounds.min.is_finite() && bounds.max.is_finite() && blur < 1.0 { bounds } else { ALL }
}
