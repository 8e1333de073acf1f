//! Decks that include other files: read with them, from below their folder only, and up to date only while all are as
//! they were.

use std::fs;

use predicates::prelude::*;

#[path = "common/desk.rs"]
mod desk;

use desk::Desk;

const RECIPE: &str = "name = \"part\"\n[inputs]\npart = \"main.inp\"\n[steps.raw]\nuse = \"read\"\nfile = \"=inputs.part\"\n\
    [outputs]\nraw = [\"result.obj\"]\n";

const NODES: &str = "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n";

const MAIN: &str = "*INCLUDE, INPUT=parts/mesh.inc\n*NSET, NSET=tip\n3,\n";

impl Desk {
    /// A deck that includes a file, which includes another.
    fn new() -> Self {
        let desk = Self::with(&[]);
        desk.write("deck/recipe.toml", RECIPE);
        desk.write("deck/main.inp", MAIN);
        desk.write("deck/parts/mesh.inc", "*INCLUDE, INPUT=parts/nodes.inc\n*ELEMENT, TYPE=S3\n1, 1, 2, 3\n");
        desk.write("deck/parts/nodes.inc", NODES);
        desk
    }

    fn in_deck(&self, arguments: &[&str]) -> assert_cmd::assert::Assert {
        self.meshmill(arguments).current_dir(self.path("deck")).assert()
    }

    fn run(&self) -> assert_cmd::assert::Assert {
        self.in_deck(&["run", "recipe.toml", "--pictures", "none", "--out", "o"])
    }
}

/// `measure` refuses the deck with this message.
#[track_caller]
fn refused(desk: &Desk, main: &str, message: &str) {
    desk.write("deck/main.inp", main);
    desk.in_deck(&["measure", "main.inp"]).code(2).stderr(predicate::str::contains(message));
    desk.run().code(2).stderr(predicate::str::contains(message));
}

#[test]
fn included_files_are_read_and_a_change_of_any_makes_another_result() {
    let desk = Desk::new();
    desk.run().success();
    let first = desk.text("deck/o/result.obj");
    desk.run().success();
    assert_eq!(desk.text("deck/o/result.obj"), first);
    desk.write("deck/parts/nodes.inc", &NODES.replace("2, 1, 0", "2, 7, 0"));
    desk.run().success();
    let second = desk.text("deck/o/result.obj");
    assert!(second.contains("v 7 0 0"), "{second}");
    desk.write(
        "deck/parts/mesh.inc",
        &format!("{}*ELEMENT, TYPE=S3\n1, 1, 2, 3\n", NODES.replace("2, 1, 0", "2, 9, 0")),
    );
    desk.run().success();
    assert!(desk.text("deck/o/result.obj").contains("v 9 0 0"));
}

#[test]
fn a_name_is_looked_for_in_the_folder_of_the_deck_then_beside_the_file_that_has_it() {
    let desk = Desk::new();
    desk.write("deck/parts/mesh.inc", "\u{feff}*INCLUDE, INPUT=nodes.inc\n*ELEMENT, TYPE=S3\n1, 1, 2, 3\n");
    desk.run().success();
    assert!(desk.text("deck/o/result.obj").contains("v 1 0 0"));
    // A file in the deck's folder comes first, also where it comes later.
    desk.write("deck/nodes.inc", &NODES.replace("2, 1, 0", "2, 6, 0"));
    desk.run().success();
    assert!(desk.text("deck/o/result.obj").contains("v 6 0 0"));
    desk.write("deck/parts/mesh.inc", "*INCLUDE, INPUT=../../secret.inc\n");
    desk.write("secret.inc", NODES);
    refused(&desk, MAIN, "`../../secret.inc` is not included: it lies outside of");
}

