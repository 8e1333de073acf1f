//! The `meshmill` command.

use std::alloc::System;

use cap::Cap;

/// Counts what is allocated, for limits and records of memory. It limits nothing itself.
#[global_allocator]
static ALLOCATOR: Cap<System> = Cap::new(System, usize::MAX);

fn main() -> std::process::ExitCode {
    meshmill::cli::main(|| ALLOCATOR.allocated() as u64)
}
