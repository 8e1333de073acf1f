//! `meshmill bundle`: a finished run with all that it was made of, as one file to hand on.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use super::Global;
use super::class::ClassArguments;
use super::context::{open_store, plan_cases, protected};
use super::exit::{Exit, Fault, say};
use crate::plan::CaseSpec;
use crate::recipe::{Overrides, Recipe, normalize};
use crate::report::bundle::{Contents, FILES, Manifest, OUTPUTS};
use crate::report::lock::{Lock, ingredients};
use crate::report::{CaseReport, Report, Status, record};
use crate::run::{self, Plan, RunOptions};

/// Write a finished run as an RO-Crate: recipe, lock, inputs, outputs, metrics and versions in one ZIP file.
///
/// `meshmill verify` computes it again and compares. Equal runs give equal bytes, apart from the date.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The output folder of a run, named as the run named it.
    #[arg(value_name = "OUTDIR")]
    folder: PathBuf,
    /// The file to write.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Tell inputs by their hashes alone; whoever verifies the bundle needs the files.
    #[arg(long)]
    hashes_only: bool,
    #[command(flatten)]
    class: ClassArguments,
    /// The day of the run, as 2026-01-31. Default: that of its record.
    #[arg(long, value_name = "DATE", value_parser = date)]
    date: Option<String>,
    /// The licence of the bundle, an address or a sentence.
    #[arg(long, value_name = "TEXT", default_value = "no licence is stated")]
    license: String,
    /// The person who made the results.
    #[arg(long, value_name = "NAME")]
    author: Option<String>,
    /// The organization that hands them on.
    #[arg(long, value_name = "NAME")]
    publisher: Option<String>,
}

pub(super) fn run(arguments: &Arguments, global: &Global) -> Result<Exit, Fault> {
    let (report, day) = recorded(&arguments.folder)?;
    let case = one_case(&report)?;
    let texts = texts(&report);
    let repeated = Repeated::of(&report, case, &texts)?;
    let mut lock = arguments.lock(&repeated, (&report, case), global)?;
    let mut gathered = repeated.gathered(&texts, case)?;
    lock.files = gathered.add_outputs(&repeated.plan, case, &arguments.folder)?;
    arguments.check_out(&gathered.on_disk, &repeated.recipe)?;
    if arguments.hashes_only {
        gathered.leave_out();
    }
    let contents = Contents {
        manifest: Manifest { meshmill: report.meshmill.clone(), set: repeated.set, ..gathered.manifest },
        lock,
        about: report.description.clone(),
        date: arguments.date.clone().unwrap_or(day),
        license: arguments.license.clone(),
        author: arguments.author.clone(),
        publisher: arguments.publisher.clone(),
        members: gathered.members,
    };
    let (files, left_out) = (contents.members.len(), contents.manifest.left_out.len());
    let bytes = contents.write().map_err(|error| Fault::usage(format!("cannot bundle the run: {error}")))?;
    run::write_named(&arguments.out, &bytes)?;
    if !global.quiet {
        let more = if left_out > 0 { format!(", and the hashes of {left_out}") } else { String::new() };
        say(&format!("{}: {files} files{more}", arguments.out.display()));
    }
    Ok(Exit::Done)
}

impl Arguments {
    /// The lock of the run, where it would be made of the same again.
    fn lock(
        &self,
        repeated: &Repeated,
        (report, case): (&Report, &CaseReport),
        global: &Global,
    ) -> Result<Lock, Fault> {
        let (class, tolerance) = self.class.read()?;
        let (name, plan) = (&repeated.recipe.name, &repeated.plan);
        let options = RunOptions::new(name, self.folder.clone(), 1);
        let lock = ingredients(name, plan, &run::records(plan, &open_store(global)?, &options));
        check_unchanged(case, &lock)?;
        let meshmill = report.meshmill.clone();
        Ok(Lock { meshmill, class, tolerance, ..lock.with_results(report, &self.folder) })
    }

    /// Fails where the bundle would replace a file of the run.
    fn check_out(&self, on_disk: &[PathBuf], recipe: &Recipe) -> Result<(), Fault> {
        let texts = protected(recipe);
        let all: Vec<&Path> = on_disk.iter().chain(&texts).map(PathBuf::as_path).collect();
        match run::replaced(&self.out, &all) {
            None => Ok(()),
            Some(file) => {
                let message = format!("--out {}: this is {}, a file of the run", self.out.display(), file.display());
                Err(Fault::usage(message).help("name another file"))
            }
        }
    }
}

/// The record of the run in this folder, and its day.
fn recorded(folder: &Path) -> Result<(Report, String), Fault> {
    let path = folder.join("run.ron");
    let text = fs::read_to_string(&path).map_err(|error| {
        Fault::usage(format!("cannot read {}: {error}", path.display())).help("name the output folder of a run")
    })?;
    let report = record::from_ron(&text).map_err(|error| {
        Fault::usage(format!("{} is not the record of a run: {error}", path.display())).help("run the recipe again")
    })?;
    let seconds = fs::metadata(&path).and_then(|meta| meta.modified()).ok();
    let seconds = seconds.and_then(|time| time.duration_since(UNIX_EPOCH).ok()).map_or(0, |time| time.as_secs());
    Ok((report, day_of(seconds / 86_400)))
}

