//! `meshmill verify`: computes the run of a bundle again, apart from everything else, and compares.

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::Global;
use super::context::{plan_cases, read_text};
use super::exit::{Exit, Fault, data, say};
use super::machine::MemoryArguments;
use super::run::{jobs_of, traced};
use super::signals::Interrupt;
use crate::plan::CaseSpec;
use crate::recipe::{Overrides, Recipe, normalize};
use crate::report::Report;
use crate::report::bundle::{Bundle, FILES};
use crate::report::lock::{Class, ingredients};
use crate::run::{self, Plan, RunOptions, Task, VERSION};
use crate::store::Store;

/// Longer files are no bundles.
const LONGEST: u64 = 8 << 30;
/// So many differences are told.
const MOST_LINES: usize = 100;

/// Compute the run of a bundle again and compare: ends with 5 where something differs, with 2 where it cannot be read.
///
/// Everything happens in a temporary folder with a cache of its own; nothing outside of the bundle is read.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The bundle.
    #[arg(value_name = "FILE")]
    bundle: PathBuf,
    /// Folder with the inputs that the bundle tells by their hashes alone.
    #[arg(long, value_name = "DIR")]
    inputs: Option<PathBuf>,
    /// Most tasks at once, and most threads. Default: one for each processor.
    #[arg(long, short, value_name = "N")]
    jobs: Option<usize>,
    #[command(flatten)]
    memory: MemoryArguments,
}

pub(super) fn run(arguments: &Arguments, global: &Global) -> Result<Exit, Fault> {
    let name = arguments.bundle.display().to_string();
    let bundle = Bundle::read(&bytes(&arguments.bundle)?).map_err(|error| {
        Fault::usage(format!("{name} is no bundle that can be verified: {error}")).help("`meshmill bundle` writes one")
    })?;
    let folder = tempfile::tempdir().and_then(|folder| Ok((folder.path().canonicalize()?, folder)));
    let (root, _folder) = folder.map_err(|error| Fault::new(Exit::Store, format!("no temporary folder: {error}")))?;
    lay_out(&bundle, &root)?;
    let missing = fetch(&bundle, arguments.inputs.as_deref(), &root)?;
    let (recipe, plan) = planned(&bundle, &root)?;
    let interrupt = Interrupt::listen();
    let options = RunOptions {
        cancelled: Arc::clone(&interrupt.cancelled),
        ..RunOptions::new(&recipe.name, root.join("out"), jobs_of(arguments.jobs)?)
    };
    let options = arguments.memory.applied(options, global);
    let store = Store::open(&root.join("cache"))?;
    let before = ingredients(&recipe.name, &plan, &run::records(&plan, &store, &options));
    let outcome = traced(None, global, &|observer| run::run(&plan, &store, &options, observer))?;
    if outcome.cancelled {
        return Ok(interrupt.exit());
    }
    let report = Report::new(&recipe.name, &plan, &outcome);
    let now = before.with_results(&report, &options.out);
    let mut lines = missing;
    lines.extend(bundle.contradictions());
    lines.extend(bundle.lock.changed_ingredients(&now));
    lines.extend(report.failures().map(|(name, failure)| format!("{name}: {}", failure.message)));
    lines.extend(bundle.lock.changed_results(&now));
    tell(&bundle, &name, &lines, global);
    Ok(if lines.is_empty() { Exit::Done } else { Exit::Locked })
}

fn bytes(path: &Path) -> Result<Vec<u8>, Fault> {
    // A pipe may have no end, and never begin.
    if fs::metadata(path).is_ok_and(|meta| !meta.is_file()) {
        return Err(Fault::usage(format!("{} is no file", path.display())).help("name a bundle"));
    }
    let mut bytes = Vec::new();
    let read = fs::File::open(path).and_then(|file| file.take(LONGEST + 1).read_to_end(&mut bytes));
    read.map_err(|error| Fault::usage(format!("cannot read {}: {error}", path.display())))?;
    if bytes.len() as u64 > LONGEST {
        return Err(Fault::usage(format!("{} is longer than any bundle", path.display())));
    }
    Ok(bytes)
}

