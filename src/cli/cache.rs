//! `meshmill cache`: how full the levels of the cache are, what is damaged, removal, and copying between them.

use std::path::PathBuf;
use std::time::Duration;

use clap::Subcommand;
use serde_json::json;

use super::Global;
use super::config;
use super::exit::{Exit, Fault, data, say};
use crate::report::table::grouped;
use crate::step::amount;
use crate::store::{CleanReport, CopyReport, GcLimits, LevelSpec, Location, Store};

/// Look after the cache and its levels.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: CacheCommand,
}

#[derive(Debug, Subcommand)]
enum CacheCommand {
    /// Say where the levels of the cache are and how full.
    Stat {
        /// Print one JSON document.
        #[arg(long)]
        json: bool,
        /// Tell which version on which machine made how many results; reads every one of them.
        #[arg(long)]
        makers: bool,
        #[command(flatten)]
        level: LevelArgument,
    },
    /// Remove what was not used for long, or the oldest until the rest fits. What a lock pins stays.
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
        #[command(flatten)]
        level: LevelArgument,
    },
    /// Check every file of a level and remove damaged ones.
    Verify {
        #[command(flatten)]
        level: LevelArgument,
    },
    /// Remove everything from a level that is a folder.
    Clear {
        #[command(flatten)]
        level: LevelArgument,
    },
    /// Copy what the first level has to the others.
    Push {
        #[command(flatten)]
        level: LevelArgument,
    },
    /// Copy what the others have to the first level.
    Pull {
        #[command(flatten)]
        level: LevelArgument,
    },
    /// List the locks whose results stay.
    Pins {
        #[command(flatten)]
        level: LevelArgument,
    },
    /// Let the results of a lock be collected.
    Unpin {
        /// The lock, as `cache pins` names it.
        lock: PathBuf,
        #[command(flatten)]
        level: LevelArgument,
    },
}

/// Which level is meant.
#[derive(Debug, clap::Args)]
struct LevelArgument {
    /// The level by its number from 1, its folder or its address, or `all`. Default: the first for what removes or
    /// reads everything, all others for `push` and `pull`, all for the rest.
    #[arg(long, value_name = "LEVEL")]
    level: Option<String>,
}

impl LevelArgument {
    /// The numbers of the levels that are meant, counted from 0.
    fn of(&self, store: &Store, default: std::ops::Range<usize>) -> Result<Vec<usize>, Fault> {
        let count = store.level_count();
        let Some(text) = &self.level else { return Ok(default.collect()) };
        if text == "all" {
            return Ok((0..count).collect());
        }
        let by_number = text.parse().ok().filter(|number| (1..=count).contains(number)).map(|number: usize| number - 1);
        // An address is one level, whatever else the settings say of it.
        let named = LevelSpec::parse(text).name();
        let by_name = || (0..count).find(|number| store.level_spec(*number).name() == named);
        by_number.or_else(by_name).map(|number| vec![number]).ok_or_else(|| {
            let names: Vec<String> =
                (0..count).map(|number| format!("{} {}", number + 1, store.level_spec(number).name())).collect();
            Fault::usage(format!("--level {text}: the cache has no such level"))
                .help(format!("it has {}", names.join(", ")))
        })
    }
}

pub(super) fn run(arguments: &Arguments, global: &Global) -> Result<Exit, Fault> {
    // Looking makes no cache of a folder that is none.
    let levels = config::levels(&global.cache)?;
    if let Some(LevelSpec { at: Location::Folder(root), .. }) = levels.first()
        && !Store::is_at(root)
        && !matches!(arguments.command, CacheCommand::Pull { .. })
    {
        return Err(Fault::usage(format!("{} is no cache of meshmill", root.display()))
            .help("a run makes one; name another with --cache DIR"));
    }
    let store = Store::with_levels(&levels)?;
    let all = 0..store.level_count();
    match &arguments.command {
        CacheCommand::Stat { json, makers, level } => stat(&store, &level.of(&store, all)?, *json, *makers),
        CacheCommand::Gc { max_size, keep_days, dry_run, level } => {
            let max_age = keep_days.map(|days| Duration::from_secs(days.saturating_mul(24 * 60 * 60)));
            let limits = GcLimits { max_bytes: *max_size, max_age, dry_run: *dry_run };
            for number in level.of(&store, 0..1)? {
                tell(&store, number, &store.gc(number, limits)?, if *dry_run { "would remove" } else { "removed" });
            }
            Ok(Exit::Done)
        }
        CacheCommand::Verify { level } => verify(&store, &level.of(&store, 0..1)?),
        CacheCommand::Clear { level } => {
            for number in level.of(&store, 0..1)? {
                tell(&store, number, &store.clear(number)?, "removed");
            }
            Ok(Exit::Done)
        }
        CacheCommand::Push { level } => copy(&store, others(&store, level)?, Direction::Push),
        CacheCommand::Pull { level } => copy(&store, others(&store, level)?, Direction::Pull),
        CacheCommand::Pins { level } => {
            for number in level.of(&store, all)? {
                for pin in store.pins(number)? {
                    let place = named(&store, number, format!("{} results", grouped(pin.keys.len() as u64)));
                    data(&format!("{place}: {} on {}, by version {}", pin.lock, pin.host, pin.version));
                }
            }
            Ok(Exit::Done)
        }
        CacheCommand::Unpin { lock, level } => unpin(&store, &level.of(&store, all)?, lock),
    }
}

