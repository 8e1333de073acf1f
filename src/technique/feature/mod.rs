//! Finds the sharp edges, borders and corners of a surface.
//!
//! The angle between the normals of two faces, with hysteresis as in J. Canny, *A computational approach to edge
//! detection*, IEEE Transactions on Pattern Analysis and Machine Intelligence, 1986: an edge of at least `angle` is
//! sharp if edges of at least `angle` connect it to one of at least `seed_angle`. Loose ends grow on along edges of at
//! least two thirds of `angle` whose direction differs by less than 30 degrees. Then chains with a loose end are
//! dropped if they are shorter than 0.5 % of the bounding box's diagonal, or have fewer than three edges and no seed;
//! a long crease that a CAD tessellation draws as one edge so stays.
//! Of curves that run alongside each other within `gap` only the sharpest stays, except about thin walls (see `gap`).
//! Rims are always curves; so are borders of regions and face groups where asked for. A corner is a vertex where the
//! number of curve edges is not 2, or where the curve turns by more than `corner_angle`.
//!
//! With [`FeatureRules::voting_radius`] the angles are those between normals that the vote tensors of the
//! neighbourhood have freed of noise; see `voting`. Corners are then turns over an arm of half that radius, because the
//! edges of a scan zigzag along a crease, and connected sets of edges shorter than twice the radius are dropped.
//!
//! Invariants: every corner ends a curve, no curve passes a corner; a second run on the result changes nothing.
//! Faces without a reliable normal, being lower than a hundred-thousandth of the diagonal, take that of the neighbour
//! over their longest side, several such at each other's longest sides together. Trap: a cylinder of `n` facets has
//! edges of 360°/n; [`Report::facet_angle`] tells the usual angle between facets, and `angle` should be more than 1.5
//! times that. Cost: O(F log F).

mod chains;
mod corners;
mod gap;
mod sharpness;
#[cfg(test)]
mod tests;
mod voting;

pub use sharpness::normals as reliable_normals;

use std::collections::BTreeSet;

use glam::DVec3;

use crate::mesh::id::{Edge, Face};
use crate::mesh::topology::EdgeTable;
use crate::mesh::{EdgeMark, FaceId, Freedom, IdVec, MarkCause, Surface, VertexId};
use crate::watch::{Cancelled, Watch};

/// What is sharp. All angles in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeatureRules {
    /// Least angle between the normals at a sharp edge.
    pub angle: f64,
    /// Least angle of one edge in each connected set of sharp edges.
    pub seed_angle: f64,
    /// A curve that turns by more has a corner.
    pub corner_angle: f64,
    /// Whether borders between regions and between face groups are curves.
    pub region_borders: bool,
    /// The geodesic radius of normal voting; without it the plain angles between faces count.
    pub voting_radius: Option<f64>,
    /// Of curves that run alongside each other within this distance only the sharpest is marked; both where the surface
    /// turns back on itself across them. Mesh units.
    pub gap: f64,
}

/// What was found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Sharp edges.
    pub sharp_edges: usize,
    /// Of those, edges below `angle` that continue a chain.
    pub grown_edges: usize,
    /// Chains that were too short.
    pub dropped_chains: usize,
    /// Sharp edges that ran alongside a sharper curve.
    pub alongside_edges: usize,
    /// Rim edges.
    pub rim_edges: usize,
    /// Edges on borders of regions or face groups that are neither sharp nor rims.
    pub border_edges: usize,
    /// Curves between corners, and closed curves.
    pub curves: usize,
    /// Corners.
    pub corners: usize,
    /// Length of all curves.
    pub length: f64,
    /// The usual angle between facets of smooth areas in degrees, where there is one.
    pub facet_angle: Option<f64>,
}

/// The curves of a surface while they are being found.
struct Curves<'a> {
    surface: &'a Surface,
    edges: EdgeTable,
    /// The normals that count.
    normals: IdVec<Face, DVec3>,
    /// Angle between the normals in degrees; 0 on rims.
    angles: IdVec<Edge, f64>,
    /// Why the edge is on a curve.
    causes: IdVec<Edge, Option<MarkCause>>,
}

