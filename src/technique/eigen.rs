//! Eigenvalues and eigenvectors of a symmetric 3×3 matrix, by Jacobi rotations.
//!
//! C. G. J. Jacobi's cyclic method as in G. H. Golub, C. F. Van Loan, *Matrix Computations*, section 8.5. It is slower
//! than the closed form, but keeps full relative accuracy for nearly rank-deficient matrices, which is the usual case
//! here: quadrics of flat parts, curvature tensors of cylinders. Four or five sweeps suffice; deterministic.

use glam::DVec3;

/// A symmetric matrix: `xx, xy, xz, yy, yz, zz`.
pub type Symmetric = [f64; 6];

/// Most sweeps; convergence is quadratic, so this is never reached on finite input.
const MOST_SWEEPS: usize = 16;

/// Eigenvalues in ascending order, each with its unit eigenvector. Not finite input gives not finite values.
pub fn symmetric_eigen(matrix: &Symmetric) -> [(f64, DVec3); 3] {
    let [xx, xy, xz, yy, yz, zz] = *matrix;
    let mut m = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    let mut vectors = [DVec3::X, DVec3::Y, DVec3::Z];
    let scale = matrix.iter().fold(0.0_f64, |s, x| s.max(x.abs()));
    for _ in 0..MOST_SWEEPS {
        let off = m[0][1].abs().max(m[0][2].abs()).max(m[1][2].abs());
        if off.is_nan() || off <= 1e-300_f64.max(scale * 1e-18) {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            rotate(&mut m, &mut vectors, p, q);
        }
    }
    let mut pairs = [(m[0][0], vectors[0]), (m[1][1], vectors[1]), (m[2][2], vectors[2])];
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    pairs
}

/// The rotation that clears the entry `(p, q)`.
fn rotate(m: &mut [[f64; 3]; 3], vectors: &mut [DVec3; 3], p: usize, q: usize) {
    let entry = m[p][q];
    if entry == 0.0 {
        return;
    }
    let theta = (m[q][q] - m[p][p]) / (2.0 * entry);
    let t = if theta.is_finite() { theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt()) } else { 0.0 };
    let c = 1.0 / (t * t + 1.0).sqrt();
    let s = t * c;
    m[p][p] -= t * entry;
    m[q][q] += t * entry;
    m[p][q] = 0.0;
    m[q][p] = 0.0;
    let r = 3 - p - q;
    let (rp, rq) = (m[r][p], m[r][q]);
    m[r][p] = c * rp - s * rq;
    m[p][r] = m[r][p];
    m[r][q] = s * rp + c * rq;
    m[q][r] = m[r][q];
    let (vp, vq) = (vectors[p], vectors[q]);
    vectors[p] = vp * c - vq * s;
    vectors[q] = vp * s + vq * c;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn apply(m: &Symmetric, v: DVec3) -> DVec3 {
        let [xx, xy, xz, yy, yz, zz] = *m;
        DVec3::new(xx * v.x + xy * v.y + xz * v.z, xy * v.x + yy * v.y + yz * v.z, xz * v.x + yz * v.y + zz * v.z)
    }

    #[test]
    fn each_pair_satisfies_the_equation() {
        let matrices: [Symmetric; 5] = [
            [2.0, -1.0, 0.0, 2.0, -1.0, 2.0],
            [1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
            [1e-9, 0.0, 1e-12, 3e5, 7.0, -2.0],
            [1.0, 0.0, 0.0, 1.0, 0.0, 1.0],
            [0.0; 6],
        ];
        for m in matrices {
            let scale = m.iter().fold(1e-300_f64, |s, x| s.max(x.abs()));
            for (value, vector) in symmetric_eigen(&m) {
                assert!((vector.length() - 1.0).abs() < 1e-12);
                assert!((apply(&m, vector) - vector * value).length() <= 1e-13 * scale, "{m:?}");
            }
        }
    }

    #[test]
    fn values_ascend_and_a_plane_has_rank_one() {
        let n = DVec3::new(1.0, 2.0, 2.0) / 3.0;
        let plane = [n.x * n.x, n.x * n.y, n.x * n.z, n.y * n.y, n.y * n.z, n.z * n.z];
        let [(a, _), (b, _), (c, v)] = symmetric_eigen(&plane);
        assert!(a.abs() < 1e-15 && b.abs() < 1e-15 && (c - 1.0).abs() < 1e-15);
        assert!((v.dot(n).abs() - 1.0).abs() < 1e-15);
    }
}
