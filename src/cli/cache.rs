//! `meshmill cache`: how full the cache is, what is damaged, and removal.

use std::time::Duration;

use clap::Subcommand;
use serde_json::json;

use super::Global;
use super::context::{open_store, store_folder};
use super::exit::{Exit, Fault, data, say};
use crate::report::table::grouped;
use crate::step::amount;
use crate::store::{CleanReport, GcLimits, Store};

/// Look after the cache.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: CacheCommand,
}

#[derive(Debug, Subcommand)]
enum CacheCommand {
    /// Say where the cache is and how full.
    Stat {
        /// Print one JSON document.
        #[arg(long)]
        json: bool,
    },
    /// Remove what was not used for long, or the oldest until the rest fits.
    Gc {
        /// Keep at most this much, such as `50GB`.
        #[arg(long, value_name = "SIZE", value_parser = size)]
        max_size: Option<u64>,
        /// Remove what was not used for so many days.
        #[arg(long, value_name = "DAYS")]
        keep_days: Option<u64>,
        /// Say what would go and remove nothing.
        #[arg(long)]
        dry_run: bool,
    },
    /// Check every file of the cache and remove damaged ones.
    Verify,
    /// Remove everything.
    Clear,
}

pub(super) fn run(arguments: &Arguments, global: &Global) -> Result<Exit, Fault> {
    let root = store_folder(global)?;
    // Looking makes no cache of a folder that is none.
    if !Store::is_at(&root) {
        return Err(Fault::usage(format!("{} is no cache of meshmill", root.display()))
            .help("a run makes one; name another with --cache DIR"));
    }
    let store = open_store(global)?;
    match &arguments.command {
        CacheCommand::Stat { json } => {
            let stat = store.stat()?;
            if *json {
                data(&json!({ "folder": store.root().display().to_string(), "contents": stat }).to_string());
            } else {
                data(&format!("folder     {}", store.root().display()));
                data(&format!("results    {}", grouped(stat.entries)));
                data(&format!("artifacts  {}", grouped(stat.blobs)));
                data(&format!("size       {}", amount::text(stat.bytes)));
                data(&format!("leftovers  {}", grouped(stat.leftovers)));
            }
        }
        CacheCommand::Gc { max_size, keep_days, dry_run } => {
            let max_age = keep_days.map(|days| Duration::from_secs(days.saturating_mul(24 * 60 * 60)));
            let report = store.gc(GcLimits { max_bytes: *max_size, max_age, dry_run: *dry_run })?;
            tell(&report, if *dry_run { "would remove" } else { "removed" });
        }
        CacheCommand::Verify => {
            let report = store.verify()?;
            for path in &report.damaged {
                say(&format!("damaged, removed: {}", path.display()));
            }
            data(&format!("{} damaged files", report.damaged.len()));
            return Ok(if report.damaged.is_empty() { Exit::Done } else { Exit::Store });
        }
        CacheCommand::Clear => tell(&store.clear()?, "removed"),
    }
    Ok(Exit::Done)
}

fn tell(report: &CleanReport, verb: &str) {
    let CleanReport { entries, blobs, bytes, damaged: _ } = report;
    data(&format!("{verb} {} results, {} artifacts, {}", grouped(*entries), grouped(*blobs), amount::text(*bytes)));
}

/// A size such as `50GB`, `1.5 TB` or `1000`.
pub(super) fn size(text: &str) -> Result<u64, String> {
    amount::bytes(text).ok_or_else(|| format!("expected a size such as 50GB or 800MB, got `{text}`"))
}
