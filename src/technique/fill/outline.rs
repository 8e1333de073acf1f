//! Quads over a loop of nodes with as few irregular nodes as its corners allow.
//!
//! A loop of four sides takes a grid, one of three or five sides a grid at each corner, all round one node. Where the
//! lengths of the sides forbid that, or where there are two or six corners, a straight row cuts the loop in two that
//! each take such a patch: a node of three and one of five quads make up for sides that differ. Where a loop turns
//! back, as round the corner of a hole, the row begins there.

use super::new_node;
use smallvec::SmallVec;

use crate::mesh::VertexId;

/// A number for each side of a loop.
type Sides = SmallVec<[usize; 8]>;

/// Polygons, said by nodes.
pub type Faces = Vec<Vec<VertexId>>;

/// A loop of nodes, counter-clockwise, with the places of its corners in rising order, and of the nodes where it turns
/// back by a right angle.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    /// The nodes.
    pub nodes: Vec<VertexId>,
    /// Places of corners.
    pub corners: Vec<usize>,
    /// Places where it turns back.
    pub reflex: Vec<usize>,
}

/// A straight row across a loop: between which places, and of how many edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cut {
    /// The lower place.
    pub from: usize,
    /// The higher one.
    pub to: usize,
    /// Edges of the row.
    pub edges: usize,
    /// Whether the end at `from` is a corner of the part ahead of it and of the other one, then those at `to`.
    is_corner: [[bool; 2]; 2],
    /// Parts that have an irregular node.
    pub irregular: usize,
}

impl Outline {
    /// The edges of each side; the first begins at the first corner.
    fn sides(&self) -> Sides {
        let (n, all) = (self.corners.len(), self.nodes.len());
        (0..n).map(|i| (self.corners[(i + 1) % n] + all - 1 - self.corners[i]) % all + 1).collect()
    }

    /// One regular patch. `fresh` counts the nodes that are new.
    pub fn whole(&self, fresh: &mut usize) -> Option<Faces> {
        let sides = self.sides();
        let start = *self.corners.first()?;
        let at = |k: usize| self.nodes[(start + k) % self.nodes.len()];
        match sides[..] {
            [a, b, c, d] => (a == c && b == d).then(|| grid(a, b, at, fresh)),
            [_, _, _] | [_, _, _, _, _] => {
                let spokes = spokes(&sides)?;
                let all = self.nodes.len();
                let places: Vec<usize> = self.corners.iter().map(|&c| (c + all - start) % all).collect();
                Some(star(&spokes, &places, all, at, fresh))
            }
            _ => None,
        }
    }

    /// The rows that leave a regular patch on both sides, among those as long as `lengths` tells for their ends. Every
    /// node where the loop turns back is an end.
    pub fn cuts(&self, lengths: impl Fn(VertexId, VertexId) -> [usize; 2]) -> Vec<Cut> {
        // Corners before each place.
        let mut before = vec![0; self.nodes.len() + 1];
        for k in 0..self.nodes.len() {
            before[k + 1] = before[k] + usize::from(self.corners.binary_search(&k).is_ok());
        }
        let inner: Vec<usize> = (0..self.nodes.len()).filter(|&k| before[k] == before[k + 1]).collect();
        let mut all = Vec::new();
        for (i, &from) in inner.iter().enumerate() {
            for &to in &inner[i + 1..] {
                let ahead = before[to] - before[from];
                let between = [ahead, self.corners.len() - ahead];
                if between.iter().any(|&n| n > 5) || !self.reflex.iter().all(|&k| k == from || k == to) {
                    continue;
                }
                for (a, b) in self.ends(from).iter().flat_map(|&a| self.ends(to).iter().map(move |&b| (a, b))) {
                    self.cuts_between([from, to], [a, b], between, &lengths, &mut all);
                }
            }
        }
        all
    }

