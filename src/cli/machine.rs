//! How much memory the machine has for a run.

use std::fs;

use super::Global;
use super::cache::size;
use crate::run::RunOptions;

/// How much memory tasks may take.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct MemoryArguments {
    /// Memory that tasks may take together, such as `16GB`: one that took more before runs alone. Default: that of the
    /// machine.
    #[arg(long, value_name = "SIZE", value_parser = size)]
    memory: Option<u64>,
}

impl MemoryArguments {
    /// The options of a run with the memory that was chosen.
    pub(super) fn applied(&self, options: RunOptions, global: &Global) -> RunOptions {
        let memory = self.memory.or_else(machine);
        RunOptions { memory, meter: global.meter, ..options }
    }
}

/// The memory of the machine, or of the part of it that this process may use. Told by Linux only; elsewhere nothing is
/// known.
fn machine() -> Option<u64> {
    let total = fs::read_to_string("/proc/meminfo").ok().and_then(|text| total(&text));
    let group = fs::read_to_string("/sys/fs/cgroup/memory.max").ok().and_then(|text| text.trim().parse().ok());
    match (total, group) {
        (Some(total), Some(group)) => Some(u64::min(total, group)),
        (total, group) => total.or(group),
    }
}

/// The bytes in the line `MemTotal:  16303428 kB`.
fn total(text: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kilobytes.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_memory_of_the_machine_is_read() {
        assert_eq!(total("MemFree: 1 kB\nMemTotal:       16303428 kB\n"), Some(16_303_428 * 1024));
        assert_eq!(total("MemTotal: many kB"), None);
    }
}
