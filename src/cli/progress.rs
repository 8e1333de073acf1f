//! Progress on stderr: bars on a terminal, plain lines elsewhere.

use std::collections::BTreeMap;
use std::io::IsTerminal;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::exit::{coloured, say, say_styled};
use crate::report::table::figures_text;
use crate::run::{Event, Observer, Silent, TaskState};
use crate::store::{Entry, Outcome};
use crate::terminal::printable_lines;

/// With `-v` off a terminal, a running task says where it is this often.
const INTERVAL: Duration = Duration::from_secs(5);

/// The observer that suits this terminal; none with `quiet`.
pub(super) fn observer(quiet: bool, verbose: bool) -> Arc<dyn Observer> {
    if quiet {
        Arc::new(Silent)
    } else if std::io::stderr().is_terminal() {
        Arc::new(Bars {
            all: MultiProgress::with_draw_target(ProgressDrawTarget::stderr()),
            running: Mutex::default(),
            verbose,
        })
    } else {
        Arc::new(Lines { running: Mutex::default(), verbose })
    }
}

/// A line for the end of a task, or none where there is nothing to tell.
fn end_line(label: &str, state: TaskState, entry: Option<&Entry>, verbose: bool) -> Option<String> {
    let figures = entry.and_then(|entry| match &entry.outcome {
        Outcome::Artifact { figures, .. } => Some(figures_text(figures)).filter(|text| !text.is_empty()),
        Outcome::Gate(_) | Outcome::Failure(_) | Outcome::File { .. } => None,
    });
    let figures = figures.map(|text| format!(", {text}")).unwrap_or_default();
    match state {
        TaskState::Done => {
            let seconds = entry.map(|entry| format!(" in {:.2} s", entry.seconds)).unwrap_or_default();
            Some(format!("{label}: done{seconds}{figures}"))
        }
        TaskState::Failed => Some(format!("{label}: FAILED")),
        TaskState::Cancelled => Some(format!("{label}: cancelled")),
        TaskState::Cached if verbose => Some(format!("{label}: cached{figures}")),
        TaskState::Skipped if verbose => Some(format!("{label}: skipped")),
        TaskState::Unknown
        | TaskState::Unwanted
        | TaskState::Want
        | TaskState::Ready
        | TaskState::Running
        | TaskState::Cached
        | TaskState::Skipped => None,
    }
}

/// One bar for each running task.
struct Bars {
    all: MultiProgress,
    running: Mutex<BTreeMap<usize, ProgressBar>>,
    verbose: bool,
}

impl Observer for Bars {
    fn event(&self, event: &Event<'_>) {
        let mut running = self.running.lock().unwrap_or_else(PoisonError::into_inner);
        match *event {
            Event::State { node, label, state: TaskState::Running, .. } => {
                let bar = self.all.add(ProgressBar::new_spinner().with_prefix(label.to_owned()));
                bar.set_style(style("{spinner} {prefix:20!} {elapsed:>5} {wide_msg}"));
                bar.enable_steady_tick(Duration::from_millis(120));
                running.insert(node, bar);
            }
            Event::State { node, label, state, entry } => {
                if let Some(bar) = running.remove(&node) {
                    bar.finish_and_clear();
                    self.all.remove(&bar);
                }
                if let Some(line) = end_line(label, state, entry, self.verbose) {
                    let plain = anstream::stderr().current_choice() == anstream::ColorChoice::Never;
                    // A terminal that went away is no reason to stop.
                    let _ = self.all.println(if plain { printable_lines(&line).into_owned() } else { coloured(&line) });
                }
            }
            Event::Phase { node, name, total } => {
                if let Some(bar) = running.get(&node) {
                    bar.set_position(0);
                    bar.set_message(name.to_owned());
                    if let Some(total) = total {
                        bar.set_length(total);
                        bar.set_style(style(
                            "{spinner} {prefix:20!} {elapsed:>5} {bar:24} {percent:>3}% {per_sec:>12} {wide_msg}",
                        ));
                    } else {
                        bar.set_style(style("{spinner} {prefix:20!} {elapsed:>5} {wide_msg}"));
                    }
                }
            }
            Event::Advance { node, done, figure } => {
                if let Some(bar) = running.get(&node) {
                    bar.set_position(done);
                    bar.set_message(figure.to_owned());
                }
            }
        }
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_spinner())
}

/// A running task, as lines tell it.
struct Line {
    label: String,
    phase: String,
    total: Option<u64>,
    said: Instant,
}

/// A line for the end of each task, and with `-v` now and then one for a task that takes long.
struct Lines {
    running: Mutex<BTreeMap<usize, Line>>,
    verbose: bool,
}

impl Observer for Lines {
    fn event(&self, event: &Event<'_>) {
        let mut running = self.running.lock().unwrap_or_else(PoisonError::into_inner);
        match *event {
            Event::State { node, label, state: TaskState::Running, .. } => {
                let line = Line { label: label.to_owned(), phase: String::new(), total: None, said: Instant::now() };
                running.insert(node, line);
            }
            Event::State { node, label, state, entry } => {
                running.remove(&node);
                if let Some(line) = end_line(label, state, entry, self.verbose) {
                    say_styled(&coloured(&line));
                }
            }
            Event::Phase { node, name, total } => {
                if let Some(line) = running.get_mut(&node) {
                    name.clone_into(&mut line.phase);
                    line.total = total;
                }
            }
            Event::Advance { node, done, figure } => {
                if self.verbose
                    && let Some(line) = running.get_mut(&node)
                    && line.said.elapsed() >= INTERVAL
                {
                    line.said = Instant::now();
                    let percent = line.total.filter(|total| *total > 0).map(|total| done.saturating_mul(100) / total);
                    let percent = percent.map(|percent| format!(" {percent}%")).unwrap_or_default();
                    say(&format!("{}: {}{percent} {figure}", line.label, line.phase));
                }
            }
        }
    }
}
