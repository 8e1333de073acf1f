//! How regular a layout of quads is: the share of triangles, and that of vertices with too many or too few elements.
//!
//! Based on: T. Itoh, A. Yamada, T. Furuhata, K. Inoue, K. Shimada. Rough Quadrilateralation of Triangular Meshes via
//! Belt-like Subregioning for Surface Reconstruction. IBM Research Report RT0354, 2000, section 4.

use std::collections::BTreeMap;

use crate::mesh::geometry::angle;
use crate::mesh::topology::{EdgeTable, euler_characteristic};
use crate::mesh::{Carried, FaceId, Facet, Freedom, Soup, VertexId};

/// A border that turns by more, in radians, has a corner.
const CORNER: f64 = std::f64::consts::FRAC_PI_3;

/// What is counted of a layout.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layout {
    /// Triangles.
    pub triangles: usize,
    /// Vertices inside with other than four elements, and on smooth borders with other than two.
    pub irregular: Vec<VertexId>,
    /// How many must be irregular if each is off by one: Euler's formula, less what the corners take.
    pub forced: usize,
    /// Vertices that an element uses.
    pub vertices: usize,
}

/// Counts triangles and irregular vertices. A corner is a border vertex that is pinned, or where the elements' angles
/// differ from a straight angle by more than 60 degrees; it may have any number of elements. Regions are judged each on
/// its own: their borders count as borders, as they do where each is cut into elements by itself.
pub fn layout_counts(mesh: &Soup) -> Layout {
    let labels = mesh.carried.regions.as_ref().map(|regions| &regions.labels);
    let mut parts: BTreeMap<u32, Vec<FaceId>> = BTreeMap::new();
    for face in mesh.faces.ids() {
        let label = labels.and_then(|labels| labels.get(face)).copied().unwrap_or(0);
        parts.entry(label).or_default().push(face);
    }
    let triangles = mesh.faces.iter().filter(|f| matches!(f, Facet::Tri(_))).count();
    let mut layout = Layout { triangles, ..Layout::default() };
    for faces in parts.values() {
        let own = faces.iter().map(|&f| mesh.faces[f]).collect();
        let part = Soup { points: mesh.points.clone(), faces: own, carried: Carried::default() };
        let (irregular, owed) = part_counts(&part, |v| mesh.carried.pins.get(&v) == Some(&Freedom::Keep));
        layout.irregular.extend(irregular);
        layout.forced += owed.unsigned_abs() as usize;
    }
    layout.irregular.sort_unstable();
    layout.irregular.dedup();
    let mut used: Vec<VertexId> = mesh.faces.iter().flat_map(Facet::corners).copied().collect();
    used.sort_unstable();
    used.dedup();
    layout.vertices = used.len();
    layout
}

/// The irregular vertices of one region, and by how much they must be irregular in sum.
fn part_counts(mesh: &Soup, is_pinned: impl Fn(VertexId) -> bool) -> (Vec<VertexId>, i64) {
    let edges = EdgeTable::new(mesh);
    let mut on_border = vec![false; mesh.points.len()];
    for (_, key, _) in edges.iter().filter(|(_, _, sides)| sides.len() == 1) {
        for v in key {
            on_border[v.index()] = true;
        }
    }
    let mut elements = vec![0_usize; mesh.points.len()];
    let mut angles = vec![0.0_f64; mesh.points.len()];
    for face in &mesh.faces {
        let corners = face.corners();
        let n = corners.len();
        for (k, v) in corners.iter().enumerate() {
            let at = |i: usize| mesh.points[corners[(k + i) % n]];
            elements[v.index()] += 1;
            angles[v.index()] += angle(at(1) - at(0), at(n - 1) - at(0));
        }
    }
    let mut irregular = Vec::new();
    // Inside 4 − n and on borders 2 − n sum to four times the Euler number.
    let mut owed = 4 * euler_characteristic(mesh, &edges);
    for v in mesh.points.ids().filter(|v| elements[v.index()] > 0) {
        let (count, turn) = (elements[v.index()], std::f64::consts::PI - angles[v.index()]);
        if on_border[v.index()] && (is_pinned(v) || turn.abs() > CORNER) {
            let natural = (angles[v.index()] / std::f64::consts::FRAC_PI_2).round().max(1.0) as i64;
            owed -= 2 - natural;
        } else if count != if on_border[v.index()] { 2 } else { 4 } {
            irregular.push(v);
        }
    }
    (irregular, owed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    fn grid(m: usize, n: usize) -> Soup {
        let points = (0..(m + 1) * (n + 1)).map(|k| dvec3((k % (m + 1)) as f64, (k / (m + 1)) as f64, 0.0)).collect();
        let id = |i: usize, j: usize| VertexId::new(j * (m + 1) + i);
        let quads = (0..m * n).map(|q| (q % m, q / m));
        let faces = quads.map(|(i, j)| Facet::Quad([id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)])).collect();
        Soup { points, faces, ..Soup::default() }
    }

    #[test]
    fn a_grid_is_regular_and_its_corners_take_the_euler_number() {
        let counts = layout_counts(&grid(5, 3));
        assert_eq!((counts.triangles, counts.irregular.len(), counts.forced, counts.vertices), (0, 0, 0, 24));
    }

    #[test]
    fn a_node_of_three_quads_is_the_irregular_one_of_a_triangle() {
        // A hexagon of three rhombi: six border nodes turn by 60 degrees, and one of every two has one quad.
        let mut mesh = Soup::default();
        for k in 0..6 {
            let (s, c) = libm::sincos(f64::from(k) * std::f64::consts::FRAC_PI_3);
            mesh.points.push(dvec3(0.99 * c, s, 0.0));
        }
        mesh.points.push(dvec3(0.0, 0.0, 0.0));
        let v = VertexId::new;
        mesh.faces =
            [[0, 1, 2], [2, 3, 4], [4, 5, 0]].map(|[a, b, c]| Facet::Quad([v(6), v(a), v(b), v(c)])).to_vec().into();
        let counts = layout_counts(&mesh);
        assert!(counts.irregular.contains(&v(6)));
        assert_eq!(counts.vertices, 7);
    }
}
