//! Makes faces smaller about a place by a ring of quads, where it is too far from the surface or poor.
//!
//! Nothing else changes, and curves get vertices too: what smaller sizes would do by meshing whole regions anew.

use super::check::Flaws;
use super::rework::{Aim, Rework, enough};
use crate::technique::clean_quads::pillow;
use crate::technique::mixed::{Mixed, NONE};
use crate::watch::Cancelled;

/// Longest sides below this multiple of the floor of sizes are not cut.
const LEAST: f64 = 2.0;

impl Rework<'_, '_> {
    /// Puts a ring about the faces near one that gain most by it. Whether any did.
    pub(super) fn pillow(&self, mesh: &mut Mixed, face: u32, flaws: &mut Flaws) -> Result<bool, Cancelled> {
        let longest = mesh.sides(face).map(|h| mesh.length(h)).fold(0.0, f64::max);
        if self.aim == Aim::Flat || longest < LEAST * self.rules.floor {
            return Ok(false);
        }
        let mut best: Option<(f64, Vec<u32>)> = None;
        for faces in candidates(mesh, face) {
            mesh.begin();
            let gain = self.pillowed(mesh, &faces, flaws)?.map_or(0.0, |(gain, _, _)| gain);
            mesh.rollback();
            if gain > best.as_ref().map_or(0.0, |best| best.0) {
                best = Some((gain, faces));
            }
        }
        let Some((_, faces)) = best else { return Ok(false) };
        mesh.begin();
        let Some((_, old, after)) = self.pillowed(mesh, &faces, flaws)? else {
            mesh.rollback();
            return Ok(false);
        };
        mesh.commit();
        flaws.replace(&old, after);
        Ok(true)
    }

    /// A ring about some faces, within an open transaction: what is gained, the faces that it changed or took away, and
    /// the flaws in their place. `None` where nothing is gained.
    fn pillowed(
        &self,
        mesh: &mut Mixed,
        faces: &[u32],
        flaws: &Flaws,
    ) -> Result<Option<(f64, Vec<u32>, Flaws)>, Cancelled> {
        let corners: Vec<u32> = faces.iter().flat_map(|&f| mesh.corners(f)).collect();
        let old = mesh.faces_around(&corners);
        let before = flaws.within(&old);
        let (lacked, least) = (self.lack(mesh, &old, &before), shortest(mesh, &old));
        let Some(touched) = pillow(mesh, self.ground, self.rules.curve_tolerance, faces) else { return Ok(None) };
        let made = mesh.faces_around(&touched);
        if shortest(mesh, &made) < self.rules.floor.min(least) {
            return Ok(None);
        }
        let enough = enough(lacked);
        if self.lack(mesh, &made, &Flaws::default()) >= enough {
            return Ok(None);
        }
        let after = self.check.flaws_near(mesh, self.rules.tolerance, &made, self.watch)?;
        let lacks = self.lack(mesh, &made, &after);
        let gains = after.crossing.len() <= before.crossing.len() && lacks < enough;
        Ok(gains.then_some((lacked - lacks, old, after)))
    }
}

/// The length of the shortest side of some faces.
fn shortest(mesh: &Mixed, faces: &[u32]) -> f64 {
    let sides = faces.iter().flat_map(|&f| mesh.sides(f));
    sides.map(|h| mesh.length(h)).fold(f64::INFINITY, f64::min)
}

/// Sets of faces about one: itself, with one neighbour, the faces at a corner, at both ends of a side, at all corners.
fn candidates(mesh: &Mixed, face: u32) -> Vec<Vec<u32>> {
    let corners = mesh.corners(face);
    let mut sets = vec![vec![face]];
    sets.extend(mesh.sides(face).map(|h| vec![face, mesh.face(h ^ 1)]).filter(|pair| pair[1] != NONE));
    sets.extend(corners.iter().map(|&v| mesh.faces_around(&[v])));
    let next = |i: usize| corners[(i + 1) % corners.len()];
    sets.extend((0..corners.len()).map(|i| mesh.faces_around(&[corners[i], next(i)])));
    sets.push(mesh.faces_around(&corners));
    sets
}
