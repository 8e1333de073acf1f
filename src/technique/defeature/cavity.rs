//! Holes and bosses as chains of coaxial rings.
//!
//! From each cylindrical ring that faces its axis (a hole) or away from it (a boss) the chain grows over both rims:
//! over further sides, over chamfers and countersinks, over a step when another side follows it, and it ends at a floor
//! or at a rim of the surface that stays.

use glam::DVec3;

use super::patches::Patches;
use super::round::{Facing, Form, Ring, ring};
use super::{Kind, Reason, Rejected};
use crate::mesh::{FaceId, Surface, VertexId};

/// Largest distance of a rim from its circle, as a share of the radius: the sagitta of a chord of 36 degrees.
pub(super) const ROUND: f64 = 0.05;
/// Axes of one feature differ by less than 8 degrees, and lie closer than this share of the radius.
pub(super) const PARALLEL: f64 = 0.99;
pub(super) const CONCENTRIC: f64 = 0.05;
/// A chamfer or countersink is at most this much wider than its hole.
pub(super) const WIDEST_CONE: f64 = 2.0;
/// A side up to this much wider than its hole is a step of it; a wider one is a pocket with a hole in its floor.
pub(super) const WIDEST_STEP: f64 = 3.0;
/// A floor lies within this much of its rim's radius.
pub(super) const WIDEST_FLOOR: f64 = 1.1;

/// A feature that may be removed.
#[derive(Clone, Debug)]
pub(super) struct Cavity {
    pub(super) kind: Kind,
    /// Patches that go.
    pub(super) patches: Vec<u32>,
    /// Rims that are to be filled: patch and number of its rim.
    pub(super) rims: Vec<(u32, usize)>,
    /// What the statistics say of it.
    pub(super) axis: DVec3,
    pub(super) diameter: f64,
    /// The bores that it consists of, by place and diameter: several where they cross.
    pub(super) bores: Vec<(DVec3, f64)>,
}

/// What a search came upon.
#[derive(Debug, Default)]
pub(super) struct Found {
    pub(super) cavities: Vec<Cavity>,
    /// What stays, with faces of it by which another search tells that it is known.
    pub(super) rejected: Vec<(Vec<FaceId>, Rejected)>,
}

/// Where a chain ends.
enum End {
    /// At the surface that stays, over this rim of this patch.
    Base(u32, usize),
    /// At a floor, which is in the chain already.
    Floor,
    /// Nowhere: the feature has a step that is too wide to be removed.
    TooWide,
}

/// What a chain makes of a side.
enum Growth {
    Cavity(Cavity),
    /// A feature with a step that is too wide.
    TooWide,
    /// One of the bores that cross.
    Crossing,
    /// Nothing to be removed: a whole pin, a column between two faces.
    Nothing,
}

/// Looks for features on the patches of a surface.
pub(super) struct Finder<'a> {
    surface: &'a Surface,
    patches: &'a Patches,
    rings: Vec<Option<Ring>>,
    /// The largest diameter that is removed.
    most: f64,
}

impl<'a> Finder<'a> {
    pub(super) fn new(surface: &'a Surface, patches: &'a Patches, most: f64) -> Self {
        let rings = patches.all.iter().map(|p| if p.rims.len() < 2 { None } else { ring(surface, p) }).collect();
        Self { surface, patches, rings, most }
    }

    /// The features of the wanted kinds, each patch in one at most, and what looked like one but is none.
    pub(super) fn find(&self, kinds: &[Kind]) -> Found {
        let mut used = vec![false; self.rings.len()];
        let mut found = Found::default();
        for number in 0..self.rings.len() {
            let Some(ring) = self.rings[number].as_ref().filter(|ring| ring.form == Form::Side) else { continue };
            let wanted = match ring.facing {
                Facing::In => kinds.contains(&Kind::ThroughHoles) || kinds.contains(&Kind::BlindHoles),
                Facing::Out => kinds.contains(&Kind::Bosses),
                Facing::Mixed => false,
            };
            if !wanted || used[number] {
                continue;
            }
            let growth = match self.refusal(number, ring) {
                Some(reason) => Err(reason),
                None => match self.grow(number as u32, ring) {
                    Growth::Cavity(cavity) => Ok(cavity),
                    Growth::TooWide => Err(Reason::StepTooLarge),
                    Growth::Crossing => Err(Reason::CutByOthers),
                    Growth::Nothing => continue,
                },
            };
            match growth {
                Err(reason) => {
                    let rejected = Rejected { centre: ring.centre, diameter: ring.diameter(), reason };
                    found.rejected.push((self.patches.all[number].faces.clone(), rejected));
                }
                Ok(cavity) => {
                    if kinds.contains(&cavity.kind) && !cavity.patches.iter().any(|&p| used[p as usize]) {
                        for &p in &cavity.patches {
                            used[p as usize] = true;
                        }
                        found.cavities.push(cavity);
                    }
                }
            }
        }
        found
    }

    /// Why a side does not begin a feature.
    fn refusal(&self, number: usize, ring: &Ring) -> Option<Reason> {
        let patch = &self.patches.all[number];
        if ring.diameter() > self.most {
            return Some(Reason::TooLarge);
        }
        if patch.rims.len() != 2 || patch.characteristic != 0 {
            return Some(Reason::CutByOthers);
        }
        if patch.rims.iter().flat_map(|rim| &rim.beyond).any(Option::is_none) {
            return Some(Reason::OpenRim);
        }
        (ring.error() > ROUND).then_some(Reason::NotRound)
    }

