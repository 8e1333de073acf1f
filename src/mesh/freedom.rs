//! Resolves marks, pins, seams and a step's locks into the freedom of each vertex and edge.
//!
//! A vertex is as strict as its pin, or `Keep` where a kept edge or a seam touches it, or where its on-curve edges do
//! not just pass through (their number is not 2, or they turn by more than 45 degrees where no mark says otherwise),
//! or `OnCurve` where exactly two on-curve edges meet. Invariant: a free vertex has no strict edge.
//! O(F + marks) time for bounded valence.

use std::collections::BTreeSet;

use super::carried::{EdgeKey, Freedom, Groups, MarkCause, edge_key};
use super::id::{FaceId, IdVec, Vertex, VertexId};
use super::surface::Surface;
use rustc_hash::{FxHashMap, FxHashSet};

/// What edits may do to the rims of an open surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rim {
    /// Rim vertices and edges are identical in the result.
    Exact,
    /// Rims may be split and collapsed along themselves.
    #[default]
    Curve,
    /// Rims are as free as the rest.
    Free,
}

/// The locks of one step: group names by what they forbid.
#[derive(Clone, Copy, Debug, Default)]
pub struct LockRules<'a> {
    /// Groups whose elements are identical in the result.
    pub keep: &'a [String],
    /// Groups whose edges, or whose borders for face groups, only change along their curve.
    pub on_curve: &'a [String],
    /// Face groups that may change while the rest is kept. Empty: everything may change.
    pub only: &'a [String],
    /// What happens to rims.
    pub rim: Rim,
}

impl LockRules<'_> {
    /// Whether elements are locked by name, which then stay whatever else they are.
    pub fn name_elements(&self) -> bool {
        !(self.keep.is_empty() && self.only.is_empty())
    }
}

/// Why locks cannot be resolved.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FreedomError {
    /// No group has this name.
    #[error("there is no group `{name}`; known groups: {}", list(known))]
    UnknownGroup {
        /// As asked for.
        name: String,
        /// The names there are.
        known: Vec<String>,
    },
    /// `only` takes face groups.
    #[error("`only` takes face groups, and `{name}` is none; face groups: {}", list(known))]
    NotAFaceGroup {
        /// As asked for.
        name: String,
        /// The names of the face groups.
        known: Vec<String>,
    },
}

fn list(names: &[String]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// The freedom of each vertex, and of the edges that are not free.
#[derive(Clone, Debug, Default)]
pub struct ResolvedFreedom {
    /// By vertex.
    pub vertices: IdVec<Vertex, Freedom>,
    edges: FxHashMap<EdgeKey, Freedom>,
    /// Edges that are kept only because they lie on a seam: all copies may be split alike.
    seam_edges: FxHashSet<EdgeKey>,
}

impl ResolvedFreedom {
    /// Everything free: for algorithms on meshes without marks.
    pub fn free(surface: &Surface) -> Self {
        let vertices = IdVec::filled(Freedom::Free, surface.points.len());
        Self { vertices, ..Self::default() }
    }

    /// Whether an edge may be halved: seams too, if all copies are halved alike.
    #[inline]
    pub fn may_halve(&self, key: EdgeKey) -> bool {
        self.edge(key) != Freedom::Keep || self.seam_edges.contains(&key)
    }

    /// Lets collapses run along an edge that is no curve: for merging corners that it joins.
    pub fn make_curve(&mut self, key: EdgeKey) {
        self.edges.entry(key).or_insert(Freedom::OnCurve);
    }

    /// The freedom of an edge.
    #[inline]
    pub fn edge(&self, key: EdgeKey) -> Freedom {
        self.edges.get(&key).copied().unwrap_or(Freedom::Free)
    }
}

/// Resolves what the surface carries and a step's locks.
///
/// # Errors
/// A group name that the surface does not have.
pub fn resolve_freedom(surface: &Surface, locks: &LockRules<'_>) -> Result<ResolvedFreedom, FreedomError> {
    let mut draft = Draft::new(surface);
    draft.marks(locks.rim);
    draft.rims(locks.rim);
    for name in locks.keep {
        draft.keep(name)?;
    }
    for name in locks.on_curve {
        draft.on_curve(name)?;
    }
    if !locks.only.is_empty() {
        draft.only(locks.only)?;
    }
    Ok(draft.finish())
}

struct Draft<'a> {
    surface: &'a Surface,
    groups: &'a Groups,
    edges: FxHashMap<EdgeKey, Freedom>,
    pins: IdVec<Vertex, Freedom>,
}

