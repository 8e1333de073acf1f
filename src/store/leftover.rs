//! Temporary files that say whose they are, so that the next run can remove what a killed process left behind, and
//! nothing else.
//!
//! The name tells machine and process. A file of this machine goes when its process is gone, one of another machine
//! when it is a day old. Where the system does not tell which processes live, age alone decides. A process that writes
//! into a shared folder for longer than a day from another machine finds its file gone, and fails.

use std::fs;
use std::io::{self, Write};
use std::path::Path;
use std::time::{Duration, SystemTime};

const PREFIX: &str = ".meshmill-";
const SUFFIX: &str = ".tmp";
/// Leftovers of other machines go when they are this old.
const STALE: Duration = Duration::from_hours(24);

/// Writes `bytes` to a temporary file in `folder` and renames it to `path`, on the same file system. A link at `path`
/// is replaced, not followed. Where anything fails, the temporary file is removed. The file has the rights of `mode`,
/// or those that the umask leaves.
pub fn write_by_rename(folder: &Path, path: &Path, bytes: &[u8], mode: Option<u32>) -> io::Result<()> {
    let prefix = format!("{PREFIX}{}-{}-", host(), std::process::id());
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(SUFFIX);
    // Temporary files are private to their owner as a rule; here the umask decides, so that a lab can share a folder.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(mode.unwrap_or(0o666)));
    let mut file = builder.tempfile_in(folder)?;
    #[cfg(not(unix))]
    let _ = mode;
    #[cfg(unix)]
    set_rights(file.as_file(), mode)?;
    file.write_all(bytes)?;
    file.persist(path).map_err(|error| error.error)?;
    Ok(())
}

/// Gives a new file the rights that the umask took. Where the system refuses, those that it has must do.
#[cfg(unix)]
fn set_rights(file: &fs::File, mode: Option<u32>) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    if let Some(mode) = mode
        && file.metadata()?.permissions().mode() & 0o7777 != mode
    {
        let _ = file.set_permissions(PermissionsExt::from_mode(mode));
    }
    Ok(())
}

/// Removes what processes that are gone left in a folder. Whatever cannot be removed is left.
pub fn remove_leftovers(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.filter_map(Result::ok) {
        let name = entry.file_name();
        let Some(rest) = name.to_str().and_then(|name| name.strip_prefix(PREFIX)?.strip_suffix(SUFFIX)) else {
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
    match process.filter(|process| process.parse::<u32>().is_ok() && Path::new("/proc/self").exists()) {
        Some(process) => !Path::new("/proc").join(process).exists(),
        None => stale,
    }
}

fn host() -> String {
    let name = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    name.trim().chars().filter(char::is_ascii_alphanumeric).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn what_a_dead_process_left_goes_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let name = |process: u32| folder.path().join(format!("{PREFIX}{}-{process}-abc{SUFFIX}", host()));
        // Process numbers end at 2^22 on Linux.
        let (dead, alive) = (name(4_194_305), name(std::process::id()));
        let elsewhere = |time: &str| folder.path().join(format!("{PREFIX}elsewhere-1-{time}{SUFFIX}"));
        let (old, new) = (elsewhere("old"), elsewhere("new"));
        for path in [&dead, &alive, &old, &new, &folder.path().join("part.tmp")] {
            fs::write(path, "x").unwrap();
        }
        for path in [&alive, &old] {
            let time = SystemTime::now() - 2 * STALE;
            fs::File::options().append(true).open(path).unwrap().set_modified(time).unwrap();
        }
        remove_leftovers(folder.path());
        assert!(!old.exists() && new.exists());
        assert!(!dead.exists() && alive.exists() && folder.path().join("part.tmp").exists());
    }
}
