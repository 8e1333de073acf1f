//! Statistics of a list of numbers: extremes, mean, percentiles, share beyond a limit.
//!
//! Sums run in index order, so that results do not depend on the number of threads.

use super::Value;

/// The least number; `None` of an empty list.
pub fn min(values: &[f64]) -> Option<f64> {
    values.iter().copied().reduce(f64::min)
}

/// The largest number; `None` of an empty list.
pub fn max(values: &[f64]) -> Option<f64> {
    values.iter().copied().reduce(f64::max)
}

/// The sum, by Neumaier's compensated summation: exact to the last digits however many terms there are.
pub fn sum(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut total, mut lost) = (0.0_f64, 0.0_f64);
    for value in values {
        let next = total + value;
        lost += if total.abs() >= value.abs() { (total - next) + value } else { (value - next) + total };
        total = next;
    }
    if lost.is_finite() { total + lost } else { total }
}

/// The mean; `None` of an empty list.
pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| sum(values.iter().copied()) / values.len() as f64)
}

/// The mean of the finite numbers; `None` when there is none.
pub fn finite_mean(values: &[f64]) -> Option<f64> {
    let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    mean(&finite)
}

/// The root of the mean square; `None` of an empty list.
pub fn rms(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| (sum(values.iter().map(|v| v * v)) / values.len() as f64).sqrt())
}

/// The percentile, interpolated linearly between the two neighbours in order; `None` of an empty list.
pub fn percentile(values: &[f64], percent: f64) -> Option<f64> {
    let last = values.len().checked_sub(1)?;
    let place = percent / 100.0 * last as f64;
    let (below, part) = (place.floor() as usize, place - place.floor());
    let mut sorted = values.to_vec();
    let (_, &mut low, above) = sorted.select_nth_unstable_by(below, f64::total_cmp);
    let high = min(above).unwrap_or(low);
    Some(if part > 0.0 { low + part * (high - low) } else { low })
}

/// How many numbers lie below the limit.
pub fn below(values: &[f64], limit: f64) -> usize {
    values.iter().filter(|&&v| v < limit).count()
}

/// The share of the numbers below the limit; `None` of an empty list.
pub fn share_below(values: &[f64], limit: f64) -> Option<f64> {
    (!values.is_empty()).then(|| below(values, limit) as f64 / values.len() as f64)
}

/// A number as a metric's value; absent when it is not finite, which no table of numbers can hold.
pub fn number(value: Option<f64>) -> Option<Value> {
    value.filter(|v| v.is_finite()).map(Value::Number)
}

/// A count as a metric's value.
pub fn count(value: usize) -> Option<Value> {
    Some(Value::Count(value as u64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_interpolated() {
        let values = [4.0, 1.0, 3.0, 2.0];
        assert_eq!(percentile(&values, 50.0), Some(2.5));
        assert_eq!(percentile(&values, 0.0), Some(1.0));
        assert_eq!(percentile(&values, 100.0), Some(4.0));
        assert_eq!(percentile(&[], 50.0), None);
    }

    #[test]
    fn means_skip_what_is_infinite_only_where_asked() {
        assert_eq!(mean(&[1.0, f64::INFINITY]), Some(f64::INFINITY));
        assert_eq!(finite_mean(&[1.0, f64::INFINITY, 3.0]), Some(2.0));
        assert_eq!(number(mean(&[1.0, f64::INFINITY])), None);
        assert_eq!(rms(&[3.0, 4.0]), Some(12.5_f64.sqrt()));
        assert_eq!(sum([1e16, 1.0, -1e16]), 1.0);
    }
}
