//! What simplification with fits tells: every figure is counted on the result.

use std::collections::BTreeMap;

use glam::DVec3;
use schemars::JsonSchema;
use serde::Serialize;

use super::cases::{Done, MOST_VALENCE};
use super::surfaces::Surfaces;
use crate::mesh::geometry::{aspect_ratio, centroid, stretch};
use crate::mesh::{EdgeId, Field, ResolvedFreedom, Support, Surface, VertexId};
use crate::technique::collapse::{Bars, bar_of};
use crate::technique::fit::{FitRegion, Quadric};
use crate::technique::guarded::{Cause, Counts, GuardedMesh, StarRules, cause};

/// How it ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// The number of faces asked for is reached, and no face breaks `max-aspect` but excused ones.
    TargetReached,
    /// The number of faces was not reached, or faces break `max-aspect`; the figures say which.
    Stuck,
}

/// Operations by case: the number of corners of the face whose dispersion was above the threshold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct Operations {
    /// Case 1, no corner: faces collapsed.
    pub flat_faces: usize,
    /// Case 1: edges collapsed.
    pub flat_edges: usize,
    /// Case 2, one corner: edges collapsed, nearly always the one opposite.
    pub opposite_edges: usize,
    /// Case 3, two corners: edges collapsed along the feature.
    pub feature_edges: usize,
    /// Case 3: edges collapsed onto the end of larger dispersion.
    pub onto_features: usize,
    /// Case 4, three corners: faces collapsed.
    pub transitional_faces: usize,
    /// Case 4: edges collapsed.
    pub transitional_edges: usize,
    /// Mending and polish: edges collapsed.
    pub mended_edges: usize,
    /// Edges flipped.
    pub flips: usize,
    /// Edges halved.
    pub halvings: usize,
    /// Vertices moved.
    pub moves: usize,
}

/// Trial fits of one kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct Trials {
    /// Neighbourhoods that a fit was tried on.
    pub tried: usize,
    /// New vertices that were put on one.
    pub accepted: usize,
}

/// A radius found in the part.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct RadiusBin {
    /// Sphere or cylinder.
    pub kind: FitKind,
    /// The mean radius, in mesh units.
    pub radius: f64,
    /// The smallest and the largest radius of the bin.
    pub range: [f64; 2],
    /// Vertices of the result on fits with such a radius.
    pub vertices: usize,
}

/// Spheres or cylinders of one radius that the input consists of.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct Fillets {
    /// Sphere or cylinder.
    pub kind: FitKind,
    /// The mean radius, in mesh units.
    pub radius: f64,
    /// The smallest and the largest radius of these.
    pub range: [f64; 2],
    /// How many there are.
    pub count: usize,
    /// Faces of the input on them.
    pub faces: usize,
}

/// The kind of a fit; as a field 1 for spheres, 2 for cylinders.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FitKind {
    /// A sphere.
    Sphere,
    /// A cylinder.
    Cylinder,
}

impl FitKind {
    /// The kind of a fit.
    pub fn of(fit: &Quadric) -> Self {
        match fit {
            Quadric::Sphere(_) => Self::Sphere,
            Quadric::Cylinder(_) => Self::Cylinder,
        }
    }

    /// The value in the field `fit-kind`.
    pub fn number(self) -> f64 {
        match self {
            Self::Sphere => 1.0,
            Self::Cylinder => 2.0,
        }
    }
}

/// A face that breaks `max-aspect`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct PoorFace {
    /// Its number in the result.
    pub face: u32,
    /// Its centroid.
    pub at: [f64; 3],
    /// Its aspect ratio; absent where it has no area.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub aspect: Option<f64>,
    /// Why it could not be mended.
    pub cause: Cause,
}

