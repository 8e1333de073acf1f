//! Remeshing by sizes: edits first, one certificate after.
//!
//! # Algorithm
//! Starting from the surface as it is, rounds of splits, collapses, flips and moves bring every edge near to the size
//! wanted there. The size is the least of what is asked for, what the surface's curvature and that of its curves allow
//! for the tolerance, and what strips between curves leave room for, graded along the mesh ([`super::sizing`]). Edits
//! pass cheap tests only: topology, freedom, turned normals, shape. Then the whole is held against the reference, both
//! ways, and against itself; where it lies too far off, sizes are lowered, points of the reference that would be lost
//! draw vertices to them, folds are undone, and the rounds go on near there, now with samples of each new face held
//! against the reference. Where the mean stretch is below the one asked for, the rounds go on with sizes that grow more
//! slowly along the mesh; where it is above, further collapses use it up. What is left of poor faces is mended in a
//! guarded mesh ([`super::guarded`]), which also certifies the result.
//!
//! Where no certificate is reached, all is done again with edges that turn less over what is rounded off, and where the
//! mesh is small in the guarded mesh from the beginning. A large one is returned without a certificate; mostly its
//! reference has sheets that lie nearer to each other than the tolerance.
//!
//! Passes decide on edits on all threads, and do them in one order: the result is the same for any number.
//!
//! Based on: M. Botsch, L. Kobbelt. A remeshing approach to multiresolution modeling. SGP 2004. M. Dunyach,
//! D. Vanderhaeghe, L. Barthe, M. Botsch. Adaptive remeshing for real-time mesh deformation. Eurographics 2013, for
//! sizes from curvature. X.-X. Cheng et al. Practical error-bounded remeshing by adaptive refinement. Computers and
//! Graphics 82, 2019, for the loop of certificates.
//!
//! # Invariants
//! - Topology, marked curves and kept elements stay; edges of curves stay within the curves' tolerance.
//! - The report names a bound of the distance only where it was certified.
//!
//! # Cost
//! O(F + result) edits a round, each a few projections, and a certificate for each lowering of sizes.
//!
//! # Departures
//! Faces over one fitted plane or cylinder are not bounded by a formula: on parts of 10 000 to 40 000 faces all
//! certificates together take about a quarter of the time, and what formulas would spare an eighth.

mod ahead;
mod certify;
mod collapse;
mod ending;
mod flip;
mod order;
mod reference;
mod smooth;
mod split;
mod unfold;
mod valence;
mod work;

use certify::Memos;
use collapse::Comfort;
use ending::{Ended, guarded_all_along, mend};
use flip::Aim;
use reference::Reference;
use work::{Care, Work};

use crate::mesh::bvh::TriangleBvh;
use crate::mesh::halfedge::{EnterError, HalfedgeMesh};
use crate::mesh::id::Face;
use crate::mesh::{FaceId, FreedomError, IdVec, LockRules, Surface, resolve_freedom};
use crate::technique::guarded::{Counts, SizeField};
use crate::technique::refine::RefineError;
use crate::watch::{Cancelled, Watch};

/// The edge length wanted on each face of the reference.
#[derive(Clone, Debug)]
pub enum Wanted {
    /// The same everywhere.
    Uniform(f64),
    /// By face.
    Faces(Vec<f64>),
}

impl Wanted {
    fn is_uniform(&self) -> bool {
        matches!(self, Self::Uniform(_))
    }

    fn at(&self, f: FaceId) -> f64 {
        match self {
            Self::Uniform(size) => *size,
            Self::Faces(sizes) => sizes[f.index()],
        }
    }

    fn most(&self) -> f64 {
        match self {
            Self::Uniform(size) => *size,
            Self::Faces(sizes) => sizes.iter().copied().fold(0.0, f64::max),
        }
    }
}

