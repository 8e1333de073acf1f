//! What the runner promises, with a catalog of toy steps: nothing twice, nothing partial, the same bytes always.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use meshmill::mesh::{Facet, Id, Soup};
use meshmill::plan::{self, Context, Plan};
use meshmill::recipe::{Overrides, Recipe};
use meshmill::run::{self, Event, FileState, Forecast, Observer, RunOptions, RunOutcome, Silent, TaskState};
use meshmill::step::{
    Artifact, FailureKind, InputDef, Inputs, Locks, OutPort, OutputDef, Port, Produced, Step, StepDef, StepFailure,
};
use meshmill::store::Store;
use meshmill::watch::Watch;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

const FILE: &[InputDef] = &[InputDef { name: "file", accepts: &[Port::File], required: true, doc: "numbers" }];
const FROM: &[InputDef] = &[InputDef { name: "from", accepts: &[Port::Soup], required: true, doc: "a soup" }];
const SOUP: &[OutputDef] = &[
    OutputDef { name: "main", port: OutPort::Is(Port::Soup), derive: None },
    OutputDef { name: "twice", port: OutPort::Is(Port::Soup), derive: Some(twice) },
];

/// The main output twice as large.
fn twice(main: &Artifact) -> Option<Artifact> {
    let Artifact::Soup(soup) = main else { return None };
    let mut soup = (**soup).clone();
    soup.points.iter_mut().for_each(|point| *point *= 2.0);
    Some(Artifact::Soup(Arc::new(soup)))
}

/// Nothing to choose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Nothing {}

/// A number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct By {
    /// The number.
    by: f64,
}

/// Declares a toy step from a function of its input soup and parameters.
macro_rules! toy {
    ($kind:ident, $name:literal, $inputs:expr, $params:ty, $work:expr) => {
        struct $kind;
        impl Step for $kind {
            const NAME: &'static str = $name;
            const REVISION: u32 = 1;
            const INPUTS: &'static [InputDef] = $inputs;
            const OUTPUTS: &'static [OutputDef] = SOUP;
            const CARRIES: &'static str = "nothing";
            const EXAMPLE: &'static str = "";
            type Params = $params;
            type Stats = usize;
            fn run(
                inputs: &Inputs,
                _output: &str,
                params: &Self::Params,
                _locks: &Locks,
                watch: &Watch,
            ) -> Result<Produced<usize>, StepFailure> {
                let work: fn(&Inputs, &$params, &Watch) -> Result<Soup, StepFailure> = $work;
                let soup = work(inputs, params, watch)?;
                Ok(Produced { stats: soup.points.len(), artifact: Artifact::Soup(Arc::new(soup)) })
            }
        }
    };
}

fn soup(inputs: &Inputs) -> Result<Soup, StepFailure> {
    Ok((**inputs.require("from")?.as_soup()?).clone())
}

toy!(ReadNumber, "number", FILE, Nothing, |inputs, _, _| {
    let Artifact::File(file) = inputs.require("file")? else { return Err(StepFailure::bad_input("no file")) };
    let text = String::from_utf8_lossy(&file.bytes);
    let number: f64 = text.trim().parse().map_err(|_| StepFailure::bad_input(format!("no number: {text}")))?;
    let points = vec![glam::DVec3::ZERO, glam::DVec3::X * number, glam::DVec3::Y];
    let face = Facet::Tri([Id::new(0), Id::new(1), Id::new(2)]);
    Ok(Soup { points: points.into(), faces: vec![face].into(), ..Soup::default() })
});
toy!(Scale, "scale", FROM, By, |inputs, params, _| {
    let mut soup = soup(inputs)?;
    soup.points.iter_mut().for_each(|point| *point *= params.by);
    Ok(soup)
});
toy!(Round, "round", FROM, Nothing, |inputs, _, _| {
    let mut soup = soup(inputs)?;
    soup.points.iter_mut().for_each(|point| *point = point.round());
    Ok(soup)
});
toy!(Slow, "slow", FROM, By, |inputs, params, watch| {
    let end = Instant::now() + Duration::from_secs_f64(params.by);
    watch.phase("waiting", None);
    while Instant::now() < end {
        watch.check()?;
        std::thread::sleep(Duration::from_millis(1));
    }
    soup(inputs)
});
toy!(Many, "many", FROM, By, |inputs, params, _| {
    use rayon::prelude::*;
    let mut soup = soup(inputs)?;
    let more: Vec<_> =
        (0..20_000).into_par_iter().map(|i| glam::DVec3::splat(libm::sin(f64::from(i) * params.by))).collect();
    for point in more {
        soup.points.push(point);
    }
    Ok(soup)
});
toy!(Fail, "fail", FROM, Nothing, |_, _, _| Err(StepFailure::failed("it cannot be done").with_help("do not")));
toy!(Panic, "panic", FROM, Nothing, |inputs, _, _| {
    let soup = soup(inputs)?;
    assert!(soup.points.is_empty(), "the toy broke");
    Ok(soup)
});

