//! The `meshmill` command.

fn main() -> std::process::ExitCode {
    meshmill::cli::main()
}
