//! Round trips, hostile bytes and stable hashes of the codec.

use proptest::prelude::*;

use super::*;
use crate::mesh::hierarchy::{Hierarchy, NodeId};
use crate::mesh::{Cover, Curve, SurfacePoint, edge_key};

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
    let inside = SurfacePoint::Edge { edge: edge_key(id(0), id(1)), t: 0.25 };
    let open = Curve { points: vec![SurfacePoint::Vertex(id(2)), inside], is_closed: false, sides: [1, 0] };
    let closed =
        Curve { points: [0, 1, 2].map(|v| SurfacePoint::Vertex(id(v))).to_vec(), is_closed: true, sides: [0, 1] };
    carried.curves = vec![open, closed];
    carried
}

fn points<K>() -> IdVec<K, DVec3> {
    vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(-0.0, 1e-300, 3.5)].into()
}

fn soup() -> Artifact {
    let faces = vec![Facet::Tri([id(0), id(1), id(2)]), Facet::Quad([id(0), id(1), id(3), id(2)])];
    Artifact::Soup(Arc::new(Soup { points: points(), faces: faces.into(), carried: carried() }))
}

fn quads(cover: Option<Cover>) -> Artifact {
    let Artifact::Soup(mesh) = soup() else { unreachable!("made just here") };
    Artifact::Quads(Arc::new(Quads { mesh: (*mesh).clone(), cover }))
}

#[test]
fn quads_come_back_with_what_they_cover() {
    let cover = Cover { surface: [7; 32], cuts: Vec::new(), faces: vec![vec![id(0), id(2)], vec![id(1)]].into() };
    let cut = Cover { cuts: vec![vec![id(2)], Vec::new(), vec![id(0), id(5)]], ..cover.clone() };
    for cover in [None, Some(cover), Some(cut)] {
        let bytes = encode(&quads(cover.clone()));
        let Artifact::Quads(after) = decode(&bytes).unwrap() else { panic!("quads went in") };
        assert_eq!(after.cover, cover);
        assert_eq!(encode(&Artifact::Quads(after)), bytes);
        assert!((0..bytes.len()).all(|end| decode(&bytes[..end]).is_err()));
    }
    let short = Cover { surface: [7; 32], cuts: Vec::new(), faces: vec![vec![id(0)]].into() };
    assert!(decode(&encode(&quads(Some(short)))).is_err(), "one list of faces for two elements");
}

fn surface() -> Artifact {
    let faces = vec![[id(0), id(1), id(2)], [id(0), id(3), id(1)]];
    Artifact::Surface(Arc::new(Surface { points: points(), faces: faces.into(), carried: carried() }))
}

/// A sound forest: each merge takes two roots, with some of the other roots as its ring.
fn forest(leaves: u32, picks: &[(u32, u32, u32, f64)], with_curvature: bool) -> Hierarchy {
    let points = (0..leaves).map(|i| DVec3::splat(f64::from(i))).collect();
    let faces = vec![[id(0), id(1), id(2)]; 2 * leaves as usize].into();
    let finest = Surface { points, faces, carried: Carried::default() };
    let values: Vec<f64> = (0..leaves).map(|i| f64::from(i % 7)).collect();
    let mut hierarchy = Hierarchy::new(finest, values.clone(), if with_curvature { values } else { Vec::new() });
    let mut roots: Vec<NodeId> = (0..leaves).map(id).collect();
    for &(a, b, ring, size) in picks.iter().take(leaves as usize - 1) {
        let kept = roots.swap_remove(a as usize % roots.len());
        let removed = roots.swap_remove(b as usize % roots.len());
        let ring = roots.iter().copied().skip(ring as usize % 5).take(6).collect::<Vec<_>>();
        roots.push(hierarchy.record([kept, removed], DVec3::splat(size), 1 + (a % 2) as u8, ring, size));
    }
    hierarchy
}

fn hierarchy() -> Artifact {
    Artifact::Hierarchy(Arc::new(forest(5, &[(0, 1, 0, 0.5), (2, 0, 1, 9.0)], true)))
}

proptest! {
    #[test]
    fn hierarchies_come_back(
        leaves in 3_u32..40,
        picks in prop::collection::vec((any::<u32>(), any::<u32>(), any::<u32>(), 0.0..10.0), 0..40),
        with_curvature in any::<bool>(),
    ) {
        let before = forest(leaves, &picks, with_curvature);
        prop_assert_eq!(before.defect(), None);
        let bytes = encode(&Artifact::Hierarchy(Arc::new(before.clone())));
        let Artifact::Hierarchy(after) = decode(&bytes).unwrap() else { panic!("a hierarchy went in") };
        prop_assert_eq!(&*after, &before);
        let mut damaged = bytes;
        for &(at, value, ..) in &picks {
            let at = at as usize % damaged.len();
            damaged[at] = value as u8;
            drop(decode(&damaged));
        }
    }
}

#[test]
fn a_forest_that_contradicts_itself_is_refused() {
    let good = forest(6, &[(0, 0, 0, 1.0), (0, 0, 0, 1.0), (0, 0, 0, 1.0)], true);
    let wrongs: [fn(&mut Hierarchy); 5] = [
        |h| h.merges[1].kept = h.merges[0].kept,
        |h| h.merges[0].removed = id(8),
        |h| h.rings[0] = h.merges[0].kept,
        |h| h.merges[2].faces = 200,
        |h| h.element_size[NodeId::from_raw(3)] = f64::NAN,
    ];
    for (place, wrong) in wrongs.into_iter().enumerate() {
        let mut bad = good.clone();
        wrong(&mut bad);
        assert!(decode(&encode(&Artifact::Hierarchy(Arc::new(bad)))).is_err(), "{place}");
    }
}

#[test]
fn decoding_gives_back_the_same_bytes() {
    let file = Artifact::File(Arc::new(FileBytes { name: "part.stl".into(), bytes: vec![1, 2, 3] }));
    let metrics = Artifact::Metrics(Arc::new(Measurement::default()));
    for artifact in [soup(), surface(), file, metrics, hierarchy()] {
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
    assert_eq!(back.carried.curves, expected.curves);
    assert_eq!(back.carried.fields[0].values[1].to_bits(), (-0.0_f64).to_bits());
}

#[test]
fn every_truncation_is_an_error() {
    for bytes in [encode(&surface()), encode(&hierarchy())] {
        for len in 0..bytes.len() {
            assert!(decode(&bytes[..len]).is_err(), "{len} of {} bytes", bytes.len());
        }
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
fn a_curve_off_the_surface_is_refused() {
    let at = |edge: [u32; 2], t| vec![SurfacePoint::Edge { edge: edge.map(id), t }];
    let wrongs = [at([0, 1], 0.0), at([0, 1], 1.0), at([0, 1], f64::NAN), at([1, 0], 0.5), at([1, 1], 0.5)];
    for (place, points) in wrongs.into_iter().enumerate() {
        let Artifact::Surface(good) = surface() else { unreachable!("made just here") };
        let mut bad = (*good).clone();
        bad.carried.curves = vec![Curve { points, is_closed: false, sides: [0, 1] }];
        assert!(decode(&encode(&Artifact::Surface(Arc::new(bad)))).is_err(), "{place}");
    }
}

#[test]
fn another_version_is_said() {
    let mut bytes = encode(&surface());
    bytes[4] = 9;
    assert_eq!(decode(&bytes).unwrap_err(), CodecError::Version(9));
}
