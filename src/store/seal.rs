//! Small files of the store that cannot be taken for another: a checksum over what they hold and the name they have.
//!
//! A file is one line, `MAGIC CHECKSUM`, and the body. The checksum is BLAKE3 over the length of the name, the name and
//! the body, where the name is what the file was written for: the key of an entry, the machine of an index. A file that
//! was copied or moved to another name, cut short or changed, opens nowhere.

use std::fs;
use std::io;
use std::path::Path;

/// First word of a sealed file.
const MAGIC: &[u8] = b"meshmill-sealed-1 ";
/// What the sealed files of every version begin with.
const FAMILY: &[u8] = b"meshmill-sealed-";
/// Length of the checksum: BLAKE3 in hexadecimal.
const CHECKSUM: usize = 64;

/// Why a sealed file does not open.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum SealError {
    /// Not a sealed file, or cut short before its body.
    #[error("not a file of this version")]
    NotSealed,
    /// Sealed by another version of the program.
    #[error("sealed by another version")]
    Foreign,
    /// Changed, cut short, or written for another name.
    #[error("the checksum differs: damaged, or written for something else")]
    Checksum,
}

fn checksum(name: &[u8], body: &[u8]) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&(name.len() as u64).to_le_bytes());
    hasher.update(name);
    hasher.update(body);
    hasher.finalize()
}

/// The bytes of a file that holds `body` under `name`.
pub(super) fn seal(name: &[u8], body: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(MAGIC.len() + CHECKSUM + 1 + body.len());
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(checksum(name, body).to_hex().as_bytes());
    bytes.push(b'\n');
    bytes.extend_from_slice(body);
    bytes
}

/// What a file written for `name` holds.
pub(super) fn open<'a>(name: &[u8], bytes: &'a [u8]) -> Result<&'a [u8], SealError> {
    let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| strange(bytes))?;
    let (expected, rest) = rest.split_at_checked(CHECKSUM).ok_or(SealError::NotSealed)?;
    let body = rest.strip_prefix(b"\n").ok_or(SealError::NotSealed)?;
    if checksum(name, body).to_hex().as_bytes() == expected { Ok(body) } else { Err(SealError::Checksum) }
}

/// What bytes are that do not begin as a sealed file of this version.
fn strange(bytes: &[u8]) -> SealError {
    let rest = bytes.strip_prefix(FAMILY).unwrap_or_default();
    let digits = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
    if digits > 0 && rest.get(digits) == Some(&b' ') { SealError::Foreign } else { SealError::NotSealed }
}

/// Whether a plain file is there: no link, folder, pipe or device, which a store never makes.
pub(super) fn is_plain(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok_and(|meta| meta.is_file())
}

/// The bytes of a plain file. Anything else in its place is an error at once: opening a pipe would wait for ever.
pub(super) fn read(path: &Path) -> io::Result<Vec<u8>> {
    if fs::symlink_metadata(path)?.is_file() {
        fs::read(path)
    } else {
        Err(io::Error::new(io::ErrorKind::InvalidData, "not a plain file"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_opens_for_its_own_name_only() {
        let bytes = seal(b"key", b"body");
        assert_eq!(open(b"key", &bytes), Ok(&b"body"[..]));
        assert_eq!(open(b"other", &bytes), Err(SealError::Checksum));
        for length in 0..bytes.len() {
            assert!(open(b"key", &bytes[..length]).is_err(), "{length} bytes");
        }
        // The border between name and body counts.
        assert_eq!(open(b"keyb", &seal(b"key", b"body")), Err(SealError::Checksum));
    }
}
