//! One run at a time in a folder: files of two runs side by side would look like the result of one.
//!
//! The claim is the system's advisory lock on the folder itself, and a shared one on each folder above it, so that a
//! run in `out` and one in `out/case` exclude each other while `out/a` and `out/b` do not. It ends with the process,
//! however that ends, so nothing is left behind. Where a file system knows no such locks, there is no claim and nothing
//! is said.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

use same_file::Handle;

use super::RunError;

/// A claim to a folder, until it is dropped.
#[derive(Debug)]
pub struct Claim {
    /// Hold the locks: the folder itself, and those above it.
    folders: Vec<File>,
    /// The folder, where the claim made it.
    made: Option<PathBuf>,
}

/// Claims the folder of the outputs for this run, and makes it where it is not there.
///
/// # Errors
/// [`RunError::Claimed`] where another run has it, [`RunError::Output`] where it cannot be made.
pub fn claim(out: &Path) -> Result<Claim, RunError> {
    let made = (!out.exists()).then(|| out.to_path_buf());
    loop {
        let failed = |source| RunError::Output { action: "create the folder", path: out.to_path_buf(), source };
        fs::create_dir_all(out).map_err(failed)?;
        let real = fs::canonicalize(out).map_err(failed)?;
        let Some(own) = locked(out, File::try_lock)? else { return Ok(Claim { folders: Vec::new(), made }) };
        // The run before may have removed its empty folder between our looking and locking.
        if is_still(out, &own) {
            let mut folders = vec![own];
            for folder in real.ancestors().skip(1) {
                folders.extend(locked(folder, File::try_lock_shared)?);
            }
            return Ok(Claim { folders, made });
        }
    }
}

/// A folder with this lock; `None` where it cannot be locked.
fn locked(folder: &Path, lock: impl Fn(&File) -> Result<(), TryLockError>) -> Result<Option<File>, RunError> {
    let Ok(file) = File::open(folder) else { return Ok(None) };
    match lock(&file) {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => Err(RunError::Claimed(folder.to_path_buf())),
        Err(TryLockError::Error(_)) => Ok(None),
    }
}

/// Whether the folder of this name is the one that was opened, as far as that can be told.
fn is_still(out: &Path, opened: &File) -> bool {
    let opened = opened.try_clone().and_then(Handle::from_file);
    let (Ok(opened), Ok(now)) = (opened, Handle::from_path(out)) else { return out.exists() };
    opened == now
}

impl Drop for Claim {
    fn drop(&mut self) {
        // A run that wrote nothing leaves nothing; a folder with files in it stays.
        if let Some(made) = &self.made {
            let _ = fs::remove_dir(made);
        }
        self.folders.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn a_folder_is_claimed_once_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let first = claim(&out).unwrap();
        assert!(matches!(claim(&out), Err(RunError::Claimed(_))));
        drop(first);
        assert!(!out.exists(), "a run that wrote nothing left its folder");
        let inside = claim(&out.join("case")).unwrap();
        let beside = claim(&out.join("other")).unwrap();
        assert!(matches!(claim(&out), Err(RunError::Claimed(_))), "a run writes below");
        drop((inside, beside));
        let second = claim(&out).unwrap();
        assert!(matches!(claim(&out.join("case")), Err(RunError::Claimed(_))), "a run writes above");
        fs::write(out.join("result.stl"), "solid").unwrap();
        drop(second);
        assert!(out.join("result.stl").exists());
    }
}
