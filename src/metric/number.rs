//! Numbers for people.

/// Six significant digits, and no more than the number has.
pub fn number_text(number: f64) -> String {
    if number == 0.0 || !number.is_finite() {
        return format!("{number}");
    }
    let magnitude = libm::floor(libm::log10(number.abs())) as i32;
    if (-5..15).contains(&magnitude) {
        let decimals = usize::try_from(5 - magnitude).unwrap_or(0);
        let text = format!("{number:.decimals$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    } else {
        format!("{number:.5e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_six_digits_and_no_idle_zeros() {
        for (number, text) in [
            (0.2, "0.2"),
            (1234.5678, "1234.57"),
            (-0.001_234_567_8, "-0.00123457"),
            (3.3e-10, "3.30000e-10"),
            (100.0, "100"),
            (123_456_789.0, "123456789"),
            (0.0, "0"),
        ] {
            assert_eq!(number_text(number), text);
        }
    }
}
