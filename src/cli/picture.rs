//! Pictures beside the output files: `result.png` beside `result.vtu`, drawn of the mesh that was written.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::exit::Fault;
use crate::report::picture;
use crate::run::{self, FileState, Output, Plan, RunOutcome, TaskId, VERSION};
use crate::store::Store;

/// With more outputs than this, pictures would cost more than trivial steps, and nobody looks at them one by one.
const FEW: usize = 32;

/// Which outputs get a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Pictures {
    /// All of up to 32 pictures; none of more.
    #[default]
    Few,
    /// All.
    All,
    /// None.
    None,
}

/// Width and height in pixels.
const SIZE: [u32; 2] = [640, 480];

/// Draws what is new, and removes pictures of files that are no longer there. A picture that is at least as new as its
/// file, which was right already, stays; so a second run draws nothing.
pub(super) fn write(plan: &Plan, outcome: &RunOutcome, store: &Store, which: Pictures) -> Result<(), Fault> {
    let all = wanted(plan, outcome);
    let is_drawn = match which {
        Pictures::Few => all.len() <= FEW,
        Pictures::All => true,
        Pictures::None => false,
    };
    for (place, wanted) in all {
        if wanted.stale.is_file() && fs::remove_file(&wanted.stale).is_ok() && !wanted.failed_gate {
            // Only an empty folder can be removed, so this takes nothing that shows a failure.
            let _ = wanted.stale.parent().map(fs::remove_dir);
        }
        if wanted.is_current && is_as_new(&place, &wanted.file) {
            continue;
        }
        if !is_drawn {
            // It would show an earlier mesh.
            let _ = fs::remove_file(&place);
            continue;
        }
        let artifact = outcome.task(wanted.task).content.and_then(|content| store.load(&content));
        let Some(mesh) = artifact.and_then(|artifact| artifact.to_soup()) else {
            // The cache could not keep it, and the picture that is there shows an earlier mesh.
            let _ = fs::remove_file(&place);
            continue;
        };
        match picture::png(&mesh, SIZE, &format!("meshmill {VERSION}")) {
            Ok(bytes) => run::write_file(&place, &bytes)?,
            Err(error) => tracing::warn!(place = %place.display(), %error, "cannot draw a picture"),
        }
    }
    Ok(())
}

/// A picture that should be there.
struct Wanted {
    task: TaskId,
    /// The file that it shows.
    file: PathBuf,
    is_current: bool,
    failed_gate: bool,
    /// Where the picture would be if the gate had ended otherwise.
    stale: PathBuf,
}

/// One picture for the files of a step that differ in their ending only.
fn wanted(plan: &Plan, outcome: &RunOutcome) -> BTreeMap<PathBuf, Wanted> {
    let mut pictures: BTreeMap<PathBuf, Wanted> = BTreeMap::new();
    let mut outputs: BTreeMap<(usize, TaskId), Vec<&Output>> = BTreeMap::new();
    for (number, case) in plan.cases().iter().enumerate() {
        case.outputs.iter().for_each(|output| outputs.entry((number, output.task)).or_default().push(output));
    }
    for file in &outcome.files {
        // Elements at fault have a file too, but no output of the recipe.
        let outputs = outputs.get(&(file.case, file.task)).into_iter().flatten();
        let output = outputs.copied().find(|output| file.path.ends_with(&output.file));
        let (Some(output), true) = (output, file.state != FileState::Missing) else { continue };
        let mut place = file.path.with_extension("png");
        if pictures.get(&place).is_some_and(|other| other.task != file.task) {
            place = PathBuf::from(format!("{}.png", file.path.display()));
        }
        let stale = counterpart(&place, output.file.components().count(), file.failed_gate);
        let is_current = file.state == FileState::Current;
        let (task, failed_gate) = (file.task, file.failed_gate);
        let fresh = Wanted { task, file: file.path.clone(), is_current, failed_gate, stale };
        let entry = pictures.entry(place).or_insert(fresh);
        entry.is_current &= is_current;
    }
    pictures
}

/// The same picture below `failed/`, or above it, where the last `depth` parts of its path are those of the output.
fn counterpart(place: &Path, depth: usize, failed_gate: bool) -> PathBuf {
    let folder = place.ancestors().nth(depth).unwrap_or(Path::new(""));
    let name = place.strip_prefix(folder).unwrap_or(place);
    if failed_gate { folder.parent().unwrap_or(Path::new("")).join(name) } else { folder.join("failed").join(name) }
}

fn is_as_new(place: &Path, file: &Path) -> bool {
    let time = |path: &Path| fs::metadata(path).and_then(|meta| meta.modified());
    matches!((time(place), time(file)), (Ok(picture), Ok(file)) if picture >= file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_changes_sides_with_its_gate() {
        let passed = Path::new("out/part/sub/result.png");
        let failed = Path::new("out/part/failed/sub/result.png");
        assert_eq!(counterpart(passed, 2, false), failed);
        assert_eq!(counterpart(failed, 2, true), passed);
    }
}