/// The only case of a run that came to its end.
fn one_case(report: &Report) -> Result<&CaseReport, Fault> {
    if report.status != Status::Done {
        return Err(Fault::usage(
            "the run did not come to its end with every gate held, and only such a run is bundled",
        )
        .help("`meshmill report` says what happened"));
    }
    match report.cases.as_slice() {
        [case] if case.name.is_empty() => Ok(case),
        _ => Err(Fault::usage("this is a sweep, and a bundle holds one run")
            .help("run the case that matters by itself, with --set")),
    }
}

/// The texts of the recipe by their paths.
fn texts(report: &Report) -> BTreeMap<PathBuf, String> {
    report.texts.iter().map(|(name, text)| (normalize(Path::new(name)), text.clone())).collect()
}

/// The recipe and its plan as they were.
struct Repeated {
    recipe: Recipe,
    plan: Plan,
    set: BTreeMap<String, String>,
}

impl Repeated {
    fn of(report: &Report, case: &CaseReport, texts: &BTreeMap<PathBuf, String>) -> Result<Self, Fault> {
        let (name, _) = report
            .texts
            .first()
            .ok_or_else(|| Fault::usage("the record of the run has no recipe").help("run the recipe again"))?;
        let loader = |path: &Path| {
            texts.get(&normalize(path)).cloned().ok_or_else(|| "the record of the run does not have it".to_owned())
        };
        let inputs: Vec<_> = case.inputs.iter().map(|(name, file)| (name.clone(), PathBuf::from(file))).collect();
        let planned = |set: &BTreeMap<String, String>| -> Result<(Recipe, Plan), Fault> {
            let set = set.iter().map(|(name, value)| (name.clone(), value.clone())).collect();
            let overrides = Overrides { set, inputs: inputs.clone(), axes: Vec::new() };
            let recipe = Recipe::load(Path::new(name), &loader, &overrides)?;
            let plan = plan_cases(&recipe, &[CaseSpec::default()], None)?;
            Ok((recipe, plan))
        };
        let mut set = case.params.clone();
        if let Ok((_, plan)) = planned(&BTreeMap::new()) {
            let own = plan.cases().first().map(|case| case.params.clone()).unwrap_or_default();
            set.retain(|name, value| own.get(name) != Some(value));
        }
        let (recipe, plan) = planned(&set)?;
        Ok(Self { recipe, plan, set })
    }

    /// What the run read, by the names that it has in the bundle.
    fn gathered(&self, texts: &BTreeMap<PathBuf, String>, case: &CaseReport) -> Result<Gathered, Fault> {
        let mut read = run::source::files(&self.plan);
        read.extend(case.inputs.values().map(PathBuf::from).filter(|path| path.is_file()));
        let names = Names::of(texts.keys().chain(&read))?;
        let mut gathered = Gathered { on_disk: read.clone(), ..Gathered::default() };
        for path in &read {
            let bytes = fs::read(path).map_err(|error| {
                Fault::usage(format!("cannot read {}: {error}", path.display()))
                    .help("bundle a run in the folder where it was run, while its inputs are there")
            })?;
            let name = names.of_file(path)?;
            gathered.inputs.push(name.clone());
            gathered.members.insert(name, bytes);
        }
        for (path, text) in texts {
            gathered.members.insert(names.of_file(path)?, text.clone().into_bytes());
        }
        gathered.manifest.recipe = names.of_file(&self.recipe.path)?;
        for (input, file) in &case.inputs {
            // A file that no step reads need not be there.
            if let Ok(name) = names.of_file(Path::new(file)) {
                gathered.manifest.inputs.insert(input.clone(), name);
            }
        }
        Ok(gathered)
    }
}

/// The names of files in a bundle: as they lie to each other.
struct Names {
    whole: BTreeMap<PathBuf, PathBuf>,
    folder: PathBuf,
}

impl Names {
    fn of<'a>(files: impl Iterator<Item = &'a PathBuf>) -> Result<Self, Fault> {
        let mut whole = BTreeMap::new();
        for path in files {
            let absolute = std::path::absolute(path);
            let absolute = absolute.map_err(|error| Fault::usage(format!("{}: {error}", path.display())))?;
            whole.insert(normalize(path), normalize(&absolute));
        }
        let folder = shared_folder(whole.values());
        Ok(Self { whole, folder })
    }

    fn of_file(&self, path: &Path) -> Result<String, Fault> {
        let within = self.whole.get(&normalize(path)).and_then(|whole| whole.strip_prefix(&self.folder).ok());
        let within = within.and_then(Path::to_str).map(|name| name.replace('\\', "/"));
        within.map(|name| format!("{FILES}{name}")).ok_or_else(|| {
            Fault::usage(format!("{}: this name cannot stand in a bundle", path.display())).help("rename the file")
        })
    }
}

