//! Distributions as small drawings (SVG) with axes, units, and the previous step behind.

use std::fmt::Write;

use super::text::{escape, short};
use crate::report::picture::ramp::{self, QUALITY, Ramp};

const WIDTH: f64 = 320.0;
const HEIGHT: f64 = 172.0;
/// Room for the axes: left, right, above, below.
const ROOM: [f64; 4] = [38.0, 8.0, 10.0, 34.0];
const BINS: usize = 40;

/// A distribution to draw.
pub(super) struct Histogram<'a> {
    /// What is counted: `Stretch`.
    pub(super) title: &'a str,
    /// Unit of the values, empty for a ratio.
    pub(super) unit: &'a str,
    /// The ends of the axis.
    pub(super) range: [f64; 2],
    /// The values; what is not finite or beyond the axis is left out and said so.
    pub(super) values: &'a [f64],
    /// Values of the step before, with its name.
    pub(super) previous: Option<(&'a str, &'a [f64])>,
    /// Whether bars are coloured from bad to good.
    pub(super) is_quality: bool,
}

/// Shares of the values in even bins, and the share beyond the axis.
fn shares(values: &[f64], [low, high]: [f64; 2]) -> ([f64; BINS], f64) {
    let mut counts = [0_u64; BINS];
    let (mut inside, width) = (0_u64, (high - low) / BINS as f64);
    for &value in values.iter().filter(|v| **v >= low && **v <= high) {
        counts[(((value - low) / width) as usize).min(BINS - 1)] += 1;
        inside += 1;
    }
    let total = values.len().max(1) as f64;
    (counts.map(|count| count as f64 / total), (values.len() as u64 - inside) as f64 / total)
}

/// Round numbers between two ends, at most `most` steps.
pub(super) fn ticks([low, high]: [f64; 2], most: usize) -> Vec<f64> {
    let span = high - low;
    if !(span > 0.0 && span.is_finite()) {
        return vec![low];
    }
    let raw = span / most.max(1) as f64;
    let magnitude = libm::pow(10.0, libm::floor(libm::log10(raw)));
    let step = [1.0, 2.0, 2.5, 5.0, 10.0].map(|m| m * magnitude).into_iter().find(|s| span / s <= most as f64 + 1e-9);
    let step = step.unwrap_or(10.0 * magnitude);
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last).map(|i| i as f64 * step).collect()
}

/// Where a plot's values lie on the drawing.
pub(super) struct Frame {
    pub(super) x: [f64; 2],
    pub(super) y: [f64; 2],
    /// Left, right, top, bottom of the plot.
    pub(super) sides: [f64; 4],
}

impl Frame {
    pub(super) fn at_x(&self, value: f64) -> f64 {
        place(value, self.x, [self.sides[0], self.sides[1]])
    }

    pub(super) fn at_y(&self, value: f64) -> f64 {
        place(value, self.y, [self.sides[3], self.sides[2]])
    }