static TOYS: &[StepDef] = &[
    StepDef::of::<ReadNumber>(),
    StepDef::of::<Scale>(),
    StepDef::of::<Round>(),
    StepDef::of::<Slow>(),
    StepDef::of::<Many>(),
    StepDef::of::<Fail>(),
    StepDef::of::<Panic>(),
];

const CHAIN: &str = r#"
name = "toy"
[inputs]
part = "part.txt"
[params]
first = 2
second = 3
[steps.raw]
use = "number"
file = "=inputs.part"
[steps.scaled]
use = "scale"
from = "raw"
by = "=first"
[steps.rounded]
use = "round"
from = "scaled"
[steps.last]
use = "scale"
from = "rounded"
by = "=second"
[outputs]
last = ["last.obj", "last.stl"]
rounded = ["rounded.obj"]
"#;

/// A folder with an input, a cache and an output folder.
struct Bench {
    folder: tempfile::TempDir,
    jobs: usize,
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("part.txt"), "1.5").unwrap();
        Self { folder, jobs: 2 }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn options(&self, out: &str) -> RunOptions {
        RunOptions::new("toy", self.path(out), self.jobs)
    }

    fn store(&self) -> Store {
        Store::open(&self.path("cache")).unwrap()
    }

    fn run(&self, text: &str, set: &[(&str, &str)]) -> (Plan, RunOutcome) {
        let plan = plan_of(self.folder.path(), text, set);
        let observer: Arc<dyn Observer> = Arc::new(Silent);
        let outcome = run::run(&plan, &self.store(), &self.options("out"), &observer).unwrap();
        (plan, outcome)
    }
}

fn plan_of(folder: &Path, text: &str, set: &[(&str, &str)]) -> Plan {
    let load = |_: &Path| Ok(text.to_owned());
    let set = set.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
    let recipe = Recipe::load(&folder.join("toy.toml"), &load, &Overrides { set, ..Overrides::default() });
    let endings = &["obj", "stl", "vtu"];
    let context = Context { catalog: TOYS, check_file: &|_| Ok(()), endings, second_order: &["vtu"] };
    plan::plan(&recipe.unwrap_or_else(|problems| panic!("{problems}")), &context)
        .unwrap_or_else(|problems| panic!("{problems}"))
}

#[test]
fn an_output_that_is_part_of_the_main_one_is_taken_from_it() {
    let text = CHAIN.replace("[outputs]", "[outputs]\n\"scaled.twice\" = [\"twice.obj\"]");
    let bench = Bench::new();
    let (plan, outcome) = bench.run(&text, &[]);
    let steps = &plan.cases()[0].steps;
    assert_eq!(plan.inputs(steps["scaled.twice"]), [("main", steps["scaled"])]);
    assert_eq!(outcome.task(steps["scaled.twice"]).state, TaskState::Done);
    let written = fs::read_to_string(bench.path("out/twice.obj")).unwrap();
    assert!(written.contains("v 6 0 0"), "{written}");
    // Asked for alone, it still needs the main one.
    let alone = text.replace("last = [", "# last = [").replace("rounded = [", "# rounded = [");
    let (plan, _) = bench.run(&alone, &[("first", "4")]);
    assert!(plan.cases()[0].steps.contains_key("scaled"));
}

/// The states of the steps, by name.
fn states(plan: &Plan, outcome: &RunOutcome) -> Vec<(String, TaskState)> {
    let mut steps: Vec<_> = plan.cases()[0].steps.iter().map(|(name, task)| (*task, name.clone())).collect();
    steps.sort();
    steps.into_iter().map(|(task, name)| (name, outcome.task(task).state)).collect()
}

