//! The command line: arguments in, a report out, one exit code. One file a subcommand.
//!
//! Data goes to stdout, everything else to stderr. This is the only module that prints, that ends the process, and
//! that decides which steps there are: it hands the catalog down.

mod best;
mod bundle;
mod cache;
mod check;
mod class;
mod completions;
mod config;
mod context;
mod convert;
mod criteria;
mod diff;
mod exit;
mod goal;
mod graph;
mod held;
mod init;
mod lock;
mod machine;
mod man;
mod measure;
mod picture;
mod plan;
mod progress;
mod record;
mod report;
mod run;
mod schema;
mod signals;
mod steps;
mod sweep;
mod tables;
mod trace;
mod unchanged;
mod verify;
mod watch;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand, ValueEnum};

use exit::{Exit, Fault};

use crate::run::Meter;

/// Turns triangle meshes of any origin into finite-element surface meshes, by recipes that run as a cached graph.
#[derive(Debug, Parser)]
#[command(name = "meshmill", version, max_term_width = 100)]
struct Arguments {
    #[command(flatten)]
    global: Global,
    #[command(subcommand)]
    command: Command,
}

/// Options of every subcommand.
#[derive(Clone, Debug, clap::Args)]
struct Global {
    /// Folder of the cache; more than once for its levels, the nearest first. Default: `MESHMILL_CACHE`, else what the
    /// files of settings say, else the user's cache folder.
    #[arg(long, global = true, value_name = "DIR")]
    cache: Vec<PathBuf>,
    /// Print nothing but data and errors.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Print more; twice for even more.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
    /// How log lines are written to stderr.
    #[arg(long, global = true, value_name = "FORMAT", default_value = "text")]
    log_format: LogFormat,
    /// Measures memory.
    #[arg(skip)]
    meter: Option<Meter>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum LogFormat {
    Text,
    Json,
}

#[derive(Debug, Subcommand)]
enum Command {
    Run(run::Arguments),
    Sweep(sweep::Arguments),
    Watch(watch::Arguments),
    Lock(lock::Arguments),
    Bundle(bundle::Arguments),
    Verify(verify::Arguments),
    Init(init::Arguments),
    Check(check::Arguments),
    Plan(plan::Arguments),
    Graph(graph::Arguments),
    Report(report::Arguments),
    Measure(measure::Arguments),
    Convert(convert::Arguments),
    Criteria(criteria::Arguments),
    Diff(diff::Arguments),
    Steps(steps::Arguments),
    Schema(schema::Arguments),
    Cache(cache::Arguments),
    Completions(completions::Arguments),
    Man(man::Arguments),
}

/// Parses the arguments, does what they say, and tells the exit code.
/// `meter` tells how many bytes the program has allocated and not freed.
pub fn main(meter: Meter) -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(mut arguments) => {
            arguments.global.meter = Some(meter);
            arguments
        }
        Err(error) => {
            // Help and version are no errors; a closed pipe is nobody's fault.
            let _ = error.print();
            return if error.use_stderr() { Exit::Usage.into() } else { Exit::Done.into() };
        }
    };
    start_log(&arguments.global);
    quiet_panics();
    signals::outlive_file_limits();
    let global = &arguments.global;
    let result = std::panic::catch_unwind(|| match &arguments.command {
        Command::Run(command) => run::run(command, global),
        Command::Sweep(command) => sweep::run(command, global),
        Command::Watch(command) => watch::run(command, global),
        Command::Lock(command) => lock::run(command, global),
        Command::Bundle(command) => bundle::run(command, global),
        Command::Verify(command) => verify::run(command, global),
        Command::Init(command) => init::run(command),
        Command::Check(command) => check::run(command),
        Command::Plan(command) => plan::run(command, global),
        Command::Graph(command) => graph::run(command),
        Command::Report(command) => report::run(command, global),
        Command::Measure(command) => measure::run(command),
        Command::Convert(command) => convert::run(command),
        Command::Criteria(command) => criteria::run(command),
        Command::Diff(command) => diff::run(command),
        Command::Steps(command) => steps::run(command),
        Command::Schema(command) => schema::run(command),
        Command::Cache(command) => cache::run(command, global),
        Command::Completions(command) => completions::run(command),
        Command::Man(command) => man::run(command),
    });
    let result = result.unwrap_or_else(|_| {
        let message = "the program reached a state that it should not; nothing partial was written";
        Err(Fault::new(Exit::Fault, message)
            .help("please report this with the command line; -v tells where it happened"))
    });
    match result.and_then(|exit| exit::unwritten().map_or(Ok(exit), Err)) {
        Ok(exit) => exit.into(),
        Err(fault) => {
            fault.print();
            fault.exit.into()
        }
    }
}

/// Log lines go to stderr: warnings as a rule, errors only with `-q`, more with `-v`.
fn start_log(global: &Global) {
    use tracing::Level;
    let level = match (global.quiet, global.verbose) {
        (true, _) => Level::ERROR,
        (false, 0) => Level::WARN,
        (false, 1) => Level::INFO,
        (false, 2) => Level::DEBUG,
        (false, _) => Level::TRACE,
    };
    let log = tracing_subscriber::fmt().with_max_level(level).with_writer(std::io::stderr).with_target(false);
    // A second start in one process, as in tests, keeps the first log.
    let _ = match global.log_format {
        LogFormat::Text => {
            use std::io::IsTerminal;
            let ansi = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
            tracing::subscriber::set_global_default(log.without_time().with_ansi(ansi).finish())
        }
        LogFormat::Json => tracing::subscriber::set_global_default(log.json().finish()),
    };
}

/// A panic is reported as the failure of its step; where it happened is for the log.
fn quiet_panics() {
    std::panic::set_hook(Box::new(|panic| {
        let place = panic.location().map(ToString::to_string).unwrap_or_default();
        tracing::info!(place, "panic");
    }));
}
