//! Files as programs write them that follow no standard to the letter.

use meshmill::format::{Format, read};
use meshmill::watch::Watch;

const SOLID: &str = "solid a\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1.5 0 0\n   vertex 0 1 0\n\
    endloop\n endfacet\n facet normal 0 0 -1\n  outer loop\n   vertex 0 0 0\n   vertex 0 1 0\n   vertex 1.5 0 0\n\
    endloop\n endfacet\nendsolid a\n";

/// The number of faces and what was left out, or the error with its remedy.
fn outcome(format: Format, bytes: &[u8]) -> Result<(usize, Vec<String>), String> {
    match read(format, bytes, &Watch::silent()) {
        Ok((soup, counts)) => Ok((soup.faces.len(), counts.left_out())),
        Err(error) => Err(format!("{error}; {}", error.remedy.clone().unwrap_or_default())),
    }
}

fn stl(text: &str) -> Result<(usize, Vec<String>), String> {
    outcome(Format::Stl, text.as_bytes())
}

#[test]
fn keywords_of_stl_in_one_word_or_two_and_in_any_case() {
    for text in [
        SOLID.replace("endloop", "end loop"),
        SOLID.replace("endfacet", "End Facet").replace("endloop", "ENDLOOP"),
        SOLID.replace("endsolid", "end solid"),
        SOLID.replace("endloop", "end_loop").replace(' ', "\t"),
        SOLID.to_uppercase(),
        SOLID.replace("endsolid a", "end"),
    ] {
        assert_eq!(stl(&text), Ok((2, Vec::new())), "{text}");
    }
    let error = stl(&SOLID.replace("endloop", "end facet")).unwrap_err();
    assert!(error.contains("expected `endloop`"), "{error}");
}

#[test]
fn a_missing_end_of_stl_is_told_and_a_facet_cut_off_is_an_error() {
    let told = vec!["nothing, but the file ends before `endsolid`: it may be cut off".to_owned()];
    assert_eq!(stl(&SOLID.replace("endsolid a\n", "")), Ok((2, told.clone())));
    assert_eq!(stl(SOLID.trim_end().strip_suffix("endsolid a").unwrap().trim_end()), Ok((2, told)));
    assert!(stl(&SOLID.replace("endfacet\nendsolid a\n", "")).unwrap_err().contains("the file ends inside a facet"));
}

#[test]
fn decimal_commas_are_read_where_they_can_be_nothing_else() {
    let told = vec!["nothing, but decimal commas were taken for points".to_owned()];
    assert_eq!(stl(&SOLID.replace("1.5", "1,5")), Ok((2, told.clone())));
    assert_eq!(stl(&SOLID.replace("1.5", "1,5e+00").replace("vertex 0 0 0", "vertex 0,0 -0,0 0,0")), Ok((2, told)));
    assert!(stl(&SOLID.replace("1.5 0 0", "1,5,0,0")).is_err());
    assert!(stl(&SOLID.replace("1.5", "1,500.25")).is_err());
    let obj = b"v 0 0 0\nv 1,5 0 0\nv 0 1 0\nf 1 2 3\n";
    assert!(outcome(Format::Obj, obj).unwrap_err().contains("this is a decimal comma"));
}

#[test]
fn a_mark_of_utf_8_is_no_part_of_any_text() {
    let nodes = "1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n";
    let inp = format!("*NODE\n{nodes}*ELEMENT, TYPE=S3\n1, 1, 2, 3\n");
    let bdf = "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,0.,1.,0.\nCTRIA3,1,1,1,2,3\n";
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let vtk = "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n0 0 0 1 0 0 0 1 0\n\
        POLYGONS 1 4\n3 0 1 2\n";
    let off = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let formats =
        [(Format::Inp, &*inp), (Format::Bdf, bdf), (Format::Ply, ply), (Format::Vtk, vtk), (Format::Off, off)];
    for (format, text) in formats {
        let marked = format!("\u{feff}{text}");
        assert_eq!(outcome(format, marked.as_bytes()), Ok((1, Vec::new())), "{marked}");
        assert_eq!(Format::from_content(marked.as_bytes()), Format::from_content(text.as_bytes()), "{marked}");
    }
}

#[test]
fn text_before_a_solid_is_named() {
    for before in ["; exported by hand\n", "# a\n# b\n"] {
        let error = stl(&format!("{before}{SOLID}")).unwrap_err();
        assert!(
            error.contains("line 1: expected `solid`") && error.contains("there is text before `solid`"),
            "{error}"
        );
    }
}

#[test]
fn text_of_16_bits_a_letter_is_named() {
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let little: Vec<u8> = obj.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let big: Vec<u8> = SOLID.encode_utf16().flat_map(u16::to_be_bytes).collect();
    let marked = [b"\xff\xfe".as_slice(), &little].concat();
    for (format, bytes) in [(Format::Obj, &little), (Format::Stl, &big), (Format::Obj, &marked), (Format::Inp, &marked)]
    {
        let error = outcome(format, bytes).unwrap_err();
        assert!(error.contains("UTF-16") && error.contains("save it as UTF-8"), "{error}");
    }
}

#[test]
fn statements_and_sections_that_nobody_reads_are_named() {
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\ns 1\nf 1 2 3\n";
    assert_eq!(outcome(Format::Obj, obj.as_bytes()), Ok((1, Vec::new())));
    let free = format!("{obj}cstype bspline\ncurv 0 1 1 2\ncurv 0 1 2 3\nend\n");
    let named = vec!["1 statements `cstype`".to_owned(), "2 statements `curv`".to_owned()];
    assert_eq!(outcome(Format::Obj, free.as_bytes()), Ok((1, named)));
    let call = outcome(Format::Obj, format!("{obj}call other.obj\n").as_bytes()).unwrap_err();
    assert!(call.contains("line 9: `call`, which takes data from elsewhere, is not supported"), "{call}");
    let msh = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n$EndNodes\n$Elements\n1\n\
        1 2 2 0 1 1 2 3\n$EndElements\n$Comments\nx\n$EndComments\n$ElementNodeData\n1\n$EndElementNodeData\n";
    assert_eq!(outcome(Format::Msh, msh.as_bytes()), Ok((1, vec!["section `$ElementNodeData`".to_owned()])));
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nelement range_grid 1\nproperty list uchar int vertex_indices\n\
        end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n1 0\n";
    assert_eq!(outcome(Format::Ply, ply.as_bytes()), Ok((1, vec!["1 items of element `range_grid`".to_owned()])));
}