fn expect(outcome: &(Plan, RunOutcome), expected: &[(&str, TaskState)]) {
    let expected: Vec<_> = expected.iter().map(|(name, state)| ((*name).to_owned(), *state)).collect();
    assert_eq!(states(&outcome.0, &outcome.1), expected);
}

/// All files of a folder with their bytes; hidden ones too.
fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut files: Vec<_> = entries
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_file())
        .map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), fs::read(&path).unwrap()))
        .collect();
    files.sort();
    files
}

use TaskState::{Cached, Done, Failed, Skipped};

#[test]
fn a_second_run_does_no_step_and_writes_no_file() {
    let bench = Bench::new();
    expect(&bench.run(CHAIN, &[]), &[("raw", Done), ("scaled", Done), ("rounded", Done), ("last", Done)]);
    let before = files(&bench.path("out"));
    assert_eq!(before.len(), 3);
    // Without blobs the second run can only succeed when it loads none.
    fs::remove_dir_all(bench.path("cache/v2/cas")).unwrap();
    let again = bench.run(CHAIN, &[]);
    expect(&again, &[("raw", Cached), ("scaled", Cached), ("rounded", Cached), ("last", Cached)]);
    assert!(again.1.files.iter().all(|file| file.state == FileState::Current));
    assert_eq!(files(&bench.path("out")), before);
}

#[test]
fn a_changed_parameter_runs_only_what_depends_on_it() {
    let bench = Bench::new();
    bench.run(CHAIN, &[]);
    let changed = bench.run(CHAIN, &[("second", "5")]);
    expect(&changed, &[("raw", Cached), ("scaled", Cached), ("rounded", Cached), ("last", Done)]);
    expect(&bench.run(CHAIN, &[]), &[("raw", Cached), ("scaled", Cached), ("rounded", Cached), ("last", Cached)]);
}

#[test]
fn an_upstream_change_that_gives_the_same_bytes_stops_there() {
    let bench = Bench::new();
    bench.run(CHAIN, &[]);
    // 1.5 * 2.1 rounds to 3 like 1.5 * 2.
    let changed = bench.run(CHAIN, &[("first", "2.1")]);
    expect(&changed, &[("raw", Cached), ("scaled", Done), ("rounded", Done), ("last", Cached)]);
    assert!(changed.1.files.iter().all(|file| file.state == FileState::Current));
}

#[test]
fn a_changed_input_is_noticed_even_when_size_and_time_are_the_same() {
    let bench = Bench::new();
    bench.run(CHAIN, &[]);
    fs::write(bench.path("part.txt"), "2.5").unwrap();
    expect(&bench.run(CHAIN, &[]), &[("raw", Done), ("scaled", Done), ("rounded", Done), ("last", Done)]);
}

#[test]
fn a_failing_step_skips_what_needs_it_and_nothing_else() {
    let text = CHAIN.replace("use = \"round\"", "use = \"fail\"") + "raw = [\"raw.obj\"]\n";
    let bench = Bench::new();
    let run = bench.run(&text, &[]);
    expect(&run, &[("raw", Done), ("scaled", Done), ("rounded", Failed), ("last", Skipped)]);
    let failures: Vec<_> = run.1.failures(&run.0).collect();
    assert_eq!(failures.len(), 1);
    assert_eq!((failures[0].0.as_str(), failures[0].1.message.as_str()), ("rounded", "it cannot be done"));
    let names: Vec<_> = files(&bench.path("out")).into_iter().map(|(name, _)| name).collect();
    assert_eq!(names, ["raw.obj"]);
}

#[test]
fn a_panicking_step_is_a_failure_of_that_step() {
    let text = CHAIN.replace("use = \"round\"", "use = \"panic\"");
    let run = Bench::new().run(&text, &[]);
    expect(&run, &[("raw", Done), ("scaled", Done), ("rounded", Failed), ("last", Skipped)]);
    let (_, failure) = run.1.failures(&run.0).next().unwrap();
    assert_eq!(failure.kind, FailureKind::Panicked);
    assert!(failure.message.contains("the toy broke"), "{}", failure.message);
}

