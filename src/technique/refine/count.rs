//! How many faces refining will make, before anything is made.
//!
//! Where no edge is kept and none is flipped, an edge is halved if and only if it is too long, whatever its neighbours
//! are; so each face can be counted on its own. The four parts of a face with three long sides are similar, which makes
//! that cheap: one of them is counted.

use glam::DVec3;

use super::{Flips, MaxEdge, Round};
use crate::mesh::geometry::{triangle_angles, triangle_area, triangle_size};
use crate::mesh::id::Vertex;
use crate::mesh::{FaceId, IdVec};

/// The least number of faces that refining makes; more than `enough` is not told apart.
///
/// Faces at a kept edge are left out: they, and what they force, may stay as they are. Where the limit varies in a
/// face, its largest value there counts. Where edges are flipped, parts of different faces are joined, and only the
/// area counts.
pub(super) fn least_faces(round: &Round, max_edge: &MaxEdge, flips: Flips, enough: usize) -> usize {
    let surface = &round.surface;
    let mut at_kept: IdVec<Vertex, bool> = IdVec::filled(false, surface.points.len());
    for e in round.edges.keys().ids().filter(|&e| !round.may[e]) {
        round.edges.key(e).into_iter().for_each(|v| at_kept[v] = true);
    }
    let free = |f: &FaceId| surface.faces[*f].iter().all(|&v| !at_kept[v]);
    let limit = |f: FaceId| match max_edge {
        MaxEdge::Uniform(length) => *length,
        MaxEdge::Corners(lengths) => lengths[f].iter().copied().fold(0.0, f64::max),
    };
    let rough: f64 = surface.faces.ids().filter(free).map(|f| at_least(surface.corners(f), limit(f), flips)).sum();
    if rough > enough as f64 || flips == Flips::Flat {
        return rough as usize;
    }
    let mut visits = enough;
    let counted = |f: FaceId| parts(surface.corners(f), limit(f), &mut visits);
    surface.faces.ids().filter(free).map(counted).sum::<f64>() as usize
}

/// A part has at most one piece of each side, and at most the area of an equilateral triangle on the limit.
fn at_least(corners: [DVec3; 3], limit: f64, flips: Flips) -> f64 {
    let by_area = triangle_area(corners) / (limit * limit * 3.0_f64.sqrt() / 4.0);
    match flips {
        Flips::None => (triangle_size(corners) / limit).max(by_area).max(1.0).floor(),
        Flips::Flat => by_area,
    }
}

/// The parts that a face is cut into. Once `visits` are used up, what is left counts as whole.
fn parts(corners: [DVec3; 3], limit: f64, visits: &mut usize) -> f64 {
    *visits = visits.saturating_sub(1);
    let [a, b, c] = corners;
    // From each corner to the next.
    let long = [(a, b), (b, c), (c, a)].map(|(from, to)| from.distance(to) > limit);
    if *visits == 0 || long == [false; 3] {
        return 1.0;
    }
    if long == [true; 3] {
        return 4.0 * parts([a, a.midpoint(b), a.midpoint(c)], limit, visits);
    }
    // Turned so that the first side is long and the last one is not.
    let sides = [(a, b, c), (b, c, a), (c, a, b)];
    let first = (0..3).find(|&k| long[k] && !long[(k + 2) % 3]).unwrap_or(0);
    let (a, b, c) = sides[first];
    let m = a.midpoint(b);
    let pieces: &[[DVec3; 3]] = if long[(first + 1) % 3] {
        let n = b.midpoint(c);
        let least =
            |faces: &[[DVec3; 3]; 2]| faces.iter().flat_map(|f| triangle_angles(*f)).fold(f64::INFINITY, f64::min);
        let (from_a, from_c) = ([[a, m, n], [a, n, c]], [[a, m, c], [m, n, c]]);
        let [x, y] = if least(&from_a) > least(&from_c) { from_a } else { from_c };
        &[x, [m, b, n], y]
    } else {
        &[[a, m, c], [m, b, c]]
    };
    pieces.iter().map(|&piece| parts(piece, limit, visits)).sum()
}

#[cfg(test)]
mod tests {
    use super::super::{MAX_FACES, refine};
    use super::*;
    use crate::mesh::halfedge::tests::surface;
    use crate::mesh::{LockRules, Surface};
    use crate::watch::Watch;

    fn counted(surface: &Surface, limit: &MaxEdge) -> usize {
        let round = Round::new(surface.clone(), &LockRules::default()).unwrap();
        least_faces(&round, limit, Flips::None, MAX_FACES)
    }

    /// A tetrahedron with sides of all lengths, one of them a needle.
    fn uneven() -> Surface {
        let points = [[0.0; 3], [3.0, 0.1, 0.2], [0.4, 1.7, 0.0], [0.3, 0.2, 0.05]];
        surface(&points, &[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    }

    #[test]
    fn the_count_is_that_of_the_result() {
        let part = uneven();
        for limit in [0.5, 0.21, 0.083, 0.01] {
            let limit = MaxEdge::Uniform(limit);
            let locks = LockRules::default();
            let (made, _) = refine(&part, &limit, MAX_FACES, Flips::None, &locks, &Watch::silent()).unwrap();
            let share = counted(&part, &limit) as f64 / made.faces.len() as f64;
            assert!((0.99..=1.01).contains(&share), "{limit:?}: {share}");
        }
    }

    #[test]
    fn counting_ends_whatever_the_limit() {
        assert!(counted(&uneven(), &MaxEdge::Uniform(f64::MIN_POSITIVE)) > MAX_FACES);
    }
}
