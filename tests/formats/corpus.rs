//! Files as other programs write them, small and nasty; what is nasty stands in their names and comments.

use std::path::Path;

use meshmill::format::{Format, ReadCounts, read};
use meshmill::mesh::{FaceId, Facet, Soup, Support, VertexId};
use meshmill::watch::Watch;

fn load(name: &str) -> (Soup, ReadCounts) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus").join(name);
    parse(name, &std::fs::read(path).expect("the corpus is part of the project"))
}

fn parse(name: &str, bytes: &[u8]) -> (Soup, ReadCounts) {
    let format = Format::detect(name, bytes).expect("a known ending");
    read(format, bytes, &Watch::silent()).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn faces(soup: &Soup, group: &str) -> Vec<u32> {
    soup.carried.groups.faces[group].iter().map(|f| f.raw()).collect()
}

fn corners(soup: &Soup, face: usize) -> Vec<u32> {
    soup.faces[FaceId::new(face)].corners().iter().map(|v| v.raw()).collect()
}

#[test]
fn solids_in_upper_case_with_repeated_and_missing_names() {
    let (soup, counts) = load("several_solids_upper_crlf.stl");
    assert_eq!((soup.points.len(), soup.faces.len(), counts.corners_welded), (5, 3, 4));
    let names: Vec<&str> = soup.carried.groups.faces.keys().map(String::as_str).collect();
    assert_eq!(names, ["Bracket Top", "Bracket Top_3", "solid_2"]);
    assert_eq!(faces(&soup, "Bracket Top_3"), [2]);
    assert!(soup.points[VertexId::new(2)].z.is_sign_positive(), "negative zero is zero");
}

#[test]
fn relative_numbers_continued_lines_and_groups() {
    let (soup, counts) = load("relative_continued_groups.obj");
    assert_eq!((soup.points.len(), soup.faces.len()), (5, 5));
    assert_eq!((counts.polygons_triangulated, counts.faces_dropped), (1, 1));
    assert_eq!(corners(&soup, 0), [0, 1, 2]);
    assert_eq!(corners(&soup, 1), [0, 2, 3]);
    assert_eq!(faces(&soup, "inlet"), [0, 1]);
    assert_eq!(faces(&soup, "WALL"), [0, 1]);
    assert_eq!(faces(&soup, "Steel#2"), [0, 1]);
    assert_eq!(faces(&soup, "Brass"), [2, 3, 4]);
    assert_eq!(faces(&soup, "Body 1"), [0, 1, 2, 3, 4]);
    assert_eq!(soup.carried.groups.edges["curve"].len(), 2);
    // The pentagon has a reflex corner in the middle of its lower side.
    let area = |face: usize| {
        let [a, b, c] = [0, 1, 2].map(|i| soup.points[VertexId::from_raw(corners(&soup, face)[i])]);
        0.5 * (b - a).cross(c - a).z
    };
    let areas = [2, 3, 4].map(area);
    assert!(areas.iter().all(|&a| a > 0.0) && (areas.iter().sum::<f64>() - 3.5).abs() < 1e-12, "{areas:?}");
}

#[test]
fn coloured_off_with_the_counts_on_the_first_line() {
    let (soup, _) = load("coloured_one_line.off");
    assert_eq!(soup.points.len(), 5);
    assert_eq!(corners(&soup, 0), [0, 1, 2, 3]);
    assert_eq!(corners(&soup, 1), [0, 1, 4]);
}

#[test]
fn ply_elements_in_any_order_with_fields() {
    let (soup, counts) = load("faces_first_extra.ply");
    assert_eq!((soup.points.len(), soup.faces.len()), (6, 4));
    assert_eq!((counts.polygons_triangulated, counts.faces_dropped, counts.fields_dropped), (1, 1, 1));
    let field = |support, name| soup.carried.field(support, name).expect("the field is there").clone();
    assert_eq!(field(Support::Face, "region").values, [7.0, 8.0, 8.0, 8.0]);
    assert_eq!(field(Support::Face, "quality").values, [0.5, 0.25, 0.25, 0.25]);
    assert_eq!(field(Support::Vertex, "nx").values[1], 0.5);
    let tint = field(Support::Vertex, "tint");
    assert_eq!((tint.components, &tint.values[..4]), (2, &[1.0, 2.0, 3.0, 4.0][..]));
    assert!(soup.carried.field(Support::Vertex, "broken").is_none(), "it holds a NaN");
}

#[test]
fn bulk_data_in_short_long_and_free_fields() {
    let (soup, counts) = load("mixed_fields.bdf");
    let points: Vec<[f64; 3]> = soup.points.iter().map(glam::DVec3::to_array).collect();
    assert_eq!(points, [[0.0; 3], [1.5, 0.0, 0.0], [1.5, 2e-3, 0.0], [0.0, 2.0, -0.25], [9.0, 9.0, 9.0]]);
    assert_eq!((counts.nodes_dropped, counts.elements_dropped), (1, 1));
    assert_eq!(corners(&soup, 0), [0, 1, 2]);
    assert_eq!(corners(&soup, 1), [0, 1, 2, 3]);
    assert_eq!(corners(&soup, 2), [0, 2, 3]);
    assert_eq!((faces(&soup, "Inlet pipe"), faces(&soup, "pid_20")), (vec![0, 2], vec![1]));
    assert_eq!(soup.carried.groups.edges["pid_30"].len(), 1);
}

#[test]
fn text_in_old_line_ends_and_with_a_byte_order_mark() {
    let obj = b"\xef\xbb\xbfv 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r";
    assert_eq!(parse("old.obj", obj).0.faces.as_slice(), [Facet::Tri([0, 1, 2].map(VertexId::from_raw))]);
    let off = b"3 1\n0 0 0\n1 0 0\n0 1d0 0\n3 0 1 2\n";
    assert_eq!(parse("no_keyword.off", off).0.points.len(), 3);
}

#[test]
fn binary_off_in_both_byte_orders_with_and_without_colours() {
    for (big, colours) in [(true, true), (true, false), (false, true), (false, false)] {
        let mut file = b"OFF BINARY\n".to_vec();
        let mut push = |raw: u32| file.extend(if big { raw.to_be_bytes() } else { raw.to_le_bytes() });
        [3, 2, 0].into_iter().for_each(&mut push);
        for x in [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.5, 0.0] {
            push(x.to_bits());
        }
        for corners in [[0, 1, 2], [2, 1, 0]] {
            push(3);
            corners.into_iter().for_each(&mut push);
            if colours {
                [3, 0x3f80_0000, 0, 0].into_iter().for_each(&mut push);
            }
        }
        let (soup, _) = parse("x.off", &file);
        assert_eq!(corners(&soup, 1), [2, 1, 0], "big endian {big}, colours {colours}");
        assert_eq!(soup.points[VertexId::new(2)].y, 2.5);
    }
}

#[test]
fn strips_of_triangles_turn_every_second_one() {
    let ply = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
        element tristrips 1\nproperty list int int vertex_indices\nend_header\n\
        0 0 0\n1 0 0\n0 1 0\n1 1 0\n9 0 1 2 3 -1 1 3 2 2\n";
    let (soup, _) = parse("strip.ply", ply.as_bytes());
    let all: Vec<Vec<u32>> = (0..soup.faces.len()).map(|f| corners(&soup, f)).collect();
    assert_eq!(all, [[0, 1, 2], [2, 1, 3], [1, 3, 2]]);
}

#[test]
fn the_content_tells_the_format_without_an_ending() {
    for name in [
        "several_solids_upper_crlf.stl",
        "relative_continued_groups.obj",
        "coloured_one_line.off",
        "faces_first_extra.ply",
        "mixed_fields.bdf",
    ] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus").join(name);
        let bytes = std::fs::read(path).expect("the corpus is part of the project");
        assert_eq!(Format::detect("part", &bytes).ok(), Format::from_file_name(name), "{name}");
    }
    assert!(Format::detect("part.xyz", b"nothing known").is_err());
}
