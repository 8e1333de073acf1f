//! Cut, flipped and spliced files: an error or a sound mesh, never a panic and never much memory.

use meshmill::format::{Format, Place, Reason, WriteOptions, read, write};
use meshmill::mesh::{FaceId, Facet, Soup, Support, VertexId};
use meshmill::watch::Watch;

/// A small mesh with all that can be carried.
fn sample() -> Soup {
    let points: Vec<glam::DVec3> = (0..12).map(|i| glam::DVec3::new(f64::from(i % 4), f64::from(i / 4), 0.1)).collect();
    let mut soup = Soup { points: points.into(), ..Soup::default() };
    for row in 0..2 {
        for column in 0..3 {
            let at = |r: usize, c: usize| VertexId::new(4 * (row + r) + column + c);
            soup.faces.push(Facet::Tri([at(0, 0), at(0, 1), at(1, 1)]));
            soup.faces.push(Facet::Quad([at(0, 0), at(1, 1), at(1, 0), at(0, 0)]));
        }
    }
    let groups = &mut soup.carried.groups;
    groups.faces.insert("top".into(), (0..5).map(FaceId::new).collect());
    groups.vertices.insert("pins".into(), (2..7).map(VertexId::new).collect());
    groups.edges.insert("rim".into(), vec![[VertexId::new(0), VertexId::new(1)]]);
    soup
}

fn is_sound(soup: &Soup) -> bool {
    let points = soup.points.len();
    let in_range = |v: &VertexId| v.index() < points;
    soup.points.iter().all(|p| p.is_finite())
        && soup.faces.iter().flat_map(Facet::corners).all(in_range)
        && soup.carried.groups.faces.values().flatten().all(|f| f.index() < soup.faces.len())
        && soup.carried.groups.edges.values().flatten().flatten().all(in_range)
        && soup.carried.groups.vertices.values().flatten().all(in_range)
        && soup.carried.fields.iter().all(|f| {
            let count = if f.support == Support::Vertex { points } else { soup.faces.len() };
            f.values.len() == count * f.components
        })
}

fn check(format: Format, bytes: &[u8]) {
    match read(format, bytes, &Watch::silent()) {
        Ok((soup, _)) => {
            assert!(is_sound(&soup), "{} reader gave an unsound mesh", format.title());
            assert!(soup.points.len() <= bytes.len() && soup.faces.len() <= bytes.len());
        }
        Err(error) => {
            let message = error.to_string();
            assert!(message.starts_with(format.title()), "{message}");
            assert!(!message.ends_with('.'), "{message}");
        }
    }
}

fn files() -> Vec<(Format, Vec<u8>)> {
    let mut files = Vec::new();
    for &format in Format::ALL {
        for binary in [false, true] {
            let options = WriteOptions { binary, ..WriteOptions::default() };
            files.push((format, write(format, &sample(), &options).expect("written")));
        }
    }
    files
}

#[test]
fn every_cut_of_every_format_is_survived() {
    for (format, bytes) in files() {
        for length in 0..bytes.len() {
            check(format, &bytes[..length]);
        }
    }
}

/// SplitMix64, so that the damage is the same in every run.
fn next_random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mixed = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ (mixed >> 31)
}

#[test]
fn random_damage_is_survived() {
    const BAIT: [&[u8]; 12] = [
        b"-1",
        b"99999999999999999999",
        b"nan",
        b"1e999",
        b"\n",
        b"/",
        b"0",
        b"\0",
        b"-",
        b"\xff\xff\xff\xff",
        b"list",
        b"\\\n",
    ];
    let mut state = 7;
    let mut below = |n: usize| (next_random(&mut state) % n as u64) as usize;
    for (format, bytes) in files() {
        for _ in 0..3000 {
            let mut damaged = bytes.clone();
            for _ in 0..=below(3) {
                let at = below(damaged.len());
                match below(4) {
                    0 => damaged[at] ^= 1 << below(8),
                    1 => damaged[at] = below(256) as u8,
                    2 => {
                        let bait = BAIT[below(BAIT.len())];
                        damaged.splice(at..at, bait.iter().copied());
                    }
                    _ => {
                        let end = (at + below(40)).min(damaged.len());
                        damaged.drain(at..end);
                    }
                }
                if damaged.is_empty() {
                    break;
                }
            }
            check(format, &damaged);
        }
    }
}

#[test]
fn any_reader_takes_any_other_format() {
    for (_, bytes) in files() {
        for &format in Format::ALL {
            check(format, &bytes);
        }
    }
}

