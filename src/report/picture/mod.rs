//! Pictures of meshes without a graphics card: a parallel view from above the corner, drawn triangle by triangle.
//!
//! # Algorithm
//! Faces are projected, filled with a depth buffer at twice the size, and averaged down. Colour is element quality
//! (scaled Jacobian of quads, stretch of triangles) under a light at the eye. Element edges are drawn where they are
//! not too dense to see; marked edges and rims always.
//!
//! # Invariants
//! - The same mesh gives the same bytes on every machine: only basic arithmetic, faces in order, ties to the first.
//! - Any mesh gives a picture: an empty one gives an empty picture.

mod camera;
mod paint;
pub mod ramp;

use std::collections::BTreeSet;

use glam::DVec3;

use crate::mesh::geometry;
use crate::mesh::topology::EdgeTable;
use crate::mesh::{FaceId, Facet, Soup, VertexId, edge_key};
use crate::metric::quad_shape::quad_shape;
use camera::Camera;
use paint::{Canvas, Patch};

/// Samples a pixel and axis.
const SAMPLES: usize = 2;
/// Element edges that are shorter than this many pixels on average are not drawn.
const LEAST_EDGE: f64 = 6.0;

/// Draws a mesh as a PNG file of this size with a transparent ground. `note` is stored in the file as a text.
///
/// # Errors
/// When the picture has no pixel.
pub fn png(mesh: &Soup, [width, height]: [u32; 2], note: &str) -> Result<Vec<u8>, png::EncodingError> {
    encode(&draw(mesh, [width as usize, height as usize]), [width, height], note)
}

/// As [`png()`], coloured by region instead of quality; faces of neighbouring numbers differ most.
///
/// # Errors
/// When the picture has no pixel.
pub fn regions_png(mesh: &Soup, [width, height]: [u32; 2], note: &str) -> Result<Vec<u8>, png::EncodingError> {
    let labels = mesh.carried.regions.as_ref().map(|regions| &regions.labels);
    let colour = |face: FaceId| hue(labels.and_then(|l| l.get(face)).copied().unwrap_or(0));
    encode(&draw_by(mesh, [width as usize, height as usize], colour), [width, height], note)
}

/// One of many colours that are easy to tell apart: steps of the golden section round the colour circle.
fn hue(label: u32) -> [f64; 3] {
    let turn = (f64::from(label) * 0.618_033_988_749_894_9).fract();
    let part = |shift: f64| {
        let t = ((turn + shift).fract() * 6.0 - 3.0).abs() - 1.0;
        90.0 + 150.0 * t.clamp(0.0, 1.0)
    };
    [part(0.0), part(2.0 / 3.0), part(1.0 / 3.0)]
}

fn encode(pixels: &[u8], [width, height]: [u32; 2], note: &str) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    encoder.add_text_chunk("Software".to_owned(), note.to_owned())?;
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(bytes)
}

/// Draws a mesh: four bytes a pixel, row by row from above.
pub fn draw(mesh: &Soup, size: [usize; 2]) -> Vec<u8> {
    draw_by(mesh, size, |face| ramp::colour(&ramp::QUALITY, quality(mesh, &mesh.faces[face])))
}

/// The same with a colour (sRGB bytes) for each face.
fn draw_by(mesh: &Soup, [width, height]: [usize; 2], colour_of: impl Fn(FaceId) -> [f64; 3]) -> Vec<u8> {
    let mut canvas = Canvas::new(width * SAMPLES, height * SAMPLES);
    let used = mesh.faces.iter().flat_map(Facet::corners).map(|&v| mesh.points[v]);
    let camera = Camera::isometric(used, [canvas.width as f64, canvas.height as f64]);
    let projected: Vec<DVec3> = mesh.points.iter().map(|&p| camera.project(p)).collect();
    let bold = bold_edges(mesh);
    let draw_edges = mean_edge(mesh, &projected) >= LEAST_EDGE * SAMPLES as f64;
    for (face, facet) in mesh.faces.enumerate() {
        let corners = facet.corners();
        let normal = camera.turn(normal(mesh, corners));
        let colour = shade(colour_of(face), normal);
        let side = |a: usize, b: usize| {
            let is_bold = bold.contains(&edge_key(corners[a], corners[b]));
            if is_bold {
                1.1 * SAMPLES as f64
            } else if draw_edges {
                0.45 * SAMPLES as f64
            } else {
                0.0
            }
        };
        let at = |i: usize| projected[corners[i].index()];
        match facet {
            Facet::Tri(_) => {
                canvas.fill(&Patch { corners: [0, 1, 2].map(at), pens: [side(1, 2), side(2, 0), side(0, 1)], colour });
            }

            Facet::Quad(_) => {
                canvas.fill(&Patch { corners: [0, 1, 2].map(at), pens: [side(1, 2), 0.0, side(0, 1)], colour });
                canvas.fill(&Patch { corners: [0, 2, 3].map(at), pens: [side(2, 3), side(3, 0), 0.0], colour });
            }
        }
    }
    canvas.average(SAMPLES)
}

