//! How far and how carefully to coarsen: the stretch that new faces need falls step by step.

use super::passes::Refusals;
use super::{ROUNDS, careful, optimise_with};
use crate::technique::collapse::{CollapseRules, Ending, Goal, simplify};
use crate::technique::guarded::{GuardedMesh, StarRules};
use crate::watch::{Cancelled, Watch};

/// Least and mean stretch that optimised coarsening asks of new stars, in falling steps.
pub(super) const COMFORT: [(f64, f64); 3] = [(0.7, 0.88), (0.6, 0.83), (0.5, 0.78)];

/// The same in smaller steps, where the mean stretch of all faces has a goal.
const SMALL_STEPS: [(f64, f64); 5] = [(0.7, 0.88), (0.65, 0.855), (0.6, 0.83), (0.55, 0.805), (0.5, 0.78)];

/// Further steps for meshes that the first ones hardly coarsen, such as grids of right-angled triangles, where the
/// first collapse always makes its star less even.
pub(super) const LESS_COMFORT: [(f64, f64); 2] = [(0.4, 0.65), (0.3, 0.5)];

/// The part of the faces that must be gone for the further steps to be left out.
const COARSENED: f64 = 0.25;

/// What the rounds at the end add to the mean stretch of most meshes; some gain twice as much.
const GAIN_AT_END: f64 = 0.02;

/// The part of what the rounds between two steps gained that the next step may count on.
const COUNTED_ON: f64 = 0.25;

/// The same for the rounds at the end, which gain less every time.
const COUNTED_ON_AT_END: f64 = 0.6;

/// Steps that take fewer of the faces are not repeated.
const MUCH: f64 = 0.01;

/// How near above its goal the mean stretch of all faces is near enough.
const CLOSE: f64 = 0.003;

/// The same after the rounds at the end, when little is left to gain.
const CLOSE_AT_END: f64 = 0.0005;

/// What the repairs after all rounds take from the mean stretch of some meshes, not counting what is regained.
const COST_OF_REPAIRS: f64 = 0.001;

/// Times that coarsening goes on after the rounds at the end.
const RETURNS: usize = 3;

/// The way down to a goal.
pub(super) struct Descent<'r> {
    rules: &'r CollapseRules,
    goal: Goal,
    steps: Vec<(f64, f64)>,
    /// The next step.
    place: usize,
    /// Faces at the start.
    start: usize,
    /// What the mean stretch must not fall below between steps; 0 before the first one.
    floor: f64,
    /// What the last rounds of optimisation gained.
    gain: f64,
    /// The mean stretch after them.
    ended: f64,
    returns: usize,
}

impl<'r> Descent<'r> {
    pub(super) fn new(guarded: &GuardedMesh<'_>, rules: &'r CollapseRules, goal: Goal) -> Self {
        let first: &[(f64, f64)] = if goal.mean_stretch > 0.0 { &SMALL_STEPS } else { &COMFORT };
        let steps = [first, &LESS_COMFORT].concat();
        let spare = if goal.mean_stretch > 0.0 { COST_OF_REPAIRS } else { 0.0 };
        let goal = Goal { mean_stretch: goal.mean_stretch + spare, ..goal };
        Self {
            rules,
            goal,
            steps,
            place: 0,
            start: guarded.mesh().face_count(),
            floor: 0.0,
            gain: 0.0,
            ended: 0.0,
            returns: 0,
        }
    }

    /// The steps, then, for a number of faces, all that the rules allow.
    pub(super) fn go_down(
        &mut self,
        guarded: &mut GuardedMesh<'_>,
        refusals: &mut Refusals,
        watch: &Watch,
    ) -> Result<Ending, Cancelled> {
        let mut ending = Ending::Exhausted;
        while let Some(&(least, mean)) = self.steps.get(self.place) {
            if self.place + LESS_COMFORT.len() >= self.steps.len() && self.is_coarsened(guarded) {
                break;
            }
            let rules = careful(self.rules, least, mean);
            let before = guarded.mesh().face_count();
            ending = self.step(guarded, &rules, refusals, watch)?;
            match ending {
                Ending::Target => return Ok(ending),
                Ending::Mean if self.is_at_floor(guarded) || !is_much(before, guarded.mesh().face_count()) => {
                    return Ok(ending);
                }
                Ending::Mean => {}
                Ending::Exhausted => self.place += 1,
            }
        }
        let (mut comfort, _) = COMFORT[COMFORT.len() - 1];
        while ending == Ending::Exhausted && self.goal.faces > 0 && comfort > self.rules.star.min_stretch {
            comfort = (comfort - 0.1).max(self.rules.star.min_stretch);
            let star = StarRules { min_stretch: comfort, ..self.rules.star };
            let rules = CollapseRules { star, ..*self.rules };
            ending = simplify(guarded, &rules, Goal { mean_stretch: self.floor, ..self.goal }, watch)?;
            optimise_with(guarded, 1, refusals, watch)?;
        }
        Ok(ending)
    }

    /// One step, ended where the mean falls below the floor by more than what optimisation gains afterwards, which the
    /// step before has shown. The first one is free: it raises the mean of most meshes, and what it reaches is all that
    /// can be asked where that is less than the goal.
    fn step(
        &mut self,
        guarded: &mut GuardedMesh<'_>,
        rules: &CollapseRules,
        refusals: &mut Refusals,
        watch: &Watch,
    ) -> Result<Ending, Cancelled> {
        let goal = Goal { mean_stretch: (self.floor - COUNTED_ON * self.gain).max(0.0), ..self.goal };
        let ending = simplify(guarded, rules, goal, watch)?;
        let before = guarded.mean_stretch();
        optimise_with(guarded, ROUNDS[0], refusals, watch)?;
        let after = guarded.mean_stretch();
        self.gain = (after - before).max(0.0);
        self.ended = after;
        if self.floor == 0.0 && self.goal.mean_stretch > 0.0 {
            self.floor = (self.goal.mean_stretch - GAIN_AT_END).min(after);
        }
        Ok(ending)
    }

    fn is_coarsened(&self, guarded: &GuardedMesh<'_>) -> bool {
        (guarded.mesh().face_count() as f64) < (1.0 - COARSENED) * self.start as f64
    }

    fn is_at_floor(&self, guarded: &GuardedMesh<'_>) -> bool {
        guarded.mean_stretch() < self.floor + CLOSE
    }

    /// Sets the floor by what the rounds at the end have gained. Whether that leaves something to do.
    pub(super) fn may_go_on(&mut self, guarded: &GuardedMesh<'_>) -> bool {
        let mean = guarded.mean_stretch();
        self.returns += 1;
        self.floor = self.goal.mean_stretch - COUNTED_ON_AT_END * (mean - self.ended).max(0.0);
        self.returns <= RETURNS && mean > self.goal.mean_stretch + CLOSE_AT_END
    }
}

fn is_much(before: usize, after: usize) -> bool {
    (after as f64) < (1.0 - MUCH) * before as f64
}