#[test]
fn the_data_of_cards_is_read_from_their_files() {
    let desk = Desk::new();
    desk.write("deck/nodes.dat", NODES.trim_start_matches("*NODE\n"));
    desk.write("deck/parts/faces.dat", "1, 1, 2, 3\n");
    let cards = "*NODE, NSET=all, INPUT=nodes.dat\n*ELEMENT, TYPE=S3,\nELSET=skin, INPUT=parts\\faces.dat\n";
    desk.write("deck/main.inp", cards);
    desk.run().success();
    assert!(desk.text("deck/o/result.obj").contains("g skin\nf 1 2 3"));
    // A change of a file of data is a change of the input.
    desk.write("deck/nodes.dat", "1, 0, 0, 0\n2, 8, 0, 0\n3, 0, 1, 0\n");
    desk.run().success();
    assert!(desk.text("deck/o/result.obj").contains("v 8 0 0"));
    desk.write("deck/nodes.dat", "1, 0, 0, 0\n2, x, 0, 0\n3, 0, 1, 0\n");
    refused(&desk, cards, "nodes.dat, line 2: ");
    refused(&desk, "*NODE, INPUT=../secret.inc\n", "there is no such file");
    desk.write("secret.inc", NODES);
    refused(&desk, "*NODE, INPUT=../secret.inc\n", "it lies outside of");
}

#[test]
fn decks_of_nastran_include_too() {
    let desk = Desk::new();
    desk.write("deck/grid.inc", "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,0.,1.,0.\n");
    desk.write("deck/main.bdf", "BEGIN BULK\nINCLUDE 'grid.inc'\nCTRIA3,1,1,1,2,3\nENDDATA\n");
    desk.in_deck(&["measure", "main.bdf"]).success();
    desk.write("deck/main.bdf", "BEGIN BULK\nINCLUDE '.\\grid.inc'\nCTRIA3,1,1,1,2,x\nENDDATA\n");
    desk.in_deck(&["measure", "main.bdf"]).code(2).stderr(predicate::str::contains("Nastran bulk data, line 3: "));
    desk.write("deck/grid.inc", "GRID,1,,0.,0.,0.\nGRID,2,,1.,y,0.\n");
    let told = "Nastran bulk data, .\\\\grid.inc, line 2: ";
    desk.in_deck(&["measure", "main.bdf"]).code(2).stderr(predicate::str::contains(told));
}

#[test]
fn nothing_is_included_from_outside_of_the_folder() {
    let desk = Desk::new();
    desk.write("secret.inc", NODES);
    let whole = desk.path("secret.inc");
    for name in ["../secret.inc", "parts/../../secret.inc", whole.to_str().unwrap()] {
        refused(&desk, &format!("*INCLUDE, INPUT={name}\n"), "it lies outside of");
    }
    refused(&desk, "*NODE\n*INCLUDE, INPUT=none.inc\n", "line 2: `none.inc` is not included: there is no such file");
    refused(&desk, "*INCLUDE, INPUT=parts\n", "it is not a file");
    desk.write("deck/self.inc", "*INCLUDE, INPUT=self.inc\n");
    refused(
        &desk,
        "*INCLUDE, INPUT=self.inc\n",
        "self.inc, line 1: `self.inc` is not included: the file includes itself",
    );
}

#[cfg(unix)]
#[test]
fn links_may_lead_anywhere_below_the_folder_and_nowhere_else() {
    use std::os::unix::fs::symlink;
    let desk = Desk::new();
    desk.write("secret.inc", NODES);
    symlink(desk.path("secret.inc"), desk.path("deck/out.inc")).unwrap();
    symlink(desk.path(""), desk.path("deck/up")).unwrap();
    symlink("parts/mesh.inc", desk.path("deck/in.inc")).unwrap();
    refused(&desk, "*INCLUDE, INPUT=out.inc\n", "it lies outside of");
    refused(&desk, "*INCLUDE, INPUT=up/secret.inc\n", "it lies outside of");
    desk.write("deck/main.inp", "*INCLUDE, INPUT=in.inc\n");
    desk.run().success();
    // A link that leads to another file is another file.
    desk.write("deck/other.inc", &format!("{}*ELEMENT, TYPE=S3\n1, 1, 2, 3\n", NODES.replace("2, 1, 0", "2, 5, 0")));
    fs::remove_file(desk.path("deck/in.inc")).unwrap();
    symlink("other.inc", desk.path("deck/in.inc")).unwrap();
    desk.run().success();
    assert!(desk.text("deck/o/result.obj").contains("v 5 0 0"));
}

#[test]
fn an_output_does_not_replace_an_included_file() {
    let desk = Desk::new();
    desk.write("deck/o/result.obj", NODES);
    desk.write("deck/main.inp", "*INCLUDE, INPUT=o/result.obj\n*ELEMENT, TYPE=S3\n1, 1, 2, 3\n");
    desk.run().code(2).stderr(predicate::str::contains("which the run reads"));
    assert_eq!(desk.text("deck/o/result.obj"), NODES);
}
