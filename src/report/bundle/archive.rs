//! The archive of a bundle: a ZIP file whose bytes depend on its members alone.
//!
//! # Algorithm
//! Members are written in the order of their names with one fixed time, deflated, or as they are where that shrinks
//! them by more than the reader believes. An archive that is read may be anybody's: names must stay below the folder,
//! no two may be equal whatever their case, no data may belong to two members, and the sizes that are promised must add
//! up to something that an archive of that length can hold.
//!
//! # Invariants
//! - Equal members give equal bytes.
//! - What `write` gives, `read` takes.
//!
//! # Cost
//! Reading takes at most [`MOST_GROWTH`] times the memory of the archive, and [`LEAST_ROOM`] besides.
//!
//! # Departures
//! ZIP64, encryption, and methods other than deflate and none are not read; links and modes are ignored, so that every
//! member is a plain file. Source: PKWARE, *.ZIP File Format Specification*, 6.3.10.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{Read, Write};

use flate2::Compression;
use flate2::bufread::DeflateDecoder;
use flate2::write::DeflateEncoder;
use rawzip::time::UtcDateTime;
use rawzip::{CompressionMethod, ZipArchive, ZipArchiveWriter, ZipSliceEntry};

/// A member shrinks by at most so much, and an archive grows by at most so much.
pub const MOST_GROWTH: u64 = 200;
/// Small archives may grow to this size.
pub const LEAST_ROOM: u64 = 64 << 20;
/// More members are no bundle.
const MOST_MEMBERS: usize = 100_000;
/// Longer names are no names of files.
const LONGEST_NAME: usize = 1024;

/// Members by name.
pub type Members = BTreeMap<String, Vec<u8>>;

/// Why an archive cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// It is no archive, or damaged.
    #[error("it is no whole ZIP file: {0}")]
    Zip(#[from] rawzip::Error),
    /// The data of a member are damaged.
    #[error("its member {0} is damaged: {1}")]
    Damaged(String, std::io::Error),
    /// A member is packed in another way than deflate.
    #[error("its member {0} is packed in a way that bundles do not use")]
    Method(String),
    /// A name leads out of the folder, or is none.
    #[error("its member {0:?} has a name that no file of a bundle has")]
    Name(String),
    /// Two members have one name, or names that differ in case only.
    #[error("two of its members are called {0}")]
    Twice(String),
    /// A member is called as the folder of another one.
    #[error("its member {0} is called as a folder")]
    Folder(String),
    /// Two members share data.
    #[error("two of its members share their data")]
    Overlap,
    /// It has too many members.
    #[error("it has more than {MOST_MEMBERS} members")]
    Many,
    /// It would grow beyond all measure.
    #[error("it promises {0} bytes, far more than an archive of its size holds")]
    Bomb(u64),
}

/// Whether this may be the name of a member: parts with slashes between them, each a plain name on every system.
pub fn is_name(name: &str) -> bool {
    let plain = |part: &str| {
        let odd =
            |letter: char| letter.is_control() || matches!(letter, '\\' | ':' | '"' | '*' | '?' | '<' | '>' | '|');
        !part.is_empty() && part != "." && part != ".." && !part.contains(odd) && !part.ends_with(['.', ' '])
    };
    name.len() <= LONGEST_NAME && name.split('/').all(plain)
}

/// The bytes of an archive with these members.
///
/// # Errors
/// [`ArchiveError::Name`] and [`ArchiveError::Twice`] for names that `read` would refuse.
pub fn write(members: &Members) -> Result<Vec<u8>, ArchiveError> {
    let mut seen = BTreeSet::new();
    let mut bytes = Vec::new();
    let mut archive = ZipArchiveWriter::new(&mut bytes);
    for (name, content) in members {
        if !is_name(name) {
            return Err(ArchiveError::Name(name.clone()));
        }
        if !seen.insert(name.to_lowercase()) {
            return Err(ArchiveError::Twice(name.clone()));
        }
        let mut packed = DeflateEncoder::new(Vec::new(), Compression::default());
        packed.write_all(content).map_err(|error| ArchiveError::Damaged(name.clone(), error))?;
        let packed = packed.finish().map_err(|error| ArchiveError::Damaged(name.clone(), error))?;
        let (packed, length) = (packed.len() as u64, content.len() as u64);
        let stored = packed >= length || packed * MOST_GROWTH < length;
        add(&mut archive, name, content, stored)?;
    }
    archive.finish()?;
    Ok(bytes)
}