/// What to hold to; lengths in mesh units.
#[derive(Clone, Debug)]
pub struct Rules {
    /// The edge length wanted where nothing asks for less.
    pub size: Wanted,
    /// No edge gets longer than this.
    pub longest: f64,
    /// The longest side of a face, where that differs from place to place; what breaks it is for the caller to name.
    pub max_size: SizeField,
    /// Sizes are not lowered below this.
    pub least_size: f64,
    /// Largest distance from the reference, both ways.
    pub promise: f64,
    /// The part of it that is used up before the end.
    pub tolerance: f64,
    /// The largest distance of curves from the reference's.
    pub curve_tolerance: f64,
    /// Least stretch of a face.
    pub min_stretch: f64,
    /// The mean stretch that is aimed for.
    pub mean_stretch: f64,
    /// Most edges at a vertex.
    pub max_valence: usize,
    /// No more faces than this are made.
    pub most_faces: usize,
}

/// What is remeshed.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// The surface, which is also the reference.
    pub surface: &'a Surface,
    /// What must stay.
    pub locks: LockRules<'a>,
}

/// How it went.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Rounds of edits.
    pub rounds: usize,
    /// How often sizes were lowered after a certificate.
    pub lowerings: usize,
    /// Edits of all attempts.
    pub edits: Counts,
    /// Whether the guarded mesh had to do all of it.
    pub is_guarded_all_along: bool,
    /// The certified bound of the distance, where there is one.
    pub bound: Option<f64>,
}

