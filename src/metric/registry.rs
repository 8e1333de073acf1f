//! The list of all metrics: name, unit, direction and what each needs.

/// The unit of a metric.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// A whole number.
    Count,
    /// Holds or not.
    Flag,
    /// Mesh units; a percent in a gate is one of the diagonal.
    Length,
    /// Squared mesh units.
    Area,
    /// Cubed mesh units.
    Volume,
    /// Degrees.
    Degrees,
    /// A part of the whole, 0 to 1.
    Share,
    /// A number without unit.
    Ratio,
}

/// Which values are good.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// More is better.
    Higher,
    /// Less is better.
    Lower,
    /// Neither.
    Neutral,
}

/// What a metric is measured on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// Any mesh.
    Mesh,
    /// Triangles; undefined without one.
    Triangles,
    /// Quads; undefined without one.
    Quads,
    /// A mesh and a reference.
    Reference,
}

/// A metric of the registry.
#[derive(Clone, Copy, Debug)]
pub struct MetricDef {
    /// Its name in recipes and reports.
    pub name: &'static str,
    /// Its unit.
    pub unit: Unit,
    /// Which values are good.
    pub direction: Direction,
    /// What it is measured on.
    pub needs: Needs,
    /// Formula and range.
    pub doc: &'static str,
}

/// The metric of this name.
pub fn find(name: &str) -> Option<&'static MetricDef> {
    METRICS.iter().find(|m| m.name == name)
}

const fn metric(name: &'static str, unit: Unit, direction: Direction, needs: Needs, doc: &'static str) -> MetricDef {
    MetricDef { name, unit, direction, needs, doc }
}

use Direction::{Higher, Lower, Neutral};
use Needs::{Mesh, Quads, Reference, Triangles};
use Unit::{Area, Count, Degrees, Flag, Length, Ratio, Share, Volume};

