//! From the surface to clean quads, tried again with smaller sizes where distance or shapes are not good enough.
//!
//! Every attempt starts from the best one so far and makes only those regions anew whose triangles changed. Where one
//! makes a region worse, the next asks for still smaller faces there; where two did, the region is left alone.

use std::f64::consts::FRAC_PI_2;

use super::check::{Check, Fault, Wish, mean_side, smaller};
use super::reuse::{Attempt, signs, take_over};
use super::settle::settle;
use super::{QMorphError, QMorphParams, QMorphStats, sizes};
use crate::technique::clean_quads::{clean, finish, sharpest_sector_of};
use crate::technique::front::advance;
use crate::technique::ground::Ground;
use crate::technique::isotropic::{Rules, pair_up, polish, remesh, tighten};
use crate::technique::join::{join_along_paths, join_neighbours};
use crate::technique::mixed::Mixed;
use crate::watch::{Cancelled, Watch};

/// How often sizes are lowered where the quads prove too far from the surface or of poor shape.
const ATTEMPTS: usize = 6;
/// How often sizes are lowered beforehand, where the triangles are too far from the surface.
const PREPARATIONS: usize = 4;
/// The part of the tolerance that triangles may use.
const TRIANGLES: f64 = 0.7;
/// What an attempt lacks from where faces are inverted or triangles are left.
const BROKEN: f64 = 10.0;
/// How much farther from their curves edges may be where that spares broken faces.
const LOOSER: f64 = 2.0;
/// Faces below this shape are not worth smaller ones for the sake of distance.
const USEFUL: f64 = 0.2;
/// A region is left alone after so many attempts that made it worse.
const FAILURES: u8 = 2;
/// The part of the size that the second of them asks for.
const AGAIN: f64 = 0.75;
/// Shapes above this count as good.
const FAIR: f64 = 0.5;
/// What a poor shape weighs that the curves at its corners excuse.
const CUSP: f64 = 0.5;
/// The sides of faces in the place of a poor one, as a part of its own.
const ROOM: f64 = 0.7;
/// Where those are shorter than this part of the size asked for there, that part counts in their stead.
const LEAST_ROOM: f64 = 0.35;

/// One run from the surface to clean quads, with all sizes times `scale`.
pub(super) fn morph(
    ground: &Ground<'_>,
    params: &QMorphParams,
    rules: Rules,
    scale: f64,
    watch: &Watch,
) -> Result<(Mixed, QMorphStats), QMorphError> {
    let stats = QMorphStats { regions: ground.region_count(), left_out: ground.left_out, ..QMorphStats::default() };
    let check = Check::new(ground);
    let work = Morpher { ground, params, check: &check, scale, watch };
    let mut best = work.attempts(rules, ATTEMPTS, &stats)?;
    // Many pieces on a curve that is rough may be what broke it: none shorter than the least size, then a looser curve.
    let longer = Rules { shortest: rules.least_size, ..rules };
    let looser = Rules { curve_tolerance: LOOSER * rules.curve_tolerance, ..longer };
    for rules in [longer, looser] {
        if best.lack < BROKEN {
            break;
        }
        let other = work.attempts(rules, ATTEMPTS, &stats)?;
        let attempts = best.stats.attempts + other.stats.attempts;
        if other.lack < best.lack {
            best = other;
        }
        best.stats.attempts = attempts;
    }
    let Attempt { quads, mut stats, .. } = best;
    stats.distance = check.distance(&quads, watch)?;
    stats.triangles = quads.census().0;
    Ok((quads, stats))
}

/// What all attempts share.
struct Morpher<'a, 'g> {
    ground: &'a Ground<'g>,
    params: &'a QMorphParams,
    check: &'a Check,
    scale: f64,
    watch: &'a Watch,
}

impl Morpher<'_, '_> {
    /// Remeshes, and runs the front at most so many times, with smaller sizes where quads prove too far away or poor.
    fn attempts(&self, rules: Rules, most: usize, stats: &QMorphStats) -> Result<Attempt, QMorphError> {
        let (ground, watch) = (self.ground, self.watch);
        let mut mesh = ground.workshop().ok_or(QMorphError::NotManifold)?;
        sizes::set(&mut mesh, ground.surface, self.params, self.scale).map_err(QMorphError::Size)?;
        watch.phase("remeshing between the curves", None);
        remesh(&mut mesh, ground, rules, watch)?;
        prepare(&mut mesh, ground, self.check, rules, watch)?;
        let mut best = self.attempt(mesh, None, rules, stats)?.ok_or(QMorphError::Empty)?;
        let mut asked = Asked::new(stats.regions);
        let mut attempts = 1;
        while attempts < most {
            let places = asked.places(&best, rules.tolerance);
            if places.is_empty() {
                break;
            }
            let mut mesh = best.triangles.clone();
            tighten(&mut mesh, ground, rules, &places, watch)?;
            attempts += 1;
            let next = self.attempt(mesh, Some(&best), rules, stats)?;
            let is_better = next.as_ref().is_some_and(|next| next.is_better_than(&best));
            asked.learn(&best.by_region, next.as_ref().map(|next| &*next.by_region), is_better);
            if let Some(next) = next.filter(|_| is_better) {
                best = next;
            }
        }
        best.stats.attempts = attempts;
        Ok(best)
    }

