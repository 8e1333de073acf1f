//! One run at a time in a folder: files of two runs side by side would look like the result of one.
//!
//! The claim is the system's advisory lock on the folder itself. It ends with the process, however that ends, so nothing
//! is left behind. Where a file system knows no such locks, there is no claim and nothing is said.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

use super::RunError;

/// A claim to a folder, until it is dropped.
#[derive(Debug)]
pub struct Claim {
    /// Holds the lock.
    folder: Option<File>,
    /// The folder, where the claim made it.
    made: Option<PathBuf>,
}

/// Claims the folder of the outputs for this run, and makes it where it is not there.
///
/// # Errors
/// [`RunError::Claimed`] where another run has it, [`RunError::Output`] where it cannot be made.
pub fn claim(out: &Path) -> Result<Claim, RunError> {
    let made = (!out.exists()).then(|| out.to_path_buf());
    let failed = |source| RunError::Output { action: "create the folder", path: out.to_path_buf(), source };
    fs::create_dir_all(out).map_err(failed)?;
    let Ok(folder) = File::open(out) else { return Ok(Claim { folder: None, made }) };
    match folder.try_lock() {
        Ok(()) => Ok(Claim { folder: Some(folder), made }),
        Err(TryLockError::WouldBlock) => Err(RunError::Claimed(out.to_path_buf())),
        Err(TryLockError::Error(_)) => Ok(Claim { folder: None, made }),
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        // A run that wrote nothing leaves nothing; a folder with files in it stays.
        if let Some(made) = &self.made {
            let _ = fs::remove_dir(made);
        }
        drop(self.folder.take());
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
        let second = claim(&out).unwrap();
        fs::write(out.join("result.stl"), "solid").unwrap();
        drop(second);
        assert!(out.join("result.stl").exists());
    }
}
