//! Meshes small pieces of finished quads anew, where faces are poor or too far from the surface.
//!
//! A region is a lottery: one more row, and the front closes elsewhere. In a piece of few rings about a poor place the
//! draw is cheap, and what is sound everywhere else stays. The first draw that makes the place better is kept. Where
//! curves are the cause, whose vertices lie badly for what is beside them, the piece goes across them. Where no draw
//! helps, faces get smaller there ([`pillows`](super::pillows)).

use rustc_hash::FxHashSet;

use super::budget::Budget;
use super::check::{Check, Flaws};
use super::flatten::{fold, unfold};
use super::lack::{CROSSING, FAIR, excess, lack_of, shortfall};
use super::patch::{Cuts, Draw, Patch};
use super::settle::Settler;
use crate::technique::ground::Ground;
use crate::technique::isotropic::Rules;
use crate::technique::mixed::Mixed;
use crate::watch::{Cancelled, Watch};

const fn inside(rings: usize, scale: f64) -> Draw {
    Draw { rings, scale, floor: 0.0, across: None }
}

const fn across(rings: usize, scale: f64, cuts: Cuts) -> Draw {
    Draw { rings, scale, floor: 0.0, across: Some(cuts) }
}

/// What is tried for poor shapes.
///
/// The first three succeed most often; of those across curves, where vertices of curves lie badly, each did on some
/// part.
const FOR_SHAPE: [Draw; 12] = [
    inside(2, 1.0),
    inside(3, 1.0),
    inside(4, 0.7),
    across(2, 1.0, Cuts::None),
    across(2, 0.7, Cuts::Near),
    across(3, 0.7, Cuts::Near),
    across(3, 1.0, Cuts::None),
    across(4, 0.7, Cuts::Near),
    across(5, 1.0, Cuts::Near),
    across(3, 0.85, Cuts::None),
    across(4, 1.0, Cuts::None),
    inside(5, 1.0),
];
/// The same where faces are too far from the surface.
const FOR_DISTANCE: [Draw; 2] = [inside(2, 0.7), inside(3, 0.7)];
/// The same where they are folded.
const FOR_FLATNESS: [Draw; 3] = [inside(2, 1.0), inside(3, 1.0), inside(4, 0.7)];
/// Most places in one go.
const PLACES: usize = 40;
/// A draw must take away this part of what the place lacks.
const GAIN: f64 = 0.05;

/// What the work needs.
pub(super) struct Rework<'a, 'g> {
    pub(super) ground: &'a Ground<'g>,
    pub(super) check: &'a Check,
    pub(super) rules: Rules,
    pub(super) watch: &'a Watch,
    /// What places are at fault for.
    pub(super) aim: Aim,
    /// Patches that were drawn, by their sign and the part of the sizes: again, they would come out the same.
    pub(super) drawn: FxHashSet<(u64, u64, Option<Cuts>)>,
    /// What drawing may cost.
    pub(super) budget: &'a Budget,
}

/// What a rework is after.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Aim {
    /// Shapes and distance.
    Sound,
    /// Quads that lie flat, as sound as they are.
    Flat,
}

/// Quads that are folded by more than this are meshed anew, in radians: 35 degrees.
const FOLDED: f64 = 0.6109;

impl Rework<'_, '_> {
    /// Goes through the worst places in regions that are `awake`. Returns how many got better.
    pub(super) fn run(&mut self, mesh: &mut Mixed, flaws: &mut Flaws, awake: &[bool]) -> Result<usize, Cancelled> {
        let (mut better, mut tried) = (0, 0);
        let mut spent: FxHashSet<(u32, bool)> = FxHashSet::default();
        for (face, is_far) in self.places(mesh, flaws, awake) {
            self.watch.check()?;
            if tried == PLACES || self.budget.is_spent() {
                break;
            }
            if !mesh.is_face(face) || spent.contains(&(face, is_far)) {
                continue;
            }
            tried += 1;
            if self.mend(mesh, face, is_far, flaws)? || self.pillow(mesh, face, flaws)? {
                better += 1;
            } else {
                // The patches of its neighbours are much the same.
                let near = mesh.corners(face).into_iter().flat_map(|v| mesh.faces_at(v).collect::<Vec<_>>());
                spent.extend(near.map(|f| (f, is_far)));
            }
        }
        Ok(better)
    }

    /// The faces at fault, the worst first, and whether they are too far from the surface.
    fn places(&self, mesh: &Mixed, flaws: &Flaws, awake: &[bool]) -> Vec<(u32, bool)> {
        let wants = |f: u32| awake[mesh.region(f) as usize];
        let mut places: Vec<(f64, u32, bool)> = Vec::new();
        if self.aim == Aim::Flat {
            let folds = mesh.faces().map(|f| (fold(mesh, f, FOLDED), f, false));
            places.extend(folds.filter(|&(fold, f, _)| fold > 0.0 && wants(f)));
            return worst_first(places);
        }
        for fault in flaws.faults.iter().filter(|fault| wants(fault.face)) {
            places.push((4.0 * excess(fault, self.rules.tolerance), fault.face, true));
        }
        places.extend(flaws.crossing.iter().filter(|&&f| wants(f)).map(|&f| (CROSSING, f, false)));
        for f in mesh.faces().filter(|&f| wants(f)) {
            let short = shortfall(mesh, f) + 10.0 * f64::from(mesh.quality(f) <= 0.0);
            if short > 0.0 {
                places.push((short, f, false));
            }
        }
        worst_first(places)
    }

