//! Repair: from any soup of triangles and quads to an oriented 2-manifold, or an error that says why not.
//!
//! # Algorithm
//! Quads are split. Vertices at the same place are welded, then open vertices within a tolerance; collapsed and
//! repeated faces go. Cracks that are wider are zipped, if wanted. At every edge with more than two faces these are
//! joined in pairs by their order round the edge, and each vertex gets one copy for each fan of faces, which makes the
//! mesh a manifold by construction. Neighbours are turned until they agree (a Möbius strip is cut), closed components
//! until they look outward, and those that bound a cavity inward. Wanted holes are filled with the least bend, refined
//! and faired like their surroundings. Faces that run through each other are cut where they meet, if wanted, and what
//! is inside of bodies goes.
//!
//! Based on: Guéziec, Taubin, Lazarus, Horn. Cutting and stitching: converting sets of polygons to manifold surfaces.
//! IEEE Transactions on Visualization and Computer Graphics 7(2), 2001.
//!
//! # Invariants
//! - The result is an oriented 2-manifold, with a border where the input has one that was not filled.
//! - Outside filled holes and what is inside of bodies the surface moves no further than `max-move`.
//! - Idempotent: repairing the result changes nothing, unless `rounds` says that it was given up after eight.
//! - Groups, regions, marks and fields follow their elements.
//! - Closed manifold input keeps its topology: nothing but open edges is welded within a tolerance.
//!
//! # Cost
//! O(F log F) time, O(F) memory.
//!
//! # Departures
//! Sheets that hang on a solid are not dropped: they are cut off, listed as components, and `keep-components` drops
//! them.
//!
//! Guéziec and others stitch borders again after cutting; here faces are joined before the cut, in radial order, so
//! that solids which touch come apart as solids and sheets go straight on.

mod adjacency;
mod carry;
mod components;
mod cut;
mod degenerate;
mod draft;
mod duplicate;
mod holes;
mod intersect;
mod near;
mod non_manifold;
mod orient;
mod outward;
mod params;
mod patch;
mod report;
mod solid;
mod tjunction;
mod weld;
mod zip;

pub use params::{Bodies, FillHoles, KeepComponents, NonManifold, RepairParams, SelfIntersections};
pub use report::{Certificate, ComponentStats, LoopFate, LoopStats, RemovalStats, RepairError, RepairStats};

use glam::DVec3;

use self::adjacency::{EdgeTable, Twins, face_of};
use self::draft::Draft;
use self::duplicate::Opposite;
use self::outward::Part;
use crate::mesh::geometry::Aabb;
use crate::mesh::{Facet, Soup, Surface};
use crate::step::{Artifact, InputDef, Inputs, Locks, OutPort, OutputDef, Port, Produced, StepFailure};
use crate::watch::Watch;

/// Repairs `soup`.
///
/// # Errors
/// [`RepairError`]: nothing to repair, nothing left of it, or a corner that is not there.
pub fn repair(soup: &Soup, params: &RepairParams, watch: &Watch) -> Result<(Surface, RepairStats), RepairError> {
    let (surface, _, stats) = repair_and_remove(soup, params, watch)?;
    Ok((surface, stats))
}

