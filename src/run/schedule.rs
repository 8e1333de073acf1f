//! The loop of a run: look at nodes whose inputs are known, start what is ready, take in what is finished.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::Instant;

use super::board::Board;
use super::job;
use super::node::{FileNotes, Finished, Node};
use super::observe::Observer;
use super::outcome::{FileOutcome, FileState, RunOutcome, TaskOutcome};
use super::queue::Queue;
use super::shared::{Shared, recipe_task};
use super::state::TaskState;
use super::{RunError, RunOptions, failed, guard, output, tasks_of};
use crate::plan::{Plan, SourceTask, Task, TaskId, in_case};
use crate::step::{FailureKind, StepFailure};
use crate::store::leftover::remove_leftovers;
use crate::store::{Entry, Outcome, Store};

/// Runs a plan. Failures of steps and gates are in the outcome; the rest of the graph goes on without them.
pub fn run(
    plan: &Plan,
    store: &Store,
    options: &RunOptions,
    observer: &Arc<dyn Observer>,
) -> Result<RunOutcome, RunError> {
    let start = Instant::now();
    guard::check(plan, options)?;
    let shared = Shared::new(plan, store, options);
    for folder in folders(&shared) {
        remove_leftovers(&folder);
    }
    let mut schedule = Schedule::new(&shared, Arc::clone(observer));
    let (sender, receiver) = mpsc::channel();
    let result = thread::scope(|scope| {
        schedule.begin();
        schedule.drive(&receiver, &mut |node, what| {
            let (sender, shared, observer) = (sender.clone(), &shared, Arc::clone(observer));
            scope.spawn(move || {
                // The receiver is gone only when the run has ended with an error.
                let _ = sender.send((node, job::run(shared, node, what, observer)));
            });
        })
    });
    shared.index.flush(store);
    result?;
    for case in 0..plan.cases().len() {
        // Only an empty folder can be removed, so this takes nothing that shows a failure.
        let _ = std::fs::remove_dir(shared.folder(case).join("failed"));
    }
    Ok(schedule.into_outcome(start.elapsed().as_secs_f64()))
}

/// Every folder that the run may write files into.
fn folders(shared: &Shared<'_>) -> BTreeSet<PathBuf> {
    let mut folders = BTreeSet::from([shared.options.out.clone()]);
    for (number, case) in shared.plan.cases().iter().enumerate() {
        let own = shared.folder(number);
        folders.extend([own.clone(), own.join("failed")]);
        let files =
            case.outputs.iter().flat_map(|output| [own.join(&output.file), own.join("failed").join(&output.file)]);
        folders.extend(files.filter_map(|file| file.parent().map(Path::to_path_buf)));
    }
    folders
}

/// What became of a file.
#[derive(Default)]
struct Filed {
    state: FileState,
    content: Option<blake3::Hash>,
    notes: FileNotes,
    failure: Option<StepFailure>,
}

struct Schedule<'a> {
    shared: &'a Shared<'a>,
    nodes: Vec<Node>,
    board: Board,
    tasks: Vec<TaskOutcome>,
    /// Entries of forced tasks from before this run.
    before: BTreeMap<TaskId, Entry>,
    forced: BTreeSet<TaskId>,
    files: BTreeMap<usize, Filed>,
    queue: Queue,
    /// Nodes to look at.
    look: VecDeque<usize>,
}

impl<'a> Schedule<'a> {
    fn new(shared: &'a Shared<'a>, observer: Arc<dyn Observer>) -> Self {
        let plan = shared.plan;
        let (mut nodes, mut labels, mut inputs) = (Vec::new(), Vec::new(), Vec::new());
        let mut add = |node: Node, label: String, mut from: Vec<usize>| {
            from.sort_unstable();
            from.dedup();
            nodes.push(node);
            labels.push(label);
            inputs.push(from);
        };
        for id in plan.order() {
            let from = plan.inputs(id).into_iter().map(|(_, input)| input.index()).collect();
            add(Node::Task(id), plan.node(id).label.clone(), from);
        }
        for (number, case) in plan.cases().iter().enumerate() {
            for (position, output) in case.outputs.iter().enumerate() {
                let gates = case.gates.iter().filter(|gate| gate.target == output.task);
                let mut from: Vec<usize> = gates.flat_map(|gate| &gate.tasks).map(|task| task.index()).collect();
                from.push(output.task.index());
                from.extend(output.options.midside_on.map(TaskId::index));
                let label = in_case(&case.name, &output.file.display().to_string());
                add(Node::File(number, position), label, from);
            }
            for (position, gate) in case.gates.iter().enumerate() {
                let mut from: Vec<usize> = gate.tasks.iter().map(|task| task.index()).collect();
                from.push(gate.target.index());
                from.extend(gate.tasks.iter().flat_map(|task| plan.inputs(*task)).map(|(_, input)| input.index()));
                let label = in_case(&case.name, &format!("faults of {}", gate.step));
                add(Node::Faults(number, position), label, from);
            }
        }
        Self {
            shared,
            nodes,
            board: Board::new(labels, inputs, observer),
            tasks: vec![TaskOutcome::unknown(); plan.len()],
            before: BTreeMap::new(),
            forced: tasks_of(plan, &shared.options.force),
            files: BTreeMap::new(),
            queue: Queue::new(shared.options.memory),
            look: VecDeque::new(),
        }
    }

