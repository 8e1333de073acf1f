//! The elements that are worst in something, with the place where they are.

use glam::DVec3;
use serde::Serialize;

use super::column::{Column, Merge, corners_of};
use crate::mesh::{FaceId, Soup, Support};

/// How many are listed of each kind.
const LISTED: usize = 8;

/// Elements that are worst in one figure, worst first.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Worst {
    /// What they are worst in: `Lowest stretch`.
    pub(super) title: String,
    /// Unit of the values.
    pub(super) unit: &'static str,
    /// The colour that shows it.
    pub(super) column: String,
    /// The elements.
    pub(super) elements: Vec<Element>,
}

/// An element and where it is.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Element {
    /// `face` or `vertex`.
    pub(super) kind: &'static str,
    /// Its number.
    pub(super) id: u32,
    /// What was measured; absent where a gate counts elements.
    pub(super) value: f64,
    /// Its centre.
    pub(super) at: [f64; 3],
    /// Its corners, or a vertex alone.
    pub(super) corners: Vec<[f64; 3]>,
}

/// The worst elements of a mesh in everything that has a bad end.
pub(super) fn worst(mesh: &Soup, columns: &[Column]) -> Vec<Worst> {
    let judged = ["scaled-jacobian", "stretch", "min-angle", "size", "distance"];
    let column = |key: &&str| columns.iter().find(|column| column.key == *key);
    let lists = judged.iter().filter_map(column).map(|column| list(mesh, column));
    lists.filter(|list| !list.elements.is_empty()).collect()
}

fn list(mesh: &Soup, column: &Column) -> Worst {
    let low = column.merge == Merge::Least;
    let mut ids: Vec<u32> =
        (0..column.values.len() as u32).filter(|id| column.values[*id as usize].is_finite()).collect();
    let badness = |id: &u32| if low { column.values[*id as usize] } else { -column.values[*id as usize] };
    let order = |a: &u32, b: &u32| badness(a).total_cmp(&badness(b)).then(a.cmp(b));
    if ids.len() > LISTED {
        ids.select_nth_unstable_by(LISTED, order);
        ids.truncate(LISTED);
    }
    ids.sort_unstable_by(order);
    // Where the largest value is nothing, nothing is worst.
    ids.retain(|id| low || column.values[*id as usize] > 0.0);
    let name = column.title.split(" (").next().unwrap_or_default();
    Worst {
        title: format!("{} {}", if low { "Lowest" } else { "Largest" }, uncapitalised(name)),
        unit: column.unit,
        column: column.key.clone(),
        elements: ids.iter().map(|id| element(mesh, column, *id)).collect(),
    }
}

fn uncapitalised(name: &str) -> String {
    let mut letters = name.chars();
    letters.next().map(|first| first.to_lowercase().chain(letters).collect()).unwrap_or_default()
}

fn element(mesh: &Soup, column: &Column, id: u32) -> Element {
    let (kind, corners) = match column.support {
        Support::Face => ("face", corners_of(mesh, FaceId::from_raw(id))),
        Support::Vertex => ("vertex", mesh.points.as_slice().get(id as usize).copied().into_iter().collect()),
    };
    let at = corners.iter().sum::<DVec3>() / corners.len().max(1) as f64;
    Element {
        kind,
        id,
        value: column.values[id as usize],
        at: at.to_array(),
        corners: corners.iter().map(DVec3::to_array).collect(),
    }
}