fn add(
    archive: &mut ZipArchiveWriter<&mut Vec<u8>>,
    name: &str,
    content: &[u8],
    stored: bool,
) -> Result<(), ArchiveError> {
    let damaged = |error| ArchiveError::Damaged(name.to_owned(), error);
    let method = if stored { CompressionMethod::STORE } else { CompressionMethod::DEFLATE };
    let builder = archive.new_file(name).compression_method(method);
    let builder = match UtcDateTime::from_components(1980, 1, 1, 0, 0, 0, 0) {
        Some(time) => builder.last_modified(time),
        None => builder,
    };
    let (mut entry, config) = builder.start()?;
    let descriptor = if stored {
        let mut writer = config.wrap(&mut entry);
        writer.write_all(content).map_err(damaged)?;
        writer.finish()?.1
    } else {
        let mut writer = config.wrap(DeflateEncoder::new(&mut entry, Compression::default()));
        writer.write_all(content).map_err(damaged)?;
        let (encoder, descriptor) = writer.finish()?;
        encoder.finish().map_err(damaged)?;
        descriptor
    };
    entry.finish(descriptor)?;
    Ok(())
}

/// The members of an archive, each whole.
///
/// # Errors
/// Where it is damaged, or made to do harm.
pub fn read(bytes: &[u8]) -> Result<Members, ArchiveError> {
    let archive = ZipArchive::from_slice(bytes)?;
    let most = (bytes.len() as u64).saturating_mul(MOST_GROWTH).saturating_add(LEAST_ROOM);
    let (mut members, mut seen, mut ranges) = (Members::new(), BTreeSet::new(), Vec::new());
    let (mut entries, mut promised) = (archive.entries(), 0_u64);
    while let Some(entry) = entries.next_entry()? {
        if ranges.len() >= MOST_MEMBERS {
            return Err(ArchiveError::Many);
        }
        let data = archive.get_entry(entry.wayfinder())?;
        ranges.push(data.compressed_data_range());
        let length = entry.uncompressed_size_hint();
        promised = promised.saturating_add(length);
        if promised > most {
            return Err(ArchiveError::Bomb(promised));
        }
        let name = String::from_utf8_lossy(entry.file_path().as_bytes()).into_owned();
        // Other programs write folders as members too.
        if name.strip_suffix('/').is_some_and(is_name) && length == 0 {
            continue;
        }
        if !is_name(&name) {
            return Err(ArchiveError::Name(name));
        }
        if !seen.insert(name.to_lowercase()) {
            return Err(ArchiveError::Twice(name));
        }
        let content = unpack(&data, entry.compression_method(), length, &name)?;
        members.insert(name, content);
    }
    ranges.sort_unstable();
    if ranges.windows(2).any(|pair| pair[0].1 > pair[1].0) {
        return Err(ArchiveError::Overlap);
    }
    match folder_among(members.keys()) {
        Some(name) => Err(ArchiveError::Folder(name)),
        None => Ok(members),
    }
}

/// The first of these names, in their order, that is the folder of another one, whatever its case.
pub(super) fn folder_among<'a>(names: impl Iterator<Item = &'a String> + Clone) -> Option<String> {
    let folded = |name: &str| name.to_lowercase();
    let folders: BTreeSet<String> = names
        .clone()
        .flat_map(|name| name.match_indices('/').map(|(at, _)| folded(&name[..at])).collect::<Vec<_>>())
        .collect();
    names.filter(|name| folders.contains(&folded(name))).min().cloned()
}

