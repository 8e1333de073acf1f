//! Text tables keep step: a line with a value too many or too few is an error with its number, never a shift.

use meshmill::format::{Format, read};
use meshmill::watch::Watch;

fn outcome(format: Format, text: &str) -> Result<usize, String> {
    match read(format, text.as_bytes(), &Watch::silent()) {
        Ok((soup, _)) => Ok(soup.faces.len()),
        Err(error) => Err(error.to_string()),
    }
}

#[track_caller]
fn refused(format: Format, text: &str, message: &str) {
    let error = outcome(format, text).expect_err(message);
    assert!(error.contains(message), "{error}");
}

fn ply(vertices: &str, faces: &str) -> String {
    let counts = (vertices.lines().count(), 2);
    format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n{vertices}{faces}",
        counts.0, counts.1
    )
}

const VERTICES: &str = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

#[test]
fn a_ply_line_is_one_item() {
    assert_eq!(outcome(Format::Ply, &ply(VERTICES, "3 0 1 2\n\n3 0 2 3\n\n")), Ok(2), "blank lines are none");
    refused(
        Format::Ply,
        &ply(VERTICES, "3 0 1 2 0 0\n3 0 2 3 0 0\n"),
        "line 14: expected the end of the line, found \"0\"",
    );
    refused(Format::Ply, &ply(VERTICES, "3 0 1 2\n3 0 2 3 255\n"), "line 15: expected the end of the line");
    refused(Format::Ply, &ply(VERTICES, "3 0 1\n2 3 0 2 3\n"), "line 14: the line ends inside an element");
    refused(Format::Ply, &ply("0 0 0\n1 0 0 9\n1 1 0\n0 1 0\n", "3 0 1 2\n3 0 2 3\n"), "line 11: expected the end");
    refused(Format::Ply, &ply("0 0 0\n1 0\n0 1 1 0\n0 1 0\n", "3 0 1 2\n3 0 2 3\n"), "line 11: the line ends");
    refused(Format::Ply, &ply(VERTICES, "3 0 1 2\n3 0 2 3\n3 0 1 3\n"), "line 16: expected the end of the file");
    refused(Format::Ply, &ply(VERTICES, "3 0 1 2\n"), "the file ends inside a table");
}

fn off(vertices: &str, faces: &str) -> String {
    format!("OFF\n4 2 0\n{vertices}{faces}")
}

#[test]
fn an_off_line_is_one_item() {
    assert_eq!(outcome(Format::Off, &off(VERTICES, "3 0 1 2\n\n# note\n3 0 2 3 0.5 0.5 0.5 # red\n# end\n")), Ok(2));
    refused(Format::Off, &off(VERTICES, "3 0 1 2\n3 0 2 3\n3 0 1 3\n"), "line 9: expected the end of the file");
    refused(Format::Off, &off(VERTICES, "3 0 1\n2 3 0 2 3\n"), "line 7: the line ends inside a face");
    refused(
        Format::Off,
        &off(VERTICES, "3 0 1 2 0 0 0 0 0\n3 0 2 3\n"),
        "line 7: expected the end of the line or a colour",
    );
    refused(
        Format::Off,
        &off("0 0 0\n1 0 0 9\n1 1 0\n0 1 0\n", "3 0 1 2\n3 0 2 3\n"),
        "line 4: expected three coordinates",
    );
    refused(
        Format::Off,
        &off("0 0 0\n1 0\n0 1 1 0\n0 1 0\n", "3 0 1 2\n3 0 2 3\n"),
        "line 4: the line ends inside a vertex",
    );
    let coloured = "0 0 0 1 2 3\n1 0 0 1 2 3\n1 1 0 1 2 3\n0 1 0 1 2 3\n";
    assert_eq!(outcome(Format::Off, &off(coloured, "3 0 1 2\n3 0 2 3\n")), Ok(2));
}

#[test]
fn an_obj_vertex_has_three_coordinates_and_perhaps_a_weight_and_a_colour() {
    let obj = |vertex: &str| format!("{vertex}\nv 1 0 0\nv 1 1 0\nf 1 2 3\n");
    for vertex in ["v 0 0 0", "v 0 0 0 1", "v 0 0 0 1 1 1", "v 0 0 0 1 1 1 1", "v 0 0 0 # origin"] {
        assert_eq!(outcome(Format::Obj, &obj(vertex)), Ok(1), "{vertex}");
    }
    refused(
        Format::Obj,
        &obj("v 0 0 0 0 0"),
        "line 1: expected a vertex of 3, 4, 6, 7 or 8 values, found \"5 values\"",
    );
    refused(Format::Obj, &obj("v 0 0"), "line 1: the file ends inside a vertex");
}
