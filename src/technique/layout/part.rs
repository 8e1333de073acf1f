//! Parts of a pattern, and the paths that cut them in two.

use std::collections::{BTreeMap, VecDeque};

/// Some faces of a pattern that form a disk.
pub(super) struct Part<'p> {
    faces: &'p [Vec<usize>],
    /// Which faces.
    pub(super) members: Vec<usize>,
    /// The face on the left of each directed edge.
    left: BTreeMap<(usize, usize), usize>,
}

impl<'p> Part<'p> {
    pub(super) fn new(faces: &'p [Vec<usize>], members: Vec<usize>) -> Self {
        let mut left = BTreeMap::default();
        for &f in &members {
            for (k, &a) in faces[f].iter().enumerate() {
                left.insert((a, faces[f][(k + 1) % faces[f].len()]), f);
            }
        }
        Self { faces, members, left }
    }

    /// Directed edges with faces of the part on both sides.
    fn crossings(&self) -> Vec<(usize, usize)> {
        let edges = self.members.iter().flat_map(|&f| {
            let face = &self.faces[f];
            (0..face.len()).map(move |k| (face[k], face[(k + 1) % face.len()]))
        });
        edges.filter(|&(a, b)| self.left.contains_key(&(b, a))).collect()
    }

    /// The shortest path through the inside from rim to rim, of equal ones that which cuts most evenly.
    pub(super) fn chord(&self) -> Option<Vec<usize>> {
        let crossings = self.crossings();
        let nodes = self.members.iter().flat_map(|&f| &self.faces[f]).max().map_or(0, |&n| n + 1);
        let mut on_rim = vec![false; nodes];
        let mut ways = vec![Vec::new(); nodes];
        for &(a, b) in self.left.keys().filter(|&&(a, b)| !self.left.contains_key(&(b, a))) {
            (on_rim[a], on_rim[b]) = (true, true);
        }
        for &(a, b) in &crossings {
            ways[a].push(b);
        }
        let mut best: Option<(usize, usize, Vec<usize>)> = None;
        for start in (0..nodes).filter(|&n| on_rim[n] && !ways[n].is_empty()) {
            for path in shortest(start, &ways, &on_rim) {
                let hops = path.len();
                if best.as_ref().is_some_and(|b| b.0 < hops) {
                    continue;
                }
                let (left, right) = self.cut(&path);
                let uneven = left.len().abs_diff(right.len());
                if best.as_ref().is_none_or(|b| (hops, uneven) < (b.0, b.1)) {
                    best = Some((hops, uneven, path));
                }
            }
        }
        best.map(|b| b.2)
    }

    /// The faces on the left and on the right of a chord.
    pub(super) fn cut(&self, chord: &[usize]) -> (Vec<usize>, Vec<usize>) {
        let is_wall = |a: usize, b: usize| chord.windows(2).any(|w| (w[0], w[1]) == (a, b) || (w[1], w[0]) == (a, b));
        let Some(&seed) = self.left.get(&(chord[0], chord[1])) else { return (Vec::new(), self.members.clone()) };
        let (mut left, mut open) = (vec![seed], vec![seed]);
        while let Some(f) = open.pop() {
            let face = &self.faces[f];
            for (k, &a) in face.iter().enumerate() {
                let b = face[(k + 1) % face.len()];
                if let Some(&g) = self.left.get(&(b, a)).filter(|g| !is_wall(a, b) && !left.contains(g)) {
                    left.push(g);
                    open.push(g);
                }
            }
        }
        left.sort_unstable();
        let right = self.members.iter().copied().filter(|f| left.binary_search(f).is_err()).collect();
        (left, right)
    }
}

/// Shortest paths through the inside from a node of the rim to each other one that is nearest.
fn shortest(start: usize, ways: &[Vec<usize>], on_rim: &[bool]) -> Vec<Vec<usize>> {
    let mut from = vec![usize::MAX; ways.len()];
    let mut depth = vec![usize::MAX; ways.len()];
    let (mut queue, mut found) = (VecDeque::from([start]), Vec::new());
    depth[start] = 0;
    let mut limit = usize::MAX;
    while let Some(at) = queue.pop_front() {
        for &next in &ways[at] {
            if depth[at] >= limit || depth[next] != usize::MAX {
                continue;
            }
            (depth[next], from[next]) = (depth[at] + 1, at);
            if !on_rim[next] {
                queue.push_back(next);
                continue;
            }
            limit = depth[next];
            let mut path = vec![next];
            while let Some(&last) = path.last().filter(|&&last| last != start) {
                path.push(from[last]);
            }
            path.reverse();
            found.push(path);
        }
    }
    found
}
