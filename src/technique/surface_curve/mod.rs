//! Polylines on a surface: networks of arcs that become shorter and smoother without crossing each other.
//!
//! A network is a set of arcs whose points lie on vertices or inside edges, neighbouring points in one face. Two ways
//! to straighten it: [`unfold`], local moves by unfolding faces into the plane after D. Martínez, L. Velho,
//! P. C. Carvalho, *Computing geodesics on triangular meshes*, Computers & Graphics 29(5), 2005; and [`flip`], edge
//! flips of an intrinsic triangulation after N. Sharp, K. Crane, *You can find geodesic paths in triangle meshes by
//! just flipping edges*, ACM Transactions on Graphics 39(6), 2020, whose paths `trace` draws on the surface.
//!
//! Invariants of both: junctions, rims, pinned vertices and marked edges stay; arcs meet nothing but at their ends; no
//! arc passes over a vertex or an arc that it may not touch, so the network stays the same up to sliding; no arc grows.

pub mod flip;
mod intrinsic;
pub mod network;
#[cfg(test)]
mod tests;
mod trace;
pub mod unfold;

pub use network::{Network, Place};
