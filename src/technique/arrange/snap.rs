//! Vertices of faces that meet go to a grid, until no other face is concerned.
//!
//! # Algorithm
//! The grid has a power of two as its unit and lies round the middle of the mesh, so that a mesh that is moved by a
//! multiple of the unit or scaled by a power of two snaps alike. The corners of all faces that meet others are rounded
//! to it, and vertices that round to the place of one of them. Faces that this lets meet others join in, and so do
//! those at an edge of more than two faces and beside faces without area, until there are no more. (Rounding whichever
//! vertex falls on a place that is taken is from S. Lazard, L. Valque. Removing self-intersections in 3D meshes while
//! preserving floating-point coordinates. SGP 2025.)
//!
//! # Invariants
//! - Vertices of other faces keep their coordinates.
//! - Faces that meet others, or lie on each other, have all corners on the grid.
//! - No two vertices are at one place, and no face is without area.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::DVec3;
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

use super::Fault;
use super::exact::{BITS, Corner};
use crate::mesh::bvh::{Primitive, Triangle, TriangleBvh};
use crate::mesh::geometry::Aabb;
use crate::mesh::predicate::{Meeting, is_degenerate, triangle_triangle};
use crate::watch::Watch;

/// Places that vertices are rounded to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    centre: DVec3,
    pub(super) unit: f64,
}

impl Grid {
    /// The grid of so many bits less than the finest one over a box. Coordinates of floats are never finer.
    pub(super) fn new(bounds: &Aabb, coarser: u32) -> Self {
        let extent = (bounds.max - bounds.min).max_element();
        let farthest = bounds.min.abs().max(bounds.max.abs()).max_element();
        // The box takes half of what the bits hold, which leaves room for rounding.
        let fine = libm::frexp(extent).1 + 1 - BITS as i32;
        let held = libm::frexp(farthest).1 - f64::MANTISSA_DIGITS as i32 + 1;
        let unit = libm::ldexp(1.0, (fine + coarser as i32).max(held));
        Self { centre: (bounds.centre() / unit).round() * unit, unit }
    }

    pub(super) fn corner(&self, p: DVec3) -> Corner {
        ((p - self.centre) / self.unit).round().to_array().map(|x| x as i64)
    }

    /// The place of a point given in units.
    pub(super) fn place(&self, at: DVec3) -> DVec3 {
        self.centre + at * self.unit
    }

    fn snapped(&self, p: DVec3) -> DVec3 {
        self.place(DVec3::from_array(self.corner(p).map(|x| x as f64)))
    }
}

/// A mesh of triangles over vertices of different places.
#[derive(Clone, Debug, Default)]
pub(super) struct Mesh {
    pub(super) points: Vec<DVec3>,
    pub(super) faces: Vec<[u32; 3]>,
    /// The face that each comes from.
    pub(super) origin: Vec<u32>,
}

impl Mesh {
    pub(super) fn triangle(&self, face: u32) -> Triangle {
        self.faces[face as usize].map(|v| self.points[v as usize])
    }

    fn triangles(&self) -> Vec<Triangle> {
        (0..self.faces.len() as u32).into_par_iter().map(|f| self.triangle(f)).collect()
    }

    /// Lets vertices at one place be one, and drops faces without area; the faces before say which these were.
    fn weld(&mut self) -> Vec<u32> {
        let mut first: FxHashMap<[u64; 3], u32> = FxHashMap::default();
        let key = |p: DVec3| p.to_array().map(|x| (x + 0.0).to_bits());
        let joined: Vec<u32> =
            self.points.iter().enumerate().map(|(v, &p)| *first.entry(key(p)).or_insert(v as u32)).collect();
        let mut dropped = Vec::new();
        for (f, face) in self.faces.iter_mut().enumerate() {
            *face = face.map(|v| joined[v as usize]);
            if is_degenerate(face.map(|v| self.points[v as usize])) {
                dropped.push(f as u32);
            }
        }
        dropped
    }

    fn drop_faces(&mut self, dropped: &[u32], touched: &mut Vec<bool>) {
        let mut keep = vec![true; self.faces.len()];
        for &f in dropped {
            keep[f as usize] = false;
        }
        retain(&mut self.faces, &keep);
        retain(&mut self.origin, &keep);
        retain(touched, &keep);
    }
}