    /// Leaves out what nobody asked for, and looks at the rest.
    fn begin(&mut self) {
        let wanted = self.wanted();
        for node in (0..self.board.len()).rev() {
            if !wanted[node] {
                self.set(node, TaskState::Unwanted, None);
            }
        }
        self.look.extend((0..self.board.len()).filter(|node| wanted[*node]));
        self.look_around();
    }

    /// The nodes that `--only` asks for, with all that they need, and the gates and files of those steps.
    fn wanted(&self) -> Vec<bool> {
        if self.shared.options.only.is_empty() {
            return vec![true; self.board.len()];
        }
        let plan: &Plan = self.shared.plan;
        let chosen = tasks_of(plan, &self.shared.options.only);
        let mut wanted = vec![false; self.board.len()];
        for (node, what) in self.nodes.iter().enumerate() {
            wanted[node] = match *what {
                Node::Task(id) => {
                    let target = plan.inputs(id).into_iter().find(|(name, _)| *name == "target");
                    let is_gate = matches!(plan.node(id).task, Task::Gate(_));
                    chosen.contains(&id) || is_gate && target.is_some_and(|(_, target)| chosen.contains(&target))
                }
                Node::File(case, position) => chosen.contains(&plan.cases()[case].outputs[position].task),
                Node::Faults(case, position) => chosen.contains(&plan.cases()[case].gates[position].target),
            };
        }
        // Inputs come before their users, so one sweep from the end reaches all that is needed.
        for node in (0..wanted.len()).rev().filter(|node| *node < self.board.len()) {
            if wanted[node] {
                self.board.inputs(node).iter().for_each(|input| wanted[*input] = true);
            }
        }
        wanted
    }

    /// Starts and takes in jobs until none is left.
    fn drive(
        &mut self,
        finished: &mpsc::Receiver<(usize, Finished)>,
        start: &mut dyn FnMut(usize, Node),
    ) -> Result<(), RunError> {
        let mut broken = None;
        loop {
            while self.queue.running() < self.shared.options.jobs.max(1) && broken.is_none() && !self.is_cancelled() {
                let Some(node) = self.queue.start(&|| self.shared.ledger.settled()) else { break };
                self.set(node, TaskState::Running, None);
                start(node, self.nodes[node]);
            }
            if self.queue.running() == 0 {
                return broken.map_or(Ok(()), Err);
            }
            let Ok((node, result)) = finished.recv() else { return Ok(()) };
            self.queue.end(node);
            match result {
                Finished::Broken(RunError::Output { .. }) if broken.is_none() && self.tries_again(node) => {}
                Finished::Broken(error) => {
                    broken.get_or_insert(error);
                    self.set(node, TaskState::Failed, None);
                    continue;
                }
                result => self.take_in(node, result),
            }
            self.look_around();
        }
    }

    fn is_cancelled(&self) -> bool {
        self.shared.options.cancelled.load(Ordering::Relaxed)
    }

    /// Changes a state and drops the artifacts that nobody needs any more.
    fn set(&mut self, node: usize, state: TaskState, entry: Option<&Entry>) {
        for input in self.board.set(node, state, entry) {
            if let Node::Task(task) = self.nodes[input] {
                self.shared.release(task);
            }
        }
        if let Node::Task(task) = self.nodes[node] {
            self.tasks[task.index()].state = state;
            if state.is_final() && !self.board.is_read(node) {
                self.shared.release(task);
            }
        }
        if state.is_final() {
            self.look.extend(self.board.users(node));
        }
    }

