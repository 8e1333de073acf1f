//! The region of each face of a cut surface: what the nearest curves say, and where there are none, what was.

use super::{Flank, Flanks, SplitError};
use crate::mesh::id::Face;
use crate::mesh::topology::EdgeTable;
use crate::mesh::{FaceId, IdVec, Surface};

/// Spreads the labels beside the curves over the faces between them.
pub(super) fn flood(
    old: &Surface,
    new: &Surface,
    parents: &IdVec<Face, FaceId>,
    flanks: &Flanks,
) -> Result<IdVec<Face, u32>, SplitError> {
    let sides = |f: FaceId| {
        let [a, b, c] = new.faces[f];
        [[a, b], [b, c], [c, a]]
    };
    let mut found: IdVec<Face, Option<Flank>> = IdVec::filled(None, new.faces.len());
    let mut waiting = Vec::new();
    for f in new.faces.ids() {
        for flank in sides(f).into_iter().filter_map(|side| flanks.get(&side)) {
            settle(new, &mut found, &mut waiting, f, *flank)?;
        }
    }
    let edges = EdgeTable::new(new);
    let edges_of = edges.edges_of_triangles(new.faces.len());
    while let Some((f, flank)) = waiting.pop() {
        for (k, side) in sides(f).into_iter().enumerate() {
            if !flanks.contains_key(&side) {
                for other in edges.sides(edges_of[f][k]).iter().filter(|other| other.face != f) {
                    settle(new, &mut found, &mut waiting, other.face, flank)?;
                }
            }
        }
    }
    let before = |f: FaceId| old.carried.regions.as_ref().map_or(0, |regions| regions.labels[parents[f]]);
    Ok(new.faces.ids().map(|f| found[f].map_or_else(|| before(f), |flank| flank.label)).collect())
}

fn settle(
    new: &Surface,
    found: &mut IdVec<Face, Option<Flank>>,
    waiting: &mut Vec<(FaceId, Flank)>,
    f: FaceId,
    flank: Flank,
) -> Result<(), SplitError> {
    match found[f] {
        None => {
            found[f] = Some(flank);
            waiting.push((f, flank));
            Ok(())
        }
        Some(known) if known.label == flank.label => Ok(()),
        Some(known) => Err(SplitError::Labels {
            curves: [known.curve, flank.curve],
            labels: [known.label, flank.label],
            at: new.points[new.faces[f][0]],
        }),
    }
}