impl<'a> Draft<'a> {
    fn new(surface: &'a Surface) -> Self {
        let mut pins = IdVec::filled(Freedom::Free, surface.points.len());
        for (&v, &pin) in &surface.carried.pins {
            if pins.get(v).is_some() {
                pins[v] = pin;
            }
        }
        for &v in surface.carried.seams.keys() {
            if pins.get(v).is_some() {
                pins[v] = Freedom::Keep;
            }
        }
        Self { surface, groups: &surface.carried.groups, edges: FxHashMap::default(), pins }
    }

    fn restrict(&mut self, edge: EdgeKey, freedom: Freedom) {
        let entry = self.edges.entry(edge).or_insert(freedom);
        *entry = (*entry).max(freedom);
    }

    fn marks(&mut self, rim: Rim) {
        for (&edge, mark) in &self.surface.carried.marks {
            match mark.cause {
                MarkCause::Seam => {}
                MarkCause::Boundary if rim == Rim::Free => {}
                MarkCause::Boundary | MarkCause::Feature | MarkCause::RegionBorder | MarkCause::Locked => {
                    self.restrict(edge, mark.freedom);
                }
            }
        }
    }

    fn rims(&mut self, rim: Rim) {
        let freedom = match rim {
            Rim::Exact => Freedom::Keep,
            Rim::Curve => Freedom::OnCurve,
            Rim::Free => return,
        };
        for edge in borders(self.surface, |_| true) {
            self.restrict(edge, freedom);
        }
    }

    fn keep_faces(&mut self, faces: impl Iterator<Item = FaceId>) {
        for f in faces {
            if let Some(&[a, b, c]) = self.surface.faces.get(f) {
                for edge in [edge_key(a, b), edge_key(b, c), edge_key(c, a)] {
                    self.restrict(edge, Freedom::Keep);
                }
            }
        }
    }

    fn pin(&mut self, vertices: &[VertexId], freedom: Freedom) {
        for &v in vertices {
            self.pins[v] = self.pins[v].max(freedom);
        }
    }

    fn known(&self, name: &str) -> Result<(), FreedomError> {
        if self.groups.contains(name) {
            return Ok(());
        }
        let known: BTreeSet<&str> = self.groups.list().map(|(_, name, _)| name).collect();
        Err(FreedomError::UnknownGroup { name: name.to_owned(), known: known.into_iter().map(str::to_owned).collect() })
    }

    fn keep(&mut self, name: &str) -> Result<(), FreedomError> {
        self.known(name)?;
        let groups = self.groups;
        self.keep_faces(groups.faces.get(name).into_iter().flatten().copied());
        for &edge in groups.edges.get(name).into_iter().flatten() {
            self.restrict(edge, Freedom::Keep);
        }
        self.pin(groups.vertices.get(name).map_or(&[], Vec::as_slice), Freedom::Keep);
        Ok(())
    }

    fn on_curve(&mut self, name: &str) -> Result<(), FreedomError> {
        self.known(name)?;
        let groups = self.groups;
        if let Some(faces) = groups.faces.get(name) {
            for edge in borders(self.surface, |f| faces.binary_search(&f).is_ok()) {
                self.restrict(edge, Freedom::OnCurve);
            }
        }
        for &edge in groups.edges.get(name).into_iter().flatten() {
            self.restrict(edge, Freedom::OnCurve);
        }
        self.pin(groups.vertices.get(name).map_or(&[], Vec::as_slice), Freedom::OnCurve);
        Ok(())
    }

