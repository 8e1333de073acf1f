//! What a reader did besides reading, and what it left out.

use schemars::JsonSchema;
use serde::Serialize;

use crate::terminal::printable;

/// Notes by name; the rest is counted, since a deck may have as many as it has lines.
const MOST_NOTES: usize = 40;

/// What a reader did besides reading.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct ReadCounts {
    /// Polygons with more than four corners, cut into triangles.
    pub polygons_triangulated: usize,
    /// Faces with fewer than three corners, left out.
    pub faces_dropped: usize,
    /// Fields with a number that is NaN or infinite, left out.
    pub fields_dropped: usize,
    /// Repeated corners merged into a vertex with identical coordinates (STL, which has no vertex numbers).
    pub corners_welded: usize,
    /// Nodes that only mid-side positions or left-out elements used, left out.
    pub nodes_dropped: usize,
    /// Volumes and other elements that are no faces, left out.
    pub elements_dropped: usize,
    #[serde(skip)]
    notes: Vec<String>,
    #[serde(skip)]
    more_notes: usize,
}

impl ReadCounts {
    /// Notes by name what was left out. Letters that could steer a terminal are escaped.
    pub(super) fn note(&mut self, what: &str) {
        if self.notes.len() == MOST_NOTES {
            self.more_notes += 1;
            return;
        }
        self.notes.push(printable(what).into_owned());
    }

    /// Notes what costs something to say, which is said only where there is room.
    pub(super) fn note_with(&mut self, what: impl FnOnce() -> String) {
        if self.notes.len() == MOST_NOTES {
            self.more_notes += 1;
        } else {
            self.note(&what());
        }
    }

    /// All that the file has and the mesh has not, in words: first by name, at most 40, then by number.
    pub fn left_out(&self) -> Vec<String> {
        let mut all = self.notes.clone();
        let counted = [
            (self.more_notes, "more things of this kind"),
            (self.faces_dropped, "faces with fewer than three corners"),
            (self.fields_dropped, "fields without finite numbers"),
            (self.elements_dropped, "elements that are no faces"),
            (self.nodes_dropped, "nodes of these, and between corners"),
        ];
        all.extend(counted.into_iter().filter(|&(count, _)| count > 0).map(|(count, what)| format!("{count} {what}")));
        all
    }
}
