//! Convex pieces of a triangle, cut along the sides of another one.
//!
//! What lies over a triangle is cut out exactly along the planes through its sides, so that a face over `k` triangles
//! falls into about `k` pieces, whatever their size against the tolerance.

use glam::DVec3;
use smallvec::SmallVec;

/// Corners of a convex piece, in order.
pub(super) type Convex = SmallVec<[DVec3; 8]>;

/// More corners than this are not worth more cutting.
const MOST_CORNERS: usize = 12;

/// The mean of the corners and the distance of the furthest from it.
pub(super) fn ball(corners: &[DVec3]) -> (DVec3, f64) {
    let centre = corners.iter().sum::<DVec3>() / corners.len() as f64;
    let squared = corners.iter().map(|&p| (p - centre).length_squared()).fold(0.0, f64::max);
    (centre, squared.sqrt())
}

/// The two parts of a convex piece on the lower and on the upper side of a plane; either may be empty. Corners within
/// `near` of the plane are on it: else rounding would have the same sliver cut off for ever.
fn cut(piece: &[DVec3], foot: DVec3, normal: DVec3, near: f64) -> [Convex; 2] {
    let mut parts = [Convex::new(), Convex::new()];
    let near = near * normal.length();
    let height_of = |p: DVec3| {
        let height = normal.dot(p - foot);
        if height.abs() <= near { 0.0 } else { height }
    };
    let mut previous = piece[piece.len() - 1];
    let mut before = height_of(previous);
    let (mut is_below, mut is_above) = (false, false);
    for &p in piece {
        let height = height_of(p);
        if before < 0.0 && height > 0.0 || before > 0.0 && height < 0.0 {
            let crossing = previous + (p - previous) * (before / (before - height));
            parts[0].push(crossing);
            parts[1].push(crossing);
        }
        if height <= 0.0 {
            parts[0].push(p);
        }
        if height >= 0.0 {
            parts[1].push(p);
        }
        is_below |= height < 0.0;
        is_above |= height > 0.0;
        (previous, before) = (p, height);
    }
    // A side or a corner that touches the plane is no part of the other side.
    if !is_above {
        parts[1].clear();
    } else if !is_below {
        parts[0].clear();
    }
    parts
}

/// Cuts `piece` along the sides of a triangle: what lies over it comes back, the rest goes to `rest`. `None` where the
/// piece lies wholly beyond one side, or has too many corners; then nothing is cut.
pub(super) fn cut_out(
    piece: &[DVec3],
    over: [DVec3; 3],
    normal: DVec3,
    near: f64,
    rest: &mut Vec<Convex>,
) -> Option<Convex> {
    if piece.len() > MOST_CORNERS {
        return None;
    }
    let kept = rest.len();
    let mut inside = Convex::from_slice(piece);
    for at in 0..3 {
        let (p, q) = (over[at], over[(at + 1) % 3]);
        let [inner, outer] = cut(&inside, p, (q - p).cross(normal), near);
        if inner.is_empty() {
            rest.truncate(kept);
            return None;
        }
        if !outer.is_empty() {
            rest.push(outer);
        }
        inside = inner;
    }
    Some(inside)
}

/// Cuts `piece` across a line through `p` and `q` at both points: what lies between them comes back, the rest goes to
/// `rest`. `None` where nothing does; then nothing is cut.
pub(super) fn cut_between(piece: &[DVec3], p: DVec3, q: DVec3, near: f64, rest: &mut Vec<Convex>) -> Option<Convex> {
    if piece.len() > MOST_CORNERS {
        return None;
    }
    let [inner, before] = cut(piece, p, p - q, near);
    if inner.is_empty() {
        return None;
    }
    let [inner, after] = cut(&inner, q, q - p, near);
    if inner.is_empty() {
        return None;
    }
    rest.extend([before, after].into_iter().filter(|part| !part.is_empty()));
    Some(inner)
}

/// Two halves, cut through the middle of the piece across its longest extent, and that extent.
pub(super) fn halve(piece: &[DVec3]) -> (f64, [Convex; 2]) {
    let mut longest = (0.0, DVec3::X);
    for (at, &p) in piece.iter().enumerate() {
        for &q in &piece[at + 1..] {
            let squared = (q - p).length_squared();
            if squared > longest.0 {
                longest = (squared, q - p);
            }
        }
    }
    let (centre, _) = ball(piece);
    (longest.0.sqrt(), cut(piece, centre, longest.1, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn area(piece: &[DVec3]) -> f64 {
        let fan = piece.windows(2).skip(1).map(|pair| (pair[0] - piece[0]).cross(pair[1] - piece[0]));
        0.5 * fan.sum::<DVec3>().length()
    }

    fn triangle() -> impl Strategy<Value = [DVec3; 3]> {
        prop::array::uniform3(prop::array::uniform3(-1.0..1.0f64)).prop_map(|t| t.map(DVec3::from_array))
    }

    proptest! {
        #[test]
        fn nothing_is_lost(piece in triangle(), over in triangle()) {
            let normal = (over[1] - over[0]).cross(over[2] - over[0]);
            prop_assume!(normal.length() > 0.01);
            let mut parts = Vec::new();
            let whole = area(&piece);
            if let Some(inside) = cut_out(&piece, over, normal, 0.0, &mut parts) {
                for at in 0..3 {
                    let outward = (over[(at + 1) % 3] - over[at]).cross(normal);
                    prop_assert!(inside.iter().all(|&p| outward.dot(p - over[at]) <= 1e-9));
                }
                parts.push(inside);
                let sum: f64 = parts.iter().map(|part| area(part)).sum();
                prop_assert!((sum - whole).abs() <= 1e-9);
            } else {
                prop_assert!(parts.is_empty());
            }
            let (_, halves) = halve(&piece);
            prop_assert!((halves.iter().map(|part| area(part)).sum::<f64>() - whole).abs() <= 1e-9);
        }
    }
}