    /// Of which parts beside a row its end may be a corner.
    fn ends(&self, place: usize) -> &'static [[bool; 2]] {
        if self.reflex.contains(&place) { &[[true, false], [false, true]] } else { &[[true, true]] }
    }

    /// The rows between two places, of which the parts beside them have so many of the loop's own corners.
    fn cuts_between(
        &self,
        [from, to]: [usize; 2],
        is_corner: [[bool; 2]; 2],
        between: [usize; 2],
        lengths: impl Fn(VertexId, VertexId) -> [usize; 2],
        all: &mut Vec<Cut>,
    ) {
        let count = |part: usize| between[part] + is_corner.iter().filter(|ends| ends[part]).count();
        let corners = [count(0), count(1)];
        if !corners.iter().all(|n| (3..=5).contains(n)) {
            return;
        }
        let irregular = corners.iter().filter(|&&n| n != 4).count();
        let cut = Cut { from, to, edges: 0, is_corner, irregular };
        // The row is part of the last side of both.
        let mut sides = [self.sides_beside([from, to], cut, false), self.sides_beside([to, from], cut, true)];
        let last = corners.map(|n| n - 1);
        let short = [sides[0][last[0]], sides[1][last[1]]];
        let [least, most] = lengths(self.nodes[from], self.nodes[to]);
        for edges in least.max(1)..=most {
            for part in 0..2 {
                sides[part][last[part]] = short[part] + edges;
            }
            if sides.iter().all(|sides| fits(sides)) {
                all.push(Cut { edges, ..cut });
            }
        }
    }

    /// The places of the corners of the part from one end of a row to the other, counted from there.
    fn corners_beside(&self, [first, last]: [usize; 2], cut: Cut, is_back: bool) -> (Sides, usize) {
        let all = self.nodes.len();
        let steps = (last + all - first) % all;
        let [at_from, at_to] = cut.is_corner.map(|ends| ends[usize::from(is_back)]);
        let [at_first, at_last] = if is_back { [at_to, at_from] } else { [at_from, at_to] };
        // In their order from the first end on.
        let from = self.corners.partition_point(|&c| c < first);
        let around = self.corners[from..].iter().chain(&self.corners[..from]);
        let mut corners = Sides::new();
        corners.extend(at_first.then_some(0));
        corners.extend(around.map(|&c| (c + all - first) % all).filter(|&c| c < steps));
        corners.extend(at_last.then_some(steps));
        (corners, steps)
    }

    /// The sides of the part between two places and a row of no edges back.
    fn sides_beside(&self, ends: [usize; 2], cut: Cut, is_back: bool) -> Sides {
        let (corners, steps) = self.corners_beside(ends, cut, is_back);
        let n = corners.len();
        (0..n).map(|i| if i + 1 < n { corners[i + 1] - corners[i] } else { steps - corners[i] + corners[0] }).collect()
    }

    /// The loops on both sides of a row.
    fn parts(&self, cut: Cut, fresh: &mut usize) -> [Self; 2] {
        let Cut { from, to, edges, .. } = cut;
        let row: Vec<VertexId> = (*fresh..*fresh + edges - 1).map(new_node).collect();
        *fresh += edges - 1;
        let all = self.nodes.len();
        let part = |first: usize, last: usize, is_back: bool, back: &mut dyn Iterator<Item = VertexId>| {
            let (corners, steps) = self.corners_beside([first, last], cut, is_back);
            let mut nodes: Vec<VertexId> = (0..=steps).map(|k| self.nodes[(first + k) % all]).collect();
            nodes.extend(back);
            Self { nodes, corners: corners.to_vec(), reflex: Vec::new() }
        };
        [part(from, to, false, &mut row.iter().rev().copied()), part(to, from, true, &mut row.iter().copied())]
    }

    /// Two regular patches beside a row.
    pub fn in_two(&self, cut: Cut) -> Option<Faces> {
        let mut fresh = 0;
        let [one, other] = self.parts(cut, &mut fresh);
        let mut faces = one.whole(&mut fresh)?;
        faces.extend(other.whole(&mut fresh)?);
        Some(faces)
    }
}

/// Whether a loop of these sides takes a regular patch.
fn fits(sides: &[usize]) -> bool {
    match *sides {
        [a, b, c, d] => a == c && b == d,
        [_, _, _] | [_, _, _, _, _] => spokes(sides).is_some(),
        _ => false,
    }
}

fn grid(a: usize, b: usize, rim: impl Fn(usize) -> VertexId, fresh: &mut usize) -> Faces {
    let first = *fresh;
    *fresh += (a - 1) * (b - 1);
    let node = |i: usize, j: usize| {
        if j == 0 {
            rim(i)
        } else if i == a {
            rim(a + j)
        } else if j == b {
            rim(2 * a + b - i)
        } else if i == 0 {
            rim(2 * (a + b) - j)
        } else {
            new_node(first + (j - 1) * (a - 1) + i - 1)
        }
    };
    let quads = (0..a * b).map(|q| (q % a, q / a));
    quads.map(|(i, j)| vec![node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)]).collect()
}

/// The lengths of the spokes of a patch of three or five sides: side `i` is as long as the spokes `i - 1` and `i + 1`.
fn spokes(sides: &[usize]) -> Option<Sides> {
    let n = sides.len();
    let along = |j: usize| sides[if 2 * j + 1 < n { 2 * j + 1 } else { (2 * j + 1) % n }] as i64;
    let twice: i64 = (0..n).map(|j| if j % 2 == 0 { along(j) } else { -along(j) }).sum();
    let mut length = (twice % 2 == 0).then_some(twice / 2)?;
    let mut spokes = Sides::from_elem(0, n);
    for j in 0..n {
        spokes[(2 * j) % n] = usize::try_from(length).ok().filter(|&l| l >= 1)?;
        length = along(j) - length;
    }
    Some(spokes)
}