/// What simplification with fits did.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct SimplifyFitStats {
    /// How it ended.
    pub status: Status,
    /// Faces of the input.
    pub faces_before: usize,
    /// Faces of the result.
    pub faces_after: usize,
    /// The number of faces asked for.
    pub target_faces: usize,
    /// The share of faces that is gone.
    pub removed: f64,
    /// Operations by case.
    pub operations: Operations,
    /// Whether needles got no new vertices, since these made more needles, or more faces than there were: everything
    /// told here is of a second run without them. Absent where false.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub without_new_vertices: bool,
    /// Trial fits of spheres.
    pub spheres: Trials,
    /// Trial fits of cylinders.
    pub cylinders: Trials,
    /// The spheres and cylinders that the input consists of, by radius, most faces first, at most 32: holes, bosses and
    /// fillets. Where a fillet follows a curve, each row of its facets counts as a short cylinder.
    pub fillets: Vec<Fillets>,
    /// Vertices of the result that lie on an accepted fit.
    pub vertices_on_fits: usize,
    /// The radii of the fits under them, most vertices first, at most 32.
    pub radii: Vec<RadiusBin>,
    /// The largest Err of the paper: distance of a projected vertex from the plane of what it replaced, in mesh units.
    pub largest_projection: f64,
    /// Edits refused because the surface would have left the tolerance.
    pub refused_by_tolerance: usize,
    /// Edits refused because faces would have intersected.
    pub refused_by_intersection: usize,
    /// Where faces are left over: the edges that are left, by what bars their collapse, whatever their length.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub barred: Option<Bars>,
    /// Least stretch.
    pub min_stretch: f64,
    /// Mean stretch.
    pub mean_stretch: f64,
    /// Share of the faces with an aspect ratio below 20, the quality of the paper.
    pub share_below_20: f64,
    /// Faces above `max-aspect`.
    pub faces_above_aspect: usize,
    /// Of these, faces that marked curves or locks allow no better.
    pub excused_faces: usize,
    /// The worst of them, at most 64.
    pub poor_faces: Vec<PoorFace>,
    /// Edges along which flat faces run smoothly into others, kept as curves.
    pub smooth_edges: usize,
    /// The tolerance in mesh units.
    pub tolerance: f64,
    /// Certified upper bound of the two-sided distance to `reference`, in mesh units; absent with
    /// `tolerance-mode = "plane"`, and where the input was further away already.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance_bound: Option<f64>,
}

/// Radii of one kind within this part of each other are one.
const SAME_RADIUS: f64 = 0.01;

/// Bins told.
const MOST_BINS: usize = 32;

/// The histogram of radii.
pub(super) fn histogram(fits: impl Iterator<Item = (FitKind, f64)>) -> Vec<RadiusBin> {
    let mut by_kind: BTreeMap<FitKind, Vec<f64>> = BTreeMap::new();
    for (kind, radius) in fits {
        by_kind.entry(kind).or_default().push(radius);
    }
    let mut bins = Vec::new();
    for (kind, mut radii) in by_kind {
        radii.sort_by(f64::total_cmp);
        for same in radii.chunk_by(|a, b| b - a <= SAME_RADIUS * a) {
            let mean = same.iter().sum::<f64>() / same.len() as f64;
            let range = [same[0], same[same.len() - 1]];
            bins.push(RadiusBin { kind, radius: mean, range, vertices: same.len() });
        }
    }
    bins.sort_by(|a, b| b.vertices.cmp(&a.vertices).then(a.kind.cmp(&b.kind)).then(a.radius.total_cmp(&b.radius)));
    bins.truncate(MOST_BINS);
    bins
}

/// The recognised regions by kind and radius.
pub(super) fn fillets(regions: &[FitRegion]) -> Vec<Fillets> {
    let key = |region: &FitRegion| (FitKind::of(&region.quadric), region.quadric.radius());
    let mut sorted: Vec<&FitRegion> = regions.iter().collect();
    sorted.sort_by(|a, b| key(a).0.cmp(&key(b).0).then(key(a).1.total_cmp(&key(b).1)));
    let is_one = |a: &&FitRegion, b: &&FitRegion| key(a).0 == key(b).0 && key(b).1 - key(a).1 <= SAME_RADIUS * key(a).1;
    let mut fillets: Vec<Fillets> = sorted
        .chunk_by(is_one)
        .map(|same| Fillets {
            kind: key(same[0]).0,
            radius: same.iter().map(|region| key(region).1).sum::<f64>() / same.len() as f64,
            range: [key(same[0]).1, key(same[same.len() - 1]).1],
            count: same.len(),
            faces: same.iter().map(|region| region.faces.len()).sum(),
        })
        .collect();
    fillets.sort_by(|a, b| b.faces.cmp(&a.faces).then(a.kind.cmp(&b.kind)).then(a.radius.total_cmp(&b.radius)));
    fillets.truncate(MOST_BINS);
    fillets
}

/// The operations by case, and what came after them.
pub(super) fn operations(done: &Done, counts: Counts) -> Operations {
    let [flat, one, two, three] = done.cases;
    let merged = 2 * (flat[0] + three[0]) + flat[1] + one[1] + two[1] + three[1];
    Operations {
        flat_faces: flat[0],
        flat_edges: flat[1],
        opposite_edges: one[1],
        feature_edges: two[1] - done.onto,
        onto_features: done.onto,
        transitional_faces: three[0],
        transitional_edges: three[1],
        mended_edges: counts.collapses.saturating_sub(merged),
        flips: counts.flips,
        halvings: counts.splits,
        moves: counts.moves,
    }
}

