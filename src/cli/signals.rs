//! Ctrl-C and SIGTERM: ask the run to stop, and stop it within two seconds in any case.
//!
//! Stopping hard leaves nothing partial: results and files appear by renaming, and hidden temporary files are removed
//! by the next run.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::thread;
use std::time::Duration;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use super::exit::Exit;

/// Steps get this long to stop by themselves.
const PATIENCE: Duration = Duration::from_millis(1500);

/// Whether a signal came, and which.
#[derive(Clone, Default)]
pub(super) struct Interrupt {
    /// Becomes true with the first signal.
    pub(super) cancelled: Arc<AtomicBool>,
    signal: Arc<AtomicU8>,
}

/// Lets a file that grows past the limit of its user (`ulimit -f`) be an error of writing, as a full disk is, and not
/// the end of the process, which would leave its temporary file behind.
pub(super) fn outlive_file_limits() {
    #[cfg(unix)]
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::new(AtomicBool::new(false)));
}

impl Interrupt {
    /// Listens from now on. Where the system refuses, signals end the process as they always did.
    pub(super) fn listen() -> Self {
        let interrupt = Self::default();
        let Ok(mut signals) = Signals::new([SIGINT, SIGTERM]) else { return interrupt };
        let shared = interrupt.clone();
        thread::spawn(move || {
            for signal in &mut signals {
                if shared.cancelled.swap(true, Ordering::SeqCst) {
                    end(signal);
                }
                shared.signal.store(u8::try_from(signal).unwrap_or(0), Ordering::SeqCst);
                thread::spawn(move || {
                    thread::sleep(PATIENCE);
                    end(signal);
                });
            }
        });
        interrupt
    }

    /// The exit code of an interrupted run.
    pub(super) fn exit(&self) -> Exit {
        exit_of(i32::from(self.signal.load(Ordering::SeqCst)))
    }
}

fn exit_of(signal: i32) -> Exit {
    if signal == SIGTERM { Exit::Terminated } else { Exit::Interrupted }
}

#[expect(clippy::exit, reason = "a step that does not react must not keep the process alive")]
fn end(signal: i32) {
    std::process::exit(exit_of(signal) as i32)
}
