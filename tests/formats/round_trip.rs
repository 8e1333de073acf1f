//! `read(write(m)) == m` for everything the format can say.

use glam::DVec3;
use meshmill::format::{Format, WriteOptions, read, write};
use meshmill::mesh::{FaceId, Facet, Field, Regions, Soup, Support, VertexId, edge_key};
use meshmill::watch::Watch;
use proptest::prelude::*;

fn again(format: Format, soup: &Soup, options: &WriteOptions<'_>) -> Soup {
    let bytes = write(format, soup, options).expect("a finite mesh can be written");
    assert_eq!(bytes, write(format, soup, options).expect("written a second time"), "equal meshes give equal bytes");
    read(format, &bytes, &Watch::silent()).unwrap_or_else(|error| panic!("{error}")).0
}

/// Coordinates of all sizes, none of them negative zero, which STL does not keep.
fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.0), -10.0..10.0f64, -1e12..1e12f64, 1e-300..1e-290f64].prop_map(|x| x + 0.0)
}

prop_compose! {
    /// Faces of three or four corners on random points, some points unused.
    fn any_soup()(
        coordinates in prop::collection::vec([coordinate(), coordinate(), coordinate()], 4..20),
        corners in prop::collection::vec((any::<[u32; 4]>(), any::<bool>()), 1..20),
    ) -> Soup {
        let points: Vec<DVec3> = coordinates.into_iter().map(DVec3::from_array).collect();
        let n = points.len() as u32;
        let faces = corners.into_iter().map(|(raw, quad)| {
            let [a, b, c, d] = raw.map(|i| VertexId::from_raw(i % n));
            if quad { Facet::Quad([a, b, c, d]) } else { Facet::Tri([a, b, c]) }
        });
        Soup { points: points.into(), faces: faces.collect(), ..Soup::default() }
    }
}

prop_compose! {
    /// Groups of all kinds; members by bit masks, names as people give them.
    fn grouped_soup()(mut soup in any_soup(), masks in any::<[u64; 3]>()) -> Soup {
        let members = |mask: u64, n: usize| (0..n).filter(move |i| mask >> (i % 64) & 1 == 1);
        for (name, mask) in ["Inlet_12", "outlet", "Wände"].iter().zip(masks) {
            let faces: Vec<FaceId> = members(mask, soup.faces.len()).map(FaceId::new).collect();
            let vertices: Vec<VertexId> = members(!mask, soup.points.len()).map(VertexId::new).collect();
            let mut edges: Vec<_> = members(mask.rotate_left(7), soup.faces.len())
                .map(|f| soup.faces[FaceId::new(f)].corners())
                .map(|c| edge_key(c[0], c[1]))
                .filter(|[a, b]| a != b)
                .collect();
            edges.sort_unstable();
            edges.dedup();
            let groups = &mut soup.carried.groups;
            if !faces.is_empty() {
                groups.faces.insert((*name).to_owned(), faces);
            }
            if !edges.is_empty() {
                groups.edges.insert(format!("{name}-edges"), edges);
            }
            if !vertices.is_empty() {
                groups.vertices.insert(format!("{name}-points"), vertices);
            }
        }
        soup
    }
}

fn with_fields(mut soup: Soup, seed: f64) -> Soup {
    for (support, count) in [(Support::Vertex, soup.points.len()), (Support::Face, soup.faces.len())] {
        for (name, components) in [("size", 1), ("normal", 3)] {
            let values = (0..count * components).map(|i| seed * i as f64).collect();
            soup.carried.set_field(Field { name: name.into(), support, components, values });
        }
    }
    let labels: Vec<u32> = (0..soup.faces.len() as u32).map(|f| f % 2).collect();
    soup.carried.regions = Some(Regions { labels: labels.into(), names: vec!["top side".into(), "rest".into()] });
    soup
}

/// The corners of each triangle, whatever the vertex numbers.
fn triangles(soup: &Soup) -> Vec<Vec<DVec3>> {
    soup.faces.iter().map(|facet| facet.corners().iter().map(|&v| soup.points[v]).collect()).collect()
}

