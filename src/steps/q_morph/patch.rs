//! A piece of a finished mesh, meshed anew within the rim that it has.

use rustc_hash::{FxHashMap, FxHashSet};
use smallvec::smallvec;

use super::reuse::sign;
use crate::mesh::{Facet, Soup, VertexId};
use crate::technique::clean_quads::{clean, finish};
use crate::technique::front::advance;
use crate::technique::ground::Ground;
use crate::technique::isotropic::{Rules, polish, refill};
use crate::technique::join::{join_along_paths, join_neighbours};
use crate::technique::mixed::{Corners, Disk, Mixed, NONE, Place, triangle_quality};
use crate::watch::{Cancelled, Watch};

/// A patch with more than so many times the faces has an unlucky rim, and comes out poor after long work.
const MORE: usize = 2;
/// Shapes that the last optimisation is for, and how many of them it can mend.
const POOR: f64 = 0.35;
const MENDABLE: usize = 8;

/// The faces of a disk inside one region.
pub(super) struct Patch {
    /// The faces.
    pub(super) faces: Vec<u32>,
    region: u32,
    /// The vertices of its rim.
    rim: Vec<u32>,
}

impl Patch {
    /// The faces round one, so many rings of neighbours at corners, all in its region: as many of them as make a disk.
    /// `None` where that is no more than the one.
    pub(super) fn around(mesh: &Mixed, face: u32, rings: usize) -> Option<Self> {
        let region = mesh.region(face);
        let mut disk = Disk::of(mesh, face);
        let mut last = 0..1;
        for _ in 0..rings {
            let mut ring: Vec<u32> = Vec::new();
            for &f in &disk.faces[last.clone()] {
                for v in mesh.corners(f) {
                    // Only through vertices inside: beyond a curve lie other parts of the region.
                    if mesh.place(v).is_free() {
                        ring.extend(mesh.faces_at(v).filter(|&f| mesh.region(f) == region));
                    }
                }
            }
            last = last.end..disk.grow(mesh, ring);
        }
        let mut rim = disk.rim(mesh);
        rim.sort_unstable();
        (disk.faces.len() > 1).then_some(Self { faces: disk.faces, region, rim })
    }

    /// A number for its faces as they lie, that is another one when they change.
    pub(super) fn sign(&self, mesh: &Mixed) -> u64 {
        self.faces.iter().fold(0, |sum, &f| sum.wrapping_add(sign(mesh, f)))
    }

    /// Quads for the patch, with sizes inside times `scale`: a mesh of its own that begins with the vertices of the rim.
    /// `None` where there is a triangle left, and as soon as it comes out too bad to become good.
    pub(super) fn remade(
        &self,
        mesh: &Mixed,
        ground: &Ground<'_>,
        rules: Rules,
        scale: f64,
        watch: &Watch,
    ) -> Result<Option<Mixed>, Cancelled> {
        let Some(mut patch) = self.triangles(mesh, scale) else { return Ok(None) };
        let mut awake = vec![false; ground.region_count()];
        awake[self.region as usize] = true;
        refill(&mut patch, ground, rules, watch)?;
        polish(&mut patch, ground, rules, 4, &awake);
        advance(&mut patch, ground, watch)?;
        join_neighbours(&mut patch);
        join_along_paths(&mut patch, ground);
        if patch.census().0 > 0 || patch.faces().count() > MORE * self.faces.len() + 8 {
            return Ok(None);
        }
        clean(&mut patch, ground, rules.curve_tolerance, &awake, watch)?;
        if patch.faces().filter(|&f| patch.quality(f) < POOR).count() > MENDABLE {
            return Ok(None);
        }
        finish(&mut patch, ground, rules.curve_tolerance, &awake, watch)?;
        Ok(Some(patch))
    }