/// A grid at each corner, all round a central node. `places` are the corners on the rim.
fn star(
    spokes: &[usize],
    places: &[usize],
    rim_len: usize,
    rim: impl Fn(usize) -> VertexId,
    fresh: &mut usize,
) -> Faces {
    let n = spokes.len();
    // New nodes: the centre, then those on spokes, then those inside the grids.
    let centre = *fresh;
    let mut first = vec![centre + 1];
    for &s in spokes {
        first.push(first[first.len() - 1] + s - 1);
    }
    let mut inside = first[n];
    let mut faces = Vec::new();
    for i in 0..n {
        let before = (i + n - 1) % n;
        let (p, s) = (spokes[before], spokes[i]);
        let base = inside;
        inside += (p - 1) * (s - 1);
        let node = |u: usize, v: usize| {
            if v == 0 {
                rim((places[i] + u) % rim_len)
            } else if u == 0 {
                rim((places[i] + rim_len - v) % rim_len)
            } else if u == p && v == s {
                new_node(centre)
            } else if u == p {
                new_node(first[i] + v - 1)
            } else if v == s {
                new_node(first[before] + u - 1)
            } else {
                new_node(base + (v - 1) * (p - 1) + u - 1)
            }
        };
        for (u, v) in (0..p * s).map(|q| (q % p, q / p)) {
            faces.push(vec![node(u, v), node(u + 1, v), node(u + 1, v + 1), node(u, v + 1)]);
        }
    }
    *fresh = inside;
    faces
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    fn outline(sides: &[usize]) -> Outline {
        let total = sides.iter().sum();
        let mut corners = vec![0];
        for side in &sides[..sides.len() - 1] {
            corners.push(corners[corners.len() - 1] + side);
        }
        Outline { nodes: (0..total).map(VertexId::new).collect(), corners, reflex: Vec::new() }
    }

    /// Checks that nodes on the rim have one quad at corners and two elsewhere; how many quads irregular ones have.
    fn irregular(outline: &Outline, faces: &Faces) -> Vec<usize> {
        let mut counts: BTreeMap<VertexId, usize> = BTreeMap::new();
        assert!(faces.iter().all(|f| f.len() == 4));
        faces.iter().flatten().for_each(|&v| *counts.entry(v).or_default() += 1);
        let mut odd = Vec::new();
        for (v, count) in counts {
            match outline.nodes.iter().position(|&w| w == v) {
                Some(place) => assert_eq!(count, if outline.corners.contains(&place) { 1 } else { 2 }, "{v:?}"),
                None if count != 4 => odd.push(count),
                None => {}
            }
        }
        odd.sort_unstable();
        odd
    }

    #[test]
    fn patches_of_three_four_and_five_sides_are_regular_but_for_the_centre() {
        let cases: [(&[usize], &[usize]); 4] =
            [(&[4, 4, 4], &[3]), (&[3, 2, 3, 2], &[]), (&[2, 3, 4, 3, 4], &[5]), (&[6, 4, 4], &[3])];
        for (sides, centre) in cases {
            let outline = outline(sides);
            let faces = outline.whole(&mut 0).expect("a patch");
            assert_eq!(irregular(&outline, &faces), centre, "{sides:?}");
        }
        assert_eq!(outline(&[2, 1, 1, 2]).whole(&mut 0), None, "opposite sides differ");
    }

    #[test]
    fn a_row_from_where_a_loop_turns_back_leaves_nothing_irregular() {
        // An L of 4 by 4 less 2 by 2, its reflex corner eighth.
        let nodes: Vec<VertexId> = (0..16).map(VertexId::new).collect();
        let outline = Outline { nodes, corners: vec![0, 4, 6, 10, 12], reflex: vec![8] };
        let best = outline.cuts(|_, _| [1, 8]).into_iter().min_by_key(|cut| cut.irregular).expect("a row");
        assert_eq!((best.irregular, best.edges), (0, 2));
        let faces = outline.in_two(best).expect("two patches");
        assert_eq!((faces.len(), faces.iter().all(|f| f.len() == 4)), (12, true));
    }

    #[test]
    fn sides_that_differ_take_one_node_of_three_and_one_of_five_quads() {
        let cases: [(&[usize], usize, &[usize]); 5] = [
            (&[7, 5, 3, 5], 8, &[3, 5]),
            (&[2, 2, 4, 4], 1, &[3, 5]),
            (&[2, 3, 5, 4], 1, &[3, 5]),
            (&[4, 4], 1, &[3, 3]),
            (&[2, 2, 4, 2, 2, 4], 1, &[5, 5]),
        ];
        for (sides, count, odd) in cases {
            let outline = outline(sides);
            let cuts = outline.cuts(|_, _| [1, 8]);
            assert_eq!(cuts.len(), count, "{sides:?}");
            for cut in cuts {
                let faces = outline.in_two(cut).expect("two patches");
                assert_eq!(irregular(&outline, &faces), odd, "{sides:?} {cut:?}");
                let sides = faces.len() * 4 - outline.nodes.len();
                let mut nodes: Vec<VertexId> = faces.concat();
                nodes.sort_unstable();
                nodes.dedup();
                assert_eq!(nodes.len() + faces.len(), sides / 2 + outline.nodes.len() + 1, "Euler's formula");
            }
        }
        // A patch of five sides needs two edges along each.
        assert_eq!(outline(&[4, 3, 2, 3]).cuts(|_, _| [1, 8]), []);
        assert_eq!(outline(&[2, 2, 2, 2, 2, 2]).cuts(|_, _| [1, 8]), []);
    }
}