fn refusal(format: Format, bytes: &[u8]) -> (Place, Reason) {
    let error = read(format, bytes, &Watch::silent()).expect_err("the file is wrong");
    (error.place, error.reason)
}

#[test]
fn an_untrue_count_is_refused_before_memory_is_taken() {
    let mut stl = vec![b' '; 84];
    stl[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    stl.resize(184, 0);
    let untrue = |what, count, room| Reason::Untrue { what, count, room };
    assert_eq!(refusal(Format::Stl, &stl), (Place::Byte(84), untrue("facets", 4_294_967_295, 2)));

    let off = b"OFF\n4000000000 1 0\n0 0 0\n";
    assert_eq!(refusal(Format::Off, off), (Place::Line(2), untrue("vertices", 4_000_000_000, 2)));
    let off = b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n2000000000 0 1 2\n";
    assert_eq!(refusal(Format::Off, off), (Place::Line(6), untrue("corners", 2_000_000_000, 4)));

    let head = "ply\nformat binary_little_endian 1.0\nelement vertex 9000000000000000\n\
        property float x\nproperty float y\nproperty float z\nelement face 1\n\
        property list uint int vertex_indices\nend_header\n";
    let ply = [head.as_bytes(), &[0; 36]].concat();
    assert_eq!(refusal(Format::Ply, &ply), (Place::Line(3), untrue("elements", 9_000_000_000_000_000, 3)));
    let ply = [head.replace("9000000000000000", "3").as_bytes(), &[0; 36], &[0xff; 4], &[0; 12]].concat();
    let (place, reason) = refusal(Format::Ply, &ply);
    assert_eq!(reason, untrue("list items", 4_294_967_295, 3));
    assert_eq!(place, Place::Byte(ply.len() as u64 - 12));
}

#[test]
fn a_wrong_vertex_number_is_refused_with_its_line() {
    let out_of_range = |index, count| Reason::OutOfRange { what: "vertex", index, count };
    for (face, index) in [("f 1 2 4", 4), ("f 0 1 2", 0), ("f 1 2 -4", -4)] {
        let obj = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{face}\n");
        assert_eq!(refusal(Format::Obj, obj.as_bytes()), (Place::Line(4), out_of_range(index, 3)));
    }
    let off = b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n";
    assert_eq!(refusal(Format::Off, off), (Place::Line(6), out_of_range(3, 3)));
}

#[test]
fn a_number_that_is_none_is_refused_with_its_place() {
    for word in ["nan", "NaN", "inf", "-Infinity", "1e999", "-1.#IND", "-nan(ind)"] {
        let obj = format!("v 0 0 0\nv 1 {word} 0\nv 0 1 0\nf 1 2 3\n");
        let (place, reason) = refusal(Format::Obj, obj.as_bytes());
        assert_eq!((place, reason), (Place::Line(2), Reason::NotFinite { what: "a coordinate", found: word.into() }));
    }
    let mut stl = write(Format::Stl, &sample(), &WriteOptions { binary: true, ..WriteOptions::default() }).expect("ok");
    let second_corner_y = 84 + 50 + 12 + 12 + 4;
    stl[second_corner_y..second_corner_y + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    let (place, reason) = refusal(Format::Stl, &stl);
    assert_eq!(place, Place::Byte(second_corner_y as u64));
    assert_eq!(reason, Reason::NotFinite { what: "a coordinate", found: "NaN".into() });
}

#[test]
fn a_file_of_another_format_is_told_by_its_content() {
    let error = read(Format::Obj, b"OFF\n1 0 0\n0 0 0\n", &Watch::silent()).expect_err("no OBJ");
    assert!(error.remedy.is_some_and(|remedy| remedy.starts_with("the content looks like OFF: name the file so")));
}

#[test]
fn a_cancelled_read_stops() {
    struct Silent;
    impl meshmill::watch::Progress for Silent {
        fn phase(&self, _: &str, _: Option<u64>) {}
        fn advance(&self, _: u64, _: &str) {}
    }
    let cancelled = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(true));
    let watch = Watch::new(std::sync::Arc::new(Silent), cancelled);
    let bytes = write(Format::Stl, &sample(), &WriteOptions { binary: true, ..WriteOptions::default() }).expect("ok");
    assert_eq!(read(Format::Stl, &bytes, &watch).map(|_| ()).map_err(|e| e.reason), Err(Reason::Cancelled));
}
