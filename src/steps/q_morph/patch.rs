//! A piece of a finished mesh, meshed anew within the rim that it has.

use rustc_hash::{FxHashMap, FxHashSet};
use smallvec::smallvec;

use super::reuse::sign;
use crate::mesh::{Facet, Soup, VertexId};
use crate::technique::clean_quads::{clean, finish};
use crate::technique::front::advance;
use crate::technique::ground::Ground;
use crate::technique::isotropic::{Rules, cut_in_three, polish, refill};
use crate::technique::join::{join_along_paths, join_neighbours};
use crate::technique::mixed::{Corners, Disk, Mixed, NONE, Place, triangle_quality};
use crate::watch::{Cancelled, Watch};

/// A patch with more than so many times the faces has an unlucky rim, and comes out poor after long work.
const MORE: usize = 2;
/// Shapes that the last optimisation is for, and how many of them it can mend.
const POOR: f64 = 0.35;
const MENDABLE: usize = 8;
/// Edges on curves are cut if they are longer than this part of the longest side at the place.
const LONG: f64 = 0.6;

/// The faces of a disk, inside one region or across curves.
pub(super) struct Patch {
    /// The faces.
    pub(super) faces: Vec<u32>,
    /// The vertices of its rim.
    rim: Vec<u32>,
    /// The edges on curves inside that are to be cut in three.
    cuts: Vec<u32>,
    /// A number for the face that tells which are.
    seed: u64,
}

/// How a patch is meshed anew.
#[derive(Clone, Copy, Debug)]
pub(super) struct Draw {
    /// Rings of neighbours about the place.
    pub(super) rings: usize,
    /// The part of the sizes there.
    pub(super) scale: f64,
    /// Below this nothing is made smaller.
    pub(super) floor: f64,
    /// Whether the patch goes across curves, and whether long edges on those are cut.
    pub(super) across: Option<Cuts>,
}

/// Which edges on curves within a patch are cut in three.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Cuts {
    /// None.
    None,
    /// The long ones near the place.
    Near,
}

impl Patch {
    /// The faces round one, so many rings of neighbours at corners, all in its region: as many of them as make a disk.
    /// `None` where that is no more than the one.
    pub(super) fn around(mesh: &Mixed, face: u32, draw: Draw) -> Option<Self> {
        let Draw { rings, across, .. } = draw;
        if across.is_some() {
            return Self::across(mesh, face, draw);
        }
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
        Self::of(mesh, disk, Vec::new())
    }

    /// The same across curves. `None` where it meets none, or has a region in several pieces, which could come
    /// together.
    fn across(mesh: &Mixed, face: u32, draw: Draw) -> Option<Self> {
        let mut disk = Disk::across(mesh, face);
        let mut last = 0..1;
        for _ in 0..draw.rings {
            let ring = disk.faces[last.clone()].iter().flat_map(|&f| mesh.corners(f));
            let ring: Vec<u32> = ring.flat_map(|v| mesh.faces_at(v).collect::<Vec<_>>()).collect();
            last = last.end..disk.grow(mesh, ring);
        }
        let regions: FxHashSet<u32> = disk.faces.iter().map(|&f| mesh.region(f)).collect();
        if regions.len() < 2 || regions.len() != pieces(mesh, &disk) {
            return None;
        }
        let cuts = match draw.across {
            Some(Cuts::Near) => long_edges(mesh, &disk, face, draw.floor),
            _ => Vec::new(),
        };
        if cuts.is_empty() && draw.across == Some(Cuts::Near) {
            return None;
        }
        let seed = if cuts.is_empty() { 0 } else { sign(mesh, face) };
        Self::of(mesh, disk, cuts).map(|patch| Self { seed, ..patch })
    }

    fn of(mesh: &Mixed, disk: Disk, cuts: Vec<u32>) -> Option<Self> {
        let mut rim = disk.rim(mesh);
        rim.sort_unstable();
        (disk.faces.len() > 1).then_some(Self { faces: disk.faces, rim, cuts, seed: 0 })
    }

    /// A number for its faces as they lie and what is cut, that is another one when they change.
    pub(super) fn sign(&self, mesh: &Mixed) -> u64 {
        self.faces.iter().fold(self.seed, |sum, &f| sum.wrapping_add(sign(mesh, f)))
    }

