//! Output files that appear whole or not at all: written beside their place under a hidden name, and renamed.

use std::fs;
use std::io::{self, Write};
use std::path::Path;

use crate::store::leftover::write_by_rename;

/// Writes a file so that readers see the old content or all of the new one.
///
/// A symbolic link in its place is replaced, and what it points at is left alone: what it leads to may be anybody's.
/// A device or a pipe is written to as it is.
pub(super) fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if fs::symlink_metadata(path).is_ok_and(|meta| !meta.is_file() && !meta.is_dir() && !meta.is_symlink()) {
        return fs::OpenOptions::new().write(true).open(path)?.write_all(bytes);
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let write = || {
        fs::create_dir_all(folder)?;
        write_by_rename(folder, path, bytes)
    };
    match write() {
        // Another run may have removed the folder while it was empty.
        Err(error) if error.kind() == io::ErrorKind::NotFound => write(),
        result => result,
    }
}