/// Files for a bundle.
#[derive(Default)]
struct Gathered {
    manifest: Manifest,
    members: BTreeMap<String, Vec<u8>>,
    /// Members that are inputs.
    inputs: Vec<String>,
    /// Files that the run read and wrote.
    on_disk: Vec<PathBuf>,
}

impl Gathered {
    /// Adds the files that were written. Returns their hashes by name.
    fn add_outputs(
        &mut self,
        plan: &Plan,
        case: &CaseReport,
        folder: &Path,
    ) -> Result<BTreeMap<String, Option<String>>, Fault> {
        let mut hashes = BTreeMap::new();
        for output in plan.cases().iter().flat_map(|case| &case.outputs) {
            let is_it = |path: &str| Path::new(path).ends_with(&output.file);
            let known =
                case.files.iter().find(|file| file.step == output.step && is_it(&file.path) && !file.failed_gate);
            let hash = known.and_then(|file| file.content.clone());
            let path = folder.join(&output.file);
            let bytes = fs::read(&path).map_err(|error| {
                Fault::usage(format!("cannot read {}: {error}", path.display())).help("run the recipe again")
            })?;
            if hash.as_deref() != Some(blake3::hash(&bytes).to_hex().as_str()) {
                return Err(Fault::usage(format!("{} is not what the run wrote", path.display()))
                    .help("run the recipe again, which writes it anew"));
            }
            let name = output.file.to_string_lossy().replace('\\', "/");
            self.members.insert(format!("{OUTPUTS}{name}"), bytes);
            self.on_disk.push(path);
            hashes.insert(name, hash);
        }
        Ok(hashes)
    }

    /// Puts hashes in the place of inputs.
    fn leave_out(&mut self) {
        for name in &self.inputs {
            if let Some(bytes) = self.members.remove(name) {
                self.manifest.left_out.insert(name.clone(), blake3::hash(&bytes).to_hex().to_string());
            }
        }
    }
}

/// The deepest folder that all these files lie below.
fn shared_folder<'a>(mut files: impl Iterator<Item = &'a PathBuf>) -> PathBuf {
    let first = files.next().and_then(|file| file.parent()).map(Path::to_path_buf).unwrap_or_default();
    files.fold(first, |folder, file| {
        folder.ancestors().find(|folder| file.starts_with(folder)).map(Path::to_path_buf).unwrap_or_default()
    })
}

/// Fails where a step would not be made of what it was made of.
fn check_unchanged(case: &CaseReport, now: &Lock) -> Result<(), Fault> {
    for step in &case.steps {
        let before: BTreeMap<&String, &String> = step.record.iter().map(|(field, value)| (field, value)).collect();
        let fields = now.tasks.get(&step.name).into_iter().flatten();
        let mut changed = fields.filter(|(field, value)| before.get(field).is_some_and(|before| before != value));
        if let Some((field, _)) = changed.next() {
            let what = field.strip_prefix("input ").map_or(field.as_str(), |_| "its file");
            return Err(Fault::usage(format!("{}: {what} is not what it was when the recipe ran", step.name))
                .help("run the recipe again"));
        }
    }
    Ok(())
}

/// A day as it is written, where it is one.
fn date(text: &str) -> Result<String, String> {
    let parts: Vec<Option<u64>> = text.split('-').map(|part| part.parse().ok()).collect();
    match parts.as_slice() {
        [Some(0..=9999), Some(1..=12), Some(1..=31)] if text.len() == 10 => Ok(text.to_owned()),
        _ => Err(format!("expected a day such as 2026-01-31, got `{text}`")),
    }
}

/// The day so many days after the first of 1970, by the Gregorian calendar.
fn day_of(days: u64) -> String {
    let is_leap = |year: u64| year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    let (mut year, mut left) = (1970, days.min(2_932_896));
    while left >= 365 + u64::from(is_leap(year)) {
        left -= 365 + u64::from(is_leap(year));
        year += 1;
    }
    let february = 28 + u64::from(is_leap(year));
    let mut month = 1;
    for length in [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31] {
        if left < length {
            break;
        }
        left -= length;
        month += 1;
    }
    format!("{year:04}-{month:02}-{:02}", left + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_are_those_of_the_calendar() {
        for (days, expected) in [
            (0, "1970-01-01"),
            (58, "1970-02-28"),
            (11_016, "2000-02-29"),
            (11_017, "2000-03-01"),
            (20_819, "2027-01-01"),
        ] {
            assert_eq!(day_of(days), expected);
        }
        assert!(date("2026-01-31").is_ok() && date("2026-13-01").is_err() && date("31.1.2026").is_err());
    }

    #[test]
    fn files_keep_their_places_to_each_other() {
        let files = ["/a/b/recipe.toml", "/a/b/c/part.stl", "/a/base.toml"].map(PathBuf::from);
        assert_eq!(shared_folder(files.iter()), Path::new("/a"));
        assert_eq!(shared_folder(files[..1].iter()), Path::new("/a/b"));
    }
}
