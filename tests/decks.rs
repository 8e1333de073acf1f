//! Decks of solvers whose cards make, move or place geometry: read right, or refused by the name of the card.

use glam::{DVec3, dvec3};
use meshmill::format::{Format, read};
use meshmill::watch::Watch;

/// The corners of the faces, or what the reader says.
fn points(format: Format, deck: &str) -> Result<Vec<DVec3>, String> {
    match read(format, deck.as_bytes(), &Watch::silent()) {
        Ok((soup, _)) => Ok(soup.points.iter().copied().collect()),
        Err(error) => Err(error.to_string()),
    }
}

fn is(found: &[DVec3], expected: &[[f64; 3]]) {
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for (p, &[x, y, z]) in found.iter().zip(expected) {
        assert!(p.distance(dvec3(x, y, z)) < 1e-12, "{p} is not at {x} {y} {z}");
    }
}

/// A triangle whose grid points are given in the system `system`, with these cards before it.
fn triangle(cards: &str, system: &str) -> Result<Vec<DVec3>, String> {
    let grids = format!("GRID,1,{system},0.,0.,0.\nGRID,2,{system},2.,0.,0.\nGRID,3,{system},2.,90.,1.\n");
    points(Format::Bdf, &format!("BEGIN BULK\n{grids}{cards}CTRIA3,1,1,1,2,3\nENDDATA\n"))
}

const SHIFTED: &str = "CORD2R,5,,100.,0.,0.,100.,0.,1.\n,101.,0.,0.\n";

#[test]
fn grid_points_take_the_default_system_of_the_deck() {
    let shifted = [[100.0, 0.0, 0.0], [102.0, 0.0, 0.0], [102.0, 90.0, 1.0]];
    let plain = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 90.0, 1.0]];
    is(&triangle(&format!("GRDSET,,5\n{SHIFTED}"), "").unwrap(), &shifted);
    is(&triangle(&format!("GRDSET  ,,5\n{SHIFTED}"), "").unwrap(), &shifted);
    is(&triangle(&format!("GRDSET,,5\n{SHIFTED}"), "0").unwrap(), &plain);
    is(&triangle("GRDSET,,,,,,6\n", "").unwrap(), &plain);
    is(&triangle(SHIFTED, "").unwrap(), &plain);
}

#[test]
fn round_systems_are_in_degrees_and_may_lie_in_each_other() {
    let cylinder = "CORD2C,7,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n";
    is(&triangle(cylinder, "7").unwrap(), &[[0.0; 3], [2.0, 0.0, 0.0], [0.0, 2.0, 1.0]]);
    let sphere = "CORD2S,7,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n";
    let turn = 1.0_f64.to_radians();
    let last = [2.0 * libm::cos(turn), 2.0 * libm::sin(turn), 0.0];
    is(&triangle(sphere, "7").unwrap(), &[[0.0; 3], [0.0, 0.0, 2.0], last]);
    // Defined in another one, which comes later and turns it by 90 degrees about z.
    let chained = "CORD2C,7,8,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\nCORD2R,8,,1.,0.,0.,1.,0.,1.\n,1.,5.,0.\n";
    is(&triangle(chained, "7").unwrap(), &[[1.0, 0.0, 0.0], [1.0, 2.0, 0.0], [-1.0, 0.0, 1.0]]);
}

#[test]
fn systems_through_grid_points() {
    let cards = "GRID,101,,100.,0.,0.\nGRID,102,,100.,0.,1.\nGRID,103,,101.,0.,0.\nCORD1R,6,101,102,103\n";
    let found = triangle(cards, "6").unwrap();
    is(&found[..3], &[[100.0, 0.0, 0.0], [102.0, 0.0, 0.0], [102.0, 90.0, 1.0]]);
}