/// Why it could not be done.
#[derive(Debug, thiserror::Error)]
pub enum RemeshError {
    /// The surface is none.
    #[error(transparent)]
    Enter(#[from] EnterError),
    /// Locks that name what is not there.
    #[error(transparent)]
    Locks(#[from] FreedomError),
    /// The surface cannot be refined.
    #[error(transparent)]
    Refine(#[from] RefineError),
    /// Stopped from outside.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// The most that edges turn, in radians, and how fast sizes grow at first. The second and third where edits have led
/// into a fold that none of them mends, and all is done again: where the tolerance is no smaller than what is rounded
/// off, it alone lets thin limbs fold up.
const STARTS: [(f64, f64); 3] = [(f64::INFINITY, 0.4), (1.0, 0.4), (f64::INFINITY, 0.27)];
/// Meshes of more faces are not done again in the guarded mesh, which takes milliseconds for each.
const MOST_GUARDED: usize = 16_000;
/// How often sizes are made to grow more slowly for the sake of the mean stretch, which ends where it loses this much.
const SLOWER: usize = 4;
const SETBACK: f64 = 0.02;
/// Nor where that has made so many times the faces.
const DENSER: usize = 2;
/// The mean stretch gains about so much where they grow by one less over a unit of length.
const STEEP: f64 = 0.2;
/// By how much less they grow at once, and how much at least.
const AT_ONCE: [f64; 2] = [0.02, 0.1];
const SLOWEST: f64 = 0.15;
/// What the faces of collapses beyond the sizes must reach.
const COMFORT: Comfort = [0.5, 0.75];
/// A mean stretch that is missed by less does not make another attempt.
const SLIGHTLY: f64 = 3e-4;
/// What the mean stretch loses where sizes are lowered.
const LOST_LATER: f64 = 0.001;
/// How often sizes are lowered where they prove too large.
const LOWERINGS: usize = 12;
/// And how often without one that leaves fewer faults.
const PATIENCE: usize = 4;
/// Nor where more than one face in so many meets another.
const HOPELESS: usize = 20;
/// From which lowering on lost points of the reference draw vertices.
const PULL_AFTER: usize = 1;
/// Rounds of edits before the first certificate, and after each lowering of sizes.
const ROUNDS: [usize; 2] = [5, 2];
/// Strips between curves are looked at after so many rounds.
const LOOK_AT_STRIPS: usize = 2;
/// The needles of the input are cut up where a pass halves less than one edge for so many faces.
const CUT_UP: usize = 20;
/// Passes of collapses beyond the sizes.
const COARSENINGS: usize = 3;
/// What further passes ask for while the mean stretch is above the one aimed for by the margin.
const LESS_COMFORT: [Comfort; 3] = [[0.45, 0.7], [0.45, 0.7], [0.45, 0.65]];
const MARGIN: f64 = 0.002;
/// Rounds of moves and flips for shape at the end of each turn; they end where fewer than one vertex in so many gains.
const POLISH: usize = 8;
const QUIET: usize = 200;

/// Meshes a surface anew. `tree` is the hierarchy over it.
///
/// # Errors
/// See [`RemeshError`]. That the tolerance could not be kept is no error: the report has no bound then.
pub fn remesh(
    input: &Input<'_>,
    tree: &TriangleBvh,
    rules: &Rules,
    watch: &Watch,
) -> Result<(Surface, Report), RemeshError> {
    let freedom = resolve_freedom(input.surface, &input.locks)?;
    let mesh = HalfedgeMesh::new(input.surface, &freedom)?;
    let mut report = Report::default();
    let mut tried: Option<(IdVec<Face, f64>, HalfedgeMesh)> = None;
    for (turn, gradation) in STARTS {
        let reference = Reference::new(input.surface, tree, &mesh, rules, turn);
        let is_as_before = tried.as_ref().is_some_and(|(longest, _)| *longest == reference.longest);
        if turn.is_finite() && is_as_before {
            continue;
        }
        let mut work = Work::new(mesh.clone(), &reference, rules, gradation);
        let ended = work.attempts(&mut report, |mesh| mend(&mesh.leave().surface, input, tree, rules, watch), watch)?;
        report.edits = report.edits + work.tally;
        if let Some(ended) = ended {
            return Ok(report.ended(ended));
        }
        tried = Some((reference.longest.clone(), work.mesh));
    }
    if let Some((_, mesh)) = tried.filter(|(_, mesh)| mesh.face_count() > MOST_GUARDED) {
        return Ok((mesh.leave().surface, report));
    }
    report.is_guarded_all_along = true;
    let ended = guarded_all_along(input, tree, rules, watch)?;
    Ok(report.ended(ended))
}

impl Report {
    fn ended(mut self, ended: Ended) -> (Surface, Self) {
        self.bound = ended.bound;
        self.edits = self.edits + ended.counts;
        (ended.surface, self)
    }
}

impl Work<'_> {
    /// Rounds of edits and certificates, with sizes that grow more slowly each time that the mean stretch stays below
    /// the one asked for. Returns the best of what `mend` makes of meshes for which a certificate has found nothing.
    fn attempts(
        &mut self,
        report: &mut Report,
        mend: impl Fn(HalfedgeMesh) -> Result<Ended, RemeshError>,
        watch: &Watch,
    ) -> Result<Option<Ended>, RemeshError> {
        let mut memos = Memos::default();
        let (mut best, mut before): (Option<Ended>, f64) = (None, 0.0);
        self.set_sizes();
        self.cut_up(watch)?;
        self.turn(ROUNDS[0], report, watch)?;
        let most_faces = DENSER * self.mesh.face_count();
        for slower in 0..=SLOWER {
            let mean = self.mean();
            let lacks = self.rules.mean_stretch + LOST_LATER - mean;
            let gains = mean > std::mem::replace(&mut before, mean) - SETBACK && self.mesh.face_count() < most_faces;
            if slower == SLOWER || lacks <= 0.0 || !gains || !self.grow_slower(lacks) {
                if !self.until_clean(&mut memos, report, watch)? {
                    break;
                }
                let ended = mend(self.mesh.clone())?;
                let lacks = self.rules.mean_stretch - ended.mean;
                let is_better = best.as_ref().is_none_or(|best| ended.mean > best.mean);
                best = if is_better && ended.bound.is_some() { Some(ended) } else { best };
                if lacks <= SLIGHTLY || self.mesh.face_count() >= most_faces || !self.grow_slower(lacks) {
                    break;
                }
            }
            self.turn(ROUNDS[1], report, watch)?;
        }
        Ok(best)
    }

    /// Lets sizes grow more slowly for a mean stretch that lacks so much; whether they may.
    fn grow_slower(&mut self, lacks: f64) -> bool {
        let before = self.sizing.bounds().gradation;
        let may = before > SLOWEST;
        if may {
            self.begin((before - (lacks / STEEP).clamp(AT_ONCE[0], AT_ONCE[1])).max(SLOWEST));
        }
        may
    }

    /// Certificates and rounds of edits where they fail, until one finds nothing; whether it came to that.
    fn until_clean(&mut self, memos: &mut Memos, report: &mut Report, watch: &Watch) -> Result<bool, Cancelled> {
        let mut verdict = self.certify(memos, watch)?;
        let mut fewest = (usize::MAX, 0);
        for lowering in 1..=LOWERINGS {
            fewest = if verdict.faults() < fewest.0 { (verdict.faults(), lowering) } else { fewest };
            let is_beyond_hope = verdict.crossing > self.mesh.face_count() / HOPELESS;
            if verdict.is_clean() || is_beyond_hope || lowering >= fewest.1 + PATIENCE {
                break;
            }
            self.care = Care::Sizes;
            self.unfold(verdict.wishes.iter().map(|&(v, _)| v));
            self.lower(&verdict.wishes);
            if lowering > PULL_AFTER {
                self.pull(&verdict.lost);
            }
            self.care = Care::Samples;
            self.turn(ROUNDS[1], report, watch)?;
            report.lowerings += 1;
            let before = std::mem::replace(&mut verdict, self.certify(memos, watch)?).crossing;
            if lowering > PULL_AFTER && verdict.is_tangled(before, self.mesh.face_count()) {
                break;
            }
        }
        Ok(verdict.is_clean())
    }

    /// Cuts the needles of the input up: halved all along they would be many times the faces that are wanted, so what
    /// gets short on the way collapses at once.
    fn cut_up(&mut self, watch: &Watch) -> Result<(), Cancelled> {
        self.flip_all(Aim::Shape);
        self.collapse_short();
        self.flip_all(Aim::Shape);
        self.care = Care::Needles;
        for _ in 0..split::PASSES {
            watch.check()?;
            let before = self.mesh.face_count();
            let halved = self.split_long(1);
            self.collapse_short();
            if halved <= before / CUT_UP {
                break;
            }
        }
        self.care = Care::Sizes;
        Ok(())
    }

    /// Rounds of edits, then fewer and better faces.
    fn turn(&mut self, rounds: usize, report: &mut Report, watch: &Watch) -> Result<(), Cancelled> {
        report.rounds += rounds;
        watch.phase("remesh", Some(rounds as u64));
        for round in 1..=rounds {
            watch.check()?;
            watch.advance(round as u64 - 1, || format!("{} faces", self.mesh.face_count()));
            self.split_long(split::PASSES);
            if self.care == Care::Samples {
                self.settle();
            }
            self.collapse_short();
            self.flip_all(Aim::Valence);
            self.flip_all(Aim::Shape);
            self.smooth();
            if round == LOOK_AT_STRIPS {
                self.lower_in_strips();
            }
        }
        let comforts = [COMFORT; COARSENINGS].into_iter().chain(LESS_COMFORT);
        for (place, comfort) in comforts.enumerate() {
            watch.check()?;
            if place >= COARSENINGS && self.mean() < self.rules.mean_stretch + MARGIN {
                break;
            }
            self.coarsen(comfort);
            for _ in 0..2 {
                self.improve();
                self.flip_all(Aim::Worth);
            }
        }
        self.relieve();
        for _ in 0..POLISH {
            let gained = self.improve() + self.flip_all(Aim::Worth);
            if gained <= self.mesh.vertex_count() / QUIET {
                break;
            }
        }
        Ok(())
    }
}