/// Marked edges, and edges that do not have two faces.
fn bold_edges(mesh: &Soup) -> BTreeSet<[VertexId; 2]> {
    let mut bold: BTreeSet<[VertexId; 2]> = mesh.carried.marks.keys().copied().collect();
    let table = EdgeTable::new(mesh);
    bold.extend(table.iter().filter(|(_, _, sides)| sides.len() != 2).map(|(_, edge, _)| edge));
    bold
}

/// Mean length of the sides of all faces on the canvas.
fn mean_edge(mesh: &Soup, projected: &[DVec3]) -> f64 {
    let (mut sum, mut count) = (0.0, 0_u32);
    for facet in &mesh.faces {
        let corners = facet.corners();
        for (i, v) in corners.iter().enumerate() {
            let (p, q) = (projected[v.index()], projected[corners[(i + 1) % corners.len()].index()]);
            sum += p.truncate().distance(q.truncate());
            count += 1;
        }
    }
    sum / f64::from(count.max(1))
}

fn normal(mesh: &Soup, corners: &[VertexId]) -> DVec3 {
    let at = |i: usize| mesh.points[corners[i]];
    match corners.len() {
        4 => (at(2) - at(0)).cross(at(3) - at(1)).normalize_or_zero(),
        _ => geometry::triangle_normal([at(0), at(1), at(2)]).unwrap_or_default(),
    }
}

fn quality(mesh: &Soup, facet: &Facet) -> f64 {
    match facet {
        Facet::Tri(corners) => geometry::stretch(corners.map(|v| mesh.points[v])),
        Facet::Quad(corners) => quad_shape(corners.map(|v| mesh.points[v])).scaled_jacobian,
    }
}

/// The colour of a face with this normal, seen along z.
fn shade(colour: [f64; 3], normal: DVec3) -> [f64; 3] {
    // A little light from the upper left keeps cylinders from looking flat.
    let light = 0.45 + 0.45 * normal.z.abs() + 0.1 * (normal.y - 0.6 * normal.x) * normal.z.signum();
    colour.map(|c| (0.88 * c + 30.0) * light)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Id;

    fn square() -> Soup {
        let points = vec![DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
        let faces = vec![Facet::Tri([0, 1, 2].map(Id::new)), Facet::Tri([0, 2, 3].map(Id::new))];
        Soup { points: points.into(), faces: faces.into(), ..Soup::default() }
    }

    #[test]
    fn a_square_is_seen_and_an_empty_mesh_is_not() {
        let pixels = draw(&square(), [80, 60]);
        let covered = pixels.chunks_exact(4).filter(|p| p[3] == 255).count();
        assert!((800..2400).contains(&covered), "{covered}");
        assert!(draw(&Soup::default(), [8, 6]).iter().all(|byte| *byte == 0));
    }

    #[test]
    fn the_file_reads_back_and_repeats() {
        let bytes = png(&square(), [40, 30], "meshmill test").unwrap();
        assert_eq!(bytes, png(&square(), [40, 30], "meshmill test").unwrap());
        let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels, draw(&square(), [40, 30]));
    }

    #[test]
    fn far_from_the_origin_it_looks_the_same() {
        let mut far = square();
        far.points.iter_mut().for_each(|p| *p += DVec3::splat(1_048_576.0));
        assert_eq!(draw(&far, [40, 30]), draw(&square(), [40, 30]));
    }
}
