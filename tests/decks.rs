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
    is(&triangle(&format!("GRDSET,,5\nGRDSET,,5\n{SHIFTED}"), "").unwrap(), &shifted);
    let two = triangle(&format!("GRDSET,,5\nGRDSET,,0\n{SHIFTED}"), "").unwrap_err();
    assert!(two.contains("line 6: a second GRDSET, with another coordinate system, is not supported"), "{two}");
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
        ("CORD2R,9,,0.,1.7+308,0.,0.,1.7+308,1.\n,5.,1.7+308,0.\nGRID,9,9,0.,1.7+308,0.\n", "is not a finite number"),
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

const PART: &str = "*PART, NAME=P\n*NODE, NSET=all\n1, 0, 0, 0\n2, 10, 0, 0\n3, 10, 20, 0\n4, 0, 20, 0\n\
    *ELEMENT, TYPE=S4, ELSET=skin\n1, 1, 2, 3, 4\n*END PART\n*ASSEMBLY, NAME=A\n";

/// The assembly of these cards: its mesh and what was left out.
fn assembly(cards: &str) -> Result<(meshmill::mesh::Soup, Vec<String>), String> {
    let deck = format!("{PART}{cards}*END ASSEMBLY\n");
    let read = read(Format::Inp, deck.as_bytes(), &Watch::silent());
    read.map(|(soup, counts)| (soup, counts.left_out())).map_err(|error| error.to_string())
}

fn names(soup: &meshmill::mesh::Soup) -> Vec<String> {
    soup.carried.groups.list().map(|(kind, name, size)| format!("{kind} {name} {size}")).collect()
}

#[test]
fn an_instance_is_moved_then_turned() {
    let turned = "*INSTANCE, NAME=P-1, PART=P\n5., 0., 0.\n0.,0.,0., 0.,0.,1., 90.\n*END INSTANCE\n";
    let (soup, _) = assembly(turned).unwrap();
    let expected = [[0.0, 5.0, 0.0], [0.0, 15.0, 0.0], [-20.0, 15.0, 0.0], [-20.0, 5.0, 0.0]];
    is(soup.points.as_slice(), &expected);
    assert_eq!(names(&soup), ["faces skin 1", "vertices all 4"]);
    // About an axis elsewhere, not along a coordinate, and by no quarter.
    let turned = "*INSTANCE, NAME=P-1, PART=p\n0., 0., 1.\n1.,1.,1., 2.,2.,2., 120.\n*END INSTANCE\n";
    let (soup, _) = assembly(turned).unwrap();
    is(&soup.points.as_slice()[..2], &[[1.0, 0.0, 0.0], [1.0, 10.0, 0.0]]);
    for (cards, message) in [
        ("*INSTANCE, NAME=I, PART=Q\n", "expected a part defined above, found \"Q\""),
        ("*INSTANCE, NAME=I, PART=P\n1, 2, 3, 4\n", "line 12: expected the end of the line"),
        ("*INSTANCE, NAME=I, PART=P\n0,0,0\n1,1,1,1,1,1,30\n", "an axis between two points that differ"),
        ("*INSTANCE, NAME=I, PART=P\n1.7e308\n-1.7e308,0,0,-1.7e308,0,1,45\n", "instance is not a finite number"),
        ("*INSTANCE, NAME=I, PART=P\n*NODE\n9, 1, 1, 1\n", "*NODE within an instance"),
        (
            "*INSTANCE, NAME=I, PART=P\n*END INSTANCE\n*INSTANCE, NAME=i, PART=P\n",
            "another name than that of an instance",
        ),
    ] {
        let error = assembly(cards).unwrap_err();
        assert!(error.contains(message), "{cards}: {error}");
    }
}

const TWO: &str = "*INSTANCE, NAME=I1, PART=P\n*END INSTANCE\n*INSTANCE, NAME=I2, PART=P\n100.,0.,0.\n*NSET, NSET=own\n1, 2\n\
    *END INSTANCE\n";

#[test]
fn each_instance_has_its_own_nodes_and_sets() {
    let sets = "*NSET, NSET=top, INSTANCE=I2\n4,\n*ELSET, ELSET=both, INSTANCE=I1\n1,\n*ELSET, ELSET=both, INSTANCE=I2\n1,\n\
        *SURFACE, NAME=face\nI2.skin, SPOS\n*NSET, NSET=corner\nI1.1, I2.3\n";
    let (soup, left_out) = assembly(&format!("{TWO}{sets}")).unwrap();
    assert_eq!((soup.points.len(), soup.faces.len(), left_out.len()), (8, 2, 0), "{left_out:?}");
    assert_eq!(soup.points.as_slice()[6], dvec3(110.0, 20.0, 0.0));
    let groups = ["faces I1.skin 1", "faces I2.skin 1", "faces both 2", "faces face 1", "vertices I1.all 4"];
    assert_eq!(names(&soup)[..5], groups);
    assert_eq!(names(&soup)[5..], ["vertices I2.all 4", "vertices corner 2", "vertices own 2", "vertices top 1"]);
    let of = |name: &str| soup.carried.groups.vertices[name].iter().map(|v| v.index()).collect::<Vec<_>>();
    assert_eq!((of("top"), of("own"), of("corner")), (vec![7], vec![4, 5], vec![0, 6]));
}

