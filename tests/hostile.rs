//! Files made to exhaust a reader: each gives an error, at once and without memory for what it only claims to hold.

use std::io::Write;

use meshmill::format::{Format, FormatError, read};
use meshmill::watch::Watch;

/// The error of a file that must not be read.
fn refused(format: Format, bytes: &[u8]) -> FormatError {
    read(format, bytes, &Watch::silent()).map(drop).expect_err("a hostile file is read")
}

fn vtu(points: &str, attributes: &str, rest: &str) -> Vec<u8> {
    format!(
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt32\"{attributes}>\
         <UnstructuredGrid><Piece NumberOfPoints=\"{points}\" NumberOfCells=\"1\"><Points>{rest}</Points>\
         </Piece></UnstructuredGrid></VTKFile>"
    )
    .into_bytes()
}

#[test]
fn xml_that_is_deep_or_grows() {
    let deep = [b"<VTKFile type=\"UnstructuredGrid\">".to_vec(), b"<a>".repeat(300_000)].concat();
    refused(Format::Vtu, &deep);
    let mut entities = String::from("<!DOCTYPE v [<!ENTITY a0 \"0 0 0 0 0 0 0 0 0 0\">");
    for i in 1..12 {
        let name = format!("&a{};", i - 1);
        entities.extend(["<!ENTITY a", &i.to_string(), " \"", &name.repeat(10), "\">"]);
    }
    entities.push_str("]>");
    let array = "<DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">&a11;</DataArray>";
    refused(Format::Vtu, &[entities.into_bytes(), vtu("3", "", array)].concat());
}

#[test]
fn xml_with_attributes_or_name_spaces_without_end() {
    let many = |name: &str, count: usize| (0..count).map(|i| format!(" {name}{i}=\"1\"")).collect::<Vec<_>>().concat();
    let error = refused(Format::Vtu, &vtu("3", &many("a", 200_000), "")).to_string();
    assert!(error.contains("attributes"), "{error}");
    let nested = (0..30_000).map(|i| format!("<a xmlns:n{i}=\"u{i}\">")).collect::<Vec<_>>().concat();
    let error = refused(Format::Vtu, &vtu("3", "", &nested)).to_string();
    assert!(error.contains("name spaces"), "{error}");
    // Quotes and comments may hold what looks like attributes.
    let signs = format!("<!-- {} -->", "= ".repeat(200));
    let error = refused(Format::Vtu, &vtu("3", "", &signs)).to_string();
    assert!(!error.contains("attributes"), "{error}");
}

#[test]
fn compressed_data_that_grows_beyond_what_the_mesh_needs() {
    let mut packer = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    for _ in 0..64 {
        packer.write_all(&vec![0; 1 << 20]).unwrap();
    }
    let block = packer.finish().unwrap();
    let claimed: u32 = 1 << 26;
    let mut file = vtu(
        "3",
        " compressor=\"vtkZLibDataCompressor\"",
        "<DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"appended\" offset=\"0\"/>",
    );
    file.truncate(file.len() - "</VTKFile>".len());
    file.extend(b"<AppendedData encoding=\"raw\">_");
    for number in [1, claimed, 0, block.len() as u32] {
        file.extend(number.to_le_bytes());
    }
    file.extend(block);
    file.extend(b"</AppendedData></VTKFile>");
    refused(Format::Vtu, &file);
}

#[test]
fn counts_that_no_file_could_hold() {
    let huge = "999999999999";
    let array = "<DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">0 0 0</DataArray>";
    refused(Format::Vtu, &vtu(huge, "", array));
    let files = [
        (Format::Vtk, format!("# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS {huge} float\n0 0 0\n")),
        (Format::Vtk, "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS -1 float\n0 0 0\n".to_owned()),
        (Format::Msh, format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{huge}\n1 0 0 0\n$EndNodes\n")),
        (Format::Msh, format!("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 {huge} 1 {huge}\n2 1 0 {huge}\n1\n")),
        (Format::Off, format!("OFF\n{huge} {huge} 0\n0 0 0\n")),
        (Format::Off, "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n4000000000 0 1 2\n".to_owned()),
        (
            Format::Ply,
            format!(
                "ply\nformat ascii 1.0\nelement vertex {huge}\nproperty float x\nproperty float y\nproperty float z\n\
                 element face {huge}\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n"
            ),
        ),
        (Format::Obj, "v 0 0 0\nf 1 -5 99999999999999999999\n".to_owned()),
        (Format::Inp, "*NODE\n1, 0, 0, 0\n*ELEMENT, TYPE=S3\n1, 1, 2, 99999999999999999999\n".to_owned()),
        (Format::Inp, "*NODE\n1, 0, 0, 0\n*NSET, NSET=all, GENERATE\n1, 18446744073709551615, 1\n".to_owned()),
    ];
    for (format, text) in files {
        refused(format, text.as_bytes());
    }
    let mut stl = vec![0; 84 + 50];
    stl[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    refused(Format::Stl, &stl);
}