/// The content of a member, which is as long as was promised and has the checksum that it should.
fn unpack(
    data: &ZipSliceEntry<'_>,
    method: CompressionMethod,
    length: u64,
    name: &str,
) -> Result<Vec<u8>, ArchiveError> {
    // One byte more than promised shows that there are more.
    let most = length.saturating_add(1);
    let mut content = Vec::new();
    let unpacked = match method {
        CompressionMethod::STORE => data.verifying_reader(data.data()).take(most).read_to_end(&mut content),
        CompressionMethod::DEFLATE => {
            let inflated = DeflateDecoder::new(data.data());
            data.verifying_reader(inflated).take(most).read_to_end(&mut content)
        }
        _ => return Err(ArchiveError::Method(name.to_owned())),
    };
    let damaged = |error| ArchiveError::Damaged(name.to_owned(), error);
    unpacked.map_err(damaged)?;
    if content.len() as u64 == length {
        Ok(content)
    } else {
        Err(damaged(std::io::Error::other("it is not as long as it says")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn members(files: &[(&str, &[u8])]) -> Members {
        files.iter().map(|(name, content)| ((*name).to_owned(), content.to_vec())).collect()
    }

    #[test]
    fn what_is_written_is_read() {
        let zeros = vec![0_u8; 1 << 20];
        let text = "vertex 0 0 1\n".repeat(1000);
        let files = members(&[("a/b.txt", b"hello"), ("empty", b""), ("zeros", &zeros), ("text", text.as_bytes())]);
        let bytes = write(&files).unwrap();
        assert_eq!(read(&bytes).unwrap(), files);
        assert_eq!(write(&files).unwrap(), bytes);
    }

    #[test]
    fn names_that_lead_out_or_meet_are_refused() {
        for name in ["../a", "/a", "a//b", "a/./b", "a\\b", "c:a", "", "a/..", "a\0b", "con.", "line\nbreak"] {
            assert!(!is_name(name), "{name}");
            assert!(matches!(write(&members(&[(name, b"x")])), Err(ArchiveError::Name(_))), "{name}");
        }
        assert!(matches!(write(&members(&[("a", b"1"), ("A", b"2")])), Err(ArchiveError::Twice(_))));
        for names in [["a/b", "A"], ["a", "a/b/c"]] {
            let bytes = write(&members(&names.map(|name| (name, &b"1"[..])))).unwrap();
            assert!(matches!(read(&bytes), Err(ArchiveError::Folder(_))), "{names:?}");
        }
        // As others write them: the name of a member with another one of equal length in its place.
        let bytes = write(&members(&[("aaaa", b"1"), ("bbbb", b"2")])).unwrap();
        let renamed = |from: &[u8], to: &[u8]| {
            let mut bytes = bytes.clone();
            for at in 0..bytes.len() - 4 {
                if &bytes[at..at + 4] == from {
                    bytes[at..at + 4].copy_from_slice(to);
                }
            }
            read(&bytes)
        };
        assert!(matches!(renamed(b"aaaa", b"../a"), Err(ArchiveError::Name(_))));
        assert!(matches!(renamed(b"aaaa", b"/etc"), Err(ArchiveError::Name(_))));
        assert!(matches!(renamed(b"aaaa", b"bbbb"), Err(ArchiveError::Twice(_))));
        assert!(matches!(renamed(b"aaaa", b"BBBB"), Err(ArchiveError::Twice(_))));
    }

    #[test]
    fn damage_never_panics_and_never_gives_other_members() {
        let text = "vertex 0 0 1\n".repeat(40);
        let whole = members(&[("a", text.as_bytes()), ("b", b"second")]);
        let bytes = write(&whole).unwrap();
        for length in 0..bytes.len() {
            assert!(read(&bytes[..length]).is_err(), "{length}");
        }
        for at in 0..bytes.len() {
            for flip in [0x01, 0x80, 0xff] {
                let mut damaged = bytes.clone();
                damaged[at] ^= flip;
                if let Ok(read) = read(&damaged) {
                    // A name, or what nobody looks at, such as a time.
                    assert!(read.values().all(|content| whole.values().any(|other| other == content)), "{at}");
                }
            }
        }
    }

    #[test]
    fn a_bomb_is_refused_before_it_goes_off() {
        let bytes = write(&members(&[("a", "vertex 0 0 1\n".repeat(100).as_bytes())])).unwrap();
        let claimed = 1300_u32.to_le_bytes();
        let mut bomb = bytes.clone();
        for at in 0..bytes.len() - 4 {
            if bytes[at..at + 4] == claimed {
                bomb[at..at + 4].copy_from_slice(&0xf000_0000_u32.to_le_bytes());
            }
        }
        assert!(matches!(read(&bomb), Err(ArchiveError::Bomb(_))));
    }
}
