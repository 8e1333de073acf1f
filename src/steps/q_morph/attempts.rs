//! From the surface to clean quads, tried again with smaller sizes where distance or shapes are not good enough.
//!
//! Every attempt starts from an earlier one ([`search`](super::search)) and makes only those regions anew whose
//! triangles changed. What is poor in it is meshed anew in small pieces ([`rework`](super::rework)): most parts need
//! one to three attempts then. For the others all begins again with whole regions only: larger steps, that lead
//! elsewhere. Pieces are for what is left then.

use std::cell::{Cell, OnceCell};

use rustc_hash::FxHashSet;

use super::budget::{self, Budget};
use super::check::{Check, Fault, Wish, mean_side, smaller};
use super::flatten::flatten;
use super::lack::lack;
use super::reuse::{Attempt, signs, take_over};
use super::rework::{Aim, Rework};
use super::search::Search;
use super::settle::settle;
use super::untangle::untangled;
use super::{QMorphError, QMorphParams, QMorphStats, sizes};
use crate::technique::clean_quads::{clean, finish, regularise};
use crate::technique::front::advance;
use crate::technique::ground::Ground;
use crate::technique::isotropic::{Rules, lower_sizes, pair_up, polish, remesh, tighten};
use crate::technique::join::{join_along_paths, join_neighbours};
use crate::technique::mixed::Mixed;
use crate::watch::{Cancelled, Watch};

/// How often poor places of an attempt are gone through.
const REWORKS: usize = 2;
/// How often sizes are lowered beforehand, where the triangles are too far from the surface.
const PREPARATIONS: usize = 4;
/// The part of the tolerance that triangles may use.
const TRIANGLES: f64 = 0.7;
/// What an attempt lacks from where faces are inverted or triangles are left.
const BROKEN: f64 = 10.0;
/// How much farther from their curves edges may be where that spares broken faces.
const LOOSER: f64 = 2.0;

/// One run from the surface to clean quads, with all sizes times `scale`.
pub(super) fn morph(
    ground: &Ground<'_>,
    params: &QMorphParams,
    rules: Rules,
    scale: f64,
    watch: &Watch,
) -> Result<(Mixed, QMorphStats), QMorphError> {
    let regions = ground.region_count();
    let stats = QMorphStats { regions, left_out: ground.left_out, attempts: 1, ..QMorphStats::default() };
    let check = Check::new(ground, watch)?;
    let left = Cell::new(2 * params.attempts);
    let work = Morpher { ground, params, check: &check, scale, watch, left, budget: OnceCell::new() };
    let mut begun = Vec::new();
    let Some(mut best) = work.attempts(rules, &stats, &mut begun)? else { return Err(QMorphError::Empty) };
    // Many pieces on a curve that is rough may be what broke it: none shorter than the least size, then a looser curve.
    let longer = Rules { shortest: rules.least_size, ..rules };
    let looser = Rules { curve_tolerance: LOOSER * rules.curve_tolerance, ..longer };
    for rules in [longer, looser] {
        if best.lack < BROKEN || params.attempts <= 1 || ground.curves.is_empty() || work.is_spent() {
            break;
        }
        work.left.set(params.attempts);
        let Some(other) = work.attempts(rules, &stats, &mut begun)? else { continue };
        let attempts = best.stats.attempts + other.stats.attempts;
        if other.lack < best.lack {
            best = other;
        }
        best.stats.attempts = attempts;
    }
    let is_hopeless = best.is_hopeless();
    if best.stats.reworked > 0 {
        work.tidy(&mut best, rules)?;
    }
    work.flatten(&mut best, rules)?;
    let Attempt { quads, mut stats, .. } = best;
    stats.distance = check.distance(&quads, watch)?;
    stats.triangles = quads.census().0;
    stats.work_limit_reached = work.is_spent() || is_hopeless;
    Ok((quads, stats))
}

/// What all attempts share.
struct Morpher<'a, 'g> {
    ground: &'a Ground<'g>,
    params: &'a QMorphParams,
    check: &'a Check,
    scale: f64,
    watch: &'a Watch,
    /// How many more attempts there may be under the rules tried.
    left: Cell<usize>,
    /// What all of it may cost, known when the first triangles are.
    budget: OnceCell<Budget>,
}

impl Morpher<'_, '_> {
    /// What may still be done; `mesh` tells the size of the part.
    fn budget(&self, mesh: &Mixed) -> &Budget {
        self.budget.get_or_init(|| Budget::of(mesh.faces().count()))
    }

    /// Whether nothing more should be begun.
    fn is_spent(&self) -> bool {
        self.budget.get().is_some_and(Budget::is_spent)
    }