    /// How much some faces lack.
    pub(super) fn lack(&self, mesh: &Mixed, faces: &[u32], flaws: &Flaws) -> f64 {
        let folds: f64 = match self.aim {
            Aim::Sound => 0.0,
            Aim::Flat => faces.iter().map(|&f| fold(mesh, f, FOLDED)).sum(),
        };
        lack_of(mesh, faces.iter().copied(), flaws, self.rules.tolerance) + folds
    }

    /// Quads for a patch, see [`Patch::remade`].
    fn draw(&self, patch: &Patch, mesh: &Mixed, scale: f64) -> Result<Option<Mixed>, Cancelled> {
        // A quad is two triangles first.
        self.budget.spend(2 * patch.faces.len());
        let Some(mut remade) = patch.remade(mesh, self.ground, self.rules, scale, self.watch)? else { return Ok(None) };
        if self.aim == Aim::Flat {
            let Rework { ground, check, rules, watch, .. } = *self;
            unfold(&mut Settler { mesh: &mut remade, ground, check, tolerance: rules.tolerance }, watch)?;
        }
        Ok(Some(remade))
    }

    /// Draws anew about a face until one draw is better. Whether one was.
    fn mend(&mut self, mesh: &mut Mixed, face: u32, is_far: bool, flaws: &mut Flaws) -> Result<bool, Cancelled> {
        let draws: &[Draw] = match self.aim {
            Aim::Flat => &FOR_FLATNESS,
            Aim::Sound if is_far => &FOR_DISTANCE,
            Aim::Sound => &FOR_SHAPE,
        };
        for &draw in draws {
            let draw = Draw { floor: self.rules.floor, ..draw };
            if let Some(patch) = Patch::around(mesh, face, draw)
                && self.remake(mesh, &patch, draw, flaws)?
            {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Meshes a patch anew if that makes it better. Whether it did.
    fn remake(&mut self, mesh: &mut Mixed, patch: &Patch, draw: Draw, flaws: &mut Flaws) -> Result<bool, Cancelled> {
        let before = flaws.within(&patch.faces);
        let enough = enough(self.lack(mesh, &patch.faces, &before));
        if enough <= 0.0 || !self.drawn.insert((patch.sign(mesh), draw.scale.to_bits(), draw.across)) {
            return Ok(false);
        }
        let sound = poorest(mesh, &patch.faces).min(FAIR);
        let Some(remade) = self.draw(patch, mesh, draw.scale)? else { return Ok(false) };
        if self.lack(&remade, &remade.faces().collect::<Vec<_>>(), &Flaws::default()) >= enough {
            return Ok(false);
        }
        mesh.begin();
        if let Some(made) = patch.put_back(mesh, &remade, self.ground, self.rules) {
            let after = self.check.flaws_near(mesh, self.rules.tolerance, &made, self.watch)?;
            let crosses = after.crossing.len() > before.crossing.len();
            let spoils =
                self.aim == Aim::Flat && (after.faults.len() > before.faults.len() || poorest(mesh, &made) < sound);
            if !crosses && !spoils && self.lack(mesh, &made, &after) < enough {
                mesh.commit();
                flaws.replace(&patch.faces, after);
                return Ok(true);
            }
        }
        mesh.rollback();
        Ok(false)
    }
}

/// What a place that lacked so much must lack less than afterwards.
pub(super) fn enough(lacked: f64) -> f64 {
    (1.0 - GAIN) * lacked
}

/// The least quality of some faces.
fn poorest(mesh: &Mixed, faces: &[u32]) -> f64 {
    faces.iter().map(|&f| mesh.quality(f)).fold(f64::INFINITY, f64::min)
}

/// Faces in the order of what they lack.
fn worst_first(mut places: Vec<(f64, u32, bool)>) -> Vec<(u32, bool)> {
    places.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)).then(x.2.cmp(&y.2)));
    places.into_iter().map(|(_, face, is_far)| (face, is_far)).collect()
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, dvec3};

    use super::super::testing::{N, id, quads, rules, square};
    use super::*;
    use crate::mesh::VertexId;
    use crate::technique::mixed::Place;

    fn rework(mesh: &mut Mixed, ground: &Ground<'_>, budget: &Budget) -> usize {
        let watch = Watch::silent();
        let check = Check::new(ground, &watch).unwrap();
        let mut flaws = check.flaws(mesh, rules().tolerance, &watch).unwrap();
        let drawn = FxHashSet::default();
        Rework { ground, check: &check, rules: rules(), watch: &watch, aim: Aim::Sound, drawn, budget }
            .run(mesh, &mut flaws, &[true])
            .unwrap()
    }

    #[test]
    fn without_work_that_may_be_done_all_stays() {
        let surface = square();
        let ground = Ground::new(&surface);
        let mut mesh = quads(&ground, &[(id(4, 5), dvec3(5.8, 5.4, 0.0))]);
        let budget = Budget::of(0);
        budget.spend(usize::MAX);
        assert_eq!(rework(&mut mesh, &ground, &budget), 0);
        assert_eq!(mesh.point(id(4, 5).raw()), dvec3(5.8, 5.4, 0.0));
        // What is done is counted.
        let budget = Budget::of(0);
        assert!(rework(&mut mesh, &ground, &budget) > 0);
        assert!(budget.left() < Budget::of(0).left());
    }

    #[test]
    fn a_knot_is_undone_and_all_else_stays() {
        let surface = square();
        let ground = Ground::new(&surface);
        // An inner vertex beyond its neighbour turns the faces between them over.
        let knot = [(id(4, 5), dvec3(5.8, 5.4, 0.0))];
        let mut mesh = quads(&ground, &knot);
        let least = |mesh: &Mixed| mesh.faces().map(|f| mesh.quality(f)).fold(1.0, f64::min);
        assert!(least(&mesh) < 0.0);
        assert!(rework(&mut mesh, &ground, &Budget::of(0)) > 0);
        assert_eq!(mesh.faults(), [] as [String; 0]);
        assert_eq!(mesh.census().0, 0, "there are triangles");
        assert!(least(&mesh) > 0.5, "{}", least(&mesh));
        for v in [id(0, 0), id(0, 7), id(9, 1), id(10, 10)] {
            assert_eq!(mesh.point(v.raw()), surface.points[v], "a vertex far from the knot moved");
        }
        let area: f64 = mesh.faces().map(|f| face_area(&mesh, f)).sum();
        assert!((area - f64::from(N * N)).abs() < 1e-9, "{area}");
    }

    fn face_area(mesh: &Mixed, f: u32) -> f64 {
        let p: Vec<DVec3> = mesh.corners(f).iter().map(|&v| mesh.point(v)).collect();
        0.5 * (p[2] - p[0]).cross(p[3] - p[1]).z
    }

    #[test]
    fn the_rim_of_a_patch_is_one_walk_that_passes_vertices_that_must_stay() {
        let surface = square();
        let ground = Ground::new(&surface);
        let mut mesh = quads(&ground, &[]);
        let kept = [id(5, 5), id(5, 7), id(6, 6), id(2, 4)].map(VertexId::raw);
        for v in kept {
            mesh.set_place(v, Place::Node);
        }
        for (face, rings) in (0..N * N).flat_map(|f| (1..5).map(move |rings| (f, rings))) {
            let Some(patch) = Patch::around(&mesh, face, inside(rings, 1.0)) else { continue };
            let is_rim = |h: &u32| !patch.faces.contains(&mesh.face(h ^ 1));
            let sides = patch.faces.iter().flat_map(|&f| mesh.sides(f));
            let rim: Vec<(u32, u32)> = sides.filter(is_rim).map(|h| (mesh.origin(h), mesh.target(h))).collect();
            let next = |v: u32| rim.iter().find(|side| side.0 == v).unwrap().1;
            let (mut at, mut steps) = (rim[0].1, 1);
            while at != rim[0].0 {
                (at, steps) = (next(at), steps + 1);
            }
            assert_eq!(steps, rim.len(), "{face} {rings}");
            let touches = |v: u32| patch.faces.iter().any(|&f| mesh.corners(f).contains(&v));
            assert!(kept.iter().all(|&v| !touches(v) || rim.iter().any(|side| side.0 == v)), "{face} {rings}");
        }
    }

    #[test]
    fn sound_quads_are_left_alone() {
        let surface = square();
        let ground = Ground::new(&surface);
        let mut mesh = quads(&ground, &[]);
        assert_eq!(rework(&mut mesh, &ground, &Budget::of(0)), 0);
        assert_eq!(mesh.census(), (0, (N * N) as usize));
    }

    #[test]
    fn a_patch_is_a_disk_without_bound_vertices_inside() {
        let surface = square();
        let ground = Ground::new(&surface);
        let mut mesh = quads(&ground, &[]);
        let middle = 5 * N + 5;
        assert!(Patch::around(&mesh, middle, inside(0, 1.0)).is_none(), "one face has nothing inside");
        assert_eq!(Patch::around(&mesh, middle, inside(1, 1.0)).unwrap().faces.len(), 9);
        mesh.set_place(id(6, 6).raw(), Place::Node);
        let beside = Patch::around(&mesh, middle, inside(1, 1.0)).unwrap().faces;
        assert_eq!(beside.len(), 8, "it goes round a vertex that must stay");
        assert!(!beside.contains(&(6 * N + 6)));
    }
}