#[test]
fn systems_that_cannot_be_are_named() {
    for (cards, word) in [
        ("", "coordinate system 9, which the file does not define"),
        ("CORD2R,9,9,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n", "defined in itself"),
        ("CORD2R,9,,0.,0.,0.,0.,0.,1.\n,0.,0.,7.\n", "lie on a line"),
        ("CORD1R,9,1,2,3\n", "defined in itself"),
        ("CORD3G,9,,0.,0.,0.\n", "CORD3G"),
        (&format!("{}{}", SHIFTED.replace(",5,", ",9,"), SHIFTED.replace(",5,", ",9,")), "coordinate system 9"),
    ] {
        let error = triangle(cards, "9").unwrap_err();
        assert!(error.contains(word), "{cards}: {error}");
    }
}

#[test]
fn exponents_of_fortran_are_read() {
    let deck = "BEGIN BULK\nGRID,1,,0.,0.,1.0D0\nGRID,2,,1.+1,0.,0.\nGRID,3,,0.,10.-1,2.5d-1\nCTRIA3,1,1,1,2,3\n";
    is(&points(Format::Bdf, deck).unwrap(), &[[0.0, 0.0, 1.0], [10.0, 0.0, 0.0], [0.0, 1.0, 0.25]]);
}

const SQUARE: &str = "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 1, 1, 0\n4, 0, 1, 0\n*ELEMENT, TYPE=S4\n1, 1, 2, 3, 4\n";

#[test]
fn cards_that_make_or_move_geometry_are_refused_by_name() {
    for card in [
        "*ELGEN, ELSET=all\n1, 2, 1, 1\n",
        "*ELCOPY, OLD SET=a, NEW SET=b\n",
        "*NCOPY, CHANGE NUMBER=4, OLD SET=a, SHIFT\n1, 0, 0\n",
        "*NGEN\n1, 4, 1\n",
        "*NFILL\na, b, 3\n",
        "*nmap, nset=a\n",
        "*IMPERFECTION, FILE=buckle, STEP=1\n1, 0.1\n",
    ] {
        let name = card.split([',', '\n']).next().unwrap().to_ascii_uppercase();
        let error = points(Format::Inp, &format!("{SQUARE}{card}")).unwrap_err();
        assert!(error.contains("line 8") && error.contains(&name), "{card}: {error}");
    }
}

#[test]
fn data_in_another_file_is_refused_with_its_name() {
    for card in ["*ELEMENT, TYPE=S4, INPUT=rest.inp\n", "*NODE, input=rest.inp\n", "*NSET, NSET=a, INPUT=rest.inp\n"] {
        let error = points(Format::Inp, &format!("{SQUARE}{card}")).unwrap_err();
        assert!(error.contains("rest.inp") && error.contains("line 8"), "{card}: {error}");
    }
}

#[test]
fn cards_about_the_analysis_are_passed_over() {
    let cards =
        "*MATERIAL, NAME=steel\n*ELASTIC\n210000, 0.3\n*STEP\n*STATIC\n*CLOAD\n1, 3, 1.0\n*NODE FILE\nU\n*END STEP\n";
    assert_eq!(points(Format::Inp, &format!("{SQUARE}{cards}")).unwrap().len(), 4);
}

/// The square with these cards after it: its groups of faces, and what was left out.
fn groups(cards: &str) -> (Vec<String>, Vec<String>) {
    let deck = format!("{SQUARE}*ELSET, ELSET=skin\n1\n{cards}");
    let (soup, counts) = read(Format::Inp, deck.as_bytes(), &Watch::silent()).expect("a square");
    assert_eq!((soup.points.len(), soup.faces.len()), (4, 1));
    (soup.carried.groups.faces.keys().cloned().collect(), counts.left_out())
}