fn retain<T>(items: &mut Vec<T>, keep: &[bool]) {
    let mut at = 0;
    items.retain(|_| {
        at += 1;
        keep[at - 1]
    });
}

/// What came of snapping.
#[derive(Debug)]
pub(super) struct Snapped {
    /// Faces that meet others, or are beside them.
    pub(super) touched: Vec<bool>,
    /// Pairs of faces that meet, the lower one first, in order.
    pub(super) pairs: Vec<(u32, u32, Meeting)>,
    /// The furthest that a vertex went.
    pub(super) moved: f64,
}

/// Snaps the faces given, which meet others, and all that have to follow.
pub(super) fn snap(mesh: &mut Mesh, meeting: &[u32], grid: &Grid, watch: &Watch) -> Result<Snapped, Fault> {
    let mut touched = vec![false; mesh.faces.len()];
    for &f in meeting {
        touched[f as usize] = true;
    }
    let before = mesh.points.clone();
    let mut state = State { grid: *grid, at_grid: vec![false; mesh.points.len()], taken: FxHashSet::default() };
    let dropped = mesh.weld();
    touch_around(mesh, &dropped, &mut touched);
    mesh.drop_faces(&dropped, &mut touched);
    loop {
        watch.check()?;
        state.spread(mesh, &mut touched, watch)?;
        let dropped = mesh.weld();
        mesh.drop_faces(&dropped, &mut touched);
        if !touch_crowded_edges(mesh, &mut touched) {
            break;
        }
    }
    let moved = mesh.points.iter().zip(&before).map(|(p, q)| p.distance(*q)).fold(0.0, f64::max);
    let pairs = pairs_of(mesh, &touched, watch)?;
    Ok(Snapped { touched, pairs, moved })
}

struct State {
    grid: Grid,
    at_grid: Vec<bool>,
    /// Places on the grid with a vertex; asked, never iterated.
    taken: FxHashSet<Corner>,
}

impl State {
    /// Snaps touched faces, and whichever these meet, before or then.
    fn spread(&mut self, mesh: &mut Mesh, touched: &mut [bool], watch: &Watch) -> Result<(), Fault> {
        let margin = self.grid.unit;
        let tree = TriangleBvh::new(mesh.triangles());
        let mut looked = vec![false; mesh.faces.len()];
        loop {
            let moved = self.move_corners(mesh, touched);
            let is_moved = |f: usize| mesh.faces[f].iter().any(|&v| moved[v as usize]);
            let is_new = |f: usize| touched[f] && !looked[f];
            let concerned: Vec<u32> =
                (0..mesh.faces.len()).filter(|&f| is_moved(f) || is_new(f)).map(|f| f as u32).collect();
            for &f in &concerned {
                looked[f as usize] = true;
            }
            let mesh = &*mesh;
            let found = search(
                &concerned,
                mesh.faces.len(),
                watch,
                |f, visit| tree.for_each_in(&mesh.triangle(f).bounds().grown(margin), |g, _| visit(g)),
                &|f, g| meets(mesh, f, g).is_some(),
            )?;
            let mut is_changed = false;
            for face in found.into_iter().flat_map(|(f, g)| [f, g]) {
                is_changed |= !touched[face as usize];
                touched[face as usize] = true;
            }
            if !is_changed {
                return Ok(());
            }
        }
    }

    /// Moves the corners of touched faces, and vertices that round to their places; says which were moved.
    fn move_corners(&mut self, mesh: &mut Mesh, touched: &[bool]) -> Vec<bool> {
        let mut moved = vec![false; mesh.points.len()];
        for (face, _) in mesh.faces.iter().zip(touched).filter(|(_, touched)| **touched) {
            for &v in face {
                if !self.at_grid[v as usize] {
                    moved[v as usize] = true;
                    self.taken.insert(self.grid.corner(mesh.points[v as usize]));
                }
            }
        }
        for (v, moved) in moved.iter_mut().enumerate() {
            let point = &mut mesh.points[v];
            if *moved || (!self.at_grid[v] && self.taken.contains(&self.grid.corner(*point))) {
                let snapped = self.grid.snapped(*point);
                self.at_grid[v] = true;
                *moved = snapped != *point;
                *point = snapped;
            }
        }
        moved
    }
}

