//! Output files that appear whole or not at all.
//!
//! A file is written beside its place under a hidden name and renamed. The hidden name tells machine and process, so
//! that the next run on this machine can remove what a killed process left behind, and nothing else.

use std::fs;
use std::io::{self, Write};
use std::path::Path;
use std::time::{Duration, SystemTime};

const PREFIX: &str = ".meshmill-";
/// Leftovers of other machines go when they are this old.
const STALE: Duration = Duration::from_hours(24);

/// Writes a file so that readers see the old content or all of the new one.
///
/// What a symbolic link points at is replaced, not the link. A device or a pipe is written to as it is.
pub(super) fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let real = fs::canonicalize(path);
    let path = real.as_deref().unwrap_or(path);
    if fs::metadata(path).is_ok_and(|meta| !meta.is_file() && !meta.is_dir()) {
        return fs::OpenOptions::new().write(true).open(path)?.write_all(bytes);
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match write_in(folder, path, bytes) {
        // Another run may have removed the folder while it was empty.
        Err(error) if error.kind() == io::ErrorKind::NotFound => write_in(folder, path, bytes),
        result => result,
    }
}

fn write_in(folder: &Path, path: &Path, bytes: &[u8]) -> io::Result<()> {
    fs::create_dir_all(folder)?;
    let prefix = format!("{PREFIX}{}-{}-", host(), std::process::id());
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(".tmp");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder)?;
    file.write_all(bytes)?;
    file.persist(path).map_err(|error| error.error)?;
    Ok(())
}

/// Removes what killed runs left in a folder. Whatever cannot be removed is left.
pub(super) fn remove_leftovers(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.filter_map(Result::ok) {
        let name = entry.file_name();
        let Some(rest) = name.to_str().and_then(|name| name.strip_prefix(PREFIX)?.strip_suffix(".tmp")) else {
            continue;
        };
        if is_dead(rest, &entry) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

fn is_dead(rest: &str, entry: &fs::DirEntry) -> bool {
    let age = entry.metadata().and_then(|meta| meta.modified()).ok();
    let stale = age.and_then(|time| SystemTime::now().duration_since(time).ok()).is_some_and(|age| age > STALE);
    let process = rest.strip_prefix(&format!("{}-", host())).and_then(|rest| rest.split('-').next());
    let gone = process.is_some_and(|process| {
        process.parse::<u32>().is_ok() && Path::new("/proc/self").exists() && !Path::new("/proc").join(process).exists()
    });
    stale || gone
}

fn host() -> String {
    let name = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    name.trim().chars().filter(char::is_ascii_alphanumeric).collect()
}