#[test]
fn what_an_assembly_has_besides_its_instances() {
    let (soup, left_out) = assembly(&format!("{TWO}*ELEMENT, TYPE=CONN3D2\n1, I1.1, I2.2\n")).unwrap();
    assert_eq!((soup.faces.len(), left_out), (2, vec!["1 elements that are no faces".to_owned()]));
    let other = "*END ASSEMBLY\n*PART, NAME=spare\n*NODE\n1, 7, 7, 7\n*NSET, NSET=one\n1\n*END PART\n*ASSEMBLY\n";
    let (soup, left_out) = assembly(&format!("{other}{TWO}")).unwrap();
    assert_eq!((soup.points.len(), soup.faces.len()), (8, 2));
    assert_eq!(left_out[0], "part `spare`, which has no instance");
}

#[test]
fn instances_without_end_are_refused() {
    let nodes: Vec<String> = (1..500).map(|i| format!("{i}, {i}, 0, 0\n")).collect();
    let instances: Vec<String> = (0..2000).map(|i| format!("*INSTANCE, NAME=I{i}, PART=P\n*END INSTANCE\n")).collect();
    let (part, instances) = (format!("*PART, NAME=P\n*NODE\n{}", nodes.concat()), instances.concat());
    let error = points(Format::Inp, &format!("{part}*END PART\n{instances}")).unwrap_err();
    assert!(error.contains("nodes and elements of instances"), "{error}");
}

/// Two bricks on each other, split so that every kind of volume occurs in one of the decks.
const BRICKS: &str = "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,0,0,1\n6,1,0,1\n7,1,1,1\n8,0,1,1\n\
    9,0,0,2\n10,1,0,2\n11,1,1,2\n12,0,1,2\n13,.5,.5,3\n";

/// Volume of the closed surface, and how many faces it has.
fn volume(deck: &str) -> (f64, usize, Vec<String>) {
    let (soup, counts) = read(Format::Inp, deck.as_bytes(), &Watch::silent()).expect("a volume mesh");
    let six: f64 = soup
        .faces
        .iter()
        .flat_map(|face| {
            let at: Vec<DVec3> = face.corners().iter().map(|&v| soup.points[v]).collect();
            (1..at.len() - 1).map(|i| at[0].dot(at[i].cross(at[i + 1]))).collect::<Vec<_>>()
        })
        .sum();
    let mut all = names(&soup);
    all.extend(counts.left_out());
    (six / 6.0, soup.faces.len(), all)
}

#[test]
fn a_mesh_of_volumes_is_its_skin_with_the_sets_as_groups() {
    let bricks =
        "*ELEMENT, TYPE=C3D8, ELSET=low\n1, 1,2,3,4,5,6,7,8\n*ELEMENT, TYPE=C3D8R, ELSET=high\n2, 5,6,7,8,9,10,11,12\n";
    let inside = "the inside of 2 volume elements, of which the mesh is the skin".to_owned();
    let said = ["faces high 5", "faces low 5", inside.as_str(), "1 nodes of these, and between corners"];
    let (size, faces, all) = volume(&format!("{BRICKS}{bricks}"));
    assert_eq!((size, faces, all[..3].to_vec()), (2.0, 10, said[..3].iter().map(|&s| s.to_owned()).collect()));
    // Two wedges, one of them inside out, and a pyramid on top, whose base is no side of theirs.
    let wedges = "*ELEMENT, TYPE=C3D6\n1, 1,2,3,5,6,7\n2, 1,4,3,5,8,7\n*ELEMENT, TYPE=C3D5\n3, 5,6,7,8,13\n";
    let (size, faces, _) = volume(&format!("{BRICKS}{wedges}"));
    assert!((size - 1.0 - 2.0 / 3.0).abs() < 1e-12 && faces == 8 + 5, "{size} {faces}");
    let tetrahedra = "*ELEMENT, TYPE=C3D4\n1, 1,2,3,6\n2, 1,3,4,8\n3, 1,6,8,5\n4, 3,8,6,7\n5, 1,3,8,6\n";
    let (size, faces, _) = volume(&format!("{BRICKS}{tetrahedra}"));
    assert!((size - 1.0).abs() < 1e-12 && faces == 12, "{size} {faces}");
}

#[test]
fn volumes_beside_faces_are_left_out() {
    let both = "*ELEMENT, TYPE=C3D4\n1, 1,2,3,6\n*ELEMENT, TYPE=S3\n2, 1,2,3\n";
    let (_, faces, all) = volume(&format!("{BRICKS}{both}"));
    assert_eq!((faces, all[0].as_str()), (1, "1 elements that are no faces"));
}