/// Repairs `soup`; returns also the pieces that were inside of bodies.
///
/// # Errors
/// As [`repair`].
pub fn repair_and_remove(
    soup: &Soup,
    params: &RepairParams,
    watch: &Watch,
) -> Result<(Surface, Soup, RepairStats), RepairError> {
    let diagonal = check_input(soup)?;
    check_arithmetic(soup, diagonal)?;
    let widest = params.gaps.map_or(0.0, |gaps| gaps.resolve(diagonal));
    let limit = params.max_move.map_or(params.weld.resolve(diagonal).max(widest), |most| most.resolve(diagonal));
    let tolerance = params.weld.resolve(diagonal).min(limit);
    let (mut surface, mut stats) = settle(soup, params, tolerance, limit, watch)?;
    watch.check()?;
    if stats.degenerate_faces_left as usize == surface.faces.len() {
        return Err(RepairError::NoArea { faces: surface.faces.len() });
    }
    let (mut pieces, mut left) = (Soup::default(), None);
    if params.self_intersections == SelfIntersections::Remove {
        let again = |soup: &Soup, rest: f64| settle(soup, params, tolerance.min(rest), rest, watch);
        let removed = solid::remove_intersections(surface, params, limit, &mut stats, watch, again)?;
        (surface, pieces, left) = (removed.surface, removed.pieces, Some(removed.left));
    }
    let longest = params.crossing_length.map(|length| (length.resolve(diagonal), diagonal));
    count_intersections(&surface, soup, left, longest, &mut stats, watch)?;
    stats.certificate =
        (params.self_intersections == SelfIntersections::Remove).then(|| solid::certify(&surface, &stats));
    stats.warnings = stats.taken_away().into_iter().chain(near::beside_each_other(&surface)).collect();
    Ok((surface, pieces, stats))
}

/// All passes, again until nothing changes: what a cut or a dropped face uncovers may need repair as well.
fn settle(
    soup: &Soup,
    params: &RepairParams,
    tolerance: f64,
    limit: f64,
    watch: &Watch,
) -> Result<(Surface, RepairStats), RepairError> {
    let (mut surface, mut stats) = repair_once(soup, params, tolerance, limit, watch)?;
    let cut = stats.vertex_copies + stats.repeated_faces + stats.cancelled_faces + stats.slivers_dropped;
    let mut unsettled = cut + stats.t_junctions + stats.vertices_zipped > 0;
    while unsettled && stats.rounds < ROUNDS {
        let rest = (limit - stats.max_move).max(0.0);
        let (again, more) = repair_once(&surface.to_soup(), params, tolerance.min(rest), rest, watch)?;
        unsettled = again != surface;
        stats.go_on(more);
        surface = again;
    }
    Ok((surface, stats))
}

/// One run of all passes.
fn repair_once(
    soup: &Soup,
    params: &RepairParams,
    tolerance: f64,
    limit: f64,
    watch: &Watch,
) -> Result<(Surface, RepairStats), RepairError> {
    let mut stats = RepairStats::default();
    let mut draft = conform(soup, params, (tolerance, limit), &mut stats);
    watch.check()?;
    let mut twins = make_clean_manifold(&mut draft, soup, params, limit, &mut stats, watch)?;
    let mut parts = choose_components(&mut draft, &mut twins, params, &mut stats)?;
    let diagonal = parts.iter().fold(Aabb::EMPTY, |all, part| all.with(part.low).with(part.high)).diagonal();
    if holes::fill_holes(&mut draft, &mut twins, params.fill_holes, diagonal, &mut stats, watch)? {
        parts = components::components(&draft, &twins);
    }
    let (turned, cavities) = outward::orient_outward(&mut draft, &mut twins, &parts, params.keeps_bodies());
    (stats.components_turned, stats.cavities) = (turned, cavities);
    check_result(&draft, &stats, limit)?;
    Ok((carry::finish(&draft, soup, params.non_manifold == NonManifold::Seam), stats))
}

/// The bounding-box diagonal of the vertices in use.
fn check_input(soup: &Soup) -> Result<f64, RepairError> {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (face, facet) in soup.faces.enumerate() {
        for &corner in facet.corners() {
            match soup.points.get(corner) {
                Some(point) if point.is_finite() => (low, high) = (low.min(*point), high.max(*point)),
                _ => return Err(RepairError::BadFace { face }),
            }
        }
    }
    if soup.faces.is_empty() { Err(RepairError::Empty) } else { Ok((high - low).length()) }
}

/// Whether computing keeps the shape.
fn check_arithmetic(soup: &Soup, extent: f64) -> Result<(), RepairError> {
    let used = soup.faces.iter().flat_map(|facet| facet.corners().iter().filter_map(|&v| soup.points.get(v)));
    let offset = used.fold(0.0, |most: f64, p| most.max(p.abs().max_element()));
    // One point alone is judged as a face without area.
    let is_held = extent == 0.0 || (report::SMALLEST..=report::LARGEST).contains(&extent);
    if is_held && (extent == 0.0 || offset <= report::FARTHEST * extent) {
        return Ok(());
    }
    Err(RepairError::BeyondArithmetic { extent, offset })
}