    /// Remeshes, runs the front, and does again what is not good enough: first with pieces meshed anew, then without.
    /// `None` where other rules gave the same triangles, whose signs are in `begun`.
    fn attempts(
        &self,
        rules: Rules,
        stats: &QMorphStats,
        begun: &mut Vec<Vec<u64>>,
    ) -> Result<Option<Attempt>, QMorphError> {
        let (ground, watch, most) = (self.ground, self.watch, self.params.attempts.max(1));
        let mut mesh = self.triangles(&[], rules)?;
        prepare(&mut mesh, ground, self.check, rules, watch)?;
        are_few_enough(&mesh, rules)?;
        let signs = signs(&mesh, ground.region_count());
        if begun.contains(&signs) {
            return Ok(None);
        }
        begun.push(signs);
        let mut first = self.attempt(mesh, None, rules, stats)?.ok_or(QMorphError::Empty)?;
        if most == 1 || first.is_good() || first.is_hopeless() {
            return Ok(Some(first));
        }
        let mut few = self.reworked(first.clone(), rules)?;
        if !few.flaws.crossing.is_empty()
            && self.left.get() > 0
            && !self.is_spent()
            && let Some(other) = self.begin_untangled(rules, stats, begun)?
        {
            let reworked = self.reworked(other.clone(), rules)?;
            if reworked.is_better_than(&few) {
                first = other;
            }
            few = few.or(reworked);
        }
        let few = self.improve(few, (2 * most).div_ceil(3), rules, stats, true)?;
        if few.is_fair() || self.is_spent() {
            return Ok(Some(few));
        }
        let mut many = self.improve(first.clone(), most, rules, stats, false)?;
        // From the first one, all would go as before.
        if many.is_better_than(&first) {
            many = self.improve(self.reworked(many, rules)?, most.div_ceil(2), rules, stats, true)?;
        }
        let mut best = many.or(few);
        // Both count the first.
        best.stats.attempts -= 1;
        Ok(Some(best))
    }

    /// An attempt from triangles that do not fold up; `None` where they are those that all `begun` with.
    fn begin_untangled(
        &self,
        rules: Rules,
        stats: &QMorphStats,
        begun: &[Vec<u64>],
    ) -> Result<Option<Attempt>, QMorphError> {
        let (ground, check, watch) = (self.ground, self.check, self.watch);
        let mut mesh = untangled(ground, check, rules, watch, &|places| self.triangles(places, rules))?;
        prepare(&mut mesh, ground, check, rules, watch)?;
        if begun.contains(&signs(&mesh, ground.region_count())) {
            return Ok(None);
        }
        Ok(self.attempt(mesh, None, rules, stats)?)
    }

    /// Triangles of the sizes asked for, and smaller ones at some places.
    fn triangles(&self, places: &[Wish], rules: Rules) -> Result<Mixed, QMorphError> {
        let (ground, watch) = (self.ground, self.watch);
        watch.phase("remeshing between the curves", None);
        let mut mesh = ground.workshop().ok_or(QMorphError::NotManifold)?;
        sizes::set(&mut mesh, ground.surface, self.params, self.scale).map_err(QMorphError::Size)?;
        lower_sizes(&mut mesh, places, rules.floor);
        remesh(&mut mesh, ground, rules, watch)?;
        are_few_enough(&mesh, rules)?;
        Ok(mesh)
    }

    /// Lowers sizes where faces prove too far away or poor, as long as that helps, and runs the front there again, with
    /// poor places meshed anew if `reworks`. The first attempt counts as one of the `most`.
    fn improve(
        &self,
        first: Attempt,
        most: usize,
        rules: Rules,
        stats: &QMorphStats,
        reworks: bool,
    ) -> Result<Attempt, QMorphError> {
        let (ground, watch) = (self.ground, self.watch);
        let mut attempts = first.stats.attempts;
        let mut search = Search::new(first);
        for _ in 1..most {
            let places = search.places(rules);
            if places.is_empty() || self.left.get() == 0 || self.is_spent() {
                break;
            }
            let mut mesh = search.from().triangles.clone();
            tighten(&mut mesh, ground, rules, &places, watch)?;
            let mut next = self.attempt(mesh, Some(search.from()), rules, stats)?;
            if let Some(next) = next.as_mut().filter(|_| reworks) {
                self.rework(next, rules)?;
            }
            search.learn(next, ground);
            attempts += 1;
        }
        let mut best = search.into_best();
        best.stats.attempts = attempts;
        Ok(best)
    }

    /// An attempt with poor places meshed anew in all regions.
    fn reworked(&self, mut attempt: Attempt, rules: Rules) -> Result<Attempt, Cancelled> {
        attempt.awake.fill(true);
        self.rework(&mut attempt, rules)?;
        Ok(attempt)
    }

    /// Meshes poor places of an attempt anew, in regions that it made.
    fn rework(&self, attempt: &mut Attempt, rules: Rules) -> Result<(), Cancelled> {
        self.watch.phase("meshing poor places anew", None);
        let drawn = FxHashSet::default();
        let Self { ground, check, watch, .. } = *self;
        let budget = self.budget(&attempt.quads);
        let mut rework = Rework { ground, check, rules, watch, aim: Aim::Sound, drawn, budget };
        for _ in 0..REWORKS {
            let before = attempt.clone();
            let reworked = rework.run(&mut attempt.quads, &mut attempt.flaws, &attempt.awake)?;
            if reworked == 0 {
                break;
            }
            attempt.stats.reworked += reworked;
            attempt.quads.compact();
            self.settle(attempt, rules)?;
            // A draw is judged by what is near it; vertices settle everywhere.
            if before.is_better_than(attempt) {
                *attempt = before;
                break;
            }
        }
        Ok(())
    }