#[test]
fn damaged_and_missing_blobs_are_computed_again() {
    let bench = Bench::new();
    bench.run(CHAIN, &[]);
    let expected = files(&bench.path("out"));
    for shard in fs::read_dir(bench.path("cache/v2/cas")).unwrap() {
        for blob in fs::read_dir(shard.unwrap().path()).unwrap() {
            fs::write(blob.unwrap().path(), b"damaged").unwrap();
        }
    }
    fs::remove_dir_all(bench.path("out")).unwrap();
    // Nothing is asked of the damaged results of `raw` and `scaled` before `rounded` has to run again.
    let run = bench.run(CHAIN, &[]);
    expect(&run, &[("raw", Done), ("scaled", Done), ("rounded", Done), ("last", Done)]);
    assert_eq!(files(&bench.path("out")), expected);
}

#[test]
fn one_thread_and_eight_give_the_same_bytes() {
    let text = CHAIN.replace("use = \"round\"", "use = \"many\"\nby = 0.37");
    let results: Vec<_> = [1, 8]
        .into_iter()
        .map(|jobs| {
            let mut bench = Bench::new();
            bench.jobs = jobs;
            let (_, outcome) = bench.run(&text, &[]);
            let contents: Vec<_> = outcome.tasks.iter().map(|task| task.content).collect();
            (contents, files(&bench.path("out")))
        })
        .collect();
    assert_eq!(results[0], results[1]);
}

#[test]
fn a_damaged_output_is_written_again() {
    let bench = Bench::new();
    bench.run(CHAIN, &[]);
    let expected = files(&bench.path("out"));
    fs::write(bench.path("out/last.obj"), "somebody wrote here").unwrap();
    let (_, outcome) = bench.run(CHAIN, &[]);
    assert_eq!(outcome.files.iter().filter(|file| file.state == FileState::Written).count(), 1);
    assert_eq!(files(&bench.path("out")), expected);
}

#[test]
fn only_runs_a_step_and_what_it_needs() {
    let bench = Bench::new();
    let plan = plan_of(bench.folder.path(), CHAIN, &[]);
    let options = RunOptions { only: vec!["rounded".into()], ..bench.options("out") };
    let observer: Arc<dyn Observer> = Arc::new(Silent);
    let outcome = run::run(&plan, &bench.store(), &options, &observer).unwrap();
    expect(&(plan, outcome), &[("raw", Done), ("scaled", Done), ("rounded", Done), ("last", TaskState::Unwanted)]);
    assert_eq!(files(&bench.path("out")).len(), 1);
}

#[test]
fn force_runs_a_cached_step_again_and_finds_it_equal() {
    let bench = Bench::new();
    bench.run(CHAIN, &[]);
    let plan = plan_of(bench.folder.path(), CHAIN, &[]);
    let options = RunOptions { force: vec!["scaled".into()], ..bench.options("out") };
    let observer: Arc<dyn Observer> = Arc::new(Silent);
    let outcome = run::run(&plan, &bench.store(), &options, &observer).unwrap();
    assert!(!outcome.differs());
    expect(&(plan, outcome), &[("raw", Cached), ("scaled", Done), ("rounded", Cached), ("last", Cached)]);
}

#[test]
fn the_forecast_says_what_the_run_then_does() {
    let bench = Bench::new();
    let forecast = |set: &[(&str, &str)]| -> Vec<String> {
        let plan = plan_of(bench.folder.path(), CHAIN, set);
        let words = |forecast: &Forecast| match forecast {
            Forecast::Source => "source".to_owned(),
            Forecast::Cached(_) => "cached".to_owned(),
            Forecast::Failed(..) => "failed".to_owned(),
            Forecast::New(_) => "new".to_owned(),
            Forecast::DependsOn(tasks) => format!("depends on {}", plan.node(tasks[0]).label),
            Forecast::Changed(_, changes) => changes.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "),
            Forecast::Gone(_) => "gone".to_owned(),
            Forecast::Forced(_) | Forecast::Unreadable(_) => panic!("not asked for"),
        };
        run::preview(&plan, &bench.store(), &bench.options("out"), &|_| None).iter().map(words).collect()
    };
    assert_eq!(forecast(&[]), ["source", "new", "depends on raw", "depends on scaled", "depends on rounded"]);
    bench.run(CHAIN, &[]);
    assert_eq!(forecast(&[]), ["source", "cached", "cached", "cached", "cached"]);
    let changed = forecast(&[("second", "4.5")]);
    assert_eq!(changed, ["source", "cached", "cached", "cached", "parameter by from 3.0 to 4.5"]);
}