/// Triangles that share vertices wherever they touch.
fn conform(soup: &Soup, params: &RepairParams, (tolerance, limit): (f64, f64), stats: &mut RepairStats) -> Draft {
    let mut draft = draft::triangulate_and_weld_exactly(soup);
    stats.quads_split = soup.faces.iter().filter(|facet| matches!(facet, Facet::Quad(_))).count() as u64;
    stats.vertices_merged = (soup.points.len() - draft.points.len()) as u64;
    stats.collapsed_faces = duplicate::drop_collapsed(&mut draft);
    let table = EdgeTable::new(&draft.faces, draft.points.len());
    stats.non_manifold_edges_read = count_non_manifold(&table);
    // A face that is there twice would hide an open edge from welding.
    let table = drop_duplicates(&mut draft, table, params, stats);
    let welded = weld::weld(&mut draft, &table, tolerance);
    (stats.vertices_welded, stats.max_move) = (welded.vertices, welded.shift);
    stats.collapsed_faces += duplicate::drop_collapsed(&mut draft);
    let table = if welded.vertices > 0 { EdgeTable::new(&draft.faces, draft.points.len()) } else { table };
    stats.non_manifold_edges_welded = count_non_manifold(&table);
    let table = drop_duplicates(&mut draft, table, params, stats);
    let closed = tjunction::close_t_junctions(&mut draft, &table, tolerance - welded.shift);
    (stats.t_junctions, stats.max_move) = (closed.vertices, welded.shift + closed.distance);
    if let Some(width) = params.gaps {
        let width = width.resolve(bounds(&draft).diagonal()).min(limit - stats.max_move);
        zip_gaps(&mut draft, width, stats);
    }
    draft
}

fn bounds(draft: &Draft) -> Aabb {
    Aabb::of(draft.faces.iter().flatten().map(|&v| draft.points[v]))
}

fn zip_gaps(draft: &mut Draft, width: f64, stats: &mut RepairStats) {
    stats.collapsed_faces += duplicate::drop_collapsed(draft);
    let table = EdgeTable::new(&draft.faces, draft.points.len());
    let zipped = zip::zip(draft, &table, width);
    stats.vertices_zipped = zipped.vertices;
    stats.max_move += zipped.distance;
}

/// Drops repeated faces; returns the table of the others.
fn drop_duplicates(draft: &mut Draft, table: EdgeTable, params: &RepairParams, stats: &mut RepairStats) -> EdgeTable {
    let opposite = Opposite { cancel: params.non_manifold == NonManifold::Cut, keep_walls: params.keeps_bodies() };
    let duplicates = duplicate::drop_duplicates(draft, &table, opposite);
    stats.repeated_faces += duplicates.repeated;
    stats.cancelled_faces += duplicates.cancelled;
    let is_changed = duplicates.repeated + duplicates.cancelled > 0;
    if is_changed { EdgeTable::new(&draft.faces, draft.points.len()) } else { table }
}

fn count_non_manifold(table: &EdgeTable) -> u64 {
    table.edges().filter(|(_, _, group)| group.len() > 2).count() as u64
}

/// Rounds after which joining and cleaning stop; each cleans what the round before uncovered.
const ROUNDS: u64 = 8;

/// Makes a manifold without degenerate faces.
///
/// Where faces at a cut were cleaned, another pairing may fit better now: the cuts are joined again and made anew, so
/// that the result is one that repairing would not change.
fn make_clean_manifold(
    draft: &mut Draft,
    soup: &Soup,
    params: &RepairParams,
    limit: f64,
    stats: &mut RepairStats,
    watch: &Watch,
) -> Result<Twins, RepairError> {
    loop {
        stats.rounds += 1;
        // A vertex put on an edge may be the apex of its face, and copies joined again may be corners of one face.
        stats.collapsed_faces += duplicate::drop_collapsed(draft);
        let table = EdgeTable::new(&draft.faces, draft.points.len());
        let table = drop_duplicates(draft, table, params, stats);
        let mut twins = make_manifold(draft, table, stats);
        watch.check()?;
        let is_clean = clean(draft, &mut twins, soup, limit, stats);
        watch.check()?;
        if is_clean || stats.vertex_copies == 0 || stats.rounds == ROUNDS {
            return Ok(twins);
        }
        let joined = draft.root.clone();
        draft.redirect(&joined);
    }
}

