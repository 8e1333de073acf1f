//! How far quads and surface are apart, certified both ways, and where sizes must get smaller for it.

use std::cell::RefCell;
use std::ops::ControlFlow;

use glam::DVec3;
use rustc_hash::FxHashSet;

use crate::mesh::FaceId;
use crate::mesh::bvh::SegmentBvh;
use crate::mesh::geometry::Aabb;
use crate::metric::distance::{Memo, Target, decide_where, upper_bound};
use crate::metric::intersection::{faces_of, self_intersections};
use crate::technique::ground::Ground;
use crate::technique::mixed::Mixed;
use crate::watch::{Cancelled, Watch};

/// How far about a place quads may be that are the nearest to it, as a multiple of the tolerance.
const REACH: f64 = 4.0;

/// The surface, ready to be measured against.
pub(super) struct Check {
    pub(super) surface: Target,
    /// The points of the surface.
    pub(super) corners: SegmentBvh,
    /// The region of each of its faces.
    regions: Vec<u32>,
    /// Whether it meets itself nowhere, so that quads should not either.
    is_simple: bool,
    /// What whole meshes showed to be within the tolerance, from them and to them.
    memos: [RefCell<Memo>; 2],
}

/// A place where quads and surface are too far apart.
#[derive(Clone, Copy)]
pub(super) struct Fault {
    /// The face nearest to it.
    pub(super) face: u32,
    /// The surface's point there.
    pub(super) at: DVec3,
    /// How far.
    pub(super) distance: f64,
}

/// Quads ready to be measured against, and their numbers in the mesh.
struct Quads {
    target: Target,
    faces: Vec<u32>,
}

/// What is wrong with quads beside their shapes.
#[derive(Clone, Default)]
pub(super) struct Flaws {
    /// Where they are too far from the surface.
    pub(super) faults: Vec<Fault>,
    /// Faces that others pass through, in order; none where the surface itself meets itself.
    pub(super) crossing: Vec<u32>,
}

impl Flaws {
    /// Those of some faces.
    pub(super) fn within(&self, faces: &[u32]) -> Self {
        let faults = self.faults.iter().filter(|fault| faces.contains(&fault.face)).copied().collect();
        Self { faults, crossing: self.crossing.iter().copied().filter(|f| faces.contains(f)).collect() }
    }

    /// Puts others in the place of those of some faces.
    pub(super) fn replace(&mut self, faces: &[u32], with: Self) {
        self.faults.retain(|fault| !faces.contains(&fault.face));
        self.crossing.retain(|f| !faces.contains(f));
        self.faults.extend(with.faults);
        self.crossing.extend(with.crossing);
    }
}

impl Check {
    pub(super) fn new(ground: &Ground<'_>, watch: &Watch) -> Result<Self, Cancelled> {
        let surface = ground.surface;
        let corners = SegmentBvh::new(surface.points.iter().map(|&p| [p, p]).collect());
        let soup = surface.to_soup();
        let is_simple = self_intersections(&soup, watch)?.pairs.is_empty();
        Ok(Self {
            surface: Target::of(&soup),
            corners,
            regions: ground.regions.clone(),
            is_simple,
            memos: Default::default(),
        })
    }

    /// All flaws of a mesh.
    pub(super) fn flaws(&self, mesh: &Mixed, tolerance: f64, watch: &Watch) -> Result<Flaws, Cancelled> {
        let all = vec![true; self.regions.iter().max().map_or(0, |&last| last as usize + 1)];
        let faults = self.beyond(mesh, tolerance, &all, watch)?;
        Ok(Flaws { faults, crossing: self.crossing_all(mesh, watch)? })
    }

    /// The flaws of some faces, as they lie beside the others.
    ///
    /// Time grows with what is near them; only finding that looks at every face.
    pub(super) fn flaws_near(
        &self,
        mesh: &Mixed,
        tolerance: f64,
        faces: &[u32],
        watch: &Watch,
    ) -> Result<Flaws, Cancelled> {
        let area = Aabb::of(faces.iter().flat_map(|&f| mesh.corners(f)).map(|v| mesh.point(v)));
        let inside: FxHashSet<u32> = faces.iter().copied().collect();
        let is_region = |region: u32| faces.iter().any(|&f| mesh.region(f) == region);
        let (mut theirs, mut reach) = (FxHashSet::default(), area);
        let _ = self.surface.bvh().for_each_in(&area.grown(tolerance), |i, [a, b, c]| {
            let face = self.surface.face(i);
            if is_region(self.regions[face.index()]) {
                theirs.insert(face);
                reach = [*a, *b, *c].into_iter().fold(reach, Aabb::with);
            }
            ControlFlow::Continue(())
        });
        let near = faces_in(mesh, &reach.grown(REACH * tolerance));
        let near = Quads { target: Target::of(&mesh.soup_of(&near)), faces: near };
        let faults =
            self.beyond_where(&near, tolerance, &|f| inside.contains(&f), &|f| theirs.contains(&f), None, watch)?;
        let mut crossing = self.crossing(mesh, &faces_in(mesh, &area), watch)?;
        crossing.retain(|f| inside.contains(f));
        Ok(Flaws { faults, crossing })
    }