/// The levels that the first one is copied to or from.
fn others(store: &Store, level: &LevelArgument) -> Result<Vec<usize>, Fault> {
    let others: Vec<usize> =
        level.of(store, 1..store.level_count())?.into_iter().filter(|number| *number > 0).collect();
    if others.is_empty() {
        return Err(Fault::usage("the cache has one level, and nothing to copy from or to")
            .help("name a second one: --cache DIR --cache OTHER, or `levels` in the settings"));
    }
    Ok(others)
}

fn stat(store: &Store, levels: &[usize], json: bool, makers: bool) -> Result<Exit, Fault> {
    let (mut documents, mut first) = (Vec::new(), None);
    for &number in levels {
        let spec = store.level_spec(number);
        let found = store.stat(number);
        let made: Vec<_> = if makers { store.makers(number)?.into_iter().collect() } else { Vec::new() };
        if json {
            let made: Vec<_> =
                made.iter().map(|((v, h), n)| json!({ "version": v, "host": h, "results": n })).collect();
            documents.push(json!({
                "level": spec.name(),
                "read-only": spec.read_only,
                "contents": found.as_ref().ok(),
                "trouble": found.as_ref().err().map(ToString::to_string),
                "makers": if makers { Some(made) } else { None },
            }));
        } else {
            let word = if matches!(spec.at, Location::Folder(_)) { "folder     " } else { "address    " };
            let mark = if spec.read_only { " (read only)" } else { "" };
            data(&format!("{word}{}{mark}", spec.name()));
            match &found {
                Ok(stat) => {
                    data(&format!("results    {}", grouped(stat.entries)));
                    data(&format!("artifacts  {}", grouped(stat.blobs)));
                    data(&format!("size       {}", amount::text(stat.bytes)));
                    data(&format!("pins       {}", grouped(stat.pins)));
                    data(&format!("leftovers  {}", grouped(stat.leftovers)));
                }
                Err(error) => data(&format!("trouble    {error}")),
            }
            for ((version, host), count) in made {
                let host = if host.is_empty() { "a machine that is not known" } else { &host };
                data(&format!("made by    {version} on {host}: {}", grouped(count)));
            }
        }
        first.get_or_insert(found.map(|_| ()));
    }
    if json {
        data(
            &json!({
                "folder": store.root().display().to_string(),
                "contents": documents.first().map(|level| &level["contents"]),
                "levels": documents,
            })
            .to_string(),
        );
    }
    // A later level may be away for a while; the first is what was asked for.
    first.transpose()?;
    Ok(Exit::Done)
}

fn verify(store: &Store, levels: &[usize]) -> Result<Exit, Fault> {
    let mut damaged = 0;
    for &number in levels {
        let report = store.verify(number)?;
        for path in &report.damaged {
            say(&format!("damaged, removed: {}", path.display()));
        }
        damaged += report.damaged.len();
        data(&named(store, number, format!("{} damaged files", report.damaged.len())));
        if report.foreign > 0 {
            data(&named(store, number, format!("{} files of another version, left alone", grouped(report.foreign))));
        }
    }
    Ok(if damaged == 0 { Exit::Done } else { Exit::Store })
}

#[derive(Clone, Copy)]
enum Direction {
    Push,
    Pull,
}

fn copy(store: &Store, others: Vec<usize>, direction: Direction) -> Result<Exit, Fault> {
    for other in others {
        let report = match direction {
            Direction::Push => store.copy(0, other, true)?,
            Direction::Pull => store.copy(other, 0, false)?,
        };
        let CopyReport { entries, blobs, bytes, present, left_out } = report;
        let (entries, blobs, present) = (grouped(entries), grouped(blobs), grouped(present));
        let name = store.level_spec(other).name();
        let word = if matches!(direction, Direction::Push) { "to" } else { "from" };
        let size = amount::text(bytes);
        data(&format!("{word} {name}: {entries} results, {blobs} artifacts, {size}; {present} were there"));
        if left_out > 0 {
            say(&format!(
                "{} results were left out: damaged, of another version, or without their mesh",
                grouped(left_out)
            ));
        }
    }
    Ok(Exit::Done)
}

fn unpin(store: &Store, levels: &[usize], lock: &std::path::Path) -> Result<Exit, Fault> {
    let named = lock.display().to_string();
    let whole = std::path::absolute(lock).map_or_else(|_| named.clone(), |path| path.display().to_string());
    let mut count = 0;
    for &number in levels {
        count += store.unpin(number, &whole)?;
        if whole != named {
            count += store.unpin(number, &named)?;
        }
    }
    if count == 0 {
        return Err(Fault::usage(format!("{named}: no such lock is pinned")).help("`meshmill cache pins` lists them"));
    }
    Ok(Exit::Done)
}

/// A line about a level, which is named where there is more than one.
fn named(store: &Store, number: usize, line: String) -> String {
    if store.level_count() == 1 { line } else { format!("{}: {line}", store.level_spec(number).name()) }
}

fn tell(store: &Store, number: usize, report: &CleanReport, verb: &str) {
    let CleanReport { entries, blobs, bytes, pinned, foreign: _, damaged: _ } = report;
    let (entries, blobs, size) = (grouped(*entries), grouped(*blobs), amount::text(*bytes));
    data(&named(store, number, format!("{verb} {entries} results, {blobs} artifacts, {size}")));
    if *pinned > 0 {
        data(&named(store, number, format!("{} results stay, for a lock pins them", grouped(*pinned))));
    }
}

/// A size such as `50GB`, `1.5 TB` or `1000`.
pub(super) fn size(text: &str) -> Result<u64, String> {
    amount::bytes(text).ok_or_else(|| format!("expected a size such as 50GB or 800MB, got `{text}`"))
}