    /// The chain through a side.
    fn grow(&self, seed: u32, ring: &Ring) -> Growth {
        let mut patches = vec![seed];
        let mut rims: Vec<(u32, usize)> = Vec::new();
        for rim in [0, 1] {
            match self.extend(seed, rim, ring, &mut patches) {
                End::Base(patch, rim) => rims.push((patch, rim)),
                End::Floor => {}
                End::TooWide => return Growth::TooWide,
            }
        }
        if rims.iter().any(|&rim| self.meets_bores(rim)) {
            return Growth::Crossing;
        }
        let kind = match (ring.facing, rims.len()) {
            (Facing::In, 2) => Kind::ThroughHoles,
            (Facing::In, 1) => Kind::BlindHoles,
            (Facing::Out, 1) => Kind::Bosses,
            _ => return Growth::Nothing,
        };
        let sides = patches.iter().filter_map(|&p| self.rings[p as usize].as_ref()).filter(|r| r.form == Form::Side);
        let diameter = sides.map(Ring::diameter).fold(0.0, f64::max);
        let bores = vec![(ring.centre, diameter)];
        Growth::Cavity(Cavity { kind, patches, rims, axis: ring.axis, diameter, bores })
    }

    /// Whether several small bores begin at a rim: they cross, and filling it would leave the place where they do as a
    /// void. What lies behind openings is taken out as a whole.
    fn meets_bores(&self, (patch, rim): (u32, usize)) -> bool {
        let beyond = self.patches.all[patch as usize].rims[rim].beyond.iter().flatten();
        let mut bores: Vec<u32> = beyond.map(|&f| self.patches.of_face[f]).collect();
        bores.sort_unstable();
        bores.dedup();
        let is_bore = |&p: &u32| {
            let ring = self.rings[p as usize].as_ref();
            ring.is_some_and(|r| r.form == Form::Side && r.facing == Facing::In && r.diameter() <= self.most)
        };
        bores.len() > 1 && bores.iter().all(is_bore)
    }

    /// Goes on over a rim as long as the feature does.
    fn extend(&self, mut patch: u32, mut rim: usize, seed: &Ring, chain: &mut Vec<u32>) -> End {
        loop {
            let here = End::Base(patch, rim);
            let Some((next, entered)) = self.patches.across(&self.patches.all[patch as usize].rims[rim]) else {
                return here;
            };
            if chain.contains(&next) {
                return here;
            }
            if self.is_floor(next, seed) {
                chain.push(next);
                return End::Floor;
            }
            let Some(ring) = self.coaxial(next, seed) else { return here };
            let decisive = match ring.form {
                Form::Side | Form::Cone => Some(ring),
                Form::Flat => self
                    .patches
                    .across(&self.patches.all[next as usize].rims[1 - entered])
                    .filter(|(beyond, _)| !chain.contains(beyond))
                    .and_then(|(beyond, _)| self.coaxial(beyond, seed))
                    .filter(|beyond| beyond.form != Form::Flat),
            };
            let Some(ring) = decisive.filter(|ring| self.belongs(ring, seed)) else { return here };
            if ring.form == Form::Side && ring.diameter() > self.most {
                return End::TooWide;
            }
            chain.push(next);
            (patch, rim) = (next, 1 - entered);
        }
    }

    /// Whether a ring is a part of the same feature, be it too wide to be removed.
    fn belongs(&self, ring: &Ring, seed: &Ring) -> bool {
        let most = match ring.form {
            Form::Cone => WIDEST_CONE * seed.diameter(),
            Form::Side | Form::Flat => self.most.max(WIDEST_STEP * seed.diameter()),
        };
        ring.facing == seed.facing && ring.diameter() <= most && ring.error() <= ROUND
    }

    /// The ring of a patch that turns about the axis of `seed`.
    fn coaxial(&self, patch: u32, seed: &Ring) -> Option<&Ring> {
        let (all, ring) = (&self.patches.all[patch as usize], self.rings[patch as usize].as_ref()?);
        let is_ring = all.rims.len() == 2
            && all.characteristic == 0
            && all.rims.iter().flat_map(|rim| &rim.beyond).all(Option::is_some);
        let off = ring.centre - seed.centre;
        let aside = (off - seed.axis * off.dot(seed.axis)).length();
        let fits = ring.axis.dot(seed.axis).abs() > PARALLEL && aside <= CONCENTRIC * seed.diameter();
        (is_ring && fits).then_some(ring)
    }

    /// Whether a patch is a disk that lies inside the feature.
    fn is_floor(&self, patch: u32, seed: &Ring) -> bool {
        let all = &self.patches.all[patch as usize];
        if all.rims.len() != 1 || all.characteristic != 1 {
            return false;
        }
        let aside = |v: &VertexId| {
            let off = self.surface.points[*v] - seed.centre;
            (off - seed.axis * off.dot(seed.axis)).length()
        };
        let rim = all.rims[0].vertices.iter().map(aside).fold(0.0, f64::max);
        all.faces.iter().flat_map(|&f| &self.surface.faces[f]).all(|v| aside(v) <= WIDEST_FLOOR * rim)
    }
}
