//! Vertices of curves: put where the samples are, or spread evenly.

use super::{Remesher, Rules};
use crate::technique::ground::{Ground, respread, sample};
use crate::technique::mixed::{Mixed, NONE, Place};

/// A vertex nearer to a sample than this part of the spacing is moved there.
const NEAR: f64 = 0.3;

/// The vertices of each curve in order with their places along it, ends included.
pub fn chains(mesh: &Mixed, ground: &Ground<'_>) -> Vec<Vec<(f64, u32)>> {
    let mut chains: Vec<Vec<(f64, u32)>> = vec![Vec::new(); ground.curves.len()];
    for h in mesh.edges().filter(|&h| mesh.arc(h) != NONE) {
        let arc = mesh.arc(h) as usize;
        let curve = &ground.curves[arc];
        let ends = [curve.points[0], curve.points[curve.points.len() - 1]];
        for v in [mesh.origin(h), mesh.target(h)] {
            match mesh.place(v) {
                Place::Arc { at, .. } => chains[arc].push((at, v)),
                _ if curve.is_closed() => chains[arc].extend([(0.0, v), (curve.length(), v)]),
                _ => {
                    let [start, end] = ends.map(|p| (p - mesh.point(v)).length_squared());
                    chains[arc].push((if start <= end { 0.0 } else { curve.length() }, v));
                }
            }
        }
    }
    for list in &mut chains {
        list.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        list.dedup();
    }
    chains
}

/// The largest distance between a curve and the edges on it.
pub fn curve_distance(mesh: &Mixed, ground: &Ground<'_>) -> f64 {
    let sag = |(arc, chain): (usize, Vec<(f64, u32)>)| {
        let curve = &ground.curves[arc];
        chain.windows(2).map(|pair| curve.sag(pair[0].0, pair[1].0)).fold(0.0, f64::max)
    };
    chains(mesh, ground).into_iter().enumerate().map(sag).fold(0.0, f64::max)
}

/// Cuts an edge on a curve, which covers it between these lengths from its start, into three, so that the regions
/// beside it keep an even number of edges. Whether it could.
pub fn cut_in_three(mesh: &mut Mixed, ground: &Ground<'_>, rules: Rules, h: u32, [from, to]: [f64; 2]) -> bool {
    let (arc, last) = (mesh.arc(h), mesh.target(h));
    let size = mesh.length(h) / 3.0;
    let mut work = Remesher { surplus: Vec::new(), asleep: Vec::new(), mesh, ground, rules };
    let mut rest = Some(h);
    for share in [1.0 / 3.0, 2.0 / 3.0] {
        let at = from + share * (to - from);
        let point = ground.curves[arc as usize].at(at);
        let Some(h) = rest else { return false };
        let Some(v) = work.split(h, point, glam::DVec3::ZERO, Place::Arc { arc, at }, size) else { return false };
        rest = work.mesh.find(v, last);
    }
    true
}

impl Remesher<'_, '_> {
    /// Samples the curves and makes their vertices those of the samples; where the sizes `before` are given, only those
    /// with a vertex whose size is another now. Returns which.
    pub(super) fn resample_curves(&mut self, before: &[f64]) -> Vec<bool> {
        self.surplus = vec![false; self.mesh.vertex_slots() as usize];
        let mut chains = chains(self.mesh, self.ground);
        let changed = |&(_, v): &(f64, u32)| self.is_changed(v, before);
        let touched: Vec<bool> = chains.iter().map(|chain| chain.iter().any(changed)).collect();
        let place = |arc: usize| {
            if touched[arc] {
                self.samples_alike(arc, &chains[arc], before)
            } else {
                chains[arc].iter().map(|&(at, _)| at).collect()
            }
        };
        let mut places: Vec<Vec<f64>> = (0..chains.len()).map(place).collect();
        for arc in self.cramped(&places) {
            if touched[arc] {
                places[arc] = self.samples(arc, &chains[arc], 2);
            }
        }
        for (arc, chain) in chains.iter_mut().enumerate() {
            if !touched[arc] {
                continue;
            }
            if places[arc].len() == 2 && chain.len() > 1 {
                // A curve shorter than the size: its ends need smaller faces, or nothing between them could move.
                let length = self.ground.curves[arc].length();
                for end in [chain[0].1, chain[chain.len() - 1].1] {
                    let size = self.mesh.size(end).min((1.2 * length).max(self.rules.least_size));
                    self.mesh.set_size(end, size);
                }
            }
            if chain.len() > 1 {
                self.fit_curve(arc as u32, chain, &places[arc]);
            }
        }
        touched
    }

