//! Exact welding: one vertex for each distinct coordinate triple.
//!
//! An open-addressing table of vertex numbers over the points themselves; points keep the order of their first
//! appearance, so that the result does not depend on the hash. Expected O(corners) time, 4 to 8 bytes a vertex
//! besides the points. Negative zero is zero.

use glam::DVec3;

use crate::mesh::VertexId;

const FREE: u32 = u32::MAX;

/// Gives equal points equal ids.
#[derive(Debug)]
pub(super) struct Welder {
    points: Vec<DVec3>,
    /// Vertex numbers by hash, linear probing, at most half full; the length is a power of two.
    slots: Vec<u32>,
}

impl Welder {
    /// A welder that expects about `points` distinct points.
    pub(super) fn new(points: usize) -> Self {
        let slots = (2 * points).next_power_of_two().max(64);
        Self { points: Vec::with_capacity(points), slots: vec![FREE; slots] }
    }

    /// The vertex at this finite position, a new one if there is none. `None` when no id is left.
    #[inline]
    pub(super) fn vertex(&mut self, position: DVec3) -> Option<VertexId> {
        // Adding zero turns negative zero into zero and changes nothing else.
        let position = position + DVec3::ZERO;
        let mask = self.slots.len() - 1;
        let mut slot = hash(position) as usize & mask;
        while self.slots[slot] != FREE {
            let known = self.slots[slot];
            if self.points[known as usize] == position {
                return Some(VertexId::from_raw(known));
            }
            slot = (slot + 1) & mask;
        }
        let id = u32::try_from(self.points.len()).ok().filter(|&id| id != FREE)?;
        self.slots[slot] = id;
        self.points.push(position);
        if 2 * self.points.len() > self.slots.len() {
            self.grow();
        }
        Some(VertexId::from_raw(id))
    }

    /// The distinct points in order of their first appearance.
    pub(super) fn into_points(self) -> Vec<DVec3> {
        self.points
    }

    fn grow(&mut self) {
        let mask = 2 * self.slots.len() - 1;
        self.slots = vec![FREE; mask + 1];
        for (id, &position) in self.points.iter().enumerate() {
            let mut slot = hash(position) as usize & mask;
            while self.slots[slot] != FREE {
                slot = (slot + 1) & mask;
            }
            self.slots[slot] = id as u32;
        }
    }
}

/// Mixes three coordinates; the high half of each 128-bit product is folded in, because the low mantissa bits of
/// single-precision coordinates are all zero.
#[inline]
fn hash(p: DVec3) -> u64 {
    let a = fold(p.x.to_bits() ^ 0x243f_6a88_85a3_08d3, p.y.to_bits() ^ 0x1319_8a2e_0370_7344);
    fold(a ^ p.z.to_bits(), 0x9e37_79b9_7f4a_7c15)
}

#[inline]
fn fold(a: u64, b: u64) -> u64 {
    let product = u128::from(a) * u128::from(b);
    (product as u64) ^ ((product >> 64) as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_points_share_an_id_in_order_of_first_appearance() {
        let mut welder = Welder::new(0);
        let ids: Vec<u32> = (0..1000)
            .map(|i| DVec3::new(f64::from(i % 400), 0.5, -1.0))
            .filter_map(|p| welder.vertex(p))
            .map(VertexId::raw)
            .collect();
        assert_eq!(ids.len(), 1000);
        assert!(ids.iter().enumerate().all(|(i, &id)| id as usize == i % 400));
        assert_eq!(welder.into_points().len(), 400);
    }

    #[test]
    fn negative_zero_is_zero() {
        let mut welder = Welder::new(4);
        assert_eq!(welder.vertex(DVec3::new(-0.0, 1.0, 2.0)), welder.vertex(DVec3::new(0.0, 1.0, 2.0)));
        assert!(welder.into_points()[0].x.is_sign_positive());
    }
}
