//! What all jobs of a run share: plan, store, known contents, and the artifacts that are alive.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::bounded::Clock;
use super::ledger::Ledger;
use super::names::Needs;
use super::{RunError, RunOptions, source};
use crate::metric::Measured;
use crate::metric::gate::GateReport;
use crate::plan::{ContentHash, Key, Plan, Record, Task, TaskId, task_key, task_record};
use crate::step::{Artifact, FileBytes, StepFailure};
use crate::store::{CODEC_VERSION, Entry, Saved, StatIndex, Store, StoreError};

/// The version that entries and output files carry.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// What a task is called in the store.
pub fn recipe_task(recipe: &str, label: &str) -> String {
    format!("{recipe}/{label}")
}

pub(super) struct Shared<'a> {
    pub(super) plan: &'a Plan,
    pub(super) store: &'a Store,
    pub(super) index: StatIndex,
    pub(super) options: &'a RunOptions,
    pub(super) ledger: Arc<Ledger>,
    pub(super) clock: Clock,
    contents: Vec<OnceLock<ContentHash>>,
    slots: Vec<Mutex<Option<Slot>>>,
    reports: Vec<OnceLock<GateReport>>,
    pool: OnceLock<Arc<rayon::ThreadPool>>,
    unsaved: OnceLock<StoreError>,
    needs: OnceLock<Needs>,
}

/// An artifact that is alive, and what was measured of it.
struct Slot {
    artifact: Artifact,
    measured: Option<Arc<Measured>>,
}

/// Why an artifact cannot be had.
pub(super) enum NoArtifact {
    /// It was cached and is damaged or gone: run this task again.
    Lost(TaskId),
    /// The input file is not what it was when the run began.
    Failed(StepFailure),
}

impl<'a> Shared<'a> {
    pub(super) fn new(plan: &'a Plan, store: &'a Store, options: &'a RunOptions) -> Self {
        Self {
            plan,
            store,
            index: StatIndex::open(store),
            options,
            ledger: Arc::new(Ledger::new(options.meter)),
            clock: Clock::default(),
            contents: (0..plan.len()).map(|_| OnceLock::new()).collect(),
            slots: (0..plan.len()).map(|_| Mutex::new(None)).collect(),
            reports: (0..plan.len()).map(|_| OnceLock::new()).collect(),
            pool: OnceLock::new(),
            unsaved: OnceLock::new(),
            needs: OnceLock::new(),
        }
    }

    /// Saves an artifact. A cache that cannot be written costs the next run time, and this one nothing; it is told at
    /// the end.
    pub(super) fn save(&self, artifact: &Artifact) -> Saved {
        let (saved, written) = self.store.save(artifact);
        self.note_unsaved(written);
        saved
    }

    /// Publishes what a task gave, as far as the cache can be written.
    pub(super) fn publish(&self, key: &Key, entry: &Entry) {
        self.note_unsaved(self.store.publish(key, entry));
    }

    fn note_unsaved(&self, written: Result<(), StoreError>) {
        if let Err(error) = written {
            self.unsaved.get_or_init(|| error);
        }
    }

    /// What the cache could not take first.
    pub(super) fn unsaved(&self) -> Option<&StoreError> {
        self.unsaved.get()
    }

    /// The content of what a task gives, once that is known.
    pub(super) fn content(&self, task: TaskId) -> Option<ContentHash> {
        self.contents[task.index()].get().copied()
    }

    /// Notes the content of what a task gives. Returns the content that was known before, where it is another one.
    pub(super) fn learn(&self, task: TaskId, content: ContentHash) -> Option<ContentHash> {
        let known = *self.contents[task.index()].get_or_init(|| content);
        (known != content).then_some(known)
    }

    /// Who needs which groups; found when the first step works.
    pub(super) fn needs(&self) -> &Needs {
        self.needs.get_or_init(|| Needs::of(self.plan))
    }