    /// From triangles to settled quads; with what the attempt before left where nothing changed. `None` where nothing
    /// did.
    fn attempt(
        &self,
        triangles: Mixed,
        earlier: Option<&Attempt>,
        rules: Rules,
        stats: &QMorphStats,
    ) -> Result<Option<Attempt>, Cancelled> {
        let (ground, watch) = (self.ground, self.watch);
        let mut stats = stats.clone();
        let mut quads = triangles.clone();
        if self.params.all_quad {
            stats.parity_splits = pair_up(&mut quads, ground, rules);
        }
        let signs = signs(&quads, stats.regions);
        let mut awake = vec![true; stats.regions];
        if let Some(earlier) = earlier {
            if signs == earlier.signs {
                return Ok(None);
            }
            if let Some(taken) = take_over(&quads, &signs, earlier, ground) {
                (quads, awake) = taken;
                let done = &earlier.stats;
                (stats.levels, stats.seams, stats.clean_edits) = (done.levels.clone(), done.seams, done.clean_edits);
            }
        }
        advance_and_clean(&mut quads, ground, rules, &awake, &mut stats, watch)?;
        stats.clean_edits += finish(&mut quads, ground, rules.curve_tolerance, &awake, watch)?.edits;
        settle(&mut quads, ground, self.check, rules.tolerance, &awake, watch)?;
        // In all regions: the face nearest to a place may belong to another region than the place.
        let faults = self.check.beyond(&quads, rules.tolerance, &vec![true; stats.regions], watch)?;
        let (lack, by_region) = lack(&quads, &faults, rules.tolerance, stats.regions);
        Ok(Some(Attempt { triangles, signs, quads, faults, lack, by_region, stats }))
    }
}

/// Lowers sizes where the triangles are too far from the surface: what they miss, quads miss more.
fn prepare(mesh: &mut Mixed, ground: &Ground<'_>, check: &Check, rules: Rules, watch: &Watch) -> Result<(), Cancelled> {
    let tolerance = TRIANGLES * rules.tolerance;
    let mut changed = vec![true; ground.region_count()];
    for _ in 0..PREPARATIONS {
        let faults = check.beyond(mesh, tolerance, &changed, watch)?;
        if faults.is_empty() {
            break;
        }
        let before = signs(mesh, changed.len());
        let wish = |fault: &Fault| smaller(mesh, fault, mean_side(mesh, fault.face), tolerance);
        let places: Vec<_> = faults.iter().map(wish).collect();
        tighten(mesh, ground, rules, &places, watch)?;
        changed = signs(mesh, changed.len()).iter().zip(before).map(|(now, before)| *now != before).collect();
    }
    Ok(())
}

/// How much an attempt lacks, in all and by region: 0 where it holds to the tolerance with sound shapes.
fn lack(mesh: &Mixed, faults: &[Fault], tolerance: f64, regions: usize) -> (f64, Vec<f64>) {
    let (mut broken, mut poorest, mut poor) = (0.0, 0.0_f64, 0.0);
    let (mut by_region, mut poorest_of) = (vec![0.0; regions], vec![0.0_f64; regions]);
    for f in mesh.faces() {
        let quality = mesh.quality(f);
        let short = shortfall(mesh, f);
        // Where curves touch, smaller faces see a sharper angle: that excuses them, and is no gain.
        let poverty = short + CUSP * (FAIR - quality).max(0.0);
        let wrong = 10.0 * f64::from(quality <= 0.0) + 100.0 * f64::from(mesh.is_triangle(f));
        broken += wrong;
        poor += short;
        poorest = poorest.max(poverty);
        let region = mesh.region(f) as usize;
        by_region[region] += wrong;
        poorest_of[region] = poorest_of[region].max(poverty);
    }
    let (mut worst, mut farthest) = (0.0_f64, vec![0.0_f64; regions]);
    for fault in faults {
        let excess = fault.distance / tolerance - 1.0;
        let far = &mut farthest[mesh.region(fault.face) as usize];
        (worst, *far) = (worst.max(excess), far.max(excess));
    }
    // The poorest only: smaller faces are more faces, and a region is not worse for that.
    for ((lack, far), poorest) in by_region.iter_mut().zip(farthest).zip(poorest_of) {
        *lack += 4.0 * far + poorest;
    }
    // Many poor faces are no broken one.
    (broken + 4.0 * worst + poorest + (0.2 * poor).min(2.0), by_region)
}