/// Joins faces in pairs, lets neighbours agree, and gives every fan of faces its own vertices.
fn make_manifold(draft: &mut Draft, table: EdgeTable, stats: &mut RepairStats) -> Twins {
    let (mut twins, cut_edges) = non_manifold::pair_faces(draft, &table);
    drop(table);
    let oriented = orient::orient(draft, &mut twins);
    let cut = cut::cut(draft, &mut twins, !cut_edges.is_empty());
    stats.non_manifold_edges_cut = cut_edges.len() as u64;
    stats.faces_turned += oriented.flipped;
    stats.one_sided_edges_cut = oriented.conflicts.len() as u64;
    (stats.vertices_cut, stats.vertex_copies) = (cut.vertices, cut.copies);
    stats.double_edges_split += cut.split_edges;
    twins
}

/// Removes faces without height, as far as the rest of the movement allowed reaches; says whether there was none.
fn clean(draft: &mut Draft, twins: &mut Twins, soup: &Soup, limit: f64, stats: &mut RepairStats) -> bool {
    let kept = degenerate::Kept::new(draft, &soup.carried);
    let cleaned = degenerate::remove_degenerate(draft, twins, &kept, limit - stats.max_move + rounding(draft));
    stats.degenerate_faces = stats.degenerate_faces.max(cleaned.found);
    stats.degenerate_faces_left = cleaned.left;
    stats.edges_collapsed += cleaned.collapsed;
    stats.edges_flipped += cleaned.flipped;
    stats.slivers_dropped += cleaned.dropped;
    stats.max_move += cleaned.moved;
    cleaned.found == cleaned.left
}

/// What rounded coordinates cannot tell from nothing: a few units in the last place of the largest one.
fn rounding(draft: &Draft) -> f64 {
    8.0 * f64::EPSILON * draft.points.iter().fold(0.0, |most: f64, p| most.max(p.abs().max_element()))
}

/// Drops the components that are not wanted, and describes the others.
fn choose_components(
    draft: &mut Draft,
    twins: &mut Twins,
    params: &RepairParams,
    stats: &mut RepairStats,
) -> Result<Vec<Part>, RepairError> {
    let parts = components::components(draft, twins);
    let wanted = components::wanted(&parts, params.keep_components);
    stats.components = parts.len() as u64;
    stats.components_dropped = wanted.iter().filter(|&&w| !w).count() as u64;
    let listed = parts.iter().zip(&wanted).take(report::LISTED);
    stats.component_list = listed
        .map(|(part, &kept)| ComponentStats {
            faces: part.faces.len() as u64,
            area: part.area,
            closed: part.closed,
            kept,
        })
        .collect();
    let dropped: usize = parts.iter().zip(&wanted).filter(|(_, w)| !**w).map(|(part, _)| part.faces.len()).sum();
    if dropped == draft.faces.len() {
        return Err(RepairError::NothingLeft { collapsed: stats.collapsed_faces, dropped: dropped as u64 });
    }
    if dropped == 0 {
        return Ok(parts);
    }
    let mut keep = vec![true; draft.faces.len()];
    for (part, _) in parts.iter().zip(&wanted).filter(|(_, wanted)| !**wanted) {
        part.faces.iter().for_each(|f| keep[f.index()] = false);
    }
    draft.retain_faces(&keep);
    *twins = EdgeTable::new(&draft.faces, draft.points.len()).twins();
    Ok(components::components(draft, twins))
}