    /// Takes out irregular vertices that rings and pieces left, where that costs nothing else.
    fn tidy(&self, attempt: &mut Attempt, rules: Rules) -> Result<(), Cancelled> {
        let (ground, watch) = (self.ground, self.watch);
        watch.phase("cleaning up", None);
        let before = attempt.clone();
        let tolerances = [rules.tolerance, rules.curve_tolerance];
        attempt.awake.fill(true);
        attempt.stats.clean_edits += regularise(&mut attempt.quads, ground, tolerances, &attempt.awake, watch)?;
        attempt.stats.clean_edits +=
            finish(&mut attempt.quads, ground, rules.curve_tolerance, &attempt.awake, watch)?.edits;
        self.settle(attempt, rules)?;
        self.rework(attempt, rules)?;
        if attempt.lack > before.lack {
            *attempt = before;
        }
        Ok(())
    }

    /// Makes folded quads flatter: by moving vertices, and where that is not enough, meshed anew in small pieces.
    fn flatten(&self, attempt: &mut Attempt, rules: Rules) -> Result<(), Cancelled> {
        let (ground, check, watch) = (self.ground, self.check, self.watch);
        watch.phase("flattening folded quads", None);
        let Attempt { quads, flaws, stats, awake, .. } = attempt;
        *flaws = flatten(quads, ground, check, rules.tolerance, flaws, watch)?;
        awake.fill(true);
        let (mut pieced, mut after) = (quads.clone(), flaws.clone());
        let (drawn, budget) = (FxHashSet::default(), &Budget::of(quads.faces().count()));
        let mut rework = Rework { ground, check, rules, watch, aim: Aim::Flat, drawn, budget };
        let reworked = rework.run(&mut pieced, &mut after, awake)?;
        if reworked == 0 {
            return Ok(());
        }
        pieced.compact();
        after = check.flaws(&pieced, rules.tolerance, watch)?;
        after = flatten(&mut pieced, ground, check, rules.tolerance, &after, watch)?;
        // A draw is judged by what is near it, and flatter quads are not worth a flaw.
        if after.faults.len() <= flaws.faults.len() && after.crossing.len() <= flaws.crossing.len() {
            stats.reworked += reworked;
            (*quads, *flaws) = (pieced, after);
        }
        Ok(())
    }

    /// Moves vertices of an attempt nearer to the surface, in regions that it made, and judges what it came to.
    fn settle(&self, attempt: &mut Attempt, rules: Rules) -> Result<(), Cancelled> {
        let Attempt { quads, awake, .. } = attempt;
        settle(quads, self.ground, self.check, rules.tolerance, awake, self.watch)?;
        // In all regions: the face nearest to a place may belong to another region than the place.
        attempt.flaws = self.check.flaws(quads, rules.tolerance, self.watch)?;
        (attempt.lack, attempt.by_region) = lack(quads, &attempt.flaws, rules.tolerance, awake.len());
        Ok(())
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
        self.left.set(self.left.get().saturating_sub(1));
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
                stats.reworked = done.reworked;
            }
        }
        let made = quads.faces().filter(|&f| awake[quads.region(f) as usize]).count();
        self.budget(&quads).spend(made);
        advance_and_clean(&mut quads, ground, rules, &awake, &mut stats, watch)?;
        stats.clean_edits += finish(&mut quads, ground, rules.curve_tolerance, &awake, watch)?.edits;
        let mut attempt = Attempt { triangles, signs, awake, quads, stats, ..Attempt::default() };
        self.settle(&mut attempt, rules)?;
        Ok(Some(attempt))
    }
}

/// Stops before the work where curves, narrow strips and distances ask for far more triangles than the size does.
fn are_few_enough(mesh: &Mixed, rules: Rules) -> Result<(), QMorphError> {
    if mesh.faces().count() <= rules.most_faces {
        return Ok(());
    }
    let wanted = rules.most_faces.saturating_sub(budget::FEW) as f64 / budget::LOWERED;
    Err(QMorphError::LoweredSizes { most: rules.most_faces, wanted })
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
    stats.clean_edits += regularise(mesh, ground, [rules.tolerance, rules.curve_tolerance], awake, watch)?;
    Ok(())
}

fn triangles_by_region(mesh: &Mixed, regions: usize) -> Vec<usize> {
    let mut count = vec![0; regions];
    for f in mesh.faces().filter(|&f| mesh.is_triangle(f)) {
        count[mesh.region(f) as usize] += 1;
    }
    count
}
