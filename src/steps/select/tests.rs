//! Every selector on a unit square of four triangles.

use super::*;
use crate::mesh::{FaceId, Regions, VertexId};

/// Corners 0 to 3, centre 4; face `k` lies at the side from corner `k` to the next.
fn square() -> Surface {
    let points = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5]];
    let faces = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
    Surface {
        points: points.iter().map(|p| DVec3::new(p[0], p[1], 0.0)).collect(),
        faces: faces.iter().map(|f| f.map(VertexId::from_raw)).collect(),
        carried: Carried {
            regions: Some(Regions { labels: vec![0, 1, 1, 1].into(), names: vec!["south".into(), "rest".into()] }),
            ..Carried::default()
        },
    }
}

fn selected(of: &str, selectors: &str) -> Result<(usize, Carried), SelectError> {
    let text = format!("name = \"g\"\nof = \"{of}\"\n{selectors}");
    let params: SelectParams = toml::from_str(&text).expect("parameters");
    let mesh = square();
    let mut carried = mesh.carried.clone();
    select(&mesh, &mesh.points, &mut carried, &params).map(|stats| (stats.selected, carried))
}

fn count(of: &str, selectors: &str) -> usize {
    selected(of, selectors).map_or(0, |(count, _)| count)
}

#[test]
fn places_take_elements_wholly_inside() {
    let south = "box = { min = [0, 0, 0], max = [1, 0.5, 0] }";
    assert_eq!([count("faces", south), count("edges", south), count("vertices", south)], [1, 3, 3]);
    assert_eq!(count("vertices", "sphere = { centre = [0.5, 0.5, 0], radius = 0.1 }"), 1);
    assert_eq!(count("vertices", "cylinder = { start = [0, 0, 0], end = [1, 0, 0], radius = \"1%\" }"), 2);
    assert_eq!(count("edges", "plane = { point = [0, 1, 0], normal = [0, 2, 0] }"), 1);
}

#[test]
fn faces_are_taken_by_normal_and_region() {
    assert_eq!(count("faces", "normal = { direction = [0, 0, 1] }"), 4);
    let (_, carried) = selected("faces", "region = \"south\"").expect("one face");
    assert_eq!(carried.groups.faces["g"], [FaceId::new(0)]);
    assert_eq!(count("vertices", "region = \"south\""), 3);
}

#[test]
fn rims_are_taken_by_length() {
    assert_eq!([count("vertices", "boundary-loop = {}"), count("edges", "boundary-loop = { rank = 1 }")], [4, 4]);
    let error = selected("edges", "boundary-loop = { rank = 2 }").unwrap_err();
    assert_eq!(error, SelectError::NoSuchRim { rank: 2, rims: 1 });
}

#[test]
fn selectors_combine() {
    let both = "region = \"south\"\nbox = { min = [0.9, 0, 0], max = [1, 1, 0] }";
    assert_eq!(count("vertices", both), 1);
    assert_eq!(count("vertices", &format!("combine = \"any\"\n{both}")), 4);
}

#[test]
fn mistakes_are_told() {
    assert_eq!(selected("faces", "").unwrap_err(), SelectError::NoSelector);
    let nowhere = "box = { min = [5, 5, 5], max = [6, 6, 6] }";
    assert!(matches!(selected("faces", nowhere), Err(SelectError::Empty { .. })));
    assert_eq!(count("faces", &format!("allow-empty = true\n{nowhere}")), 0);
    assert!(matches!(selected("faces", "region = \"x\""), Err(SelectError::UnknownRegion { .. })));
    let flat = "normal = { direction = [0, 0, 0] }";
    assert_eq!(selected("faces", flat).unwrap_err(), SelectError::NoDirection("normal"));
}
