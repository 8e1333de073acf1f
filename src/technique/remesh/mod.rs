//! Local remeshing under guards: what pure collapse cannot reach.
//!
//! Passes as in Botsch and Kobbelt, A Remeshing Approach to Multiresolution Modeling, SGP 2004 (split, collapse, flip,
//! tangential relaxation, projection), each a verb of the [`GuardedMesh`]: thresholds, certified tolerance and
//! embedding hold after every one of them, and it must gain, so that the passes end.
//!
//! Where no face is poor any more, the mean is raised: see [`coarsen`]. [`raise_stretch`] repairs the faces below a
//! threshold before and after.

mod descent;
mod passes;
mod raise;
mod regular;
mod search;

use descent::Descent;
pub use passes::{Refusals, flip_edges, relax_vertices, towards_centroid};
use passes::{relax, split_long_edges};
use raise::settle_in;
pub use raise::{faces_below, raise_stretch, touch_up};
use regular::flip_to_regular;

use crate::technique::collapse::{CollapseRules, Ending, Goal, simplify};
use crate::technique::guarded::{Gain, GuardedMesh, StarRules};
use crate::watch::{Cancelled, Watch};

/// What optimised faces should reach beyond the threshold asked for, with all means, and with single edits.
const GOOD: f64 = 0.35;
const BETTER: f64 = 0.45;

/// Thresholds for faces that stay below the one asked for, in parts of it.
const HIGHER_AIMS: [f64; 3] = [1.25, 1.5, 2.0];

/// Rounds of flips and relaxation between collapses, and at the end.
const ROUNDS: [usize; 2] = [2, 8];

/// Rounds of flips towards regular valences and of moves that raise the mean, at the end.
const EVENING: usize = 4;

/// Evening out that raises the mean stretch by less is not worth its time.
const LITTLE: f64 = 1e-4;

/// Coarsens to the goal, or until no edge is valid, with optimisation in between.
///
/// The stretch that new faces need starts high and falls in steps, so that poor collapses are only done when a number
/// of faces asks for them; without one they are not done. Towards a mean stretch it goes down until evening out leaves
/// little more than was asked for.
pub fn coarsen(
    guarded: &mut GuardedMesh<'_>,
    rules: &CollapseRules,
    goal: Goal,
    watch: &Watch,
) -> Result<Ending, Cancelled> {
    let mut refusals = Refusals::default();
    let mut descent = Descent::new(guarded, rules, goal);
    let mut ending = descent.go_down(guarded, &mut refusals, watch)?;
    finish(guarded, rules, &mut refusals, watch)?;
    while ending == Ending::Mean && descent.may_go_on(guarded) {
        ending = descent.go_down(guarded, &mut refusals, watch)?;
        finish(guarded, rules, &mut refusals, watch)?;
    }
    for threshold in [rules.star.min_stretch, GOOD.max(rules.star.min_stretch)] {
        raise_stretch(guarded, threshold, rules, watch)?;
    }
    touch_up(guarded, BETTER.max(rules.star.min_stretch), rules, watch)?;
    mend_stubborn(guarded, rules, watch)?;
    regain_mean(guarded, goal.mean_stretch, BETTER.max(rules.star.min_stretch), watch)?;
    Ok(ending)
}

/// What repairs took from the mean stretch, evened out again, as far as that goes.
fn regain_mean(guarded: &mut GuardedMesh<'_>, goal: f64, least: f64, watch: &Watch) -> Result<(), Cancelled> {
    let mut before = 0.0;
    while guarded.mean_stretch() < goal && guarded.mean_stretch() > before + LITTLE {
        before = guarded.mean_stretch();
        even_out(guarded, least, watch)?;
    }
    Ok(())
}

/// Rounds of optimisation after the last collapses. Faces that single edits can mend are mended before the mean is
/// raised, and kept so, since repairs afterwards would lower it again.
fn finish(
    guarded: &mut GuardedMesh<'_>,
    rules: &CollapseRules,
    refusals: &mut Refusals,
    watch: &Watch,
) -> Result<(), Cancelled> {
    optimise_with(guarded, ROUNDS[1], refusals, watch)?;
    touch_up(guarded, BETTER.max(rules.star.min_stretch), rules, watch)?;
    even_out(guarded, BETTER.max(rules.star.min_stretch), watch)
}