/// What a face lacks from the shape that it could have: good, or as good as the curves that meet at its corners allow.
fn shortfall(mesh: &Mixed, f: u32) -> f64 {
    let quality = mesh.quality(f);
    if quality >= FAIR {
        return 0.0;
    }
    let fair = match sharpest_sector_of(mesh, f) {
        Some(angle) if angle < FRAC_PI_2 => FAIR.min(0.9 * libm::sin(angle)),
        _ => FAIR,
    };
    (fair - quality).max(0.0)
}

/// What to ask of the next attempt, by what became of those before.
struct Asked {
    /// By region, the attempts that did not make it better.
    failures: Vec<u8>,
    /// Where the last attempt was worse as a whole, the regions that it made better: they are asked for alone.
    only: Option<Vec<bool>>,
    /// Whether the attempt asked for is to make each region better.
    regions: Vec<bool>,
}

impl Asked {
    fn new(regions: usize) -> Self {
        Self { failures: vec![0; regions], only: None, regions: vec![false; regions] }
    }

    /// Where the next attempt should have smaller faces: at faults of sound faces, and at poor faces, whose strips get
    /// more room for good ones. Where one failed, still smaller; not in regions where two did.
    fn places(&mut self, best: &Attempt, tolerance: f64) -> Vec<Wish> {
        let mesh = &best.quads;
        let wants = |f: u32| {
            let region = mesh.region(f) as usize;
            self.failures[region] < FAILURES && self.only.as_ref().is_none_or(|only| only[region])
        };
        let again = |f: u32| if self.failures[mesh.region(f) as usize] == 0 { 1.0 } else { AGAIN };
        let mut asked = vec![false; self.regions.len()];
        let mut places = Vec::new();
        for fault in best.faults.iter().filter(|fault| wants(fault.face) && mesh.quality(fault.face) > USEFUL) {
            // Quads may come out larger than they were to be.
            let side = mean_side(mesh, fault.face).min(mean_size(mesh, fault.face));
            let (at, reach, size) = smaller(mesh, fault, side, tolerance);
            places.push((at, reach, again(fault.face) * size));
            asked[mesh.region(fault.face) as usize] = true;
        }
        for f in mesh.faces().filter(|&f| wants(f) && shortfall(mesh, f) > 0.0) {
            // A sliver's sides say nothing about what would do in its place.
            let side = mean_side(mesh, f).max(LEAST_ROOM * mean_size(mesh, f));
            places.push((mesh.centre(f), 1.2 * side, again(f) * ROOM * side));
            asked[mesh.region(f) as usize] = true;
        }
        self.regions = asked;
        places
    }

    /// What regions lacked before, and what they do after the attempt, if it changed anything.
    fn learn(&mut self, before: &[f64], after: Option<&[f64]>, is_better: bool) {
        let Some(after) = after else {
            self.only = None;
            for (failures, _) in self.failures.iter_mut().zip(&self.regions).filter(|(_, asked)| **asked) {
                *failures += 1;
            }
            return;
        };
        for (r, failures) in self.failures.iter_mut().enumerate() {
            let failed = after[r] > before[r] || self.regions[r] && after[r] == before[r];
            *failures = failures.saturating_add(u8::from(failed));
        }
        let better: Vec<bool> =
            self.regions.iter().enumerate().map(|(r, asked)| *asked && after[r] < before[r]).collect();
        let alone = !is_better && self.only.is_none() && better.contains(&true);
        self.only = alone.then_some(better);
    }
}

/// The mean length of the sides that a face is to have.
fn mean_size(mesh: &Mixed, f: u32) -> f64 {
    let corners = mesh.corners(f);
    corners.iter().map(|&v| mesh.size(v)).sum::<f64>() / corners.len() as f64
}

/// From triangles to clean quads in the regions that are awake.
fn advance_and_clean(
    mesh: &mut Mixed,
    ground: &Ground<'_>,
    rules: Rules,
    awake: &[bool],
    stats: &mut QMorphStats,
    watch: &Watch,
) -> Result<(), Cancelled> {
    polish(mesh, ground, rules, 4, awake);
    watch.phase("advancing the front", None);
    stats.seams += advance(mesh, ground, watch)?.seams;
    let after_front = triangles_by_region(mesh, stats.regions);
    join_neighbours(mesh);
    let after_pairs = triangles_by_region(mesh, stats.regions);
    join_along_paths(mesh, ground);
    stats.levels.resize(stats.regions, 0);
    for region in (0..stats.regions).filter(|&r| awake[r]) {
        stats.levels[region] = if after_front[region] <= 1 { 0 } else { 1 + usize::from(after_pairs[region] > 1) };
    }
    stats.regions_by_level = [0; 4];
    for &level in &stats.levels {
        stats.regions_by_level[level] += 1;
    }
    watch.phase("cleaning up", None);
    stats.clean_edits += clean(mesh, ground, rules.curve_tolerance, awake, watch)?.edits;
    Ok(())
}

fn triangles_by_region(mesh: &Mixed, regions: usize) -> Vec<usize> {
    let mut count = vec![0; regions];
    for f in mesh.faces().filter(|&f| mesh.is_triangle(f)) {
        count[mesh.region(f) as usize] += 1;
    }
    count
}
