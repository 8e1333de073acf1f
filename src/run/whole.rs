//! Output files that appear whole or not at all: written beside their place under a hidden name, and renamed.

use std::fs;
use std::io::{self, Write};
use std::path::Path;

use crate::store::leftover::write_by_rename;

/// Writes a file so that readers see the old content or all of the new one.
///
/// A link or a pipe in its place is replaced: what a link leads to may be anybody's, and a pipe that nobody reads would
/// make the run wait for ever.
pub(super) fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let write = || {
        fs::create_dir_all(folder)?;
        write_by_rename(folder, path, bytes, None)
    };
    match write() {
        // Another run may have removed the folder while it was empty.
        Err(error) if error.kind() == io::ErrorKind::NotFound => write(),
        result => result,
    }
}

/// The same for a file that somebody named, who means what a link leads to, or the device or pipe itself.
pub(super) fn write_named(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let real = fs::canonicalize(path);
    let path = real.as_deref().unwrap_or(path);
    if fs::metadata(path).is_ok_and(|meta| !meta.is_file() && !meta.is_dir()) {
        return fs::OpenOptions::new().write(true).open(path)?.write_all(bytes);
    }
    write(path, bytes)
}