/// Once more where faces are below the threshold still, and past it: what was done about their neighbours meanwhile,
/// and what a higher aim changes round them, may have made room.
pub fn mend_stubborn(guarded: &mut GuardedMesh<'_>, rules: &CollapseRules, watch: &Watch) -> Result<(), Cancelled> {
    for aim in HIGHER_AIMS {
        let aim = aim * rules.star.min_stretch;
        if faces_below(guarded, rules.star.min_stretch).is_empty() || aim > BETTER {
            return Ok(());
        }
        raise_stretch(guarded, aim, rules, watch)?;
        raise_stretch(guarded, rules.star.min_stretch, rules, watch)?;
    }
    Ok(())
}

/// Raises the mean stretch where no face falls below `least` by it: flips towards regular valences, which only pay
/// after the moves that follow, and moves to the centre of the star and then to the best place nearby.
fn even_out(guarded: &mut GuardedMesh<'_>, least: f64, watch: &Watch) -> Result<(), Cancelled> {
    watch.phase("even out", Some(EVENING as u64));
    let gain = Gain::Mean(least);
    let (mut centred, mut settled) = (Refusals::default(), Refusals::default());
    for round in 0..EVENING {
        watch.advance(round as u64, || format!("{} faces", guarded.mesh().face_count()));
        if round + 1 < EVENING {
            flip_to_regular(guarded, watch)?;
        }
        for _ in 0..2 {
            relax_vertices(guarded, &mut centred, watch, |guarded, v| relax(guarded, v, gain))?;
        }
        flip_edges(guarded, &mut centred, watch)?;
        relax_vertices(guarded, &mut settled, watch, |guarded, v| settle_in(guarded, v, gain))?;
    }
    Ok(())
}

/// Collapses until no edge is valid, those that leave good faces first, and nothing else in between.
pub fn coarsen_purely(
    guarded: &mut GuardedMesh<'_>,
    rules: &CollapseRules,
    watch: &Watch,
) -> Result<Ending, Cancelled> {
    for (least, mean) in descent::COMFORT.into_iter().chain(descent::LESS_COMFORT) {
        let rules = careful(rules, least, mean);
        simplify(guarded, &rules, Goal::default(), watch)?;
    }
    simplify(guarded, rules, Goal::default(), watch)
}

/// The rules of a step that [`coarsen`] takes in any case: of the last one, or where the mean stretch has a goal, which
/// poor stars would take away, of the first.
pub fn comfortable(rules: &CollapseRules, has_mean_goal: bool) -> CollapseRules {
    let (least, mean) = descent::COMFORT[if has_mean_goal { 0 } else { descent::COMFORT.len() - 1 }];
    careful(rules, least, mean)
}

/// The same rules with more asked of new stars.
fn careful(rules: &CollapseRules, least: f64, mean_stretch: f64) -> CollapseRules {
    let star = StarRules { min_stretch: least.max(rules.star.min_stretch), mean_stretch, ..rules.star };
    CollapseRules { star, ..*rules }
}

/// Rounds of splits, flips and relaxation. Returns the number of edits that gained in the last round.
pub fn optimise(guarded: &mut GuardedMesh<'_>, rounds: usize, watch: &Watch) -> Result<usize, Cancelled> {
    optimise_with(guarded, rounds, &mut Refusals::default(), watch)
}

/// As [`optimise`], past the edits that were refused earlier and would be again.
fn optimise_with(
    guarded: &mut GuardedMesh<'_>,
    rounds: usize,
    refusals: &mut Refusals,
    watch: &Watch,
) -> Result<usize, Cancelled> {
    let mut last = 0;
    watch.phase("optimise", Some(rounds as u64));
    for round in 0..rounds {
        watch.advance(round as u64, || format!("{} faces", guarded.mesh().face_count()));
        split_long_edges(guarded, watch)?;
        last = flip_edges(guarded, refusals, watch)?;
        last += relax_vertices(guarded, refusals, watch, |guarded, v| relax(guarded, v, Gain::Quality))?;
        if last * 200 < guarded.mesh().vertex_count() {
            break;
        }
    }
    Ok(last)
}