/// Writes what the run reads into the folder. The names were checked: none leads out of it.
fn lay_out(bundle: &Bundle, root: &Path) -> Result<(), Fault> {
    for (name, content) in bundle.members.iter().filter(|(name, _)| name.starts_with(FILES)) {
        run::write_file(&root.join(name), content)?;
    }
    Ok(())
}

/// Puts the inputs that were left out where the run looks for them. Returns what differs from what is known of them.
fn fetch(bundle: &Bundle, inputs: Option<&Path>, root: &Path) -> Result<Vec<String>, Fault> {
    let mut lines = Vec::new();
    for (name, hash) in &bundle.manifest.left_out {
        let Some(inputs) = inputs else {
            let count = bundle.manifest.left_out.len();
            return Err(Fault::usage(format!("the bundle has only the hashes of {count} inputs, such as {name}"))
                .help("name the folder that has them with --inputs DIR"));
        };
        let within = name.strip_prefix(FILES).unwrap_or(name);
        let last = within.rsplit('/').next().unwrap_or(within);
        let found = [within, last].iter().map(|name| inputs.join(name)).find(|path| path.is_file());
        let found = found.ok_or_else(|| {
            Fault::usage(format!("{} has no {within}", inputs.display())).help("copy the input there")
        })?;
        let content =
            fs::read(&found).map_err(|error| Fault::usage(format!("cannot read {}: {error}", found.display())))?;
        if blake3::hash(&content).to_hex().as_str() != hash {
            lines.push(format!("{}: this is not the input that was locked", found.display()));
        }
        run::write_file(&root.join(name), &content)?;
    }
    Ok(lines)
}

/// The recipe of the bundle and its plan, which reads nothing outside of the folder.
fn planned(bundle: &Bundle, root: &Path) -> Result<(Recipe, Plan), Fault> {
    let is_inside = |path: &Path| normalize(path).starts_with(root);
    let loader = |path: &Path| {
        if is_inside(path) { read_text(path) } else { Err("it is not in the bundle".to_owned()) }
    };
    let overrides = Overrides {
        set: bundle.manifest.set.iter().map(|(name, value)| (name.clone(), value.clone())).collect(),
        inputs: bundle.manifest.inputs.iter().map(|(name, member)| (name.clone(), root.join(member))).collect(),
        axes: Vec::new(),
    };
    let recipe = Recipe::load(&root.join(&bundle.manifest.recipe), &loader, &overrides)?;
    let plan = plan_cases(&recipe, &[CaseSpec::default()], None)?;
    let sources = plan.order().filter_map(|id| match &plan.node(id).task {
        Task::Source(source) => Some(&source.path),
        Task::Step(_) | Task::Gate(_) => None,
    });
    for path in sources {
        if !is_inside(path) {
            return Err(Fault::usage(format!("the recipe reads {}, which is not in the bundle", path.display())));
        }
    }
    Ok((recipe, plan))
}

/// Says what differs, or that nothing does.
fn tell(bundle: &Bundle, name: &str, lines: &[String], global: &Global) {
    if bundle.manifest.meshmill != VERSION && !global.quiet {
        let made = &bundle.manifest.meshmill;
        say(&format!("the bundle was made by meshmill {made}, and this is {VERSION}; bytes of files are not compared"));
    }
    for line in lines.iter().take(MOST_LINES) {
        say(&format!("differs: {line}"));
    }
    if lines.len() > MOST_LINES {
        say(&format!("and {} more", lines.len() - MOST_LINES));
    }
    if lines.is_empty() && !global.quiet {
        let class = match bundle.lock.class {
            Class::Bytes => "byte by byte".to_owned(),
            Class::Metrics => "in every metric".to_owned(),
            Class::Tolerance => format!("in every metric, within {}", bundle.lock.tolerance),
        };
        let (results, files) = (bundle.lock.results.len(), bundle.lock.files.len());
        data(&format!("{name}: {results} results and {files} files are equal {class}"));
    }
}