    /// Faces that others pass through, in order; none where the surface itself meets itself.
    pub(super) fn crossing_all(&self, mesh: &Mixed, watch: &Watch) -> Result<Vec<u32>, Cancelled> {
        self.crossing(mesh, &mesh.faces().collect::<Vec<_>>(), watch)
    }

    /// Those of these faces that pass through each other.
    fn crossing(&self, mesh: &Mixed, faces: &[u32], watch: &Watch) -> Result<Vec<u32>, Cancelled> {
        if !self.is_simple {
            return Ok(Vec::new());
        }
        let found = self_intersections(&mesh.soup_of(faces), watch)?;
        Ok(faces_of(&found.pairs).into_iter().map(|f| faces[f.index()]).collect())
    }

    /// The places where the mesh and the surface are farther apart than `tolerance`, by a witness in each face at
    /// fault, in regions that are `awake`.
    pub(super) fn beyond(
        &self,
        mesh: &Mixed,
        tolerance: f64,
        awake: &[bool],
        watch: &Watch,
    ) -> Result<Vec<Fault>, Cancelled> {
        let quads = Quads { target: Target::of(&mesh.leave().0), faces: mesh.faces().collect() };
        let ours = |f: u32| awake[mesh.region(f) as usize];
        let regions = &self.regions;
        let theirs = |f: FaceId| awake[regions[f.index()] as usize];
        let [mut to, mut from] = [0, 1].map(|way: usize| self.memos[way].borrow_mut());
        self.beyond_where(&quads, tolerance, &ours, &theirs, Some([&mut to, &mut from]), watch)
    }

    fn beyond_where(
        &self,
        Quads { target, faces }: &Quads,
        tolerance: f64,
        ours: &(dyn Fn(u32) -> bool + Sync),
        theirs: &(dyn Fn(FaceId) -> bool + Sync),
        memos: Option<[&mut Memo; 2]>,
        watch: &Watch,
    ) -> Result<Vec<Fault>, Cancelled> {
        let mut found = Vec::new();
        let [to, from] = memos.map_or([None, None], |memos| memos.map(Some));
        let decision = decide_where(target, &self.surface, tolerance, &|f| ours(faces[f.index()]), to, watch)?;
        for (face, p, distance) in decision.into_iter().flat_map(|d| d.beyond) {
            let at = self.surface.bvh().closest(p).map_or(p, |c| c.nearest.point);
            found.push(Fault { face: faces[face.index()], at, distance });
        }
        let decision = decide_where(&self.surface, target, tolerance, theirs, from, watch)?;
        for (_, at, distance) in decision.into_iter().flat_map(|d| d.beyond) {
            if let Some(nearest) = target.bvh().closest(at) {
                found.push(Fault { face: faces[target.face(nearest.index).index()], at, distance });
            }
        }
        Ok(found)
    }

    /// The certified distance between quads and surface, the larger one of both ways.
    pub(super) fn distance(&self, mesh: &Mixed, watch: &Watch) -> Result<f64, Cancelled> {
        let quads = Target::of(&mesh.leave().0);
        let to = upper_bound(&quads, &self.surface, watch)?.unwrap_or(0.0);
        let from = upper_bound(&self.surface, &quads, watch)?.unwrap_or(0.0);
        Ok(to.max(from))
    }
}

/// The faces whose boxes reach into an area.
fn faces_in(mesh: &Mixed, area: &Aabb) -> Vec<u32> {
    let box_of = |f: u32| Aabb::of(mesh.corners(f).iter().map(|&v| mesh.point(v)));
    mesh.faces().filter(|&f| box_of(f).overlaps(area)).collect()
}

/// A place, how far about it, and the size that faces are to have there.
pub(super) type Wish = (DVec3, f64, f64);

/// Where a fault is, how far about it, and the size that should do there, if faces are to have `side` now.
pub(super) fn smaller(mesh: &Mixed, fault: &Fault, side: f64, tolerance: f64) -> Wish {
    // Between what a round place needs, the square root, and what a pointed one does.
    let factor = libm::pow(0.75 * tolerance / fault.distance, 0.75).clamp(0.4, 0.82);
    (mesh.centre(fault.face), 1.2 * side, factor * side)
}

/// The mean length of a face's sides.
pub(super) fn mean_side(mesh: &Mixed, f: u32) -> f64 {
    let (sum, n) = mesh.sides(f).fold((0.0, 0.0), |(sum, n), h| (sum + mesh.length(h), n + 1.0));
    sum / n
}

/// The mean length of the sides that a face is to have.
pub(super) fn mean_size(mesh: &Mixed, f: u32) -> f64 {
    let corners = mesh.corners(f);
    corners.iter().map(|&v| mesh.size(v)).sum::<f64>() / corners.len() as f64
}
