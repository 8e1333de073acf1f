//! Plots of many cases (SVG): a scatter with its Pareto front, and parallel coordinates.

use std::fmt::Write;

use super::chart::{Frame, ticks};
use super::text::{escape, short};

/// How a case is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Rank {
    /// It did not pass.
    Failed,
    /// Another case is better.
    Other,
    /// No case is better.
    Front,
}

impl Rank {
    fn class(self) -> &'static str {
        match self {
            Self::Failed => "failed",
            Self::Other => "other",
            Self::Front => "front",
        }
    }
}

/// A case on a scatter.
pub(super) struct Point {
    pub(super) at: [f64; 2],
    pub(super) rank: Rank,
    pub(super) title: String,
    pub(super) link: String,
}

const SCATTER: [f64; 2] = [400.0, 300.0];

/// Draws cases over two figures. `lower` says for each axis whether little is good.
pub(super) fn scatter(points: &[Point], titles: &[String; 2], lower: [bool; 2]) -> String {
    let range = |axis: usize| {
        let values = points.iter().map(|p| p.at[axis]);
        let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)]);
        let margin = if high > low { 0.06 * (high - low) } else { 0.5 * low.abs().max(1.0) };
        if low <= high { [low - margin, high + margin] } else { [0.0, 1.0] }
    };
    let sides = [56.0, SCATTER[0] - 10.0, 22.0, SCATTER[1] - 40.0];
    let frame = Frame { x: range(0), y: range(1), sides };
    let name = escape(&format!("{} over {}", titles[1], titles[0]));
    let mut text = format!(
        r#"<svg class="chart plot" viewBox="0 0 {} {}" role="group" aria-label="{name}">"#,
        SCATTER[0], SCATTER[1]
    );
    frame.axes(&mut text, [&titles[0], &titles[1]], [6, 5], &short);
    front_line(&mut text, &frame, points, lower);
    let mut order: Vec<&Point> = points.iter().collect();
    order.sort_by_key(|point| point.rank);
    for point in order {
        let (x, y) = (frame.at_x(point.at[0]), frame.at_y(point.at[1]));
        let radius = if point.rank == Rank::Front { 5.0 } else { 4.0 };
        let _ = write!(
            text,
            r##"<a href="#{}"><title>{}</title><circle class="{}" cx="{x:.1}" cy="{y:.1}" r="{radius}"/></a>"##,
            escape(&point.link),
            escape(&point.title),
            point.rank.class()
        );
    }
    text.push_str("</svg>");
    text
}

/// Joins the cases of the front by steps: everything on the bad side of them is beaten.
fn front_line(text: &mut String, frame: &Frame, points: &[Point], lower: [bool; 2]) {
    let mut front: Vec<[f64; 2]> = points.iter().filter(|p| p.rank == Rank::Front).map(|p| p.at).collect();
    front.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let mut path = String::new();
    for (index, at) in front.iter().enumerate() {
        let (x, y) = (frame.at_x(at[0]), frame.at_y(at[1]));
        if index == 0 {
            let _ = write!(path, "M{x:.1} {y:.1}");
        } else if lower[0] {
            // Going right costs, so the value before holds until the next case is reached.
            let _ = write!(path, "H{x:.1}V{y:.1}");
        } else {
            let _ = write!(path, "V{y:.1}H{x:.1}");
        }
    }
    let _ = write!(text, r#"<path class="front-line" d="{path}"/>"#);
}

/// An axis of parallel coordinates: a place from 0 to 1 for each case that has one.
pub(super) struct Axis {
    title: String,
    places: Vec<Option<f64>>,
    labels: Vec<(f64, String)>,
}

impl Axis {
    /// Numbers, with round labels.
    pub(super) fn of_numbers(title: &str, numbers: Vec<Option<f64>>, is_share: bool) -> Self {
        let finite = numbers.iter().flatten().copied();
        let [low, high] = finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)]);
        let place = |v: f64| if high > low { (v - low) / (high - low) } else { 0.5 };
        let word = |v: f64| if is_share { format!("{} %", short(100.0 * v)) } else { short(v) };
        let marks = if high > low { ticks([low, high], 4) } else { vec![low] };
        let labels = marks.into_iter().filter(|v| v.is_finite()).map(|v| (place(v), word(v))).collect();
        Self { title: title.to_owned(), places: numbers.into_iter().map(|v| v.map(place)).collect(), labels }
    }

    /// Texts: numbers or percents where all are, else each text a place, in order of appearance.
    pub(super) fn of_texts(title: &str, texts: Vec<String>) -> Self {
        let number = |text: &String| text.trim_end_matches('%').parse::<f64>().ok().filter(|v| v.is_finite());
        let numbers: Vec<Option<f64>> = texts.iter().map(number).collect();
        let mut known: Vec<(Option<f64>, &String)> = Vec::new();
        for (text, number) in texts.iter().zip(&numbers) {
            if !known.iter().any(|(_, other)| *other == text) {
                known.push((*number, text));
            }
        }
        if numbers.iter().all(Option::is_some) {
            known.sort_by(|a, b| a.0.unwrap_or(0.0).total_cmp(&b.0.unwrap_or(0.0)));
        }
        let last = known.len().saturating_sub(1).max(1) as f64;
        let place = |text: &String| known.iter().position(|(_, other)| *other == text).map(|i| i as f64 / last);
        let every = known.len().div_ceil(12);
        let labels =
            known.iter().enumerate().step_by(every.max(1)).map(|(i, (_, text))| (i as f64 / last, (*text).clone()));
        Self { title: title.to_owned(), places: texts.iter().map(place).collect(), labels: labels.collect() }
    }

    /// Whether cases differ on it.
    pub(super) fn varies(&self) -> bool {
        let first = self.places.iter().flatten().next();
        self.places.iter().flatten().any(|place| Some(place) != first)
    }
}