proptest! {
    #[test]
    fn obj_keeps_points_faces_and_groups(soup in grouped_soup()) {
        prop_assert_eq!(again(Format::Obj, &soup, &WriteOptions::default()), soup);
    }

    #[test]
    fn off_keeps_points_faces_and_groups(soup in grouped_soup()) {
        prop_assert_eq!(again(Format::Off, &soup, &WriteOptions::default()), soup);
    }

    #[test]
    fn ply_keeps_everything(soup in grouped_soup(), seed in coordinate(), binary: bool) {
        let soup = with_fields(soup, seed);
        let options = WriteOptions { binary, header: "meshmill 0.0.0 key".into(), ..WriteOptions::default() };
        prop_assert_eq!(again(Format::Ply, &soup, &options), soup);
    }

    #[test]
    fn bulk_data_keeps_faces_and_a_partition_into_groups(soup in any_soup(), cut in any::<usize>()) {
        let mut soup = soup;
        // A coordinate has 16 characters; a quad with a repeated corner is a triangle there.
        for point in &mut soup.points {
            *point = DVec3::from_array(point.to_array().map(|x| f64::from(x as f32 as i16) / 64.0));
        }
        soup.faces = soup.faces.iter().filter(|f| matches!(f, Facet::Tri(_))).copied().collect();
        prop_assume!(!soup.faces.is_empty());
        let cut = cut % (soup.faces.len() + 1);
        let inlet: Vec<FaceId> = (0..cut).map(FaceId::new).collect();
        if !inlet.is_empty() {
            soup.carried.groups.faces.insert("Inlet \u{e9} 1".into(), inlet);
        }
        prop_assert_eq!(again(Format::Bdf, &soup, &WriteOptions::default()), soup);
    }

    #[test]
    fn text_stl_keeps_triangles_exactly(mut soup in any_soup()) {
        soup.faces = soup.faces.iter().filter(|f| matches!(f, Facet::Tri(_))).copied().collect();
        prop_assume!(!soup.faces.is_empty());
        prop_assert_eq!(triangles(&again(Format::Stl, &soup, &WriteOptions::default())), triangles(&soup));
    }

    #[test]
    fn text_stl_keeps_a_partition_into_groups(faces in 2usize..30, cuts in any::<[usize; 2]>()) {
        let points: Vec<DVec3> = (0..3 * faces).map(|i| DVec3::new(i as f64, (i * i) as f64, 0.5)).collect();
        let mut soup = Soup { points: points.into(), ..Soup::default() };
        for f in 0..faces {
            soup.faces.push(Facet::Tri([3 * f, 3 * f + 1, 3 * f + 2].map(VertexId::new)));
        }
        let mut ends = [0, cuts[0] % (faces + 1), cuts[1] % (faces + 1), faces];
        ends.sort_unstable();
        for (name, end) in ["a solid", "b", "c"].iter().zip(ends.windows(2)).filter(|(_, end)| end[0] < end[1]) {
            soup.carried.groups.faces.insert((*name).to_owned(), (end[0]..end[1]).map(FaceId::new).collect());
        }
        prop_assert_eq!(again(Format::Stl, &soup, &WriteOptions::default()), soup);
    }

    #[test]
    fn binary_stl_and_off_keep_what_32_bits_hold(mut soup in any_soup()) {
        for point in &mut soup.points {
            *point = DVec3::from_array(point.to_array().map(|x| f64::from(x as f32)));
        }
        let options = WriteOptions { binary: true, header: "solid bait".into(), ..WriteOptions::default() };
        prop_assert_eq!(&again(Format::Off, &soup, &options), &soup);
        soup.faces = soup.faces.iter().filter(|f| matches!(f, Facet::Tri(_))).copied().collect();
        prop_assume!(!soup.faces.is_empty());
        prop_assert_eq!(triangles(&again(Format::Stl, &soup, &options)), triangles(&soup));
    }
}

#[test]
fn precision_rounds_to_significant_digits() {
    let points = vec![DVec3::new(1.0 / 3.0, 123_456.789, -2e-9), DVec3::X, DVec3::Y];
    let mut soup = Soup { points: points.into(), ..Soup::default() };
    soup.faces.push(Facet::Tri([0, 1, 2].map(VertexId::new)));
    let options = WriteOptions { precision: Some(4), ..WriteOptions::default() };
    let text = String::from_utf8(write(Format::Obj, &soup, &options).expect("written")).expect("text");
    assert!(text.starts_with("v 0.3333 123500 -2e-9\n"), "{text}");
}
