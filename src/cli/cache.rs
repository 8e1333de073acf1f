//! `meshmill cache`: how full the cache is, what is damaged, and removal.

use std::time::Duration;

use clap::Subcommand;
use serde_json::json;

use super::Global;
use super::context::{open_store, store_folder};
use super::exit::{Exit, Fault, data, say};
use crate::report::table::grouped;
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
                data(&format!("size       {}", bytes_text(stat.bytes)));
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
    data(&format!("{verb} {} results, {} artifacts, {}", grouped(*entries), grouped(*blobs), bytes_text(*bytes)));
}

const UNITS: [(&str, u64); 4] = [("TB", 1_000_000_000_000), ("GB", 1_000_000_000), ("MB", 1_000_000), ("kB", 1000)];

fn bytes_text(bytes: u64) -> String {
    for (unit, factor) in UNITS {
        if bytes >= factor {
            return format!("{:.1} {unit}", bytes as f64 / factor as f64);
        }
    }
    format!("{bytes} B")
}

/// A size such as `50GB`, `1.5 TB` or `1000`.
fn size(text: &str) -> Result<u64, String> {
    let split = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = (text[..split].trim(), text[split..].trim().to_ascii_lowercase());
    let factor = match unit.as_str() {
        "" | "b" => Some(1),
        unit => UNITS.iter().find(|(name, _)| name.to_ascii_lowercase() == unit).map(|(_, factor)| *factor),
    };
    let number = number.parse::<f64>().ok().filter(|number| *number >= 0.0);
    match (number, factor) {
        (Some(number), Some(factor)) => Ok((number * factor as f64) as u64),
        _ => Err(format!("expected a size such as 50GB or 800MB, got `{text}`")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_with_their_units() {
        assert_eq!(size("50GB"), Ok(50_000_000_000));
        assert_eq!(size("1.5 MB"), Ok(1_500_000));
        assert_eq!(size("12"), Ok(12));
        assert!(size("-1").is_err() && size("1QB").is_err() && size("").is_err());
        assert_eq!(bytes_text(1_500_000), "1.5 MB");
    }
}
