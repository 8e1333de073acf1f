//! The finite-element formats: what is written comes back, and no bytes make a reader panic.

use glam::DVec3;
use meshmill::format::{self, Element, Format, WriteOptions};
use meshmill::mesh::{Carried, FaceId, Facet, Field, Regions, Soup, Support, VertexId, edge_key};
use meshmill::watch::Watch;
use proptest::prelude::*;

fn read(format: Format, bytes: &[u8]) -> Result<Soup, format::FormatError> {
    format::read(format, bytes, &Watch::silent()).map(|(soup, _)| soup)
}

fn write(format: Format, soup: &Soup, options: &WriteOptions<'_>) -> Vec<u8> {
    format::write(format, soup, options).expect("a valid mesh is written")
}

fn v(raw: u32) -> VertexId {
    VertexId::from_raw(raw)
}

fn f(raw: u32) -> FaceId {
    FaceId::from_raw(raw)
}

/// A triangle and a quad side by side, with everything that VTK formats carry.
fn sample() -> Soup {
    let mut soup = Soup::default();
    for (x, y) in [(0.0, 0.0), (1.0, 0.0), (0.25, 1.0), (2.0, 0.1), (1.5, 1.0)] {
        soup.points.push(DVec3::new(x, y, 0.1 * x * y));
    }
    soup.faces.push(Facet::Tri([v(0), v(1), v(2)]));
    soup.faces.push(Facet::Quad([v(1), v(3), v(4), v(2)]));
    let groups = &mut soup.carried.groups;
    groups.faces.insert("Inlet".into(), vec![f(0)]);
    groups.faces.insert("all_of_it".into(), vec![f(0), f(1)]);
    groups.edges.insert("rim".into(), vec![edge_key(v(0), v(1)), edge_key(v(1), v(3))]);
    groups.vertices.insert("fixed".into(), vec![v(0), v(4)]);
    soup
}

/// The sample with regions and fields.
fn rich_sample() -> Soup {
    let mut soup = sample();
    soup.carried.regions =
        Some(Regions { labels: vec![1, 0].into(), names: vec!["steel & <iron>".into(), "rubber".into()] });
    let field = |name: &str, support, components: usize, values: Vec<f64>| Field {
        name: name.into(),
        support,
        components,
        values,
    };
    soup.carried.set_field(field("curvature", Support::Vertex, 1, vec![0.5, 1.5, -2.0, 0.0, 1e-30]));
    soup.carried.set_field(field("normal", Support::Face, 3, vec![0.0, 0.0, 1.0, 0.25, 0.0, -1.0]));
    soup
}

fn binary() -> WriteOptions<'static> {
    WriteOptions { binary: true, header: "meshmill 0.1.0 0123abcd".into(), ..WriteOptions::default() }
}

fn text() -> WriteOptions<'static> {
    WriteOptions { binary: false, ..binary() }
}

#[test]
fn vtu_and_vtk_bring_everything_back() {
    let soup = rich_sample();
    for options in [binary(), text(), WriteOptions { element: Some(Element::S8R), ..binary() }] {
        for format in [Format::Vtu, Format::Vtk] {
            assert_eq!(read(format, &write(format, &soup, &options)), Ok(soup.clone()), "{format:?} {options:?}");
        }
    }
}

#[test]
fn vtp_is_polygonal_data_and_has_no_second_order() {
    let soup = rich_sample();
    for options in [binary(), text()] {
        let bytes = write(Format::Vtp, &soup, &options);
        assert!(bytes.windows(15).any(|w| w == b"type=\"PolyData\""));
        assert_eq!(read(Format::Vtp, &bytes), Ok(soup.clone()));
        assert_eq!(Format::from_content(&bytes), Some(Format::Vtp));
    }
    let quadratic = WriteOptions { element: Some(Element::S8R), ..binary() };
    let error = meshmill::format::write(Format::Vtp, &soup, &quadratic).expect_err("no such cells");
    assert!(error.to_string().contains("second-order"), "{error}");
}

#[test]
fn lz4_blocks_are_read() {
    // Text, but for the points: one block of 72 bytes for three points.
    let points: Vec<u8> =
        [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0_f64].iter().flat_map(|x| x.to_le_bytes()).collect();
    let packed = lz4_flex::block::compress(&points);
    let array = |name: &str, kind: &str, values: &str| {
        format!("<DataArray type=\"{kind}\" Name=\"{name}\" format=\"ascii\">{values}</DataArray>")
    };
    let cells = [array("connectivity", "Int64", "0 1 2"), array("offsets", "Int64", "3"), array("types", "UInt8", "5")];
    let mut file = format!(
        "<VTKFile type=\"UnstructuredGrid\" byte_order=\"LittleEndian\" header_type=\"UInt32\" \
         compressor=\"vtkLZ4DataCompressor\"><UnstructuredGrid><Piece NumberOfPoints=\"3\" NumberOfCells=\"1\"><Points>\
         <DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"appended\" offset=\"0\"/></Points><Cells>{}</Cells>\
         </Piece></UnstructuredGrid><AppendedData encoding=\"raw\">_",
        cells.concat()
    )
    .into_bytes();
    let head = file.len();
    for number in [1, 72, 0, packed.len() as u32] {
        file.extend(number.to_le_bytes());
    }
    file.extend(packed);
    file.extend(b"</AppendedData></VTKFile>");
    let soup = read(Format::Vtu, &file).expect("a good file");
    assert_eq!(soup.points.as_slice(), [DVec3::ZERO, DVec3::X, DVec3::Y]);
    // A block that is said to be larger than it is.
    file[head + 4] += 1;
    assert!(read(Format::Vtu, &file).is_err());
}