    fn only(&mut self, names: &[String]) -> Result<(), FreedomError> {
        let mut may_change = vec![false; self.surface.faces.len()];
        for name in names {
            let Some(faces) = self.groups.faces.get(name) else {
                let known = self.groups.faces.keys().cloned().collect();
                return Err(FreedomError::NotAFaceGroup { name: name.clone(), known });
            };
            for f in faces {
                may_change[f.index()] = true;
            }
        }
        self.keep_faces(self.surface.faces.ids().filter(|f| !may_change[f.index()]));
        Ok(())
    }

    /// Seams come last, to tell the edges that nothing else keeps.
    fn seams(&mut self) -> FxHashSet<EdgeKey> {
        let mut halved = FxHashSet::default();
        for (&edge, mark) in &self.surface.carried.marks {
            if mark.cause == MarkCause::Seam {
                if self.edges.get(&edge) != Some(&Freedom::Keep) {
                    halved.insert(edge);
                }
                self.restrict(edge, Freedom::Keep);
            }
        }
        halved
    }

    fn finish(mut self) -> ResolvedFreedom {
        let seam_edges = self.seams();
        let mut vertices = self.pins.clone();
        let mut strict: Vec<(EdgeKey, Freedom)> = self.edges.iter().map(|(&edge, &freedom)| (edge, freedom)).collect();
        strict.sort_unstable();
        let mut curves: FxHashMap<VertexId, CurveEnds> = FxHashMap::default();
        for &([a, b], freedom) in &strict {
            if a.index() >= vertices.len() || b.index() >= vertices.len() {
                continue;
            }
            for (v, other) in [(a, b), (b, a)] {
                match freedom {
                    Freedom::Free => {}
                    Freedom::OnCurve => curves.entry(v).or_default().add(other),
                    Freedom::Keep => vertices[v] = Freedom::Keep,
                }
            }
        }
        for v in self.surface.points.ids() {
            if let Some(ends) = curves.get(&v) {
                vertices[v] = vertices[v].max(self.on_curves(v, *ends));
            }
        }
        ResolvedFreedom { vertices, edges: self.edges, seam_edges }
    }

    fn on_curves(&self, v: VertexId, ends: CurveEnds) -> Freedom {
        let [a, b] = ends.first;
        if ends.count != 2 {
            return Freedom::Keep;
        }
        // Marked curves have had their corners pinned by whoever marked them, with an angle of their own.
        let is_marked = |w| self.surface.carried.marks.contains_key(&edge_key(v, w));
        if is_marked(a) && is_marked(b) {
            return Freedom::OnCurve;
        }
        let [p, q, r] = [a, v, b].map(|w| self.surface.points[w]);
        if turns_sharply(q - p, r - q) { Freedom::Keep } else { Freedom::OnCurve }
    }
}

/// Whether two directions differ by more than 45 degrees.
fn turns_sharply(u: glam::DVec3, w: glam::DVec3) -> bool {
    u.dot(w) < std::f64::consts::FRAC_1_SQRT_2 * (u.length_squared() * w.length_squared()).sqrt()
}

/// The on-curve edges at one vertex: their number and the other ends of the first two.
#[derive(Clone, Copy)]
struct CurveEnds {
    count: u32,
    first: [VertexId; 2],
}

impl Default for CurveEnds {
    fn default() -> Self {
        Self { count: 0, first: [VertexId::from_raw(0); 2] }
    }
}

impl CurveEnds {
    fn add(&mut self, other: VertexId) {
        if let Some(slot) = self.first.get_mut(self.count as usize) {
            *slot = other;
        }
        self.count += 1;
    }
}

/// The edges with exactly one side in the faces chosen, sorted.
fn borders(surface: &Surface, chosen: impl Fn(FaceId) -> bool) -> Vec<EdgeKey> {
    let mut sides: Vec<EdgeKey> = Vec::new();
    for (f, &[a, b, c]) in surface.faces.enumerate() {
        if chosen(f) {
            sides.extend([edge_key(a, b), edge_key(b, c), edge_key(c, a)]);
        }
    }
    sides.sort_unstable();
    sides.chunk_by(|a, b| a == b).filter(|same| same.len() == 1).map(|same| same[0]).collect()
}
