//! The element types of input files: their shapes and node counts.

use super::super::element::Shape;

/// The shape and the number of nodes of an element type in upper case, `None` when it is not known.
pub(super) fn element_type(name: &str) -> Option<(Shape, usize)> {
    const LINES: [(&str, usize); 20] = [
        ("B21", 2),
        ("B22", 3),
        ("B23", 2),
        ("B31", 2),
        ("B32", 3),
        ("B33", 2),
        ("T2D2", 2),
        ("T2D3", 3),
        ("T3D2", 2),
        ("T3D3", 3),
        ("PIPE31", 2),
        ("PIPE32", 3),
        ("R2D2", 2),
        ("RAX2", 2),
        ("RB3D2", 2),
        ("FRAME3D", 2),
        ("CONN3D2", 2),
        ("SPRINGA", 2),
        ("SPRING2", 2),
        ("DASHPOTA", 2),
    ];
    const POINTS: [&str; 4] = ["MASS", "ROTARYI", "SPRING1", "DASHPOT1"];
    const SOLIDS: [&str; 4] = ["DC3D", "C3D", "COH3D", "SC"];
    const SHEETS: [&str; 17] = [
        "SFM3D", "M3D", "R3D", "F3D", "ACIN3D", "CPEG", "CPE", "CPS", "CGAX", "DCAX", "CAX", "DC2D", "AC2D", "DS",
        "STRI", "WARP2D", "S",
    ];
    if POINTS.contains(&name) {
        return Some((Shape::Point, 1));
    }
    if let Some(&(_, nodes)) = LINES.iter().find(|(line, _)| name.starts_with(line)) {
        return Some((Shape::Line, nodes));
    }
    if name == "STRI65" {
        return Some((Shape::Triangle, 6));
    }
    if let Some(nodes) = SOLIDS.iter().find_map(|family| leading_number(name.strip_prefix(family)?)) {
        return Some((Shape::Volume, nodes)).filter(|_| (4..=64).contains(&nodes));
    }
    match SHEETS.iter().find_map(|family| leading_number(name.strip_prefix(family)?))? {
        nodes @ (3 | 6 | 7) => Some((Shape::Triangle, nodes)),
        nodes @ (4 | 8 | 9) => Some((Shape::Quad, nodes)),
        _ => None,
    }
}

fn leading_number(text: &str) -> Option<usize> {
    let digits = text.bytes().take_while(u8::is_ascii_digit).count();
    text[..digits].parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shells_membranes_beams_and_solids_are_told_apart() {
        let cases = [
            ("S3", Shape::Triangle, 3),
            ("S3R", Shape::Triangle, 3),
            ("STRI3", Shape::Triangle, 3),
            ("STRI65", Shape::Triangle, 6),
            ("S6", Shape::Triangle, 6),
            ("CPS3", Shape::Triangle, 3),
            ("M3D3", Shape::Triangle, 3),
            ("S4R5", Shape::Quad, 4),
            ("S8R", Shape::Quad, 8),
            ("S9R5", Shape::Quad, 9),
            ("CPE4R", Shape::Quad, 4),
            ("R3D4", Shape::Quad, 4),
            ("B32R", Shape::Line, 3),
            ("C3D10M", Shape::Volume, 10),
            ("SC8R", Shape::Volume, 8),
            ("MASS", Shape::Point, 1),
        ];
        for (name, shape, nodes) in cases {
            assert_eq!(element_type(name), Some((shape, nodes)), "{name}");
        }
        assert_eq!(element_type("U1"), None);
    }
}