#[test]
fn a_set_or_surface_that_is_not_understood_is_left_out_and_named() {
    for (card, left_out) in [
        ("*SURFACE, NAME=s, COMBINE=UNION\nskin, other\n", "surface `s` (line 10): COMBINE=UNION"),
        ("*SURFACE, NAME=s, COMBINE=DIFFERENCE\nskin\n", "surface `s` (line 10): COMBINE=DIFFERENCE"),
        ("*SURFACE, NAME=s\n,\n", "surface `s` (line 10): all free faces of the model"),
        ("*SURFACE, NAME=s, TYPE=ELEMENT\nskin,\n, SPOS\n", "surface `s` (line 10): all free faces of the model"),
        ("*SURFACE, NAME=s, TYPE=CYLINDER\nSTART, 0., 0.\nLINE, 1., 0.\n", "surface `s` (line 10): TYPE=CYLINDER"),
        ("*SURFACE, TYPE=revolution, NAME=s\nSTART, 0., 0.\n", "surface `s` (line 10): TYPE=REVOLUTION"),
        ("*SURFACE, NAME=s\nskin, EDGE\n", "surface `s` (line 10): side `EDGE`"),
        ("*SURFACE, NAME=s\nrest, SPOS\n", "surface `s` (line 10): no set `rest` could be read from the file"),
        ("*ELSET, ELSET=s\nskin, rest\n", "element set `s` (line 10): no set `rest` could be read from the file"),
        (
            "*ELSET, ELSET=s, GENERATE\none, 2\n",
            "element set `s` (line 10): expected a range of numbers, found \"one\"",
        ),
        ("*NSET, NSET=s, INSTANCE=I\n1\n", "node set `s` (line 10): no instance `I` is defined above"),
        ("*NSET\n1\n", "node set `` (line 10): it has no name"),
        ("*NSET, NSET=s, ELSET=skin\n", "node set `s` (line 10): ELSET=skin"),
    ] {
        assert_eq!(groups(card), (vec!["skin".to_owned()], vec![left_out.to_owned()]), "{card}");
    }
}

#[test]
fn numbers_that_nobody_has_are_left_out_of_their_set_and_counted() {
    let (names, left_out) = groups("*ELSET, ELSET=more\n1, 7, 8\n");
    assert_eq!((names.len(), left_out.len()), (2, 1));
    assert_eq!(left_out, ["2 members of element set `more` (line 10), which the file does not have"]);
}

#[test]
fn names_in_notes_cannot_steer_a_terminal() {
    let (_, left_out) = groups("*SURFACE, NAME=a\u{1b}[2Jb, COMBINE=UNION\nskin\n");
    assert_eq!(left_out, ["surface `a\\u{1b}[2Jb` (line 10): COMBINE=UNION"]);
}

#[test]
fn notes_are_counted_when_there_are_many() {
    let cards = "*SURFACE, NAME=s, COMBINE=UNION\n".repeat(1000);
    let (_, left_out) = groups(&cards);
    assert_eq!((left_out.len(), left_out.last().unwrap().as_str()), (41, "960 more things of this kind"));
}

#[test]
fn an_element_takes_neither_more_nor_fewer_nodes_than_its_type_has() {
    let deck = |elements: &str| format!("{}{elements}", &SQUARE[..SQUARE.len() - "1, 1, 2, 3, 4\n".len()]);
    for (elements, line) in [("1, 1, 2, 3, 4, 2\n", 7), ("1, 1, 2, 3\n2, 2, 3, 4, 1\n", 8)] {
        let error = points(Format::Inp, &deck(elements)).unwrap_err();
        assert!(error.contains(&format!("line {line}: expected the end of the element")), "{error}");
    }
    for elements in ["1, 1, 2, 3, 4,\n", "1, 1, 2,\n3, 4\n", "1, 1, 2, 3, 4, ,\n"] {
        assert_eq!(points(Format::Inp, &deck(elements)).unwrap().len(), 4);
    }
    let beam = format!("{SQUARE}*ELEMENT, TYPE=B31\n2, 1, 2, 4\n");
    assert_eq!(points(Format::Inp, &beam).unwrap().len(), 4, "a beam may name a node for its orientation");
}