    fn look_around(&mut self) {
        while let Some(node) = self.look.pop_front() {
            self.examine(node);
        }
    }

    /// Decides what to do with a node whose inputs are all known or one of whose inputs failed.
    fn examine(&mut self, node: usize) {
        let state = self.board.state(node);
        if !matches!(state, TaskState::Unknown | TaskState::Want) || self.is_cancelled() {
            return;
        }
        let inputs = self.board.inputs(node).iter().map(|input| self.board.state(*input));
        let (mut all, mut failed) = (true, false);
        for input in inputs {
            all &= input.is_available();
            failed |= matches!(input, TaskState::Failed | TaskState::Skipped);
        }
        if failed {
            self.set(node, TaskState::Skipped, None);
        } else if all && (state == TaskState::Want || !self.look_up(node)) {
            if state == TaskState::Unknown {
                self.set(node, TaskState::Want, None);
            }
            self.set(node, TaskState::Ready, None);
            let weight = if self.queue.weighs() { self.weight(node) } else { 0 };
            self.queue.push(self.rank(node), node, weight);
        }
    }

    /// Its place among those that can run; what is tried again comes after the others.
    fn rank(&self, node: usize) -> usize {
        let rank = match self.nodes[node] {
            Node::Task(_) => node,
            Node::File(..) | Node::Faults(..) => self.board.inputs(node).iter().copied().max().unwrap_or(node),
        };
        rank + self.queue.retried(node) as usize * self.board.len()
    }

    /// The bytes that the node is expected to take: what the newest result of its name took, else its limit.
    fn weight(&self, node: usize) -> u64 {
        let Node::Task(id) = self.nodes[node] else { return 0 };
        let task = self.shared.plan.node(id);
        let newest = self.shared.store.newest(&recipe_task(&self.shared.options.name, &task.label));
        let recorded = newest.and_then(|(_, entry)| entry.memory).map(|peak| peak.bytes);
        recorded.or(task.limits.memory).unwrap_or_default()
    }

    /// Has a node run again that a limit or the disk ended, where its step may be tried again.
    fn tries_again(&mut self, node: usize) -> bool {
        let (plan, cases) = (self.shared.plan, self.shared.plan.cases());
        let task = match self.nodes[node] {
            Node::Task(id) => id,
            Node::File(case, position) => cases[case].outputs[position].task,
            Node::Faults(case, position) => cases[case].gates[position].target,
        };
        let again = self.queue.retry(node, plan.node(task).limits.retries);
        if again {
            self.wants(node);
        }
        again
    }

    /// Takes a node that ran back to those that have to run.
    fn wants(&mut self, node: usize) {
        self.set(node, TaskState::Want, None);
        self.look.push_back(node);
    }

    /// Whether the node needs no job: its result is known, or cannot be had.
    fn look_up(&mut self, node: usize) -> bool {
        let Node::Task(id) = self.nodes[node] else {
            // What has to be made, and every fault, is for the job.
            let found = output::settled(self.shared, self.nodes[node]);
            return found.is_some_and(|finished| {
                self.take_in(node, finished);
                true
            });
        };
        if let Task::Source(source) = &self.shared.plan.node(id).task {
            self.hash_source(node, id, source);
            return true;
        }
        let Some((key, _)) = self.shared.key(id) else { return false };
        self.tasks[id.index()].key = Some(key);
        let Some(entry) = self.shared.store.entry(&key) else { return false };
        if self.forced.contains(&id) {
            self.before.insert(id, entry);
            return false;
        }
        if let Some(failure) = failed::recall(&entry, self.shared.options) {
            self.tasks[id.index()].failure = Some(failure);
            self.tasks[id.index()].entry = Some(entry);
            self.set(node, TaskState::Failed, None);
            return true;
        }
        if !self.note(id, &entry) {
            return false;
        }
        self.set(node, TaskState::Cached, Some(&entry));
        self.tasks[id.index()].entry = Some(entry);
        true
    }

    fn hash_source(&mut self, node: usize, id: TaskId, source: &SourceTask) {
        match super::source::hash(&self.shared.index, &source.path) {
            Ok(hash) => {
                self.shared.learn(id, hash);
                self.tasks[id.index()].content = Some(hash);
                self.set(node, TaskState::Cached, None);
            }
            Err(failure) => {
                self.tasks[id.index()].failure = Some(failure);
                self.set(node, TaskState::Failed, None);
            }
        }
    }

