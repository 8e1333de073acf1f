//! Remove-features: a hole goes, the rest stays.

use super::golden::golden;
use crate::corpus::corpus;
use crate::shapes;
use crate::step::{run, soup, surface};
use meshmill::format::{Format, read};
use meshmill::watch::Watch;

#[test]
fn the_hole_of_a_washer_goes() {
    let marked = run("features", "", &surface(shapes::surface(&shapes::washer(24)))).artifact;
    let made = golden("remove-features", "washer", "max-diameter = 0.8", &marked);
    assert_eq!(made.stats["through-holes"], 1);
    let same = run("remove-features", "max-diameter = 0.5", &marked);
    assert_eq!(same.stats["through-holes"], 0, "a hole wider than asked stays");
}

/// How models were drilled: for a largest diameter, through holes, blind holes, and openings below it that are not
/// round, or break out at their side, and stay.
type Drilled = (f64, [u64; 3]);

/// The ring of 1.8 mm; seven screws of 3 mm, as the notch has cut the eighth; pivot and spindle, past four slots and
/// the hollows below four beads.
const COVER: [Drilled; 3] = [(2.0, [6, 0, 0]), (3.2, [13, 0, 1]), (7.0, [15, 0, 9])];

/// Microphone and screw bosses; the slots of the ear piece stay.
const PANEL: [Drilled; 1] = [(5.0, [1, 6, 5])];

/// Cap screws of bearings, neck and lid; twelve counterbored flange holes and the drain. The counterbores have left
/// notches in the four end ribs, three of them a little more than a third of the turn.
const CASTING: [Drilled; 2] = [(12.0, [0, 40, 0]), (30.0, [13, 40, 3])];

#[test]
fn the_holes_that_a_part_was_drilled_with_go_and_nothing_else() {
    check_drilled("cad/hdd_cover.stl", &COVER);
    check_drilled("cad/phone_panel.stl", &PANEL);
    check_drilled("cad/casting_part.stl", &CASTING);
}

fn check_drilled(part: &str, drilled: &[Drilled]) {
    let Some(path) = corpus(part) else { return };
    let bytes = std::fs::read(path).expect("a file of the corpus");
    let mesh = read(Format::Stl, &bytes, &Watch::silent()).expect("a good file").0;
    let clean = run("repair", "", &soup(mesh)).artifact;
    let marked = run("features", "", &clean).artifact;
    for (diameter, expected) in drilled {
        let stats = run("remove-features", &format!("max-diameter = {diameter:?}"), &marked).stats;
        let count = |name: &str| stats[name].as_u64().expect("a count");
        assert_eq!(["through-holes", "blind-holes", "refused"].map(count), *expected, "{part} to {diameter}");
    }
}