#[test]
fn solids_of_nastran_are_their_skin_too() {
    let grids = "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,0.,1.,0.\nGRID,4,,0.,0.,1.\n";
    let deck = format!("BEGIN BULK\n{grids}CTETRA,1,7,1,2,3,4\nENDDATA\n");
    let some = format!("BEGIN BULK\n{grids}GRID,5,,.5,0.,0.\nCTETRA,1,7,1,2,3,4,5\nENDDATA\n");
    for deck in [deck, some] {
        let (soup, _) = read(Format::Bdf, deck.as_bytes(), &Watch::silent()).expect("a tetrahedron");
        assert_eq!((soup.points.len(), soup.faces.len(), names(&soup)), (4, 4, vec!["faces pid_7 4".to_owned()]));
    }
}

#[test]
fn cards_that_nobody_knows_are_named_and_those_of_the_analysis_are_not() {
    let (_, left_out) =
        groups("*ELASTIC\n1, 0\n*WOBBLE, BY=2\n1, 2\n*SHELL SECTION, ELSET=skin\n1.\n*WOBBLE\n*STEP\n*ODD\n");
    assert_eq!(left_out, ["card `*WOBBLE` (line 12), which is not known"]);
    let deck = "BEGIN BULK\nGRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,0.,1.,0.\nCTRIA3,1,1,1,2,3\nPSHELL,1,1,.1\n\
        MAT1,1,2.+5\nCTRIAX6,2,1,1,2,3\nCTRIAX6,3,1,1,2,3\nWOBBLE,1\nSPC1,1,123,1\nENDDATA\n";
    let (_, counts) = read(Format::Bdf, deck.as_bytes(), &Watch::silent()).unwrap();
    assert_eq!(counts.left_out(), ["2 elements `CTRIAX6`", "1 cards `WOBBLE`, which are not known"]);
    for card in ["=,*(1),=,=,*(1.)", "CGEN,TRIA3,1", "SEBULK,1,MIRROR"] {
        let error = points(Format::Bdf, &deck.replace("WOBBLE,1", card)).unwrap_err();
        assert!(error.contains("which makes or moves parts of the mesh"), "{card}: {error}");
    }
}

#[test]
fn sides_of_volumes_are_their_faces_on_the_skin() {
    let bricks = "*ELEMENT, TYPE=C3D8, ELSET=all\n1, 1,2,3,4,5,6,7,8\n2, 5,6,7,8,9,10,11,12\n";
    let sides = "*SURFACE, NAME=bottom\n1, S1\n*SURFACE, NAME=x\nall, S4\n*SURFACE, NAME=top\n1, S2\n2, S2\n";
    let deck = format!("{BRICKS}{bricks}{sides}");
    let (soup, counts) = read(Format::Inp, deck.as_bytes(), &Watch::silent()).expect("two bricks");
    let all_at = |name: &str, axis: usize, value: f64| {
        let faces = &soup.carried.groups.faces[name];
        let mut corners = faces.iter().flat_map(|&f| soup.faces[f].corners().to_vec());
        assert!(corners.all(|v| soup.points[v][axis] == value), "{name}");
        faces.len()
    };
    assert_eq!((all_at("bottom", 2, 0.0), all_at("x", 0, 1.0), all_at("top", 2, 2.0)), (1, 2, 1));
    assert!(counts.left_out().contains(&"1 sides of surface `top` (line 22), which lie inside".to_owned()));
    // Numbers of sides as Abaqus counts them, for each kind of volume.
    for (kind, nodes, side, expected) in [
        ("C3D4", "1,2,4,5", 2, [1, 2, 5].as_slice()),
        ("C3D6", "1,2,3,5,6,7", 4, &[2, 3, 6, 7]),
        ("C3D5", "5,6,7,8,13", 3, &[6, 7, 13]),
        ("C3D8", "1,2,3,4,5,6,7,8", 6, &[1, 4, 5, 8]),
    ] {
        let deck = format!(
            "{BRICKS}*ELEMENT, TYPE={kind}\n1, {nodes}\n*SURFACE, NAME=s\n1, S{side}\n*NSET, NSET=n\n1,2,3,4,5,6,7,8,9,10,11,12,13\n"
        );
        let (soup, _) = read(Format::Inp, deck.as_bytes(), &Watch::silent()).expect(kind);
        let corners = soup.faces[soup.carried.groups.faces["s"][0]].corners();
        let mut at: Vec<String> = corners.iter().map(|&v| soup.points[v].to_string()).collect();
        let node = |n: &i32| {
            let line = BRICKS.lines().find(|line| line.starts_with(&format!("{n},"))).expect("a node");
            let mut numbers = line.split(',').skip(1).map(|x| x.parse::<f64>().expect("a number"));
            let mut next = || numbers.next().expect("three");
            dvec3(next(), next(), next()).to_string()
        };
        let mut expected: Vec<String> = expected.iter().map(node).collect();
        at.sort();
        expected.sort();
        assert_eq!(at, expected, "{kind}");
    }
}
