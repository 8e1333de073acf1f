//! Read: the same mesh from every text, and what the file names.

use meshmill::step::Artifact;

use super::golden::golden_of;
use crate::step::{file, run_locked};

const OBJ: &str = "# two plates\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\n\
    g left\nf 1 2 3 4\ng right\nf 2 5 6 3\n";

fn read(name: &str, text: &str, parameters: &str) -> Artifact {
    let made = run_locked("read", "main", parameters, "", &[("file", file(name, text))]);
    made.unwrap_or_else(|failure| panic!("{name}: {failure}")).artifact
}

#[test]
fn groups_and_quads_arrive() {
    golden_of("read", "plates", "", "", &[("file", file("plates.obj", OBJ))]);
}

#[test]
fn scale_multiplies_the_coordinates() {
    let (once, twice) = (read("plates.obj", OBJ, ""), read("plates.obj", OBJ, "scale = 2"));
    let (once, twice) = (once.as_soup().unwrap(), twice.as_soup().unwrap());
    assert!(once.points.iter().zip(&twice.points).all(|(a, b)| *a * 2.0 == *b));
    assert_eq!((&once.faces, &once.carried), (&twice.faces, &twice.carried));
}

#[test]
fn the_ending_is_in_doubt_and_format_decides() {
    let named = read("plates.txt", OBJ, "format = \"obj\"");
    assert_eq!(named.as_soup().unwrap(), read("plates.obj", OBJ, "").as_soup().unwrap());
}

#[test]
fn a_file_cut_short_is_bad_input() {
    let text = "OFF\n3 1 0\n0 0 0\n1 0 0\n";
    let failure = run_locked("read", "main", "", "", &[("file", file("cut.off", text))]).unwrap_err();
    assert_eq!(failure.kind, meshmill::step::FailureKind::BadInput, "{failure}");
}