    /// Where the vertices of a curve should be. Where sizes are lowered, an even number of pieces more, so that no
    /// region far away has to change for it.
    fn samples_alike(&self, arc: usize, chain: &[(f64, u32)], before: &[f64]) -> Vec<f64> {
        let mut places = self.samples(arc, chain, 1);
        if !before.is_empty() && places.len() % 2 != chain.len() % 2 {
            let length = |i: usize| places[i] - places[i - 1];
            let longest = (1..places.len()).max_by(|&i, &j| length(i).total_cmp(&length(j)));
            if let Some(i) = longest {
                places.insert(i, 0.5 * (places[i - 1] + places[i]));
            }
        }
        places
    }

    /// Where the vertices of a curve should be, with at least so many pieces.
    fn samples(&self, arc: usize, chain: &[(f64, u32)], least: usize) -> Vec<f64> {
        let curve = &self.ground.curves[arc];
        let sizes: Vec<(f64, f64)> = chain.iter().map(|&(at, v)| (at, self.mesh.size(v))).collect();
        let least = if curve.is_closed() { 4 } else { least };
        sample(curve, &sizes, self.rules.curve_tolerance, least, self.rules.shortest)
    }

    /// The curves of one piece round regions of so few pieces that quads would have flat corners there.
    fn cramped(&self, places: &[Vec<f64>]) -> Vec<usize> {
        let mut pieces = vec![(0, 0); self.ground.region_count()];
        for (arc, sides) in self.ground.beside.iter().enumerate() {
            for &region in sides.iter().filter(|&&r| r != NONE) {
                pieces[region as usize].0 += places[arc].len() - 1;
                pieces[region as usize].1 += 1;
            }
        }
        let is_cramped = |r: u32| r != NONE && pieces[r as usize].0 <= 5 && pieces[r as usize] != (4, 4);
        (0..places.len())
            .filter(|&arc| places[arc].len() == 2 && self.ground.beside[arc].iter().any(|&r| is_cramped(r)))
            .collect()
    }

    fn fit_curve(&mut self, arc: u32, chain: &mut Vec<(f64, u32)>, places: &[f64]) {
        let curve = &self.ground.curves[arc as usize];
        let inside: Vec<(f64, u32)> = chain[1..chain.len() - 1].to_vec();
        let mut taken = vec![false; inside.len()];
        let (mut missing, mut stuck) = (Vec::new(), Vec::new());
        for k in 1..places.len().saturating_sub(1) {
            let reach = NEAR * (places[k] - places[k - 1]).min(places[k + 1] - places[k]);
            let near = inside.partition_point(|&(at, _)| at < places[k]);
            let pick = [near.wrapping_sub(1), near]
                .into_iter()
                .filter(|&i| i < inside.len() && !taken[i] && (inside[i].0 - places[k]).abs() <= reach)
                .min_by(|&i, &j| (inside[i].0 - places[k]).abs().total_cmp(&(inside[j].0 - places[k]).abs()));
            // The longer one of both pieces: where a bend makes one short, the other must not follow it.
            let size = (places[k + 1] - places[k]).max(places[k] - places[k - 1]);
            match pick {
                Some(i) => {
                    taken[i] = true;
                    let place = Place::Arc { arc, at: places[k] };
                    if self.try_move(inside[i].1, curve.at(places[k]), glam::DVec3::ZERO, place) {
                        chain[i + 1].0 = places[k];
                    } else {
                        stuck.push((places[k], size, inside[i].1));
                    }
                    self.note_size(inside[i].1, size);
                }
                None => missing.push((places[k], size)),
            }
        }
        for (i, &(_, v)) in inside.iter().enumerate() {
            self.surplus[v as usize] = !taken[i];
        }
        for (at, size) in missing {
            self.insert(arc, chain, at, size);
        }
        for (at, size, v) in stuck {
            let next = chain.partition_point(|&(s, _)| s < at).clamp(1, chain.len() - 1);
            if curve.sag(chain[next - 1].0, chain[next].0) > self.rules.curve_tolerance {
                self.insert(arc, chain, at, size);
                self.surplus[v as usize] = true;
            }
        }
    }