    /// The patch cut into triangles.
    fn triangles(&self, mesh: &Mixed, scale: f64) -> Option<Mixed> {
        let mut number: FxHashMap<u32, u32> = FxHashMap::default();
        let mut list = self.rim.clone();
        number.extend(self.rim.iter().enumerate().map(|(i, &v)| (v, i as u32)));
        let (mut soup, mut regions) = (Soup::default(), Vec::new());
        for &f in &self.faces {
            let corners = mesh.corners(f);
            for &v in &corners {
                number.entry(v).or_insert_with(|| {
                    list.push(v);
                    list.len() as u32 - 1
                });
            }
            for triangle in cut(mesh, &corners) {
                soup.faces.push(Facet::Tri(triangle.map(|v| VertexId::from_raw(number[&v]))));
                regions.push(self.region);
            }
        }
        soup.points = list.iter().map(|&v| mesh.point(v)).collect::<Vec<_>>().into();
        let place = |i: usize| if i < self.rim.len() { Place::Node } else { Place::Region(self.region) };
        let places = (0..list.len()).map(place).collect();
        let mut patch = Mixed::new(&soup, places, regions, |_, _| NONE)?;
        let largest = list.iter().map(|&v| mesh.size(v)).fold(0.0, f64::max);
        for (i, &v) in list.iter().enumerate() {
            patch.set_point(i as u32, mesh.point(v), mesh.normal(v));
            patch.set_size(i as u32, scale * largest);
        }
        for i in 0..self.rim.len() as u32 {
            let (sum, n) = patch
                .star(i)
                .filter(|&h| is_rim(&patch, h))
                .fold((0.0, 0.0), |(sum, n), h| (sum + patch.length(h), n + 1.0));
            patch.set_size(i, sum / f64::max(n, 1.0));
        }
        Some(patch)
    }

    /// Puts quads made for the patch into its place, within an open transaction. Returns the new faces; `None` where they
    /// do not fit, and the transaction must be rolled back.
    pub(super) fn put_back(&self, mesh: &mut Mixed, patch: &Mixed) -> Option<Vec<u32>> {
        let inside: FxHashSet<u32> = self.faces.iter().copied().collect();
        let is_old = |mesh: &Mixed, h: u32| inside.contains(&mesh.face(h));
        let mut number: FxHashMap<u32, u32> = self.rim.iter().enumerate().map(|(i, &v)| (i as u32, v)).collect();
        let mut new: Vec<Corners> = Vec::new();
        for h in patch.edges().filter(|&h| patch.face(h) != NONE && patch.face(h ^ 1) != NONE) {
            // A chord between vertices of the rim that an edge outside joins already.
            if let (Some(&a), Some(&b)) = (number.get(&patch.origin(h)), number.get(&patch.target(h)))
                && let Some(k) = mesh.find(a, b)
                && !(is_old(mesh, k) && is_old(mesh, k ^ 1))
            {
                return None;
            }
        }
        for f in patch.faces() {
            let mut corners: Corners = smallvec![];
            for v in patch.corners(f) {
                corners.push(*number.entry(v).or_insert_with(|| {
                    mesh.add_vertex(patch.point(v), patch.normal(v), patch.place(v), patch.size(v))
                }));
            }
            new.push(corners);
        }
        let made = mesh.replace(&self.faces, &new, None)?.to_vec();
        let is_sound = |v: u32| !mesh.place(v).is_free() || mesh.valence(v) > 2;
        self.rim.iter().all(|&v| is_sound(v)).then_some(made)
    }
}

fn is_rim(mesh: &Mixed, h: u32) -> bool {
    mesh.face(h) == NONE || mesh.face(h ^ 1) == NONE
}

/// A face as triangles, a quad cut where the poorer one is better.
fn cut(mesh: &Mixed, corners: &Corners) -> Vec<[u32; 3]> {
    let &[a, b, c, d] = corners.as_slice() else { return vec![[corners[0], corners[1], corners[2]]] };
    let quality = |triangle: [u32; 3]| triangle_quality(triangle.map(|v| mesh.point(v)));
    let ways = [[[a, b, c], [a, c, d]], [[a, b, d], [b, c, d]]];
    let worse = ways.map(|way| quality(way[0]).min(quality(way[1])));
    ways[usize::from(worse[1] > worse[0])].to_vec()
}