/// All metrics, in the order of reports.
pub static METRICS: &[MetricDef] = &[
    metric("vertices", Count, Neutral, Mesh, "Vertices that a face uses."),
    metric("faces", Count, Neutral, Mesh, "Triangles and quads."),
    metric("triangles", Count, Neutral, Mesh, "Triangles."),
    metric("quads", Count, Neutral, Mesh, "Quads."),
    metric("edges", Count, Neutral, Mesh, "Distinct edges of faces without repeated corners."),
    metric("boundary-edges", Count, Lower, Mesh, "Edges with one face."),
    metric("boundary-loops", Count, Lower, Mesh, "Connected components of the boundary edges."),
    metric("components", Count, Neutral, Mesh, "Parts connected over vertices."),
    metric("shells", Count, Neutral, Mesh, "Parts connected over edges."),
    metric(
        "euler-characteristic",
        Count,
        Neutral,
        Mesh,
        "Vertices − edges + faces, without faces of repeated corners.",
    ),
    metric("genus", Ratio, Neutral, Mesh, "Handles: (2·shells − loops − χ) / 2; of a manifold, oriented mesh only."),
    metric("closed", Flag, Higher, Mesh, "Every edge has two faces, and there is one."),
    metric("manifold", Flag, Higher, Mesh, "Edge-manifold and vertex-manifold."),
    metric("edge-manifold", Flag, Higher, Mesh, "No edge has more than two faces."),
    metric("vertex-manifold", Flag, Higher, Mesh, "The faces at every vertex form one fan."),
    metric("non-manifold-edges", Count, Lower, Mesh, "Edges with more than two faces."),
    metric("non-manifold-vertices", Count, Lower, Mesh, "Vertices of several fans or on a non-manifold edge."),
    metric(
        "oriented",
        Flag,
        Higher,
        Mesh,
        "Edge-manifold, and the two faces at every inner edge run it in opposite ways.",
    ),
    metric("inconsistent-edges", Count, Lower, Mesh, "Edges whose two faces run them in the same way."),
    metric(
        "duplicate-faces",
        Count,
        Lower,
        Mesh,
        "Faces whose corners another face of the same kind has, less one of each.",
    ),
    metric("repeated-vertex-faces", Count, Lower, Mesh, "Faces that have a corner twice."),
    metric(
        "degenerate-faces",
        Count,
        Lower,
        Mesh,
        "Repeated corner; triangle with height / longest side < 1e-6; quad with area < 1e-6 · longest side².",
    ),
    metric(
        "self-intersecting-faces",
        Count,
        Lower,
        Mesh,
        "Faces that meet another one outside what they share, decided exactly; quads cut on the shorter diagonal.",
    ),
    metric("self-intersections", Count, Lower, Mesh, "Pairs of such faces."),
    metric("area", Area, Neutral, Mesh, "Sum of face areas; a quad is the mean of its two cuts."),
    metric("volume", Volume, Neutral, Mesh, "Signed volume against the origin; a quad is the mean of its two cuts."),
    metric("diagonal", Length, Neutral, Mesh, "Diagonal of the bounding box."),
    metric("extent-x", Length, Neutral, Mesh, "Bounding box along x."),
    metric("extent-y", Length, Neutral, Mesh, "Bounding box along y."),
    metric("extent-z", Length, Neutral, Mesh, "Bounding box along z."),
    metric("min-stretch", Ratio, Higher, Triangles, "Least of √12 · inradius / longest side; 0 to 1, equilateral 1."),
    metric("mean-stretch", Ratio, Higher, Triangles, "Mean stretch."),
    metric("p1-stretch", Ratio, Higher, Triangles, "First percentile of stretch, interpolated linearly."),
    metric("p5-stretch", Ratio, Higher, Triangles, "Fifth percentile of stretch."),
    metric("p50-stretch", Ratio, Higher, Triangles, "Median stretch."),
    metric("max-stretch", Ratio, Higher, Triangles, "Largest stretch."),
    metric("low-stretch-faces", Count, Lower, Triangles, "Triangles of stretch below 0.2."),
    metric("low-stretch-share", Share, Lower, Triangles, "Share of triangles of stretch below 0.2."),
    metric("min-size", Length, Neutral, Triangles, "Least longest side of a triangle."),
    metric("mean-size", Length, Neutral, Triangles, "Mean longest side."),
    metric("max-size", Length, Lower, Triangles, "Largest longest side."),
    metric("min-edge", Length, Higher, Triangles, "Shortest side of a triangle."),
    metric("mean-edge", Length, Neutral, Triangles, "Mean side, each side of each triangle counted."),
    metric("min-aspect-ratio", Ratio, Lower, Triangles, "Least of (√3/2) · longest side / height on it; from 1."),
    metric("mean-aspect-ratio", Ratio, Lower, Triangles, "Mean of the finite aspect ratios."),
    metric("max-aspect-ratio", Ratio, Lower, Triangles, "Largest aspect ratio; infinite where a triangle has no area."),
    metric("low-aspect-ratio-share", Share, Higher, Triangles, "Share of triangles of aspect ratio below 20."),
    metric("min-angle", Degrees, Higher, Triangles, "Least angle of a triangle."),
    metric("p1-min-angle", Degrees, Higher, Triangles, "First percentile of the least angles."),
    metric("p5-min-angle", Degrees, Higher, Triangles, "Fifth percentile of the least angles."),
    metric("mean-min-angle", Degrees, Higher, Triangles, "Mean of the least angles."),
    metric("max-angle", Degrees, Lower, Triangles, "Largest angle of a triangle."),
    metric("low-angle-share", Share, Lower, Triangles, "Share of triangles whose least angle is below 30 degrees."),
    metric("min-valence", Count, Neutral, Mesh, "Least number of edges at a vertex."),
    metric("max-valence", Count, Lower, Mesh, "Largest number of edges at a vertex."),
    metric(
        "min-scaled-jacobian",
        Ratio,
        Higher,
        Quads,
        "Least corner area along the centre normal / product of its sides; −1 to 1, square 1.",
    ),
    metric("mean-scaled-jacobian", Ratio, Higher, Quads, "Mean scaled Jacobian."),
    metric("p1-scaled-jacobian", Ratio, Higher, Quads, "First percentile of the scaled Jacobian."),
    metric("low-scaled-jacobian-share", Share, Lower, Quads, "Share of quads of scaled Jacobian below 0.2."),
    metric("inverted-quads", Count, Lower, Quads, "Quads of scaled Jacobian 0 or less."),
    metric("min-quad-angle", Degrees, Higher, Quads, "Least corner angle of a quad."),
    metric("max-quad-angle", Degrees, Lower, Quads, "Largest corner angle of a quad; above 180 at a reflex corner."),
    metric(
        "mean-quad-aspect",
        Ratio,
        Lower,
        Quads,
        "Mean of longest side · perimeter / (4 · area), where finite; square 1.",
    ),
    metric("max-quad-aspect", Ratio, Lower, Quads, "Largest quad aspect ratio."),
    metric(
        "min-warpage",
        Ratio,
        Higher,
        Quads,
        "Least cube of the smaller cosine between opposite corner normals; planar 1.",
    ),
    metric("mean-warpage", Ratio, Higher, Quads, "Mean warpage."),
    metric("max-warp-angle", Degrees, Lower, Quads, "Largest angle between opposite corner normals."),
    metric("mean-skew", Ratio, Lower, Quads, "Mean of |cosine| between the principal axes; rectangle 0."),
    metric("max-skew", Ratio, Lower, Quads, "Largest skew."),
    metric("mean-taper", Ratio, Lower, Quads, "Mean of cross derivative / shorter principal axis; parallelogram 0."),
    metric("max-taper", Ratio, Lower, Quads, "Largest taper."),
    metric("min-quad-stretch", Ratio, Higher, Quads, "Least of √2 · shortest side / longer diagonal; square 1."),
    metric("irregular-vertices", Count, Lower, Quads, "Inner vertices whose valence is not 4."),
    metric("irregular-share", Share, Lower, Quads, "Share of irregular among inner vertices."),
    metric("triangle-share", Share, Lower, Mesh, "Triangles / faces."),
    metric("distance", Length, Lower, Reference, "Certified upper bound of the two-sided Hausdorff distance."),
    metric(
        "distance-slack",
        Length,
        Lower,
        Reference,
        "By how much at most the bound `distance` exceeds the true distance.",
    ),
    metric(
        "distance-to-reference",
        Length,
        Lower,
        Reference,
        "Certified upper bound of the largest distance from the mesh to the reference.",
    ),
    metric(
        "distance-from-reference",
        Length,
        Lower,
        Reference,
        "Certified upper bound of the largest distance from the reference to the mesh.",
    ),
    metric(
        "mean-distance-to-reference",
        Length,
        Lower,
        Reference,
        "Mean distance of area-uniform samples of the mesh.",
    ),
    metric(
        "mean-distance-from-reference",
        Length,
        Lower,
        Reference,
        "Mean distance of area-uniform samples of the reference.",
    ),
    metric("mean-distance", Length, Lower, Reference, "The larger of the two mean distances."),
    metric("rms-distance-to-reference", Length, Lower, Reference, "Root mean square distance of samples of the mesh."),
    metric(
        "rms-distance-from-reference",
        Length,
        Lower,
        Reference,
        "Root mean square distance of samples of the reference.",
    ),
    metric("rms-distance", Length, Lower, Reference, "The larger of the two root mean squares."),
    metric(
        "feature-loss",
        Length,
        Lower,
        Reference,
        "Largest distance from marked edges of the reference to marked edges of the mesh, at samples of diagonal / 2000.",
    ),
    metric(
        "feature-spur",
        Length,
        Lower,
        Reference,
        "Largest distance from marked edges of the mesh to marked edges of the reference.",
    ),
    metric("feature-deviation", Length, Lower, Reference, "The larger of feature loss and feature spur."),
    metric("rms-feature-deviation", Length, Lower, Reference, "The larger root mean square of the two ways."),
    metric("area-drift", Share, Lower, Reference, "|area / area of the reference − 1|."),
    metric("volume-drift", Share, Lower, Reference, "|volume / volume of the reference − 1|."),
    metric("groups-kept", Flag, Higher, Reference, "Every group and region name of the reference still has elements."),
];