    /// The size at a curve's vertex is never above the spacing that the curve's bend asked for.
    fn note_size(&mut self, v: u32, spacing: f64) {
        let size = self.mesh.size(v).min(1.15 * spacing);
        self.mesh.set_size(v, size);
    }

    fn insert(&mut self, arc: u32, chain: &mut Vec<(f64, u32)>, at: f64, size: f64) {
        let place = chain.partition_point(|&(s, _)| s < at).clamp(1, chain.len() - 1);
        let (a, b) = (chain[place - 1].1, chain[place].1);
        let Some(h) = self.mesh.star(a).find(|&h| self.mesh.target(h) == b && self.mesh.arc(h) == arc) else { return };
        let point = self.ground.curves[arc as usize].at(at);
        if let Some(v) = self.split(h, point, glam::DVec3::ZERO, Place::Arc { arc, at }, size) {
            chain.insert(place, (at, v));
            self.surplus.resize(self.mesh.vertex_slots() as usize, false);
        }
    }

    /// Spreads the vertices of each curve evenly by the sizes there, where both regions beside it are awake.
    pub(super) fn even_curves(&mut self, awake: &[bool]) {
        for (arc, chain) in chains(self.mesh, self.ground).into_iter().enumerate() {
            let sleeps = |&region: &u32| region != NONE && !awake[region as usize];
            let curve = &self.ground.curves[arc];
            // In a piece of a mesh there may be a piece of the curve only, or vertices of its rim that lie on the
            // curve.
            let is_whole = |chain: &[(f64, u32)]| {
                let ends = [chain[0].1, chain[chain.len() - 1].1].map(|v| self.mesh.point(v));
                ends == [curve.points[0], curve.points[curve.points.len() - 1]]
                    && chain.windows(2).all(|pair| pair[0].0 < pair[1].0)
            };
            if chain.len() < 3 || self.ground.beside[arc].iter().any(sleeps) || !is_whole(&chain) {
                continue;
            }
            let sizes: Vec<(f64, f64)> = chain.iter().map(|&(at, v)| (at, self.mesh.size(v))).collect();
            let places = respread(&sizes, curve.length(), chain.len() - 1);
            let sag = |at: &[f64]| at.windows(2).map(|pair| curve.sag(pair[0], pair[1])).fold(0.0, f64::max);
            let before: Vec<f64> = chain.iter().map(|&(at, _)| at).collect();
            let most = sag(&before).max(self.rules.curve_tolerance);
            if places.len() != chain.len() || sag(&places) > most {
                continue;
            }
            let mut reached = before.clone();
            for k in 1..chain.len() - 1 {
                let place = Place::Arc { arc: arc as u32, at: places[k] };
                if self.try_move(chain[k].1, curve.at(places[k]), glam::DVec3::ZERO, place) {
                    reached[k] = places[k];
                }
            }
            // Where some may not move, edges between these and the others can be too long for the curve.
            if sag(&reached) > most {
                for (&at, &(_, v)) in before.iter().zip(&chain).take(chain.len() - 1).skip(1) {
                    self.mesh.set_point(v, curve.at(at), glam::DVec3::ZERO);
                    self.mesh.set_place(v, Place::Arc { arc: arc as u32, at });
                }
            }
        }
    }
}
