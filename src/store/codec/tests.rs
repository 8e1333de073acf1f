//! Round trips, hostile bytes and stable hashes of the codec.

use super::*;
use crate::mesh::edge_key;

fn id<K>(raw: u32) -> Id<K> {
    Id::from_raw(raw)
}

fn carried() -> Carried {
    let mut carried = Carried::default();
    carried.groups.faces.insert("Deckel".into(), vec![id(0)]);
    carried.groups.edges.insert("rim".into(), vec![edge_key(id(2), id(1))]);
    carried.groups.vertices.insert(String::new(), vec![id(0), id(3)]);
    carried.regions = Some(Regions { labels: vec![1, 0].into(), names: vec!["top".into(), "side".into()] });
    carried.mark(edge_key(id(0), id(1)), EdgeMark { freedom: Freedom::OnCurve, cause: MarkCause::Feature });
    carried.pin(id(3), Freedom::Keep);
    carried.seams.insert(id(2), SeamId(7));
    carried.set_field(Field {
        name: "size".into(),
        support: Support::Vertex,
        components: 1,
        values: vec![f64::NAN, -0.0, 1.0, 2.0],
    });
    carried
}

fn points<K>() -> IdVec<K, DVec3> {
    vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(-0.0, 1e-300, 3.5)].into()
}

fn soup() -> Artifact {
    let faces = vec![Facet::Tri([id(0), id(1), id(2)]), Facet::Quad([id(0), id(1), id(3), id(2)])];
    Artifact::Soup(Arc::new(Soup { points: points(), faces: faces.into(), carried: carried() }))
}

fn surface() -> Artifact {
    let faces = vec![[id(0), id(1), id(2)], [id(0), id(3), id(1)]];
    Artifact::Surface(Arc::new(Surface { points: points(), faces: faces.into(), carried: carried() }))
}

#[test]
fn decoding_gives_back_the_same_bytes() {
    let file = Artifact::File(Arc::new(FileBytes { name: "part.stl".into(), bytes: vec![1, 2, 3] }));
    let metrics = Artifact::Metrics(Arc::new(Measurement::default()));
    for artifact in [soup(), surface(), file, metrics] {
        let bytes = encode(&artifact);
        let decoded = decode(&bytes).unwrap();
        assert_eq!(decoded.port(), artifact.port());
        assert_eq!(encode(&decoded), bytes);
    }
}

#[test]
fn what_a_surface_carries_comes_back() {
    let Artifact::Surface(back) = decode(&encode(&surface())).unwrap() else { panic!("a surface went in") };
    let expected = carried();
    assert_eq!(back.carried.groups, expected.groups);
    assert_eq!(back.carried.regions, expected.regions);
    assert_eq!((&back.carried.marks, &back.carried.pins), (&expected.marks, &expected.pins));
    assert_eq!(back.carried.seams, expected.seams);
    assert_eq!(back.carried.fields[0].values[1].to_bits(), (-0.0_f64).to_bits());
}

#[test]
fn every_truncation_is_an_error() {
    let bytes = encode(&surface());
    for len in 0..bytes.len() {
        assert!(decode(&bytes[..len]).is_err(), "{len} of {} bytes", bytes.len());
    }
}

#[test]
fn hostile_bytes_never_panic() {
    let bytes = encode(&soup());
    for at in 0..bytes.len() {
        for value in [0, 1, 2, 3, 0x7f, 0xff] {
            let mut damaged = bytes.clone();
            damaged[at] = value;
            drop(decode(&damaged));
        }
    }
}

#[test]
fn a_corner_beyond_the_points_is_refused() {
    let faces = vec![[id(0), id(1), id(9)]];
    let bad =
        Artifact::Surface(Arc::new(Surface { points: points(), faces: faces.into(), carried: Carried::default() }));
    assert!(matches!(decode(&encode(&bad)), Err(CodecError::Malformed(_))));
}

#[test]
fn another_version_is_said() {
    let mut bytes = encode(&surface());
    bytes[4] = 9;
    assert_eq!(decode(&bytes).unwrap_err(), CodecError::Version(9));
}
