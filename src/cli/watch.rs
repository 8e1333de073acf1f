//! `meshmill watch`: run again whenever the recipe or a file that it reads changes.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use notify::{Event, RecursiveMode, Watcher};

use super::Global;
use super::exit::{Exit, Fault, say};
use super::run;
use super::signals::Interrupt;

/// Run a recipe, and again whenever it or a file that it reads changes, until Ctrl-C.
#[derive(Debug, clap::Args)]
// The arguments of `run` make a group of the same name.
#[group(id = "watch")]
pub(super) struct Arguments {
    #[command(flatten)]
    run: run::Arguments,
}

/// Editors write a file in several goes; changes that follow each other so closely are one.
const SETTLED: Duration = Duration::from_millis(200);
/// How often an interrupt is looked for.
const TICK: Duration = Duration::from_millis(100);

pub(super) fn run(arguments: &Arguments, global: &Global) -> Result<Exit, Fault> {
    let interrupt = Interrupt::listen();
    let (sender, changes) = mpsc::channel();
    let fault = |error: notify::Error| Fault::new(Exit::Store, format!("cannot watch files: {error}"));
    let mut watcher = notify::recommended_watcher(move |event: notify::Result<Event>| {
        // The receiver is gone only when the command has ended.
        let _ = event.map(|event| sender.send(event));
    })
    .map_err(fault)?;
    let mut files = BTreeSet::new();
    let mut folders = BTreeSet::new();
    loop {
        // What is read is known before the run, so that a change while it runs is not missed.
        match arguments.run.recipe.plan() {
            Ok(planned) => files = whole(planned.files()),
            Err(_) => files.extend(whole([arguments.run.recipe.path().to_path_buf()])),
        }
        for folder in files.iter().filter_map(|file| file.parent()) {
            if folders.insert(folder.to_path_buf()) {
                watcher.watch(folder, RecursiveMode::NonRecursive).map_err(fault)?;
            }
        }
        match run::once(&arguments.run, global, &interrupt) {
            Ok(Exit::Interrupted | Exit::Terminated) => return Ok(interrupt.exit()),
            Ok(_) => {}
            Err(fault) => fault.print(),
        }
        say(&format!("watching {} files; Ctrl-C ends", files.len()));
        if !wait(&changes, &files, &interrupt) {
            return Ok(interrupt.exit());
        }
    }
}

/// Absolute paths, as events tell them.
fn whole(files: impl IntoIterator<Item = PathBuf>) -> BTreeSet<PathBuf> {
    let whole = |file: PathBuf| {
        let name = file.file_name()?.to_owned();
        let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Some(folder.canonicalize().ok()?.join(name))
    };
    files.into_iter().filter_map(whole).collect()
}

/// Waits until one of the files has changed and settled; false when interrupted.
fn wait(changes: &Receiver<Event>, files: &BTreeSet<PathBuf>, interrupt: &Interrupt) -> bool {
    let concerns = |event: &Event| !event.kind.is_access() && event.paths.iter().any(|path| files.contains(path));
    // Other files of the same folders may change all the time, so that silence is no sign.
    let mut changed: Option<Instant> = None;
    loop {
        if interrupt.cancelled.load(Ordering::Relaxed) {
            return false;
        }
        if changed.is_some_and(|last| last.elapsed() >= SETTLED) {
            return true;
        }
        match changes.recv_timeout(TICK) {
            Ok(event) if concerns(&event) => changed = Some(Instant::now()),
            Ok(_) | Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return false,
        }
    }
}