    /// Notes the verdicts of a gate.
    pub(super) fn judge(&self, gate: TaskId, report: GateReport) {
        self.reports[gate.index()].get_or_init(|| report);
    }

    /// The verdicts of a gate that was decided.
    pub(super) fn report(&self, gate: TaskId) -> Option<&GateReport> {
        self.reports[gate.index()].get()
    }

    /// Key and explanation of a task, once the contents of its inputs are known.
    pub(super) fn key(&self, id: TaskId) -> Option<(Key, Record)> {
        let contents: Option<Vec<_>> =
            self.plan.inputs(id).into_iter().map(|(name, input)| Some((name, self.content(input)?))).collect();
        let (task, contents) = (&self.plan.node(id).task, contents?);
        let codec = u32::from(CODEC_VERSION);
        Some((task_key(task, codec, &contents), task_record(task, codec, &contents)))
    }

    /// The artifact of a task that is cached or done. Readers of one artifact share it; the first one loads it.
    pub(super) fn artifact(&self, task: TaskId) -> Result<Artifact, NoArtifact> {
        self.with_slot(task, |slot| slot.artifact.clone())
    }

    /// The mesh of a task, which keeps what its readers measure of it; `None` where it gives no mesh.
    pub(super) fn measured(&self, task: TaskId) -> Result<Option<Arc<Measured>>, NoArtifact> {
        self.with_slot(task, |slot| {
            if slot.measured.is_none() {
                slot.measured = slot.artifact.to_soup().map(|mesh| Arc::new(Measured::new(mesh)));
            }
            slot.measured.clone()
        })
    }

    fn with_slot<T>(&self, task: TaskId, read: impl FnOnce(&mut Slot) -> T) -> Result<T, NoArtifact> {
        let mut slot = self.slots[task.index()].lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(slot) = &mut *slot {
            return Ok(read(slot));
        }
        let content = self.content(task).ok_or(NoArtifact::Lost(task))?;
        let artifact = match &self.plan.node(task).task {
            Task::Source(source) => self.source(&source.path, content).map_err(NoArtifact::Failed)?,
            Task::Step(_) | Task::Gate(_) => self.store.load(&content).ok_or(NoArtifact::Lost(task))?,
        };
        Ok(read(slot.insert(Slot { artifact, measured: None })))
    }

    fn source(&self, path: &Path, content: ContentHash) -> Result<Artifact, StepFailure> {
        let (bytes, hash) = source::bytes(&self.index, path)?;
        if hash != content {
            return Err(StepFailure::bad_input(format!("{} changed while the run read it", path.display()))
                .with_help("run again when nobody writes to it"));
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Artifact::File(Arc::new(FileBytes { name, bytes })))
    }

    /// Keeps an artifact for its readers.
    pub(super) fn keep(&self, task: TaskId, artifact: Artifact) {
        *self.slots[task.index()].lock().unwrap_or_else(PoisonError::into_inner) =
            Some(Slot { artifact, measured: None });
    }

    /// Drops an artifact after its last reader.
    pub(super) fn release(&self, task: TaskId) {
        *self.slots[task.index()].lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// The threads that steps work on. They are started with the first step that runs.
    pub(super) fn pool(&self) -> Result<Arc<rayon::ThreadPool>, RunError> {
        if let Some(pool) = self.pool.get() {
            return Ok(Arc::clone(pool));
        }
        let jobs = self.options.jobs.max(1);
        // A waiting task may take up another one on its own stack, so that stacks nest; hence the generous size.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs).stack_size(32 << 20).build();
        let pool = Arc::new(pool.map_err(|error| RunError::Threads(jobs, error.to_string()))?);
        Ok(Arc::clone(self.pool.get_or_init(|| pool)))
    }

    /// Where the files of a case go.
    pub(super) fn folder(&self, case: usize) -> PathBuf {
        self.options.out.join(&self.plan.cases()[case].name)
    }
}
