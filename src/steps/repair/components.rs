//! The connected components of the result: which there are, and which are wanted.

use glam::DVec3;

use super::adjacency::{NONE, Twins, face_of, halfedge};
use super::draft::{Draft, normal};
use super::outward::Part;
use super::params::KeepComponents;
use crate::mesh::id::Face;
use crate::mesh::{FaceId, IdVec};

/// The components in the order of their lowest faces.
pub(super) fn components(draft: &Draft, twins: &Twins) -> Vec<Part> {
    let mut seen: IdVec<Face, bool> = IdVec::filled(false, draft.faces.len());
    let mut parts = Vec::new();
    for start in draft.faces.ids() {
        if seen[start] {
            continue;
        }
        seen[start] = true;
        let mut faces = vec![start];
        let mut closed = true;
        let mut done = 0;
        while done < faces.len() {
            for i in 0..3 {
                let across = twins[halfedge(faces[done], i)];
                if across == NONE {
                    closed = false;
                } else if !std::mem::replace(&mut seen[face_of(across)], true) {
                    faces.push(face_of(across));
                }
            }
            done += 1;
        }
        faces.sort_unstable();
        parts.push(describe(draft, faces, closed));
    }
    parts
}

fn describe(draft: &Draft, faces: Vec<FaceId>, closed: bool) -> Part {
    let (mut low, mut high, mut area) = (DVec3::INFINITY, DVec3::NEG_INFINITY, 0.0);
    for &face in &faces {
        let corners = draft.corners(face);
        area += 0.5 * normal(corners).length();
        for p in corners {
            (low, high) = (low.min(p), high.max(p));
        }
    }
    Part { faces, closed, low, high, area }
}

/// Whether each component stays.
pub(super) fn wanted(parts: &[Part], keep: KeepComponents) -> Vec<bool> {
    let total: f64 = parts.iter().map(|part| part.area).sum();
    let largest = parts.iter().enumerate().max_by(|(i, a), (j, b)| a.area.total_cmp(&b.area).then(j.cmp(i)));
    let largest = largest.map(|(i, _)| i);
    parts
        .iter()
        .enumerate()
        .map(|(i, part)| match keep {
            KeepComponents::All => true,
            KeepComponents::Largest => Some(i) == largest,
            KeepComponents::Share(share) => part.area >= share.0 * total,
        })
        .collect()
}