const PARALLEL: [f64; 2] = [150.0, 300.0];

/// Draws a line for each case through its places on all axes.
pub(super) fn parallel(axes: &[Axis], lines: &[(Rank, String)]) -> String {
    let (top, bottom) = (34.0, PARALLEL[1] - 14.0);
    let width = PARALLEL[0] * axes.len() as f64;
    let at_x = |axis: usize| PARALLEL[0] * (axis as f64 + 0.42);
    let at_y = |place: f64| bottom - place * (bottom - top);
    let mut text = format!(
        r#"<svg class="chart parallel" viewBox="0 0 {width} {}" style="width:{width}px" role="img" aria-label="Parameters and metrics of all cases">"#,
        PARALLEL[1]
    );
    let mut order: Vec<usize> = (0..lines.len()).collect();
    order.sort_by_key(|line| lines[*line].0);
    for line in order {
        let mut path = String::new();
        for (index, axis) in axes.iter().enumerate() {
            let Some(Some(place)) = axis.places.get(line).copied() else { continue };
            let _ = write!(path, "{}{:.1} {:.1}", if path.is_empty() { 'M' } else { 'L' }, at_x(index), at_y(place));
        }
        let (rank, title) = &lines[line];
        let _ =
            write!(text, r#"<path class="line {}" d="{path}"><title>{}</title></path>"#, rank.class(), escape(title));
    }
    for (index, axis) in axes.iter().enumerate() {
        let x = at_x(index);
        let _ = write!(text, r#"<line class="axis" x1="{x:.1}" x2="{x:.1}" y1="{top}" y2="{bottom}"/>"#);
        let _ = write!(text, r#"<text class="title mid" x="{x:.1}" y="{}">{}</text>"#, top - 14.0, escape(&axis.title));
        for (place, label) in &axis.labels {
            let y = at_y(*place);
            let _ = write!(text, r#"<line class="axis" x1="{:.1}" x2="{x:.1}" y1="{y:.1}" y2="{y:.1}"/>"#, x - 4.0);
            let _ = write!(
                text,
                r#"<text class="tick end halo" x="{:.1}" y="{:.1}">{}</text>"#,
                x - 7.0,
                y + 3.5,
                escape(label)
            );
        }
    }
    text.push_str("</svg>");
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(x: f64, y: f64, rank: Rank) -> Point {
        Point { at: [x, y], rank, title: "<case>".to_owned(), link: "case-a".to_owned() }
    }

    #[test]
    fn the_front_is_drawn_last_and_titles_are_safe() {
        let points = [point(2.0, 0.5, Rank::Front), point(3.0, 0.4, Rank::Other), point(1.0, 0.2, Rank::Front)];
        let text = scatter(&points, &["faces".to_owned(), "stretch".to_owned()], [true, false]);
        assert!(text.find("class=\"other\"").unwrap() < text.find("class=\"front\"").unwrap());
        assert_eq!(text.matches("&lt;case&gt;").count(), 3);
        assert!(scatter(&[], &[String::new(), String::new()], [true, true]).ends_with("</svg>"));
    }

    #[test]
    fn texts_that_are_numbers_stand_in_their_order() {
        let axis = Axis::of_texts("size", ["4%", "10%", "1%", "4%"].map(str::to_owned).to_vec());
        assert_eq!(axis.places, [Some(0.5), Some(1.0), Some(0.0), Some(0.5)]);
        let words = Axis::of_texts("mode", ["b", "a", "b"].map(str::to_owned).to_vec());
        assert_eq!(words.places, [Some(0.0), Some(1.0), Some(0.0)]);
        assert!(words.varies() && !Axis::of_numbers("n", vec![Some(1.0), None, Some(1.0)], false).varies());
    }
}