    /// Takes over what an entry says. False when it is no entry of such a task.
    fn note(&mut self, id: TaskId, entry: &Entry) -> bool {
        match (&entry.outcome, &self.shared.plan.node(id).task) {
            (Outcome::Artifact { content, .. }, Task::Step(_)) => {
                self.shared.learn(id, *content);
                self.tasks[id.index()].content = Some(*content);
                true
            }
            (Outcome::Gate(report), Task::Gate(_)) => match serde_json::from_value(report.clone()) {
                Ok(report) => {
                    self.shared.judge(id, report);
                    true
                }
                Err(_) => false,
            },
            _ => false,
        }
    }

    fn take_in(&mut self, node: usize, result: Finished) {
        match result {
            Finished::Task(entry) => {
                if let Node::Task(id) = self.nodes[node] {
                    self.note(id, &entry);
                    self.compare(id, &entry);
                    self.tasks[id.index()].entry = Some((*entry).clone());
                }
                self.set(node, TaskState::Done, Some(&entry));
            }
            Finished::File(state, content, notes) => {
                self.files.insert(node, Filed { state, content: Some(content), notes, failure: None });
                let state = if state == FileState::Written { TaskState::Done } else { TaskState::Cached };
                self.set(node, state, None);
            }
            Finished::Nothing => self.set(node, TaskState::Cached, None),
            Finished::Lost(input) => {
                self.set(node, TaskState::Want, None);
                // Another reader may have said so already.
                if self.board.state(input.index()).is_available() {
                    self.set(input.index(), TaskState::Want, None);
                    self.look.push_back(input.index());
                }
                self.look.push_back(node);
            }
            Finished::Crowded => {
                self.queue.isolate(node);
                self.wants(node);
            }
            Finished::Failed(failure) if failure.kind == FailureKind::Cancelled => {
                self.set(node, TaskState::Cancelled, None);
            }
            Finished::Failed(failure) if failure.kind.is_of_limits() && self.tries_again(node) => {}
            Finished::Failed(mut failure) => {
                if failure.kind.is_of_limits() && self.queue.retried(node) > 0 {
                    failure.message = format!("{}, {} times", failure.message, self.queue.retried(node) + 1);
                }
                match self.nodes[node] {
                    Node::Task(id) => self.tasks[id.index()].failure = Some(failure),
                    Node::File(..) | Node::Faults(..) => {
                        self.files.insert(node, Filed { failure: Some(failure), ..Filed::default() });
                    }
                }
                self.set(node, TaskState::Failed, None);
            }
            Finished::Broken(_) => {}
        }
    }

    /// Notes where a forced task gave something else than before.
    fn compare(&mut self, id: TaskId, entry: &Entry) {
        let before = self.before.get(&id).and_then(Entry::content);
        if let (Some(before), Some(now)) = (before, entry.content())
            && before != now
        {
            self.tasks[id.index()].differs = Some((before, now));
        }
    }

    fn into_outcome(mut self, seconds: f64) -> RunOutcome {
        let mut files = Vec::new();
        for (node, what) in self.nodes.iter().enumerate() {
            let Filed { state, content, notes, failure } = self.files.remove(&node).unwrap_or_default();
            let (case, step, task, (path, passed)) = match *what {
                Node::Task(_) => continue,
                Node::File(case, position) => {
                    let output = &self.shared.plan.cases()[case].outputs[position];
                    let fallback = || (self.shared.folder(case).join(&output.file), true);
                    let place = output::place(self.shared, case, output).unwrap_or_else(fallback);
                    (case, output.step.clone(), output.task, place)
                }
                Node::Faults(..) if content.is_none() && failure.is_none() => continue,
                Node::Faults(case, position) => {
                    let gate = &self.shared.plan.cases()[case].gates[position];
                    let path = output::faults_place(self.shared, case, position);
                    (case, gate.step.clone(), gate.target, (path, false))
                }
            };
            files.push(FileOutcome { case, step, task, path, state, content, failed_gate: !passed, notes, failure });
        }
        RunOutcome {
            tasks: self.tasks,
            files,
            cancelled: self.shared.options.cancelled.load(Ordering::Relaxed),
            unsaved: self.shared.unsaved().map(ToString::to_string),
            seconds,
        }
    }
}
