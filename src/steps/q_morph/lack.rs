//! How much quads lack: faces that are broken, too far from the surface, or of a poor shape.

use std::f64::consts::FRAC_PI_2;

use super::check::{Fault, Flaws};
use crate::technique::clean_quads::sharpest_sector_of;
use crate::technique::mixed::Mixed;

/// Shapes above this count as good.
pub(super) const FAIR: f64 = 0.5;
/// What a poor shape weighs that the curves at its corners excuse.
const CUSP: f64 = 0.5;

/// What a face lacks that another one passes through.
pub(super) const CROSSING: f64 = 0.1;

/// What a face lacks: for being broken, from its shape, and that and what the curves at its corners excuse.
fn lacks(mesh: &Mixed, f: u32) -> (f64, f64, f64) {
    let quality = mesh.quality(f);
    let short = shortfall(mesh, f);
    // Where curves touch, smaller faces see a sharper angle: that excuses them, and is no gain.
    let poverty = short + CUSP * (FAIR - quality).max(0.0);
    (10.0 * f64::from(quality <= 0.0) + 100.0 * f64::from(mesh.is_triangle(f)), short, poverty)
}

/// How much an attempt lacks, in all and by region: 0 where it holds to the tolerance with sound shapes.
pub(super) fn lack(mesh: &Mixed, flaws: &Flaws, tolerance: f64, regions: usize) -> (f64, Vec<f64>) {
    let mut by_region = vec![0.0; regions];
    let mut poorest = vec![0.0_f64; regions];
    for f in mesh.faces() {
        let (wrong, _, poverty) = lacks(mesh, f);
        let region = mesh.region(f) as usize;
        by_region[region] += wrong;
        poorest[region] = poorest[region].max(poverty);
    }
    let mut farthest = vec![0.0_f64; regions];
    for &f in &flaws.crossing {
        by_region[mesh.region(f) as usize] += CROSSING;
    }
    for fault in &flaws.faults {
        let far = &mut farthest[mesh.region(fault.face) as usize];
        *far = far.max(excess(fault, tolerance));
    }
    // The poorest only: smaller faces are more faces, and a region is not worse for that.
    for ((lack, far), poorest) in by_region.iter_mut().zip(farthest).zip(poorest) {
        *lack += 4.0 * far + poorest;
    }
    (lack_of(mesh, mesh.faces(), flaws, tolerance), by_region)
}

/// By how much a fault exceeds the tolerance, as a part of it.
pub(super) fn excess(fault: &Fault, tolerance: f64) -> f64 {
    fault.distance / tolerance - 1.0
}

/// How much some faces lack, with the flaws there.
pub(super) fn lack_of(mesh: &Mixed, faces: impl Iterator<Item = u32>, flaws: &Flaws, tolerance: f64) -> f64 {
    let (mut broken, mut poorest, mut poor) = (0.0, 0.0_f64, 0.0);
    for f in faces {
        let (wrong, short, poverty) = lacks(mesh, f);
        broken += wrong;
        poor += short;
        poorest = poorest.max(poverty);
    }
    let worst = flaws.faults.iter().map(|fault| excess(fault, tolerance)).fold(0.0, f64::max);
    // Many poor faces are no broken one.
    broken + CROSSING * flaws.crossing.len() as f64 + 4.0 * worst + poorest + (0.2 * poor).min(2.0)
}

/// What a face lacks from the shape that it could have, as a part of that: good, or as good as the curves that meet at
/// its corners allow.
pub(super) fn shortfall(mesh: &Mixed, f: u32) -> f64 {
    let quality = mesh.quality(f).max(0.0);
    if quality >= FAIR {
        return 0.0;
    }
    let fair = match sharpest_sector_of(mesh, f) {
        Some(angle) if angle < FRAC_PI_2 => FAIR.min(0.9 * libm::sin(angle)),
        _ => FAIR,
    };
    FAIR * (1.0 - quality / fair).max(0.0)
}
