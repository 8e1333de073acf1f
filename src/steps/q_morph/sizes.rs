//! The edge length asked for at each vertex of the surface.

use super::QMorphParams;
use crate::mesh::geometry::{Aabb, angle, area_vector, triangle_area};
use crate::mesh::topology::EdgeTable;
use crate::mesh::{Surface, VertexId};
use crate::step::{ResolvedSizing, StepFailure};
use crate::technique::mixed::Mixed;

/// Gives every vertex of the workshop its size, times `scale`.
pub(super) fn set(mesh: &mut Mixed, surface: &Surface, params: &QMorphParams, scale: f64) -> Result<(), StepFailure> {
    let diagonal = Aabb::of(surface.points.iter().copied()).diagonal();
    let mut sizes = vec![f64::INFINITY; surface.points.len()];
    match params.size.resolve(surface, diagonal)? {
        ResolvedSizing::Uniform(length) => sizes.fill(length),
        ResolvedSizing::Corners(corners) => {
            for (f, values) in surface.faces.iter().zip(&corners) {
                for (v, value) in f.iter().zip(values) {
                    sizes[v.index()] = sizes[v.index()].min(*value);
                }
            }
        }
    }
    if params.size_curvature > 0.0 {
        for (size, curvature) in sizes.iter_mut().zip(curvatures(surface)) {
            if curvature > 0.0 {
                *size = size.min(std::f64::consts::TAU / (params.size_curvature * curvature));
            }
        }
    }
    for (v, size) in sizes.into_iter().enumerate() {
        mesh.set_size(v as u32, scale * size);
    }
    Ok(())
}

/// The bend per length at each vertex, of smooth edges only: the sum over its edges of angle times length, over the
/// area that belongs to them.
fn curvatures(surface: &Surface) -> Vec<f64> {
    let edges = EdgeTable::new(surface);
    let mut bend = vec![0.0; surface.points.len()];
    let mut area = vec![0.0; surface.points.len()];
    for (_, key, sides) in edges.iter() {
        let [s, t] = sides else { continue };
        if surface.carried.marks.contains_key(&key) {
            continue;
        }
        let [f, g] = [s.face, t.face].map(|f| surface.corners(f));
        let length = (surface.points[key[0]] - surface.points[key[1]]).length();
        let turned = angle(area_vector(f), area_vector(g)) * length;
        let belongs = (triangle_area(f) + triangle_area(g)) / 3.0;
        for v in key {
            let v: VertexId = v;
            bend[v.index()] += turned;
            area[v.index()] += belongs;
        }
    }
    bend.iter().zip(&area).map(|(b, a)| if *a > 0.0 { b / a } else { 0.0 }).collect()
}
