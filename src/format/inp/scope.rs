//! What numbers of nodes and elements belong to: parts, the assembly, and instances with where they stand.

use std::ops::Range;

use glam::DVec3;
use libm::{cos, sin};
use rustc_hash::FxHashMap;

use super::super::error::{FormatError, Place};
use super::super::text::parse_number;

/// Numbers of one part, or of the assembly, which is the first scope; or an instance of a part, with the part's
/// numbers.
#[derive(Debug, Default)]
pub(super) struct Scope {
    /// The name of the part or instance, empty outside both.
    pub(super) name: String,
    /// Positions of nodes by number.
    pub(super) nodes: FxHashMap<i64, u32>,
    /// Positions of elements by number.
    pub(super) elements: FxHashMap<i64, u32>,
    /// Where its nodes lie among all.
    pub(super) node_range: Range<usize>,
    /// Where its elements lie among all.
    pub(super) element_range: Range<usize>,
    /// The part that this is an instance of, and where it stands.
    pub(super) instance: Option<Instance>,
}

/// An instance of a part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Instance {
    /// The scope of the part.
    pub(super) part: usize,
    /// Where it stands.
    pub(super) placement: Placement,
}

/// A translation, and a turn after it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Placement {
    shift: DVec3,
    /// A point of the axis, its direction, and the angle in degrees.
    turn: Option<(DVec3, DVec3, f64)>,
}

impl Placement {
    /// Takes the data line after `before` others.
    pub(super) fn line(&mut self, before: usize, line: &[u8], place: Place) -> Result<(), FormatError> {
        let mut numbers = [0.0; 7];
        let wanted = match before {
            0 => 3,
            1 => 7,
            _ => return Err(FormatError::unexpected(place, "at most two lines of an instance", line)),
        };
        for (position, item) in items(line).enumerate().filter(|(_, item)| !item.is_empty()) {
            if position >= wanted {
                return Err(FormatError::unexpected(place, "the end of the line", item).with_remedy(
                    "the first line of an instance moves it by three numbers, the second turns it by seven",
                ));
            }
            numbers[position] = parse_number(item, "a number that moves or turns an instance", place)?;
        }
        let [a, b, c, d, e, f, angle] = numbers;
        if before == 0 {
            self.shift = DVec3::new(a, b, c);
            return Ok(());
        }
        let (from, to) = (DVec3::new(a, b, c), DVec3::new(d, e, f));
        self.turn = match (to - from).try_normalize() {
            Some(axis) => Some((from, axis, angle)),
            None if angle == 0.0 => None,
            None => return Err(FormatError::unexpected(place, "an axis between two points that differ", line)),
        };
        Ok(())
    }

    pub(super) fn place(&self, point: DVec3) -> DVec3 {
        let moved = point + self.shift;
        let Some((from, axis, angle)) = self.turn else { return moved };
        // Quarter turns are exact.
        let (sin, cos) = match angle.rem_euclid(360.0) {
            0.0 => (0.0, 1.0),
            90.0 => (1.0, 0.0),
            180.0 => (0.0, -1.0),
            270.0 => (-1.0, 0.0),
            other => (sin(other.to_radians()), cos(other.to_radians())),
        };
        let arm = moved - from;
        from + arm * cos + axis.cross(arm) * sin + axis * (axis.dot(arm) * (1.0 - cos))
    }
}

/// Where the nodes and elements of a scope are now, relative to those of its part.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Shift {
    /// Added to positions of nodes.
    pub(super) nodes: u32,
    /// Added to positions of elements.
    pub(super) elements: u32,
}

/// The comma-separated items of a data line; a comma at the end is no item.
pub(super) fn items(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.strip_suffix(b",").unwrap_or(line).split(|&b| b == b',').map(<[u8]>::trim_ascii)
}