/// Marks sharp edges, rims and borders, and pins corners; marks of an earlier run are replaced.
///
/// Marks of seams and locks stay, and so do pins away from the marks replaced.
///
/// # Errors
/// The run was interrupted.
pub fn mark_features(surface: &Surface, rules: &FeatureRules, watch: &Watch) -> Result<(Surface, Report), Cancelled> {
    let mut result = surface.clone();
    forget(&mut result);
    let (marks, corners, report) = {
        let mut curves = Curves::new(&result, rules, watch)?;
        let mut report = Report { facet_angle: curves.facet_angle(rules), ..Report::default() };
        curves.mark_rims(&mut report);
        report.grown_edges = curves.mark_sharp(rules);
        if rules.region_borders {
            curves.mark_borders(&mut report);
        }
        report.alongside_edges = curves.drop_alongside(rules.gap, rules.corner_angle);
        report.dropped_chains = curves.drop_short_chains(rules);
        let corners = match rules.voting_radius {
            None => curves.corners(rules.corner_angle),
            Some(radius) => {
                report.dropped_chains += curves.drop_islands(2.0 * radius);
                curves.corners_by_arm(rules.corner_angle, 0.5 * radius)
            }
        };
        curves.count(&corners, &mut report);
        (curves.marks(), corners, report)
    };
    for (edge, mark) in marks {
        result.carried.mark(edge, mark);
    }
    for corner in corners {
        result.carried.pin(corner, Freedom::Keep);
    }
    Ok((result, report))
}

fn is_ours(cause: MarkCause) -> bool {
    match cause {
        MarkCause::Boundary | MarkCause::Feature | MarkCause::RegionBorder => true,
        MarkCause::Seam | MarkCause::Locked => false,
    }
}

/// Removes the marks of an earlier run, and the pins on them.
fn forget(surface: &mut Surface) {
    let carried = &mut surface.carried;
    let ours: BTreeSet<VertexId> =
        carried.marks.iter().filter(|(_, mark)| is_ours(mark.cause)).flat_map(|(edge, _)| *edge).collect();
    carried.marks.retain(|_, mark| !is_ours(mark.cause));
    carried.pins.retain(|v, _| !ours.contains(v));
}

impl<'a> Curves<'a> {
    fn new(surface: &'a Surface, rules: &FeatureRules, watch: &Watch) -> Result<Self, Cancelled> {
        let edges = EdgeTable::new(surface);
        let raw = sharpness::normals(surface, &edges);
        let normals = match rules.voting_radius {
            None => raw,
            Some(radius) => voting::normals(surface, &edges, raw, radius, watch)?,
        };
        let angles = sharpness::angles(&edges, &normals);
        let causes = edges.keys().iter().map(|key| surface.carried.marks.get(key).map(|m| m.cause)).collect();
        Ok(Self { surface, edges, normals, angles, causes })
    }

    fn facet_angle(&self, rules: &FeatureRules) -> Option<f64> {
        sharpness::facet_angle(self.angles.as_slice(), rules.seed_angle)
    }

    fn mark_rims(&mut self, report: &mut Report) {
        for e in self.edges.keys().ids() {
            if self.edges.sides(e).len() == 1 {
                self.causes[e].get_or_insert(MarkCause::Boundary);
                report.rim_edges += 1;
            }
        }
    }

    fn mark_borders(&mut self, report: &mut Report) {
        let class = face_classes(self.surface);
        for e in self.edges.keys().ids() {
            if let [a, b] = self.edges.sides(e)
                && class[a.face.index()] != class[b.face.index()]
                && self.causes[e].is_none()
            {
                self.causes[e] = Some(MarkCause::RegionBorder);
                report.border_edges += 1;
            }
        }
    }

    /// The marks found, without those that the surface had.
    fn marks(&self) -> Vec<([VertexId; 2], EdgeMark)> {
        let found = self.causes.enumerate().filter_map(|(e, cause)| Some((self.edges.key(e), (*cause)?)));
        let ours = found.filter(|(_, cause)| is_ours(*cause));
        ours.map(|(key, cause)| (key, EdgeMark { freedom: Freedom::OnCurve, cause })).collect()
    }
}

/// A number for each face: equal where region and groups are equal.
fn face_classes(surface: &Surface) -> Vec<u32> {
    let mut classes = crate::mesh::classes::Classes::new(0);
    let mut of_face = vec![0; surface.faces.len()];
    let groups = surface.carried.groups.faces.values();
    for (label, members) in groups.enumerate() {
        for f in members {
            of_face[f.index()] = classes.with(of_face[f.index()], label as u32);
        }
    }
    if let Some(regions) = &surface.carried.regions {
        let first = surface.carried.groups.faces.len() as u32;
        for (f, label) in regions.labels.enumerate() {
            let f: FaceId = f;
            of_face[f.index()] = classes.with(of_face[f.index()], first + label);
        }
    }
    of_face
}
