//! What one attempt takes over from the one before: the quads of all regions whose triangles are still the same.

use std::hash::{Hash, Hasher};

use glam::DVec3;
use rustc_hash::{FxHashMap, FxHasher};

use super::QMorphStats;
use super::budget::is_hopeless;
use super::check::Flaws;
use super::lack::{FAIR, shortfall};
use crate::mesh::{Facet, Soup, VertexId, edge_key};
use crate::technique::ground::Ground;
use crate::technique::isotropic::chains;
use crate::technique::mixed::{Mixed, NONE, Place};

/// What an attempt began with and what it came to.
#[derive(Clone, Default)]
pub(super) struct Attempt {
    /// The triangles before regions were made even.
    pub(super) triangles: Mixed,
    /// A number for the even triangles of each region.
    pub(super) signs: Vec<u64>,
    /// Whether it made each region; the others are taken over. Pieces across curves and rings change those too.
    pub(super) awake: Vec<bool>,
    /// The finished quads.
    pub(super) quads: Mixed,
    /// What is wrong with them beside their shapes.
    pub(super) flaws: Flaws,
    /// How much they lack: 0 where they hold to the tolerance with sound shapes.
    pub(super) lack: f64,
    /// The same by region.
    pub(super) by_region: Vec<f64>,
    /// What was done for them.
    pub(super) stats: QMorphStats,
}

impl Attempt {
    /// Whether there is nothing that another attempt could be asked for.
    pub(super) fn is_good(&self) -> bool {
        let Flaws { faults, crossing } = &self.flaws;
        let is_sound = |f: u32| self.quads.quality(f) > 0.0 && shortfall(&self.quads, f) == 0.0;
        faults.is_empty() && crossing.is_empty() && self.quads.faces().all(is_sound)
    }

    /// Whether nothing is left but poor shapes, which lack less together than one flat face.
    pub(super) fn is_fair(&self) -> bool {
        self.flaws.faults.is_empty() && self.flaws.crossing.is_empty() && self.lack < FAIR
    }

    /// Whether so much is broken that no more work would mend it.
    pub(super) fn is_hopeless(&self) -> bool {
        is_hopeless(self.lack, self.quads.faces().count())
    }

    /// This one or a better one, which counts the attempts of both.
    pub(super) fn or(self, other: Self) -> Self {
        let attempts = self.stats.attempts + other.stats.attempts;
        let mut best = if other.is_better_than(&self) { other } else { self };
        best.stats.attempts = attempts;
        best
    }

    /// Whether this one lacks less than another: as a whole, or else in the sum of its regions.
    pub(super) fn is_better_than(&self, other: &Self) -> bool {
        let sum = |attempt: &Self| attempt.by_region.iter().sum::<f64>();
        self.lack < other.lack || self.lack == other.lack && sum(self) < sum(other)
    }
}

/// A number for the triangles of each region that is another one when they change.
pub(super) fn signs(mesh: &Mixed, regions: usize) -> Vec<u64> {
    let mut signs = vec![0_u64; regions];
    for f in mesh.faces() {
        let region = &mut signs[mesh.region(f) as usize];
        // A sum, because there is no first face.
        *region = region.wrapping_add(sign(mesh, f));
    }
    signs
}

/// A number for where a face's corners are.
pub(super) fn sign(mesh: &Mixed, f: u32) -> u64 {
    let hash = |p: DVec3| {
        let mut hasher = FxHasher::default();
        p.to_array().map(f64::to_bits).hash(&mut hasher);
        hasher.finish()
    };
    // A sum, because there is no first corner.
    let corners = mesh.corners(f).iter().fold(0_u64, |sum, &v| sum.wrapping_add(hash(mesh.point(v))));
    let mut hasher = FxHasher::default();
    corners.hash(&mut hasher);
    hasher.finish()
}

