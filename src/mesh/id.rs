//! Typed indices and the vectors they index.
//!
//! A vertex number cannot be used where a face number is meant: `Id<Vertex>` and `Id<Face>` are different types.
//! An id is 4 bytes; a mesh holds at most `u32::MAX - 1` elements of a kind.

use std::fmt;
use std::hash::{Hash, Hasher};
use std::marker::PhantomData;
use std::ops::{Index, IndexMut};

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Names the kind of element in debug output.
pub trait Kind {
    /// One letter, as in `v12`.
    const LETTER: char;
}

/// Marks vertex ids.
pub enum Vertex {}
/// Marks edge ids.
pub enum Edge {}
/// Marks half-edge ids.
pub enum Halfedge {}
/// Marks face ids.
pub enum Face {}

impl Kind for Vertex {
    const LETTER: char = 'v';
}
impl Kind for Edge {
    const LETTER: char = 'e';
}
impl Kind for Halfedge {
    const LETTER: char = 'h';
}
impl Kind for Face {
    const LETTER: char = 'f';
}

/// An index of one kind of element.
pub struct Id<K> {
    raw: u32,
    kind: PhantomData<fn() -> K>,
}

/// A vertex.
pub type VertexId = Id<Vertex>;
/// An undirected edge of the workshop.
pub type EdgeId = Id<Edge>;
/// A directed side of an edge of the workshop.
pub type HalfedgeId = Id<Halfedge>;
/// A face.
pub type FaceId = Id<Face>;

impl<K> Id<K> {
    /// The id of element `index`.
    ///
    /// # Panics
    /// If `index` does not fit in 32 bits; readers refuse such meshes.
    #[inline]
    pub fn new(index: usize) -> Self {
        debug_assert!(u32::try_from(index).is_ok());
        Self { raw: index as u32, kind: PhantomData }
    }

    /// The id with this raw number.
    #[inline]
    pub const fn from_raw(raw: u32) -> Self {
        Self { raw, kind: PhantomData }
    }

    /// The raw number.
    #[inline]
    pub const fn raw(self) -> u32 {
        self.raw
    }

    /// The number as an index.
    #[inline]
    pub const fn index(self) -> usize {
        self.raw as usize
    }
}

impl<K> Clone for Id<K> {
    #[inline]
    fn clone(&self) -> Self {
        *self
    }
}
impl<K> Copy for Id<K> {}
impl<K> PartialEq for Id<K> {
    #[inline]
    fn eq(&self, other: &Self) -> bool {
        self.raw == other.raw
    }
}
impl<K> Eq for Id<K> {}
impl<K> PartialOrd for Id<K> {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
impl<K> Ord for Id<K> {
    #[inline]
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.raw.cmp(&other.raw)
    }
}
impl<K> Hash for Id<K> {
    #[inline]
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.raw.hash(state);
    }
}
impl<K: Kind> fmt::Debug for Id<K> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", K::LETTER, self.raw)
    }
}
impl<K: Kind> fmt::Display for Id<K> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.raw)
    }
}
impl<K> Serialize for Id<K> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.raw.serialize(serializer)
    }
}
impl<'de, K> Deserialize<'de> for Id<K> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        u32::deserialize(deserializer).map(Self::from_raw)
    }
}

/// A vector indexed by ids of kind `K`.
#[derive(Serialize, Deserialize)]
#[serde(transparent)]
pub struct IdVec<K, T> {
    items: Vec<T>,
    #[serde(skip)]
    kind: PhantomData<fn() -> K>,
}

impl<K, T> IdVec<K, T> {
    /// An empty vector.
    pub const fn new() -> Self {
        Self { items: Vec::new(), kind: PhantomData }
    }

    /// An empty vector with room for `capacity` items.
    pub fn with_capacity(capacity: usize) -> Self {
        Vec::with_capacity(capacity).into()
    }

    /// Number of items.
    #[inline]
    pub fn len(&self) -> usize {
        self.items.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }

    /// Appends an item and returns its id.
    #[inline]
    pub fn push(&mut self, item: T) -> Id<K> {
        let id = Id::new(self.items.len());
        self.items.push(item);
        id
    }

    /// The item, or `None` when the id is out of range.
    pub fn get(&self, id: Id<K>) -> Option<&T> {
        self.items.get(id.index())
    }

    /// All ids in order.
    pub fn ids(&self) -> impl DoubleEndedIterator<Item = Id<K>> + ExactSizeIterator + Clone + use<K, T> {
        (0..self.items.len()).map(Id::new)
    }

    /// Items in order.
    pub fn iter(&self) -> std::slice::Iter<'_, T> {
        self.items.iter()
    }

    /// Items in order, for change.
    pub fn iter_mut(&mut self) -> std::slice::IterMut<'_, T> {
        self.items.iter_mut()
    }

    /// Ids with their items.
    pub fn enumerate(&self) -> impl DoubleEndedIterator<Item = (Id<K>, &T)> + ExactSizeIterator {
        self.items.iter().enumerate().map(|(i, item)| (Id::new(i), item))
    }

    /// The items as a slice.
    pub fn as_slice(&self) -> &[T] {
        &self.items
    }

    /// The items as a plain vector, for bulk work.
    pub fn into_vec(self) -> Vec<T> {
        self.items
    }
}

impl<K, T: Clone> IdVec<K, T> {
    /// `len` copies of `item`.
    pub fn filled(item: T, len: usize) -> Self {
        vec![item; len].into()
    }
}

impl<K, T> From<Vec<T>> for IdVec<K, T> {
    fn from(items: Vec<T>) -> Self {
        Self { items, kind: PhantomData }
    }
}
impl<K, T> FromIterator<T> for IdVec<K, T> {
    fn from_iter<I: IntoIterator<Item = T>>(iter: I) -> Self {
        iter.into_iter().collect::<Vec<T>>().into()
    }
}
impl<K, T> Default for IdVec<K, T> {
    fn default() -> Self {
        Self::new()
    }
}
impl<K, T: Clone> Clone for IdVec<K, T> {
    fn clone(&self) -> Self {
        self.items.clone().into()
    }
}
impl<K, T: PartialEq> PartialEq for IdVec<K, T> {
    fn eq(&self, other: &Self) -> bool {
        self.items == other.items
    }
}
impl<K, T: fmt::Debug> fmt::Debug for IdVec<K, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.items.fmt(f)
    }
}
impl<K, T> Index<Id<K>> for IdVec<K, T> {
    type Output = T;
    #[inline]
    fn index(&self, id: Id<K>) -> &T {
        &self.items[id.index()]
    }
}
impl<K, T> IndexMut<Id<K>> for IdVec<K, T> {
    #[inline]
    fn index_mut(&mut self, id: Id<K>) -> &mut T {
        &mut self.items[id.index()]
    }
}
impl<'a, K, T> IntoIterator for &'a IdVec<K, T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;
    fn into_iter(self) -> Self::IntoIter {
        self.items.iter()
    }
}
impl<'a, K, T> IntoIterator for &'a mut IdVec<K, T> {
    type Item = &'a mut T;
    type IntoIter = std::slice::IterMut<'a, T>;
    fn into_iter(self) -> Self::IntoIter {
        self.items.iter_mut()
    }
}