/// The promises: a manifold, and no more movement than allowed.
fn check_result(draft: &Draft, stats: &RepairStats, limit: f64) -> Result<(), RepairError> {
    let table = EdgeTable::new(&draft.faces, draft.points.len());
    for (_, _, group) in table.edges() {
        let agree = match *group {
            [_] => true,
            [(_, a), (_, b)] => adjacency::tail(&draft.faces, a) != adjacency::tail(&draft.faces, b),
            _ => false,
        };
        if !agree {
            let face = face_of(group[0].1);
            let at = draft.corners(face)[0];
            return Err(RepairError::NotManifold { face: draft.origin[face].face(), at });
        }
    }
    if stats.max_move > limit + 2.0 * rounding(draft) {
        return Err(RepairError::MovedTooFar { moved: stats.max_move, allowed: limit });
    }
    Ok(())
}

/// Counts faces that run through each other, before and after; where nothing was changed, once.
fn count_intersections(
    surface: &Surface,
    soup: &Soup,
    known: Option<intersect::Intersections>,
    longest: Option<(f64, f64)>,
    stats: &mut RepairStats,
    watch: &Watch,
) -> Result<(), RepairError> {
    let count = || intersect::self_intersections(surface.faces.len(), |f| surface.corners(f), watch);
    let after = known.map_or_else(count, Ok)?;
    if let Some(longest) = longest {
        after.check_length(longest, |f| surface.corners(f))?;
    }
    let changes =
        stats.vertices_welded + stats.t_junctions + stats.vertices_zipped + stats.edges_collapsed + stats.edges_flipped;
    let dropped = stats.repeated_faces + stats.cancelled_faces + stats.slivers_dropped + stats.components_dropped;
    let added = stats.faces_filled + stats.double_edges_split + stats.removal.as_ref().map_or(0, |all| all.rounds);
    let before = if changes + dropped + added == 0 {
        None
    } else {
        let mut input = draft::triangulate_and_weld_exactly(soup);
        duplicate::drop_collapsed(&mut input);
        Some(intersect::self_intersections(input.faces.len(), |f| input.corners(f), watch)?)
    };
    let before = before.as_ref().unwrap_or(&after);
    stats.self_intersections_before = before.pairs;
    stats.counting_stopped = !(before.complete && after.complete);
    stats.contacts = after.contacts(surface);
    (stats.self_intersections, stats.self_intersecting_faces) = (after.pairs, after.faces);
    Ok(())
}

/// The room's entry in the catalog.
#[derive(Debug)]
pub struct Step;

impl crate::step::Step for Step {
    const NAME: &'static str = "repair";
    const REVISION: u32 = 5;
    const INPUTS: &'static [InputDef] = &[InputDef {
        name: "from",
        accepts: &[Port::Soup, Port::Surface],
        required: true,
        doc: "the mesh to repair, as read",
    }];
    const OUTPUTS: &'static [OutputDef] = &[
        OutputDef { name: "main", port: OutPort::Is(Port::Surface), derive: None },
        OutputDef { name: "removed", port: OutPort::Is(Port::Soup), derive: None },
    ];
    const CARRIES: &'static str = "groups, regions, marks and fields follow their elements; faces that fill holes are \
        in the face group `filled`, and take region and values from the rim; seams are made anew";
    const EXAMPLE: &'static str = "use = \"repair\"\nfrom = \"raw\"\nfill-holes = \"all\"\n";

    type Params = RepairParams;
    type Stats = RepairStats;

    fn run(
        inputs: &Inputs,
        output: &str,
        params: &RepairParams,
        _locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<RepairStats>, StepFailure> {
        let soup = inputs.require("from")?.to_soup();
        let soup = soup.ok_or_else(|| StepFailure::bad_input("expected a soup or a surface"))?;
        let (surface, removed, stats) = repair_and_remove(&soup, params, watch)?;
        let artifact = match output {
            "removed" => Artifact::Soup(std::sync::Arc::new(removed)),
            _ => Artifact::Surface(std::sync::Arc::new(surface)),
        };
        Ok(Produced { artifact, stats })
    }
}