/// How two faces meet; `None` where they do not, or one has no area.
fn meets(mesh: &Mesh, f: u32, g: u32) -> Option<Meeting> {
    let meeting = triangle_triangle(mesh.triangle(f), mesh.triangle(g));
    (meeting.is_intersection() || meeting == Meeting::Duplicate).then_some(meeting)
}

/// All pairs of touched faces that meet.
fn pairs_of(mesh: &Mesh, touched: &[bool], watch: &Watch) -> Result<Vec<(u32, u32, Meeting)>, Fault> {
    let faces: Vec<u32> = (0..mesh.faces.len() as u32).filter(|&f| touched[f as usize]).collect();
    let tree = TriangleBvh::new(faces.iter().map(|&f| mesh.triangle(f)).collect());
    let near = |f: u32, visit: &mut dyn FnMut(u32) -> ControlFlow<()>| {
        tree.for_each_in(&mesh.triangle(f).bounds(), |i, _| visit(faces[i as usize]))
    };
    let found = search(&faces, mesh.faces.len(), watch, near, &|f, g| f < g && meets(mesh, f, g).is_some())?;
    Ok(found.into_par_iter().filter_map(|(f, g)| Some((f, g, meets(mesh, f, g)?))).collect())
}

/// Candidates that any mesh may have, and further ones for each face.
const CANDIDATES: (u64, u64) = (1 << 24, 256);

/// The pairs of these faces with those near them for which the test holds, in order.
fn search(
    faces: &[u32],
    all: usize,
    watch: &Watch,
    near: impl Fn(u32, &mut dyn FnMut(u32) -> ControlFlow<()>) -> ControlFlow<()> + Sync,
    test: &(dyn Fn(u32, u32) -> bool + Sync),
) -> Result<Vec<(u32, u32)>, Fault> {
    let looked = AtomicU64::new(0);
    let most = CANDIDATES.0 + CANDIDATES.1 * all as u64;
    let lists: Vec<Vec<(u32, u32)>> = faces
        .par_iter()
        .map(|&f| {
            let mut list = Vec::new();
            let mut count = 0;
            let _ = near(f, &mut |g| {
                count += 1;
                if count % 4096 == 0 && looked.fetch_add(4096, Ordering::Relaxed) > most {
                    return ControlFlow::Break(());
                }
                if g != f && test(f, g) {
                    list.push((f, g));
                }
                ControlFlow::Continue(())
            });
            looked.fetch_add(count % 4096, Ordering::Relaxed);
            list.sort_unstable();
            list
        })
        .collect();
    watch.check()?;
    if looked.load(Ordering::Relaxed) > most {
        return Err(Fault::TooMany);
    }
    Ok(lists.into_iter().flatten().collect())
}

/// Touches what shares a corner with these faces.
fn touch_around(mesh: &Mesh, faces: &[u32], touched: &mut [bool]) {
    if faces.is_empty() {
        return;
    }
    let mut at = vec![false; mesh.points.len()];
    faces.iter().flat_map(|&f| mesh.faces[f as usize]).for_each(|v| at[v as usize] = true);
    for (face, touched) in mesh.faces.iter().zip(touched) {
        *touched |= face.iter().any(|&v| at[v as usize]);
    }
}

/// Touches the faces at edges of more than two; says whether one was not touched before.
fn touch_crowded_edges(mesh: &Mesh, touched: &mut [bool]) -> bool {
    let mut edges: Vec<(u32, u32, u32)> = Vec::with_capacity(3 * mesh.faces.len());
    for (f, &[a, b, c]) in mesh.faces.iter().enumerate() {
        edges.extend([(a, b), (b, c), (c, a)].map(|(a, b)| (a.min(b), a.max(b), f as u32)));
    }
    edges.par_sort_unstable();
    let mut is_changed = false;
    for same in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).filter(|same| same.len() > 2) {
        for &(.., f) in same {
            is_changed |= !touched[f as usize];
            touched[f as usize] = true;
        }
    }
    is_changed
}
