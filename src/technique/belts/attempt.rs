//! One way to cut a surface: belts, elements, optimisation. Where elements do not fit between the edges of the mesh,
//! faces there are cut in four below the complex, which stays as it is.

use super::{BeltReport, BeltRules, cut_belts};
use crate::mesh::{FaceId, Quads, Surface};
use crate::metric::quad_layout::{Layout as Counts, layout_counts};
use crate::technique::layout::optimise::{OptimiseReport, optimise, polygonise};
use crate::technique::layout::{Complex, Ground, Layout, Room, to_quads, with_rings};
use crate::watch::{Cancelled, Watch};

/// Quads made in one way.
#[derive(Clone, Debug)]
pub struct Attempt {
    /// The quads.
    pub quads: Quads,
    /// What is counted of them.
    pub counts: Counts,
    /// Belts.
    pub belts: BeltReport,
    /// Parts of the surface that were cut each on its own.
    pub domains: usize,
    /// Pairs of triangles coupled, and triangles opened at the rim, after the belts were cut.
    pub post_processed: usize,
    /// What optimisation did.
    pub report: OptimiseReport,
    /// Faces cut in four, round by round.
    pub cuts: Vec<Vec<FaceId>>,
}

/// Where elements do not fit between the edges of the mesh: a face of it at each place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Narrow {
    /// The faces, in rising order.
    pub places: Vec<FaceId>,
}

/// Cuts a surface in one way. Complexes in `known` are not worked on again; the one that is made joins them.
///
/// # Errors
/// The run was interrupted.
pub fn attempt(
    surface: &Surface,
    rules: &BeltRules,
    may_optimise: bool,
    known: &mut Vec<Complex>,
    watch: &Watch,
) -> Result<Result<Attempt, Narrow>, Cancelled> {
    let mut room = Room::new(surface);
    let (mut complex, belts) = match disks(&mut room, rules, watch)? {
        Ok(made) => made,
        Err(narrow) => return Ok(Err(narrow)),
    };
    if known.contains(&complex) {
        return Ok(Err(Narrow { places: Vec::new() }));
    }
    known.push(complex.clone());
    let mut work = Work { may_optimise, ..Work::default() };
    loop {
        let ground = Ground::new(&room.surface);
        let mut layout = complex.on(&ground);
        layout.largest = rules.largest;
        let stuck = work.go_on(&mut layout, watch)?;
        if stuck.is_empty() {
            let quads = to_quads(&layout);
            let counts = layout_counts(&quads.mesh);
            let Work { post_processed, report, .. } = work;
            let (domains, cuts) = (ground.domains, room.cuts);
            return Ok(Ok(Attempt { quads, counts, belts, domains, post_processed, report, cuts }));
        }
        let tight = layout.tight(&stuck);
        let lowest: Vec<FaceId> = stuck.iter().filter_map(|&c| layout.faces(c).iter().min().copied()).collect();
        let places = room.origins(&lowest);
        complex = layout.into_complex();
        let Some(parents) = room.cut(tight)? else { return Ok(Err(Narrow { places })) };
        complex.refine(&parents, room.surface.points.len());
    }
}

/// The belts cut into disks, where need be on a finer mesh.
fn disks(
    room: &mut Room,
    rules: &BeltRules,
    watch: &Watch,
) -> Result<Result<(Complex, BeltReport), Narrow>, Cancelled> {
    /// What is no disk after so many rounds will remain so.
    const ROUNDS: usize = 5;
    loop {
        let ground = Ground::new(&room.surface);
        let (layout, bad, belts) = cut_belts(&ground, rules, watch)?;
        if bad.is_empty() {
            return Ok(Ok((layout.into_complex(), belts)));
        }
        let around: Vec<FaceId> = bad.iter().flat_map(|b| layout.faces(b.cell)).copied().collect();
        let around = with_rings(&ground, &around);
        let places = room.origins(&bad.iter().map(|b| b.face).collect::<Vec<_>>());
        if room.cuts.len() >= ROUNDS || room.cut(around)?.is_none() {
            return Ok(Err(Narrow { places }));
        }
    }
}

/// How far the work on a complex has come, and what it did.
#[derive(Clone, Copy, Debug, Default)]
struct Work {
    may_optimise: bool,
    is_coupled: bool,
    post_processed: usize,
    report: OptimiseReport,
}

impl Work {
    /// Makes quads and few triangles of all cells; those for which there is no room.
    fn go_on(&mut self, layout: &mut Layout<'_>, watch: &Watch) -> Result<Vec<u32>, Cancelled> {
        let mut stuck = polygonise(layout, watch)?;
        if !stuck.is_empty() {
            return Ok(stuck);
        }
        if !self.is_coupled {
            self.is_coupled = true;
            self.post_processed = layout.couple_triangles() + layout.open_triangles();
            self.post_processed += layout.couple_triangles();
            if self.may_optimise {
                self.report = optimise(layout, watch)?;
                stuck = polygonise(layout, watch)?;
            }
        }
        part_parallels(layout, &mut stuck, watch)?;
        let odd = layout.cells().filter(|&c| !(3..=4).contains(&layout.ring(c).len()));
        let mut left: Vec<u32> = stuck.into_iter().filter(|&c| layout.exists(c)).chain(odd).collect();
        left.sort_unstable();
        left.dedup();
        Ok(left)
    }
}

/// Parts edges between the same two nodes, and what becomes of the cells beside them.
fn part_parallels(layout: &mut Layout<'_>, stuck: &mut Vec<u32>, watch: &Watch) -> Result<(), Cancelled> {
    /// Cutting the cells beside may make new ones.
    const ROUNDS: usize = 4;
    for _ in 0..ROUNDS {
        if layout.part_parallels() == 0 {
            break;
        }
        *stuck = polygonise(layout, watch)?;
        layout.couple_triangles();
    }
    Ok(())
}
