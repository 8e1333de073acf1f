//! Colours for numbers, the same in pictures and in the viewer.

/// Colours at even steps from the least to the largest value, as sRGB bytes.
pub type Ramp = [[u8; 3]; 5];

/// From bad to good: red over yellow to blue, which people who do not tell red from green can read.
pub const QUALITY: Ramp = [[165, 0, 38], [244, 109, 67], [254, 224, 144], [116, 173, 209], [49, 84, 165]];
/// From little to much: dark violet to yellow, even in lightness.
pub const SEQUENTIAL: Ramp = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
/// From negative over nothing to positive.
pub const DIVERGING: Ramp = [[59, 76, 192], [143, 177, 254], [221, 221, 221], [245, 156, 125], [180, 4, 38]];

/// The colour at `t` from 0 to 1; values beyond take the colour of the end.
pub fn colour(ramp: &Ramp, t: f64) -> [f64; 3] {
    let last = ramp.len() - 1;
    let place = t.clamp(0.0, 1.0) * last as f64;
    let below = (place.floor() as usize).min(last - 1);
    let part = place - below as f64;
    std::array::from_fn(|i| {
        let (low, high) = (f64::from(ramp[below][i]), f64::from(ramp[below + 1][i]));
        low + part * (high - low)
    })
}

/// The colour as CSS writes it.
pub fn css(colour: [f64; 3]) -> String {
    let [r, g, b] = colour.map(|c| c.round().clamp(0.0, 255.0) as u8);
    format!("#{r:02x}{g:02x}{b:02x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_and_middle_are_the_stops() {
        assert_eq!(css(colour(&QUALITY, -1.0)), "#a50026");
        assert_eq!(css(colour(&QUALITY, 0.5)), "#fee090");
        assert_eq!(css(colour(&QUALITY, 7.0)), "#3154a5");
        assert_eq!(colour(&SEQUENTIAL, 0.125), [63.5, 41.5, 111.5]);
    }
}