    /// Grid lines, ticks and axis titles.
    pub(super) fn axes(&self, text: &mut String, titles: [&str; 2], steps: [usize; 2], label: &dyn Fn(f64) -> String) {
        let [left, right, top, bottom] = self.sides;
        for value in ticks(self.y, steps[1]) {
            let y = self.at_y(value);
            let _ = write!(text, r#"<line class="grid" x1="{left:.1}" x2="{right:.1}" y1="{y:.1}" y2="{y:.1}"/>"#);
            let _ = write!(
                text,
                r#"<text class="tick end" x="{:.1}" y="{:.1}">{}</text>"#,
                left - 5.0,
                y + 3.5,
                label(value)
            );
        }
        for value in ticks(self.x, steps[0]) {
            let x = self.at_x(value);
            let _ = write!(
                text,
                r#"<line class="axis" x1="{x:.1}" x2="{x:.1}" y1="{bottom:.1}" y2="{:.1}"/>"#,
                bottom + 4.0
            );
            let _ =
                write!(text, r#"<text class="tick mid" x="{x:.1}" y="{:.1}">{}</text>"#, bottom + 15.0, short(value));
        }
        let _ =
            write!(text, r#"<line class="axis" x1="{left:.1}" x2="{right:.1}" y1="{bottom:.1}" y2="{bottom:.1}"/>"#);
        let middle = 0.5 * (left + right);
        let _ = write!(
            text,
            r#"<text class="title mid" x="{middle:.1}" y="{:.1}">{}</text>"#,
            bottom + 29.0,
            escape(titles[0])
        );
        let _ = write!(text, r#"<text class="title" x="{:.1}" y="{:.1}">{}</text>"#, 2.0, top - 2.0, escape(titles[1]));
    }
}

fn place(value: f64, [low, high]: [f64; 2], [from, to]: [f64; 2]) -> f64 {
    if high > low { from + (value - low) / (high - low) * (to - from) } else { 0.5 * (from + to) }
}

/// Draws a distribution.
pub(super) fn histogram(chart: &Histogram<'_>) -> String {
    let (bars, beyond) = shares(chart.values, chart.range);
    let before = chart.previous.map(|(name, values)| (name, shares(values, chart.range).0));
    let highest = |shares: &[f64]| shares.iter().copied().fold(0.0, f64::max);
    // A step before with one high bar must not press the bars of this step flat.
    let top = highest(&bars).max(before.as_ref().map_or(0.0, |(_, b)| highest(b).min(1.6 * highest(&bars)))).max(1e-6);
    let sides = [ROOM[0], WIDTH - ROOM[1], ROOM[2] + 6.0, HEIGHT - ROOM[3]];
    let frame = Frame { x: chart.range, y: [0.0, 1.08 * top], sides };
    let name = if chart.unit.is_empty() { chart.title.to_owned() } else { format!("{} ({})", chart.title, chart.unit) };
    let mut text = format!(
        r#"<svg class="chart" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{}"><title>{}</title>"#,
        escape(&description(chart, beyond)),
        escape(&description(chart, beyond))
    );
    let percent = |share: f64| format!("{} %", short(100.0 * share));
    frame.axes(&mut text, [&name, "share"], [6, 3], &percent);
    draw_bars(&mut text, &frame, chart, &bars);
    if let Some((name, shares)) = &before {
        outline(&mut text, &frame, shares);
        let _ = write!(
            text,
            r#"<text class="title ghost end" x="{:.1}" y="{:.1}">outline: {}</text>"#,
            sides[1],
            sides[2] - 8.0,
            escape(name)
        );
    }
    text.push_str("</svg>");
    text
}

fn draw_bars(text: &mut String, frame: &Frame, chart: &Histogram<'_>, bars: &[f64; BINS]) {
    let width = (chart.range[1] - chart.range[0]) / BINS as f64;
    for (index, share) in bars.iter().enumerate().filter(|(_, share)| **share > 0.0) {
        let (left, right) = (chart.range[0] + index as f64 * width, chart.range[0] + (index + 1) as f64 * width);
        let (x, y) = (frame.at_x(left), frame.at_y(*share).min(frame.sides[3] - 1.0));
        let fill = if chart.is_quality {
            format!(r#" style="fill:{}""#, ramp::css(ramp::colour(&QUALITY, (index as f64 + 0.5) / BINS as f64)))
        } else {
            String::new()
        };
        let _ = write!(
            text,
            r#"<rect class="bar"{fill} x="{:.1}" y="{y:.1}" width="{:.1}" height="{:.1}"/>"#,
            x + 0.4,
            frame.at_x(right) - x - 0.8,
            frame.sides[3] - y
        );
    }
}

fn outline(text: &mut String, frame: &Frame, shares: &[f64; BINS]) {
    let width = (frame.x[1] - frame.x[0]) / BINS as f64;
    let mut path = format!("M{:.1} {:.1}", frame.sides[0], frame.sides[3]);
    for (index, share) in shares.iter().enumerate() {
        let (left, y) = (frame.x[0] + index as f64 * width, frame.at_y(*share).max(frame.sides[2]));
        let _ = write!(path, "L{:.1} {y:.1}L{:.1} {y:.1}", frame.at_x(left), frame.at_x(left + width));
    }
    let _ = write!(text, r#"<path class="outline" d="{path}L{:.1} {:.1}"/>"#, frame.sides[1], frame.sides[3]);
}

fn description(chart: &Histogram<'_>, beyond: f64) -> String {
    let mut text = format!("Distribution of {}", chart.title.to_lowercase());
    let mut sorted: Vec<f64> = chart.values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    if let (Some(least), Some(largest)) = (sorted.first(), sorted.last()) {
        let median = sorted[sorted.len() / 2];
        let _ = write!(text, ": least {}, median {}, largest {}", short(*least), short(median), short(*largest));
        if !chart.unit.is_empty() {
            let _ = write!(text, " ({})", chart.unit);
        }
    }
    if beyond > 0.0 {
        let _ = write!(text, "; {} % lie beyond the axis", short(100.0 * beyond));
    }
    text
}

/// The stops of a ramp for CSS.
pub(super) fn stops(ramp: &Ramp) -> Vec<String> {
    ramp.iter().map(|stop| ramp::css(stop.map(f64::from))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within() {
        assert_eq!(ticks([0.0, 1.0], 5), [0.0, 0.2, 0.4, 3.0 * 0.2, 0.8, 1.0]);
        assert_eq!(ticks([0.0, 180.0], 6), [0.0, 50.0, 100.0, 150.0]);
        assert_eq!(ticks([3.0, 3.0], 4), [3.0]);
        assert_eq!(ticks([-0.3, 0.3], 3), [-0.2, 0.0, 0.2]);
    }

    #[test]
    fn bars_are_shares_and_the_rest_is_told() {
        let (bars, beyond) = shares(&[0.0, 0.5, 1.0, 2.0], [0.0, 1.0]);
        assert_eq!((bars[0], bars[20], bars[39], beyond), (0.25, 0.25, 0.25, 0.25));
        let values = [0.5, 0.75, 1.5];
        let previous = Some(("<raw>", &values[..2]));
        let chart =
            Histogram { title: "Stretch", unit: "", range: [0.0, 1.0], values: &values, previous, is_quality: true };
        let text = histogram(&chart);
        assert!(text.contains("33.3 % lie beyond") && text.contains("&lt;raw&gt;") && !text.contains("<raw>"));
        assert_eq!(text.matches("class=\"bar\"").count(), 2);
    }
}