    /// Quads for the patch, with sizes inside times `scale`: a mesh of its own that begins with the vertices of the
    /// rim. `None` where there is a triangle left, and as soon as it comes out too bad to become good.
    pub(super) fn remade(
        &self,
        mesh: &Mixed,
        ground: &Ground<'_>,
        rules: Rules,
        scale: f64,
        watch: &Watch,
    ) -> Result<Option<Mixed>, Cancelled> {
        let Some(mut patch) = self.triangles(mesh, ground, rules, scale) else { return Ok(None) };
        let mut awake = vec![false; ground.region_count()];
        for &f in &self.faces {
            awake[mesh.region(f) as usize] = true;
        }
        refill(&mut patch, ground, rules, watch)?;
        let most = MORE * self.faces.len() + 8;
        if patch.faces().count() > 3 * most {
            return Ok(None);
        }
        polish(&mut patch, ground, rules, 4, &awake);
        advance(&mut patch, ground, watch)?;
        join_neighbours(&mut patch);
        join_along_paths(&mut patch, ground);
        if patch.census().0 > 0 || patch.faces().count() > most {
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
    fn triangles(&self, mesh: &Mixed, ground: &Ground<'_>, rules: Rules, scale: f64) -> Option<Mixed> {
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
                regions.push(mesh.region(f));
            }
        }
        soup.points = list.iter().map(|&v| mesh.point(v)).collect::<Vec<_>>().into();
        let place = |i: usize| if i < self.rim.len() { Place::Node } else { mesh.place(list[i]) };
        let places = (0..list.len()).map(place).collect();
        let is_ours = |h: &u32| [h, &(h ^ 1)].iter().any(|&&k| self.faces.contains(&mesh.face(k)));
        let arc = |a: VertexId, b: VertexId| {
            mesh.find(list[a.index()], list[b.index()]).filter(is_ours).map_or(NONE, |h| mesh.arc(h))
        };
        let mut patch = Mixed::new(&soup, places, regions, arc)?;
        let largest = list.iter().map(|&v| mesh.size(v)).fold(0.0, f64::max);
        let spans_curves = patch.edges().any(|h| patch.arc(h) != NONE && !is_rim(&patch, h));
        for (i, &v) in list.iter().enumerate() {
            patch.set_point(i as u32, mesh.point(v), mesh.normal(v));
            let size = if spans_curves { mesh.size(v) } else { largest };
            patch.set_size(i as u32, (scale * size).max(rules.floor.min(size)));
        }
        for i in 0..self.rim.len() as u32 {
            let (sum, n) = patch
                .star(i)
                .filter(|&h| is_rim(&patch, h))
                .fold((0.0, 0.0), |(sum, n), h| (sum + patch.length(h), n + 1.0));
            patch.set_size(i, sum / f64::max(n, 1.0));
        }
        for &h in &self.cuts {
            let [a, b] = [mesh.origin(h), mesh.target(h)].map(|v| number[&v]);
            let inner = patch.find(a, b)?;
            if !cut_in_three(&mut patch, ground, rules, inner, ground.ends_on(mesh, h)) {
                return None;
            }
        }
        Some(patch)
    }

    /// Puts quads made for the patch into its place, within an open transaction. Returns the new faces; `None` where
    /// they do not fit, and the transaction must be rolled back.
    pub(super) fn put_back(
        &self,
        mesh: &mut Mixed,
        patch: &Mixed,
        ground: &Ground<'_>,
        rules: Rules,
    ) -> Option<Vec<u32>> {
        let mut number: FxHashMap<u32, u32> = self.rim.iter().enumerate().map(|(i, &v)| (i as u32, v)).collect();
        if self.doubles_an_edge(mesh, patch, &number) {
            return None;
        }
        let mut sags: FxHashMap<u32, f64> = FxHashMap::default();
        for h in self.faces.iter().flat_map(|&f| mesh.sides(f)).filter(|&h| mesh.arc(h) != NONE) {
            let most = sags.entry(mesh.arc(h)).or_insert(rules.curve_tolerance);
            *most = most.max(sag(mesh, ground, h));
        }
        let mut new: Vec<Corners> = Vec::new();
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
        for (&f, from) in made.iter().zip(patch.faces()) {
            mesh.set_region(f, patch.region(from));
        }
        for h in patch.edges().filter(|&h| !is_rim(patch, h)) {
            let k = mesh.find(number[&patch.origin(h)], number[&patch.target(h)])?;
            let arc = patch.arc(h);
            mesh.set_arc(k, arc);
            // In the patch nobody knew where the curve goes on beyond the rim.
            if arc != NONE && sag(mesh, ground, k) > sags.get(&arc).map_or(rules.curve_tolerance, |&most| most) {
                return None;
            }
        }
        let is_sound = |v: u32| !mesh.place(v).is_free() || mesh.valence(v) > 2;
        self.rim.iter().all(|&v| is_sound(v)).then_some(made)
    }

    /// Whether an edge of quads made for the patch joins vertices of the rim that an edge outside joins already.
    fn doubles_an_edge(&self, mesh: &Mixed, patch: &Mixed, number: &FxHashMap<u32, u32>) -> bool {
        let inside: FxHashSet<u32> = self.faces.iter().copied().collect();
        let is_outside = |k: u32| !(inside.contains(&mesh.face(k)) && inside.contains(&mesh.face(k ^ 1)));
        patch.edges().filter(|&h| !is_rim(patch, h)).any(|h| {
            let ends = [patch.origin(h), patch.target(h)].map(|v| number.get(&v));
            matches!(ends, [Some(&a), Some(&b)] if mesh.find(a, b).is_some_and(is_outside))
        })
    }
}