/// What bars the edges that are left.
pub(super) fn bars(guarded: &mut GuardedMesh<'_>, min_stretch: f64) -> Bars {
    let rules = StarRules { min_stretch, ..StarRules::default() };
    let edges: Vec<EdgeId> = guarded.mesh().edges().collect();
    let mut bars = Bars::default();
    for e in edges {
        bars.add(bar_of(guarded, e, &rules, MOST_VALENCE));
    }
    bars
}

/// The fit that a vertex lies on, tested on where it lies.
pub(super) fn on_fit(fits: &Surfaces, p: DVec3, v: VertexId) -> Option<(FitKind, f64)> {
    let number = fits.number(v)?;
    let fit = fits.of(v).filter(|_| fits.holds(number, p))?;
    Some((FitKind::of(fit), fit.radius()))
}

/// Carries the fits on the result: `fit-kind` and `fit-radius`.
pub(super) fn set_fields(result: &mut Surface, on_fits: &[Option<(FitKind, f64)>]) {
    let kinds = on_fits.iter().map(|fit| fit.map_or(0.0, |(kind, _)| kind.number())).collect();
    let radii = on_fits.iter().map(|fit| fit.map_or(0.0, |(_, radius)| radius)).collect();
    for (name, values) in [("fit-kind", kinds), ("fit-radius", radii)] {
        result.carried.set_field(Field { name: name.into(), support: Support::Vertex, components: 1, values });
    }
}

/// Faces above an aspect ratio.
pub(super) fn needles(surface: &Surface, max_aspect: f64) -> usize {
    surface.faces.ids().filter(|&f| is_above(aspect_ratio(surface.corners(f)), max_aspect)).count()
}

fn is_above(aspect: f64, most: f64) -> bool {
    aspect.is_nan() || aspect > most
}

/// The figures that are counted on the result alone.
pub(super) fn quality(
    result: &Surface,
    freedom: &ResolvedFreedom,
    max_aspect: f64,
    least_allowed: f64,
) -> SimplifyFitStats {
    let (mut least, mut sum, mut below_20) = (1.0_f64, 0.0, 0_usize);
    let mut poor = Vec::new();
    for f in result.faces.ids() {
        let corners = result.corners(f);
        let (shape, aspect) = (stretch(corners), aspect_ratio(corners));
        least = least.min(shape);
        sum += shape;
        below_20 += usize::from(aspect < 20.0);
        if is_above(aspect, max_aspect) {
            let aspect = aspect.is_finite().then_some(aspect);
            let cause = cause(result, freedom, f, least_allowed);
            poor.push(PoorFace { face: f.raw(), at: centroid(corners).to_array(), aspect, cause });
        }
    }
    let count = result.faces.len();
    poor.sort_by(|a, b| {
        let key = |p: &PoorFace| p.aspect.unwrap_or(f64::INFINITY);
        key(b).total_cmp(&key(a)).then(a.face.cmp(&b.face))
    });
    let faces_above_aspect = poor.len();
    let excused_faces = poor.iter().filter(|p| p.cause != Cause::Stuck).count();
    poor.truncate(64);
    SimplifyFitStats {
        status: Status::Stuck,
        faces_before: count,
        faces_after: count,
        target_faces: count,
        removed: 0.0,
        operations: Operations::default(),
        without_new_vertices: false,
        spheres: Trials::default(),
        cylinders: Trials::default(),
        fillets: Vec::new(),
        vertices_on_fits: 0,
        radii: Vec::new(),
        largest_projection: 0.0,
        refused_by_tolerance: 0,
        refused_by_intersection: 0,
        barred: None,
        min_stretch: least,
        mean_stretch: sum / count.max(1) as f64,
        share_below_20: below_20 as f64 / count.max(1) as f64,
        faces_above_aspect,
        excused_faces,
        poor_faces: poor,
        smooth_edges: 0,
        tolerance: 0.0,
        distance_bound: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radii_that_differ_by_less_than_a_hundredth_are_one_fillet() {
        let radii = [3.0, 3.01, 2.99, 0.5, 0.5].map(|r| (FitKind::Cylinder, r));
        let bins = histogram(radii.into_iter().chain([(FitKind::Sphere, 3.0)]));
        assert_eq!(
            bins.iter().map(|b| (b.kind, b.vertices)).collect::<Vec<_>>(),
            [(FitKind::Cylinder, 3), (FitKind::Cylinder, 2), (FitKind::Sphere, 1)]
        );
        assert!((bins[0].radius - 3.0).abs() < 1e-12 && bins[0].range == [2.99, 3.01]);
    }
}
