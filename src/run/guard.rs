//! What a run must not touch: its own inputs under any name, and whatever a link below its folder leads to.
//!
//! Looked at before anything runs. Two names are one file when the system says so (device and inode), so links, hard
//! links, other spellings and other letter cases are all seen; a file that is not there yet can be nobody's input.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Component, Path, PathBuf};
use std::time::SystemTime;

use same_file::is_same_file;

use super::{RunError, RunOptions, source};
use crate::plan::Plan;

/// Files that the program writes into the folder of a run besides its outputs.
const OWN: [&str; 6] = ["run.ron", "report.html", "sweep.csv", "sweep.ron", "sweep.html", "best.toml"];

/// Fails where an output would replace what the run reads, or would be written through a link below the folder.
pub(super) fn check(plan: &Plan, options: &RunOptions) -> Result<(), RunError> {
    let sources = source::files(plan);
    let read: Vec<&Path> =
        sources.iter().map(PathBuf::as_path).chain(options.protected.iter().map(PathBuf::as_path)).collect();
    let mut by_stat: BTreeMap<(u64, Option<SystemTime>), Vec<&Path>> = BTreeMap::new();
    for &input in &read {
        by_stat.entry(fingerprint(input).unwrap_or_default()).or_default().push(input);
    }
    for output in written(plan, options) {
        check_links(&options.out, &output)?;
        // One file has one size and time by all its names, so that few are looked at closely.
        let Some(alike) = fingerprint(&output).and_then(|stat| by_stat.get(&stat)) else { continue };
        if let Some(input) = replaced(&output, alike) {
            return Err(RunError::WouldReplace { input: input.to_path_buf(), output });
        }
    }
    Ok(())
}

/// Size and time of the file that a name leads to.
fn fingerprint(path: &Path) -> Option<(u64, Option<SystemTime>)> {
    fs::metadata(path).ok().map(|meta| (meta.len(), meta.modified().ok()))
}

/// Which of these files is the one that `output` names, by whatever alias.
pub fn replaced<'a>(output: &Path, read: &[&'a Path]) -> Option<&'a Path> {
    if output.symlink_metadata().is_err() {
        return None;
    }
    read.iter().copied().find(|input| is_same_file(input, output).unwrap_or(false))
}

/// Whether a file lies in the folder of a run, reached by plain folders alone: by no link, and by no way back up.
pub fn is_inside(out: &Path, file: &Path) -> bool {
    let below = |rest: &Path| rest.components().all(|part| matches!(part, Component::Normal(_)));
    file.strip_prefix(out).is_ok_and(below) && check_links(out, file).is_ok()
}

/// All that a run may write, with the pictures beside the outputs.
fn written(plan: &Plan, options: &RunOptions) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = OWN.iter().map(|name| options.out.join(name)).collect();
    for case in plan.cases() {
        let folder = options.out.join(&case.name);
        let failed = folder.join("failed");
        files.push(failed.join("failed.vtu"));
        files.extend(case.gates.iter().map(|gate| failed.join(format!("failed-{}.vtu", gate.step))));
        for output in &case.outputs {
            let here = [folder.join(&output.file), failed.join(&output.file)];
            files.extend(here.iter().map(|file| file.with_extension("png")));
            files.extend(here);
        }
    }
    files
}

/// Fails where a folder between `out` and the file is a link.
fn check_links(out: &Path, file: &Path) -> Result<(), RunError> {
    let between = file.ancestors().skip(1).take_while(|folder| folder.starts_with(out) && *folder != out);
    match between.filter(|folder| folder.is_symlink()).last() {
        Some(link) => Err(RunError::Link(link.to_path_buf())),
        None => Ok(()),
    }
}