#[test]
fn second_order_vtu_reads_back_as_its_corners() {
    let soup = rich_sample();
    let options = WriteOptions { element: Some(Element::S6), ..text() };
    assert_eq!(read(Format::Vtu, &write(Format::Vtu, &soup, &options)), Ok(soup));
}

#[test]
fn inp_brings_faces_and_sets_back() {
    for element in [None, Some(Element::S6), Some(Element::S8R)] {
        let options = WriteOptions { element, first_id: Some(101), ..text() };
        let back = read(Format::Inp, &write(Format::Inp, &sample(), &options)).expect("reads");
        let mut expected = sample();
        // Sets of edges arrive as the nodes of the edges.
        expected.carried.groups.edges.clear();
        expected.carried.groups.vertices.insert("rim".into(), vec![v(0), v(1), v(3)]);
        assert_eq!(back, expected, "{element:?}");
    }
}

#[test]
fn msh_brings_groups_and_fields_back() {
    let mut soup = rich_sample();
    for format in [Format::Msh, Format::Msh22] {
        for options in [binary(), text(), WriteOptions { element: Some(Element::S6), ..binary() }] {
            let back = read(format, &write(format, &soup, &options)).expect("reads");
            let mut expected = rich_sample();
            // Regions are physical groups like others.
            expected.carried.regions = None;
            expected.carried.groups.faces.insert("rubber".into(), vec![f(0)]);
            expected.carried.groups.faces.insert("steel & <iron>".into(), vec![f(1)]);
            assert_eq!(back, expected, "{format:?} {options:?}");
        }
    }
    soup.carried = Carried::default();
    assert_eq!(read(Format::Msh, &write(Format::Msh, &soup, &text())), Ok(soup));
}

fn soups() -> impl Strategy<Value = Soup> {
    let points = prop::collection::vec(prop::array::uniform3(-1e3..1e3_f64), 4..20);
    let faces = prop::collection::vec((prop::array::uniform4(0..1000_u32), any::<bool>(), any::<u8>()), 1..24);
    (points, faces, 0..3_usize).prop_map(|(points, faces, names)| {
        let mut soup = Soup { points: points.into_iter().map(DVec3::from).collect(), ..Soup::default() };
        let n = soup.points.len() as u32;
        for (corners, quad, flags) in faces {
            // Four different corners, from four offsets.
            let a = corners[0] % n;
            let c = [a, (a + 1) % n, (a + 2) % n, (a + 3) % n].map(v);
            let face = soup.faces.push(if quad { Facet::Quad(c) } else { Facet::Tri([c[0], c[1], c[2]]) });
            for bit in (0..names).filter(|bit| flags >> bit & 1 == 1) {
                soup.carried.groups.faces.entry(format!("Set {bit}")).or_default().push(face);
            }
        }
        let values = (0..soup.faces.len()).map(|i| i as f64 / 7.0).collect();
        soup.carried.set_field(Field { name: "size".into(), support: Support::Face, components: 1, values });
        soup
    })
}

proptest! {
    #[test]
    fn any_soup_comes_back_from_vtu(soup in soups(), raw in any::<bool>()) {
        let options = if raw { binary() } else { text() };
        let bytes = write(Format::Vtu, &soup, &options);
        prop_assert_eq!(&bytes, &write(Format::Vtu, &soup, &options));
        prop_assert_eq!(read(Format::Vtu, &bytes), Ok(soup.clone()));
        prop_assert_eq!(read(Format::Vtp, &write(Format::Vtp, &soup, &options)), Ok(soup.clone()));
        prop_assert_eq!(read(Format::Vtk, &write(Format::Vtk, &soup, &options)), Ok(soup));
    }

    #[test]
    fn any_soup_comes_back_from_inp(soup in soups()) {
        let back = read(Format::Inp, &write(Format::Inp, &soup, &text())).expect("reads");
        prop_assert_eq!(&back.faces, &soup.faces);
        let sizes = |s: &Soup| s.carried.groups.faces.values().cloned().collect::<Vec<_>>();
        prop_assert_eq!(sizes(&back), sizes(&soup));
        for (a, b) in back.points.iter().zip(&soup.points) {
            prop_assert!(a.distance(*b) <= 1e-9);
        }
    }

    #[test]
    fn any_soup_comes_back_from_msh(soup in soups(), raw in any::<bool>()) {
        let options = if raw { binary() } else { text() };
        prop_assert_eq!(read(Format::Msh, &write(Format::Msh, &soup, &options)), Ok(soup.clone()));
        let back = read(Format::Msh22, &write(Format::Msh22, &soup, &options)).expect("reads");
        prop_assert_eq!(&back.points, &soup.points);
        prop_assert_eq!(&back.carried.groups.vertices, &soup.carried.groups.vertices);
    }

    #[test]
    fn damaged_files_give_errors_and_never_panic(
        seed in 0..FORMATS.len(), cut in 0.0..1.0_f64, at in 0.0..1.0_f64, byte in any::<u8>(), raw in any::<bool>(),
    ) {
        let format = FORMATS[seed];
        let options = if raw { binary() } else { text() };
        let whole = write(format, &rich_sample(), &options);
        let mut mutated = whole.clone();
        let position = (at * whole.len() as f64) as usize;
        mutated[position] = byte;
        let _ = read(format, &mutated);
        let _ = read(format, &whole[..(cut * whole.len() as f64) as usize]);
        mutated.truncate((cut * whole.len() as f64) as usize);
        let _ = read(format, &mutated);
    }
}

/// The formats that this file tests.
const FORMATS: &[Format] = &[Format::Vtu, Format::Vtp, Format::Inp, Format::Msh, Format::Msh22, Format::Vtk];