/// The triangles of `mesh` in regions that changed, and the earlier quads in the others; and whether each region
/// changed. `None` where nothing can be taken over.
pub(super) fn take_over(
    mesh: &Mixed,
    signs: &[u64],
    earlier: &Attempt,
    ground: &Ground<'_>,
) -> Option<(Mixed, Vec<bool>)> {
    let mut awake: Vec<bool> = signs.iter().zip(&earlier.signs).map(|(now, before)| now != before).collect();
    for f in earlier.quads.faces().filter(|&f| earlier.quads.is_triangle(f)) {
        awake[earlier.quads.region(f) as usize] = true;
    }
    let same = same_vertices(mesh, &earlier.quads, ground, &mut awake);
    if awake.iter().all(|&is| is) {
        return None;
    }
    let mut glue = Glue::default();
    let old = glue.add(&earlier.quads, |f| !awake[earlier.quads.region(f) as usize], &|_| None);
    glue.add(mesh, |f| awake[mesh.region(f) as usize], &|v| same.get(&v).map(|&w| old[w as usize]));
    let arcs = glue.arcs;
    let arc = |a, b| arcs.get(&edge_key(a, b)).copied().unwrap_or(NONE);
    let mut glued = Mixed::new(&glue.soup, glue.places, glue.regions, arc)?;
    for (v, (normal, size)) in glue.extras.into_iter().enumerate() {
        glued.set_point(v as u32, glued.point(v as u32), normal);
        glued.set_size(v as u32, size);
    }
    Some((glued, awake))
}

/// For each vertex of `mesh` on the border of a region at rest the vertex of `quads` in its place. Regions at rest
/// whose curves do not fit those of regions awake are woken: quads made smaller have more vertices on curves than
/// triangles.
fn same_vertices(mesh: &Mixed, quads: &Mixed, ground: &Ground<'_>, awake: &mut [bool]) -> FxHashMap<u32, u32> {
    let (new, old) = (chains(mesh, ground), chains(quads, ground));
    let is = |region: u32, state: bool, awake: &[bool]| region != NONE && awake[region as usize] == state;
    let fits = |arc: usize| new[arc].len() == old[arc].len();
    // One that wakes has other curves.
    loop {
        let is_torn =
            |sides: &[u32; 2]| [true, false].into_iter().all(|state| sides.iter().any(|&r| is(r, state, awake)));
        let torn = (0..new.len()).find(|&arc| !fits(arc) && is_torn(&ground.beside[arc]));
        let Some(arc) = torn else { break };
        for &region in ground.beside[arc].iter().filter(|&&region| region != NONE) {
            awake[region as usize] = true;
        }
    }
    let mut same = FxHashMap::default();
    for (arc, sides) in ground.beside.iter().enumerate() {
        if !sides.iter().any(|&region| is(region, false, awake)) {
            continue;
        }
        if fits(arc) {
            same.extend(new[arc].iter().zip(&old[arc]).map(|(&(_, v), &(_, w))| (v, w)));
        } else {
            // Between regions at rest: others know only its ends.
            let ends = [(new[arc].first(), old[arc].first()), (new[arc].last(), old[arc].last())];
            same.extend(ends.into_iter().filter_map(|(new, old)| Some((new?.1, old?.1))));
        }
    }
    same
}

/// A mesh put together from faces of others.
#[derive(Default)]
struct Glue {
    soup: Soup,
    places: Vec<Place>,
    regions: Vec<u32>,
    arcs: FxHashMap<[VertexId; 2], u32>,
    /// Normal and size of each vertex.
    extras: Vec<(DVec3, f64)>,
}

impl Glue {
    /// Adds some faces of a mesh; `known` gives the vertices that are there already. Returns the number of each vertex.
    fn add(&mut self, from: &Mixed, wanted: impl Fn(u32) -> bool, known: &dyn Fn(u32) -> Option<u32>) -> Vec<u32> {
        let mut number = vec![NONE; from.vertex_slots() as usize];
        for f in from.faces().filter(|&f| wanted(f)) {
            let corners = from.corners(f);
            for &v in &corners {
                if number[v as usize] == NONE {
                    number[v as usize] = known(v).unwrap_or_else(|| self.add_vertex(from, v));
                }
            }
            let id = |i: usize| VertexId::from_raw(number[corners[i] as usize]);
            self.soup.faces.push(match corners.len() {
                3 => Facet::Tri([id(0), id(1), id(2)]),
                _ => Facet::Quad([id(0), id(1), id(2), id(3)]),
            });
            self.regions.push(from.region(f));
            for h in from.sides(f).filter(|&h| from.arc(h) != NONE) {
                let ends = [from.origin(h), from.target(h)].map(|v| VertexId::from_raw(number[v as usize]));
                self.arcs.insert(edge_key(ends[0], ends[1]), from.arc(h));
            }
        }
        number
    }

    fn add_vertex(&mut self, from: &Mixed, v: u32) -> u32 {
        self.places.push(from.place(v));
        self.extras.push((from.normal(v), from.size(v)));
        self.soup.points.push(from.point(v)).raw()
    }
}
