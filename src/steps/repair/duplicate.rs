//! Faces that cannot be part of a surface: those that repeat a corner, and those that are there twice.

use super::adjacency::{EdgeTable, apex, face_of};
use super::draft::Draft;
use crate::mesh::id::Face;
use crate::mesh::{FaceId, IdVec, VertexId};

/// Drops faces that name a vertex twice; returns how many.
pub(super) fn drop_collapsed(draft: &mut Draft) -> u64 {
    let keep: Vec<bool> = draft.faces.iter().map(|[a, b, c]| a != b && b != c && c != a).collect();
    let dropped = keep.iter().filter(|&&k| !k).count() as u64;
    if dropped > 0 {
        draft.retain_faces(&keep);
    }
    dropped
}

/// How many faces were dropped because others cover the same three vertices.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Duplicates {
    /// Repeats of a face.
    pub(super) repeated: u64,
    /// Faces of pairs that look in opposite directions and enclose nothing.
    pub(super) cancelled: u64,
}

/// What becomes of two faces that look in opposite directions, where an even number of faces meets at each edge. Else
/// one stays.
#[derive(Clone, Copy, Debug)]
pub(super) struct Opposite {
    /// Both go, because they enclose nothing.
    pub(super) cancel: bool,
    /// Both stay where they are a wall between solids.
    pub(super) keep_walls: bool,
}

/// Drops repeated faces.
///
/// One face of each set stays, with two exceptions that keep neighbours meeting in pairs. Two faces that look in
/// opposite directions may both go or both stay. And of two that look the same way both stay where each of their
/// neighbours needs one of them, as where solids touch.
pub(super) fn drop_duplicates(draft: &mut Draft, table: &EdgeTable, rule: Opposite) -> Duplicates {
    let mut dropped = Duplicates::default();
    let groups = duplicate_groups(&draft.faces, table);
    if groups.is_empty() {
        return dropped;
    }
    let mut keep = vec![true; draft.faces.len()];
    let mut settled = Vec::new();
    for group in groups {
        let is_even = |f: FaceId| is_even_permutation(draft.faces[f]);
        let first = group[0];
        let opposite = group.iter().copied().find(|&f| is_even(f) != is_even(first));
        for &f in group.iter().filter(|&&f| f != first && Some(f) != opposite) {
            keep[f.index()] = false;
            dropped.repeated += 1;
        }
        settled.push((first, group[1], opposite));
    }
    let sides = Sides::new(&keep, table);
    let pairs = settled.iter().filter_map(|&(first, _, opposite)| Some([first, opposite?]));
    let walls = if rule.keep_walls { walls(pairs, &keep, table) } else { vec![false; keep.len()] };
    for (first, repeat, opposite) in settled {
        if let Some(second) = opposite {
            if walls[first.index()] {
                continue;
            }
            keep[second.index()] = false;
            if rule.cancel && sides.odd[first.index()] == 0 {
                keep[first.index()] = false;
                dropped.cancelled += 2;
            } else {
                dropped.repeated += 1;
            }
        } else if sides.crowded[first.index()] == 3 {
            keep[repeat.index()] = true;
            dropped.repeated -= 1;
        }
    }
    draft.retain_faces(&keep);
    dropped
}

/// Which faces of opposite pairs are walls: solids lie on both sides of all that is connected of them, so that nowhere
/// such a pair ends at an edge of its own.
fn walls(pairs: impl Iterator<Item = [FaceId; 2]>, keep: &[bool], table: &EdgeTable) -> Vec<bool> {
    let mut second = vec![None; keep.len()];
    for [a, b] in pairs {
        second[a.index()] = Some(b);
        second[b.index()] = Some(a);
    }
    let mut joined: Vec<usize> = (0..keep.len()).collect();
    let root = |joined: &mut Vec<usize>, mut f: usize| {
        while joined[f] != f {
            joined[f] = joined[joined[f]];
            f = joined[f];
        }
        f
    };
    let mut ends = Vec::new();
    for (_, _, group) in table.edges() {
        let faces: Vec<usize> = group.iter().map(|(_, h)| face_of(*h).index()).filter(|&f| keep[f]).collect();
        let paired: Vec<usize> = faces.iter().copied().filter(|&f| second[f].is_some()).collect();
        for pair in paired.windows(2) {
            let [a, b] = [pair[0], pair[1]].map(|f| root(&mut joined, f));
            joined[a.max(b)] = a.min(b);
        }
        if faces.len() % 2 == 1 || faces.len() == 2 {
            ends.extend(paired);
        }
    }
    let mut is_open = vec![false; keep.len()];
    for f in ends {
        is_open[root(&mut joined, f)] = true;
    }
    (0..keep.len()).map(|f| second[f].is_some() && !is_open[root(&mut joined, f)]).collect()
}

/// For each face, at how many of its sides the number of kept faces is odd, and at how many it is odd and at least 3.
struct Sides {
    odd: Vec<u8>,
    crowded: Vec<u8>,
}

impl Sides {
    fn new(keep: &[bool], table: &EdgeTable) -> Self {
        let mut sides = Self { odd: vec![0; keep.len()], crowded: vec![0; keep.len()] };
        for (_, _, group) in table.edges() {
            let count = group.iter().filter(|(_, h)| keep[face_of(*h).index()]).count();
            if count % 2 == 1 {
                for (_, h) in group {
                    let face = face_of(*h).index();
                    sides.odd[face] += 1;
                    sides.crowded[face] += u8::from(count >= 3);
                }
            }
        }
        sides
    }
}

/// Sets of faces with the same three vertices, each ascending; two such faces share an edge and the corner across it.
fn duplicate_groups(faces: &IdVec<Face, [VertexId; 3]>, table: &EdgeTable) -> Vec<Vec<FaceId>> {
    let mut suspects: Vec<([VertexId; 3], FaceId)> = Vec::new();
    for (a, _, group) in table.edges() {
        for (i, &(_, h)) in group.iter().enumerate() {
            let across = apex(faces, h);
            // The edge across from the lowest corner need not tell what the two others tell already.
            let repeated = group.iter().enumerate().any(|(j, &(_, g))| i != j && apex(faces, g) == across);
            if repeated && a < across {
                let mut key = faces[face_of(h)];
                key.sort_unstable();
                suspects.push((key, face_of(h)));
            }
        }
    }
    suspects.sort_unstable();
    suspects.dedup();
    suspects.chunk_by(|a, b| a.0 == b.0).map(|chunk| chunk.iter().map(|s| s.1).collect()).collect()
}

fn is_even_permutation([a, b, c]: [VertexId; 3]) -> bool {
    // Of the six orders these three turn the same way.
    [[a, b, c], [b, c, a], [c, a, b]].iter().any(|turn| turn.is_sorted())
}