/// Cancels a run when its slow step begins.
struct CancelSlow(Arc<AtomicBool>);

impl Observer for CancelSlow {
    fn event(&self, event: &Event<'_>) {
        if matches!(event, Event::Phase { name: "waiting", .. }) {
            self.0.store(true, Ordering::SeqCst);
        }
    }
}

#[test]
fn a_cancelled_run_stops_soon_and_the_next_one_goes_on() {
    let text = CHAIN.replace("use = \"round\"", "use = \"slow\"\nby = 20");
    let bench = Bench::new();
    let plan = plan_of(bench.folder.path(), &text, &[]);
    let options = bench.options("out");
    let observer: Arc<dyn Observer> = Arc::new(CancelSlow(Arc::clone(&options.cancelled)));
    let outcome = run::run(&plan, &bench.store(), &options, &observer).unwrap();
    assert!(outcome.cancelled);
    assert_eq!(outcome.count(TaskState::Cancelled), 1);
    assert!(files(&bench.path("out")).is_empty());
    let observer: Arc<dyn Observer> = Arc::new(Silent);
    let fast = text.replace("by = 20", "by = 0");
    let plan = plan_of(bench.folder.path(), &fast, &[]);
    let outcome = run::run(&plan, &bench.store(), &bench.options("out"), &observer).unwrap();
    expect(&(plan, outcome), &[("raw", Cached), ("scaled", Cached), ("rounded", Done), ("last", Done)]);
}

const SLOW_CHAIN: &str = "use = \"slow\"\nby = 0.05";
const CHILD: &str = "MESHMILL_RUNNER_CHILD";

/// Not a test of its own: the other process of the tests below.
#[test]
fn child() {
    let Ok(folder) = std::env::var(CHILD) else { return };
    let (folder, out) = folder.split_once('|').unwrap();
    let text = CHAIN.replace("use = \"round\"", SLOW_CHAIN);
    let plan = plan_of(Path::new(folder), &text, &[]);
    let store = Store::open(&Path::new(folder).join("cache")).unwrap();
    let options = RunOptions::new("toy", Path::new(folder).join(out), 2);
    let observer: Arc<dyn Observer> = Arc::new(Silent);
    run::run(&plan, &store, &options, &observer).unwrap();
}

fn spawn(bench: &Bench, out: &str) -> std::process::Child {
    Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "child", "--quiet"])
        .env(CHILD, format!("{}|{out}", bench.folder.path().display()))
        .stdout(Stdio::null())
        .spawn()
        .unwrap()
}

#[test]
fn two_processes_on_one_cache_give_the_same_bytes() {
    let bench = Bench::new();
    let mut children = [spawn(&bench, "out-1"), spawn(&bench, "out-2")];
    for child in &mut children {
        assert!(child.wait().unwrap().success());
    }
    let first = files(&bench.path("out-1"));
    assert_eq!(first.len(), 3);
    assert_eq!(first, files(&bench.path("out-2")));
    assert!(bench.store().verify(0).unwrap().damaged.is_empty());
}

#[test]
fn killed_at_any_moment_leaves_nothing_partial_and_the_next_run_gives_the_same_bytes() {
    let whole = Bench::new();
    assert!(spawn(&whole, "out").wait().unwrap().success());
    let expected = files(&whole.path("out"));
    let bench = Bench::new();
    for delay in [5, 20, 35, 50, 65, 80, 120] {
        fs::remove_dir_all(bench.path("cache")).ok();
        fs::remove_dir_all(bench.path("out")).ok();
        let mut child = spawn(&bench, "out");
        std::thread::sleep(Duration::from_millis(delay));
        child.kill().unwrap();
        child.wait().unwrap();
        for (name, bytes) in files(&bench.path("out")).into_iter().filter(|(name, _)| !name.starts_with('.')) {
            assert!(expected.contains(&(name.clone(), bytes)), "{name} is partial after {delay} ms");
        }
        assert!(spawn(&bench, "out").wait().unwrap().success());
        assert_eq!(files(&bench.path("out")), expected, "killed after {delay} ms");
        assert!(bench.store().verify(0).unwrap().damaged.is_empty());
    }
}
