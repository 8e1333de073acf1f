//! Room for elements where a mesh is too coarse: faces there are cut in four before anything is laid over them.

use rustc_hash::FxHashSet;

use super::ground::Ground;
use crate::mesh::id::Face;
use crate::mesh::{FaceId, IdVec, Surface, VertexId};
use crate::technique::refine::{RefineError, quarter};
use crate::watch::Cancelled;

/// A surface that is made finer where it has to be.
#[derive(Clone, Debug)]
pub struct Room {
    /// The surface as it is now.
    pub surface: Surface,
    /// The faces cut in each round, as the round before left them.
    pub cuts: Vec<Vec<FaceId>>,
    /// For each face now the one that it is a part of.
    parents: IdVec<Face, FaceId>,
    /// The limit of faces.
    most: usize,
}

impl Room {
    /// The surface as it is.
    pub fn new(surface: &Surface) -> Self {
        /// It does not get more than so many times the faces that it has, and some.
        const GROWTH: usize = 4;
        const SOME: usize = 100_000;
        let most = GROWTH * surface.faces.len() + SOME;
        Self { surface: surface.clone(), cuts: Vec::new(), parents: surface.faces.ids().collect(), most }
    }

    /// The faces of the first surface that these are parts of.
    pub fn origins(&self, faces: &[FaceId]) -> Vec<FaceId> {
        let mut origins: Vec<FaceId> = faces.iter().map(|&f| self.parents[f]).collect();
        origins.sort_unstable();
        origins.dedup();
        origins
    }

    /// Cuts these faces in four, in rising order; for each face now the one before that it is a part of. `None` where
    /// that does not help.
    ///
    /// # Errors
    /// The run was interrupted.
    pub fn cut(&mut self, faces: Vec<FaceId>) -> Result<Option<IdVec<Face, FaceId>>, Cancelled> {
        /// What is still too coarse after so many rounds will remain so.
        const ROUNDS: usize = 24;
        if self.cuts.len() >= ROUNDS {
            return Ok(None);
        }
        match quarter(&self.surface, &faces, self.most) {
            Ok((surface, parents)) if surface.faces.len() > self.surface.faces.len() => {
                self.parents = parents.iter().map(|&f| self.parents[f]).collect();
                self.surface = surface;
                self.cuts.push(faces);
                Ok(Some(parents))
            }
            Err(RefineError::Cancelled(cancelled)) => Err(cancelled),
            Ok(_) | Err(_) => Ok(None),
        }
    }
}

/// Faces with those near them, in rising order.
pub fn with_rings(ground: &Ground<'_>, faces: &[FaceId]) -> Vec<FaceId> {
    /// Rings of faces round a place: what is beside a narrow cell is narrow too.
    const RINGS: usize = 3;
    let mut chosen: FxHashSet<FaceId> = faces.iter().copied().collect();
    let mut front: Vec<FaceId> = faces.to_vec();
    for _ in 0..RINGS {
        let mut corners: Vec<VertexId> = front.iter().flat_map(|&f| ground.surface.faces[f]).collect();
        corners.sort_unstable();
        corners.dedup();
        let beside = corners.iter().flat_map(|&v| ground.faces_at.of(v)).copied();
        front = beside.filter(|&f| chosen.insert(f)).collect();
    }
    let mut all: Vec<FaceId> = chosen.into_iter().collect();
    all.sort_unstable();
    all
}

/// A surface with the faces of a list of rounds cut in four; `None` where it has no such faces.
pub fn cut_again(surface: &Surface, cuts: &[Vec<FaceId>]) -> Option<Surface> {
    let mut fine = surface.clone();
    for faces in cuts {
        if faces.iter().any(|f| f.index() >= fine.faces.len()) {
            return None;
        }
        fine = quarter(&fine, faces, usize::MAX).ok()?.0;
    }
    Some(fine)
}
