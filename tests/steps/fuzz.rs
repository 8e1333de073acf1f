//! Random damage to stored artifacts, and whole recipes on random tiny meshes: never a panic, and what is accepted is
//! right. Readers have theirs in `tests/formats/damage.rs`; `tests/mutants.py` does the same through the program with
//! limits.
//!
//! `MESHMILL_FUZZ=20` looks at twenty times as many; the same number looks at the same ones.

use std::fmt::Write as _;
use std::fs;

use meshmill::step::Artifact;
use meshmill::store::codec;

use crate::step::{self, run};
use crate::{levels, shapes};

/// SplitMix64, so that every run meets the same damage.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound.max(1) as u64) as usize
    }
}

fn times(count: usize) -> usize {
    let factor = std::env::var("MESHMILL_FUZZ").ok().and_then(|factor| factor.parse().ok());
    count * factor.unwrap_or(1)
}

/// One artifact of every kind.
fn artifacts() -> Vec<Artifact> {
    let surface = step::surface(shapes::surface(&shapes::cylinder(8, 2)));
    let named = run("select", "name = \"top\", normal = { direction = [0, 0, 1], angle = 40 }", &surface).artifact;
    let mut sheet = shapes::grid(24);
    sheet.points.iter_mut().for_each(|p| p.z = p.x * p.x);
    let sheet = step::surface(shapes::surface(&sheet));
    let quads = run("rough-quads", "interval = 0.4", &sheet).artifact;
    let patches =
        step::run_locked("fit-patches", "main", "max-spans = 2", "", &[("from", quads.clone()), ("surface", sheet)]);
    vec![
        step::file("part.obj", "v 0 0 0\n"),
        step::soup(shapes::cylinder(8, 2)),
        run("features", "angle = 35", &named).artifact,
        levels::levels(&shapes::sphere(2)),
        quads,
        patches.expect("patches of a parabolic sheet").artifact,
        run("measure", "", &surface).artifact,
    ]
}

fn damaged(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=random.below(3) {
        // Numbers that count things stand near the beginning, and matter most.
        let reach = if random.below(2) == 0 { bytes.len().min(96) } else { bytes.len() };
        let at = random.below(reach);
        match random.below(5) {
            0 => bytes[at] ^= 1 << random.below(8),
            1 => bytes[at] = random.below(256) as u8,
            2 => bytes[at] = 0xff,
            3 => drop(bytes.splice(at..at, (0..random.below(9)).map(|_| 0))),
            _ => drop(bytes.drain(at..(at + random.below(16)).min(bytes.len()))),
        }
        if bytes.is_empty() {
            break;
        }
    }
    bytes
}

#[test]
fn damaged_artifacts_are_refused_or_read_as_what_they_say() {
    let mut random = Random(11);
    for artifact in artifacts() {
        let port = artifact.port();
        let bytes = codec::encode(&artifact);
        assert_eq!(codec::encode(&codec::decode(&bytes).unwrap()), bytes, "{port}");
        let (mut accepted, mut refused) = (0, 0);
        for _ in 0..times(1500) {
            let other = damaged(&bytes, &mut random);
            match codec::decode(&other) {
                // A hash guards the store; without it, another number is another mesh. It must hold together, though.
                Ok(read) => {
                    accepted += 1;
                    let again = codec::encode(&read);
                    assert_eq!(codec::encode(&codec::decode(&again).unwrap()), again, "{port}");
                    assert!(again.len() <= 16 * other.len() + 4096, "{port} grew from {} bytes", other.len());
                }
                Err(_) => refused += 1,
            }
        }
        assert!(accepted + refused == times(1500) && refused > 0, "{port}: {accepted} accepted");
    }
}

/// A few points and faces without rhyme or reason, as an OBJ file.
fn soup(random: &mut Random) -> String {
    let (points, faces) = (3 + random.below(9), 1 + random.below(14));
    let scale = [1.0, 1.0, 1.0, 1e-6, 1e6][random.below(5)];
    let grid = random.below(2) == 0;
    let mut text = String::new();
    for _ in 0..points {
        let mut coordinate = || {
            let whole = random.below(4) as f64;
            (whole + if grid { 0.0 } else { random.below(1000) as f64 / 1000.0 }) * scale
        };
        let (x, y, z) = (coordinate(), coordinate(), coordinate());
        writeln!(text, "v {x} {y} {z}").unwrap();
    }
    for _ in 0..faces {
        let corners = 3 + random.below(8) / 7;
        let corners: Vec<String> = (0..corners).map(|_| (1 + random.below(points)).to_string()).collect();
        writeln!(text, "f {}", corners.join(" ")).unwrap();
    }
    text
}

/// Recipes that make something of any mesh. What they cannot work on they refuse; what they write is checked by its
/// gates.
#[test]
fn whole_recipes_end_on_random_tiny_meshes() {
    let folder = tempfile::tempdir().unwrap();
    let pipelines = concat!(env!("CARGO_MANIFEST_DIR"), "/pipelines");
    let mut random = Random(5);
    let mut codes = std::collections::BTreeMap::new();
    for number in 0..times(15) {
        let part = folder.path().join(format!("part-{number}.obj"));
        fs::write(&part, soup(&mut random)).unwrap();
        for recipe in ["repair", "inspect", "fe-surface"] {
            let mut command = assert_cmd::Command::new(assert_cmd::cargo::cargo_bin!("meshmill"));
            command.current_dir(folder.path()).env("MESHMILL_CACHE", folder.path().join("cache"));
            command.args(["run", &format!("{pipelines}/{recipe}.toml"), "--pictures", "none", "--out", "out", "-q"]);
            let input = format!("part={}", part.display());
            let output = command.args(["--input", &input]).output().unwrap();
            let text = String::from_utf8_lossy(&output.stderr);
            let code = output.status.code();
            assert!(!text.contains("panicked"), "{recipe}: {text}\n{}", fs::read_to_string(&part).unwrap());
            assert!(
                matches!(code, Some(0 | 2 | 3 | 4)),
                "{recipe}: {code:?} {text}\n{}",
                fs::read_to_string(&part).unwrap()
            );
            // Whatever is not done is explained.
            assert!(code == Some(0) || !text.trim().is_empty(), "{recipe}: {code:?} without a word");
            *codes.entry((recipe, code)).or_insert(0) += 1;
        }
    }
    assert!(codes.keys().any(|(_, code)| *code == Some(0)), "{codes:?}");
}