/// How far an edge is away from its curve.
fn sag(mesh: &Mixed, ground: &Ground<'_>, h: u32) -> f64 {
    let [a, b] = ground.ends_on(mesh, h);
    ground.curves[mesh.arc(h) as usize].sag(a.min(b), a.max(b))
}

/// The edges on curves inside a disk near a face that are not much shorter than its longest side, and whose thirds are
/// not below `floor`.
fn long_edges(mesh: &Mixed, disk: &Disk, face: u32, floor: f64) -> Vec<u32> {
    let longest = mesh.sides(face).map(|h| mesh.length(h)).fold(0.0, f64::max);
    let is_inner = |h: u32| disk.contains(mesh.face(h)) && disk.contains(mesh.face(h ^ 1));
    let least = (LONG * longest).max(3.0 * floor);
    let is_long = |h: u32| mesh.arc(h) != NONE && is_inner(h) && mesh.length(h) >= least;
    let near = mesh.faces_around(&mesh.corners(face));
    let mut long: Vec<u32> = near.iter().flat_map(|&f| mesh.sides(f)).filter(|&h| is_long(h)).map(|h| h & !1).collect();
    long.sort_unstable();
    long.dedup();
    long
}

/// Into how many pieces curves cut a disk.
fn pieces(mesh: &Mixed, disk: &Disk) -> usize {
    let mut seen: FxHashSet<u32> = FxHashSet::default();
    let mut pieces = 0;
    for &start in &disk.faces {
        if !seen.insert(start) {
            continue;
        }
        pieces += 1;
        let mut stack = vec![start];
        while let Some(f) = stack.pop() {
            let across = mesh.sides(f).filter(|&h| mesh.arc(h) == NONE).map(|h| mesh.face(h ^ 1));
            let next: Vec<u32> = across.filter(|&g| disk.contains(g)).collect();
            stack.extend(next.into_iter().filter(|&g| seen.insert(g)));
        }
    }
    pieces
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

#[cfg(test)]
mod tests {
    use super::super::testing::{N, id, quads, rules, square};
    use super::*;
    use crate::mesh::carried::{EdgeMark, MarkCause};
    use crate::mesh::{Freedom, Surface, edge_key};

    /// A square with a wall from below to above.
    fn halves() -> Surface {
        let mut surface = square();
        let mark = EdgeMark { freedom: Freedom::OnCurve, cause: MarkCause::Feature };
        for y in 0..N {
            surface.carried.mark(edge_key(id(5, y), id(5, y + 1)), mark);
        }
        surface
    }

    fn draw(rings: usize, scale: f64, cuts: Cuts) -> Draw {
        Draw { rings, scale, floor: 0.1, across: Some(cuts) }
    }

    #[test]
    fn a_patch_across_a_curve_keeps_it_and_both_regions() {
        let surface = halves();
        let ground = Ground::new(&surface);
        assert_eq!(ground.region_count(), 2);
        let beside = 5 * N + 5;
        for (draw, more) in
            [(draw(2, 1.0, Cuts::None), 0), (draw(2, 0.6, Cuts::Near), 6), (draw(3, 0.6, Cuts::Near), 6)]
        {
            let mut mesh = quads(&ground, &[]);
            let patch = Patch::around(&mesh, beside, draw).unwrap();
            assert_eq!(patch.cuts.len(), more / 2, "edges of three faces beside the wall");
            let remade = patch.remade(&mesh, &ground, rules(), draw.scale, &Watch::silent()).unwrap().unwrap();
            mesh.begin();
            patch.put_back(&mut mesh, &remade, &ground, rules()).unwrap();
            mesh.commit();
            assert_eq!(mesh.faults(), [] as [String; 0]);
            assert_eq!(mesh.census().0, 0);
            let is_wall = |&h: &u32| mesh.arc(h) != NONE && mesh.face(h) != NONE && mesh.face(h ^ 1) != NONE;
            let wall: Vec<u32> = mesh.edges().filter(is_wall).collect();
            assert_eq!(wall.len(), N as usize + more);
            let length: f64 = wall.iter().map(|&h| mesh.length(h)).sum();
            assert!((length - f64::from(N)).abs() < 1e-9, "the wall is covered once: {length}");
            for f in mesh.faces() {
                let side = u32::from(mesh.centre(f).x > 5.0);
                let first = u32::from(mesh.centre(0).x > 5.0);
                assert_eq!(mesh.region(f) == mesh.region(0), side == first, "each half is one region");
                assert!(mesh.quality(f) > 0.2, "{}", mesh.quality(f));
            }
        }
    }

    #[test]
    fn a_patch_inside_a_region_does_not_go_across() {
        let surface = halves();
        let ground = Ground::new(&surface);
        let mesh = quads(&ground, &[]);
        assert!(Patch::around(&mesh, 5 * N + 1, draw(2, 1.0, Cuts::None)).is_none(), "it meets no curve");
        let inside = Patch::around(&mesh, 5 * N + 5, Draw { rings: 3, scale: 1.0, floor: 0.1, across: None }).unwrap();
        assert!(inside.faces.iter().all(|&f| mesh.centre(f).x > 5.0));
    }
}
