//! What fitted patches are worth: distances between them and the mesh, angles along their seams.

use glam::DVec3;
use rayon::prelude::*;

use super::fit::Fit;
use super::frame::Frame;
use super::sample::{tessellate, triangles};
use super::{at_seam, normal, on_side};
use crate::mesh::bvh::TriangleBvh;
use crate::mesh::patches::{Patch, Seam};
use crate::mesh::{Facet, Soup, Surface};
use crate::metric::summary::rms;

/// How far each patch and the mesh are apart: largest and root mean square distance, both ways.
pub(super) struct Distances {
    surface: TriangleBvh,
    /// Places of patches as they were measured last, each with its distance: most do not move between two rounds.
    last: (Vec<DVec3>, Vec<f64>),
}

impl Distances {
    pub(super) fn from(surface: &Surface) -> Self {
        Self { surface: TriangleBvh::of_surface(surface), last: Default::default() }
    }

    /// Of each element: of its vertices from all patches together, and of places of its patch from the mesh. So a patch
    /// that reaches out over a notch in the border counts as what it is.
    pub(super) fn of(&mut self, frame: &Frame<'_>, fits: &[Fit]) -> Vec<(f64, f64)> {
        /// Elements of the mesh for distances along a side of a patch.
        const FINE: usize = 16;
        let patches: Vec<Patch> = fits.iter().map(|fit| fit.patch.clone()).collect();
        let fine: Soup = tessellate(frame, &patches, FINE);
        let tree = TriangleBvh::of_surface(&triangles(&fine));
        self.measure(fine.points.as_slice());
        let out = &self.last.1;
        let facets: Vec<&Facet> = fine.faces.iter().collect();
        let ground = frame.layout.ground;
        let of_element = |(e, fit): (usize, &Fit)| {
            let own = fit.samples.points.iter().zip(&fit.samples.places).map(|(&p, &place)| {
                let [u, v] = fit.patch.foot(p, place);
                let own = fit.patch.point(u, v).distance(p);
                tree.closest_within(p, own * own).map_or(own, |near| near.distance().min(own))
            });
            let rim = frame.sides[e].iter().enumerate().flat_map(|(side, &(arc, is_along))| {
                let path = &frame.arcs[arc].path;
                let share = move |k: usize| k as f64 / (path.len() - 1) as f64;
                path.iter().enumerate().map(move |(k, &v)| (side, if is_along { share(k) } else { 1.0 - share(k) }, v))
            });
            let rim = rim.map(|(side, t, v)| {
                let p = ground.point(v);
                let [u, v] = fit.patch.foot(p, on_side(side, frame.sides[e].len(), t));
                distance(&tree, p).min(fit.patch.point(u, v).distance(p))
            });
            let back = facets[e * FINE * FINE..(e + 1) * FINE * FINE].iter().flat_map(|f| f.corners());
            let all: Vec<f64> = own.chain(rim).chain(back.map(|&v| out[v.index()])).collect();
            (all.iter().copied().fold(0.0, f64::max), rms(&all).unwrap_or(0.0))
        };
        fits.par_iter().enumerate().map(of_element).collect()
    }

    fn measure(&mut self, points: &[DVec3]) {
        let (places, distances) = &self.last;
        let again = |(k, &p): (usize, &DVec3)| match places.get(k) {
            Some(&last) if last == p => distances[k],
            _ => distance(&self.surface, p),
        };
        self.last = (points.to_vec(), points.par_iter().enumerate().map(again).collect());
    }
}

fn distance(tree: &TriangleBvh, p: DVec3) -> f64 {
    tree.closest(p).map_or(0.0, |near| near.distance())
}

/// The angle between the tangent planes along each inner arc.
pub(super) fn seams(frame: &Frame<'_>, fits: &[Fit]) -> Vec<Seam> {
    /// Places along a seam where the planes are compared; the ends are common to more than two patches.
    const PLACES: usize = 16;
    let seam = |arc: usize| {
        let mut angle = 0.0_f64;
        let mut pair = None;
        for k in 1..PLACES {
            let [a, b] = at_seam(frame, arc, k as f64 / PLACES as f64)?;
            let normals = [a, b].map(|(e, uv)| normal(&fits[e].patch, uv));
            // Planes have no sides: at a corner of nearly 180 degrees the order of the derivatives may swap.
            let between = crate::mesh::geometry::angle(normals[0], normals[1]).to_degrees();
            angle = angle.max(between.min(180.0 - between));
            pair = Some([a.0 as u32, b.0 as u32]);
        }
        pair.map(|patches| Seam { patches, angle, is_smooth: frame.arcs[arc].is_smooth })
    };
    (0..frame.arcs.len()).filter_map(seam).collect()
}
