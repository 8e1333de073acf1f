//! Output files: written only when they are not right already, and only under their name when the gates hold.
//!
//! What a file must contain is known by a key, like any result: artifact, options and version. The store remembers the
//! hash of the bytes under that key, so a second run compares hashes and loads no artifact. The bytes carry version
//! and content hash of the artifact, nothing else, and so repeat. Files of a step whose gate failed go to `failed/`,
//! and the file of an earlier run that they would have replaced is removed, so that nobody takes it for the result.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;

use super::certify::certified;
use super::node::{FileNotes, Finished, Node};
use super::shared::{Shared, VERSION, recipe_task};
use super::{FileState, RunError, whole};
use crate::format::{self, Element, Format, WriteOptions};
use crate::mesh::bvh::TriangleBvh;
use crate::mesh::{FaceId, IdVec, Soup, VertexId};
use crate::metric::gate::{FaultKind, GateReport};
use crate::plan::{ContentHash, Gate, Output, OutputOptions, TaskId};
use crate::step::{Artifact, StepFailure};
use crate::store::{Entry, Outcome, host};
use crate::watch::Watch;

/// Where an output of a case belongs, and whether its gates hold. `None` while a gate is undecided.
pub(super) fn place(shared: &Shared<'_>, case: usize, output: &Output) -> Option<(PathBuf, bool)> {
    let gates = shared.plan.cases()[case].gates.iter().filter(|gate| gate.target == output.task);
    let mut passed = true;
    for task in gates.flat_map(|gate| &gate.tasks) {
        passed &= shared.report(*task)?.passed();
    }
    let folder = shared.folder(case);
    Some((if passed { folder.join(&output.file) } else { folder.join("failed").join(&output.file) }, passed))
}

/// Where the elements at fault of a gate go.
pub(super) fn faults_place(shared: &Shared<'_>, case: usize, gate: usize) -> PathBuf {
    let gates = &shared.plan.cases()[case].gates;
    let name = if gates.len() == 1 { "failed.vtu".to_owned() } else { format!("failed-{}.vtu", gates[gate].step) };
    shared.folder(case).join("failed").join(name)
}

/// How a file is, where it is right already or nothing is to be written, so that no thread is needed to find out.
pub(super) fn settled(shared: &Shared<'_>, node: Node) -> Option<Finished> {
    match node {
        Node::Task(_) => None,
        Node::File(case, position) => {
            let output = &shared.plan.cases()[case].outputs[position];
            let (path, passed) = place(shared, case, output)?;
            let folder = shared.folder(case);
            let other = if passed { folder.join("failed").join(&output.file) } else { folder.join(&output.file) };
            if other.symlink_metadata().is_ok() {
                return None;
            }
            let midside = output.options.midside_on.map(|task| shared.content(task));
            let midside = if let Some(midside) = midside { Some(midside?) } else { None };
            let promises = promises(shared, case, output);
            let key = file_key(shared.content(output.task)?, midside, &promises, output);
            let (current, notes) = current(shared, &key, &path).ok()?;
            Some(Finished::File(FileState::Current, current, notes))
        }
        Node::Faults(case, position) => {
            let gate = &shared.plan.cases()[case].gates[position];
            let mut reports = gate.tasks.iter().map(|task| shared.report(*task));
            let none = reports.all(|report| report.is_some_and(|r| r.rows.iter().all(|row| row.faults.is_empty())));
            let gone = faults_place(shared, case, position).symlink_metadata().is_err();
            (none && gone).then_some(Finished::Nothing)
        }
    }
}

/// The hash of a file that is right already, with what is known of it; else its hash as it is, where it is there.
fn current(
    shared: &Shared<'_>,
    key: &ContentHash,
    path: &Path,
) -> Result<(ContentHash, FileNotes), Option<ContentHash>> {
    let current = if path.is_file() { shared.index.hash(path).ok() } else { None };
    let Some(hash) = current else { return Err(None) };
    match shared.store.entry(key) {
        Some(Entry { outcome: Outcome::File { content, .. }, stats, .. }) if content == hash => {
            Ok((hash, serde_json::from_value(stats).unwrap_or_default()))
        }
        _ => Err(current),
    }
}

/// Keys of the gates that speak of an output: how it is written depends on them.
fn promises(shared: &Shared<'_>, case: usize, output: &Output) -> Vec<ContentHash> {
    let gates = shared.plan.cases()[case].gates.iter().filter(|gate| gate.target == output.task);
    gates.flat_map(|gate| &gate.tasks).filter_map(|task| Some(shared.key(*task)?.0)).collect()
}

/// Sees to one output file.
pub(super) fn file(shared: &Shared<'_>, case: usize, position: usize, watch: &Watch) -> Result<Finished, Finished> {
    let output = &shared.plan.cases()[case].outputs[position];
    let Some((path, passed)) = place(shared, case, output) else { return Ok(Finished::Nothing) };
    let folder = shared.folder(case);
    let other = if passed { folder.join("failed").join(&output.file) } else { folder.join(&output.file) };
    remove(&other)?;
    let content = known(shared, output.task)?;
    let midside = output.options.midside_on.map(|task| known(shared, task)).transpose()?;
    let key = file_key(content, midside, &promises(shared, case, output), output);
    settle(shared, &key, &path, &output.step, || {
        let artifact = shared.artifact(output.task)?;
        let midside = output.options.midside_on.map(|task| shared.artifact(task)).transpose()?;
        let name = output.file.file_name().unwrap_or_default().to_string_lossy();
        if let (Artifact::Patches(patches), true) = (&artifact, name.to_ascii_lowercase().ends_with(".json")) {
            return Ok((super::patches::json(patches, &header(content)), FileNotes::default()));
        }
        let encoder = Encoder::new(&artifact, midside.as_ref(), output, &name, content).map_err(Finished::Failed)?;
        let write = |binary: bool| encoder.encode(binary);
        certified((shared, case, output), (encoder.format, &encoder.soup), &write, watch)
    })
}

/// Writes the elements at fault of a gate that failed; removes those of an earlier run when it holds.
pub(super) fn faults(shared: &Shared<'_>, case: usize, position: usize) -> Result<Finished, Finished> {
    let gate = &shared.plan.cases()[case].gates[position];
    let path = faults_place(shared, case, position);
    let reports: Option<Vec<&GateReport>> = gate.tasks.iter().map(|task| shared.report(*task)).collect();
    let Some(reports) = reports else { return Ok(Finished::Nothing) };
    if reports.iter().all(|report| report.rows.iter().all(|row| row.faults.is_empty())) {
        remove(&path)?;
        return Ok(Finished::Nothing);
    }
    let content = known(shared, gate.target)?;
    let mut hasher = blake3::Hasher::new();
    part(&mut hasher, b"faults");
    part(&mut hasher, VERSION.as_bytes());
    part(&mut hasher, content.as_bytes());
    part(&mut hasher, &serde_json::to_vec(&reports).unwrap_or_default());
    settle(shared, &hasher.finalize(), &path, &gate.step, || {
        let soup = faults_soup(shared, gate, &reports)?;
        let options = WriteOptions { binary: true, header: header(content), ..WriteOptions::default() };
        let format = Format::from_file_name("failed.vtu");
        let format = format.ok_or_else(|| Finished::Failed(StepFailure::failed("there is no writer for VTU")))?;
        let bytes = format::write(format, &soup, &options);
        let bytes = bytes.map_err(|error| Finished::Failed(StepFailure::failed(error.to_string())))?;
        Ok((bytes, FileNotes::default()))
    })
}

/// Writes the file unless it is right already.
fn settle(
    shared: &Shared<'_>,
    key: &ContentHash,
    path: &Path,
    step: &str,
    make: impl FnOnce() -> Result<(Vec<u8>, FileNotes), Finished>,
) -> Result<Finished, Finished> {
    let current = match current(shared, key, path) {
        Ok((right, notes)) => return Ok(Finished::File(FileState::Current, right, notes)),
        Err(current) => current,
    };
    let (bytes, notes) = make()?;
    let content = blake3::hash(&bytes);
    if current != Some(content) {
        whole::write(path, &bytes).map_err(broken("write", path))?;
    }
    let outcome = Outcome::File { content, bytes: bytes.len() as u64 };
    // The same bytes under another path, as cases of a sweep share them, are known already.
    if shared.store.entry(key).is_none_or(|known| known.outcome != outcome) {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let task = recipe_task(&shared.options.name, &format!("{step} -> {name}"));
        shared.publish(key, &file_entry(task, outcome, &notes));
    }
    let state = if current == Some(content) { FileState::Current } else { FileState::Written };
    Ok(Finished::File(state, content, notes))
}

fn file_entry(task: String, outcome: Outcome, notes: &FileNotes) -> Entry {
    let stats = serde_json::to_value(notes).unwrap_or_default();
    Entry {
        version: VERSION.to_owned(),
        host: host(),
        task,
        record: Vec::new(),
        outcome,
        stats,
        seconds: 0.0,
        memory: None,
    }
}

fn known(shared: &Shared<'_>, task: TaskId) -> Result<ContentHash, Finished> {
    shared.content(task).ok_or(Finished::Lost(task))
}

fn remove(path: &Path) -> Result<(), Finished> {
    match fs::remove_file(path) {
        Ok(()) => Ok(()),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(broken("remove", path)(error)),
    }
}

fn broken(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Finished {
    move |source| Finished::Broken(RunError::Output { action, path: path.to_path_buf(), source })
}

fn part(hasher: &mut blake3::Hasher, bytes: &[u8]) {
    hasher.update(&(bytes.len() as u64).to_le_bytes());
    hasher.update(bytes);
}

fn file_key(
    content: ContentHash,
    midside: Option<ContentHash>,
    promises: &[ContentHash],
    output: &Output,
) -> ContentHash {
    let OutputOptions { element, midside_on: _, binary, precision, first_id } = &output.options;
    let ending = output.file.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let mut hasher = blake3::Hasher::new();
    part(&mut hasher, b"file");
    part(&mut hasher, VERSION.as_bytes());
    part(&mut hasher, content.as_bytes());
    part(&mut hasher, midside.as_ref().map_or(&[], |hash| hash.as_bytes()));
    for promise in promises {
        part(&mut hasher, promise.as_bytes());
    }
    part(&mut hasher, ending.as_bytes());
    part(&mut hasher, format!("{element:?} {binary:?} {precision:?} {first_id:?}").as_bytes());
    hasher.finalize()
}

fn header(content: ContentHash) -> String {
    format!("meshmill {VERSION} {}", content.to_hex())
}

/// Makes the bytes of an output file.
struct Encoder<'a> {
    format: Format,
    soup: Arc<Soup>,
    element: Option<Element>,
    /// The surface on which mid-side nodes lie.
    midside: Option<TriangleBvh>,
    options: &'a OutputOptions,
    name: &'a str,
    content: ContentHash,
}

impl<'a> Encoder<'a> {
    fn new(
        artifact: &Artifact,
        midside: Option<&Artifact>,
        output: &'a Output,
        name: &'a str,
        content: ContentHash,
    ) -> Result<Self, StepFailure> {
        let no_mesh = || StepFailure::failed(format!("a {} is not a mesh", artifact.port()));
        let tree = |artifact: &Artifact| artifact.as_surface().map(|surface| TriangleBvh::of_surface(surface));
        Ok(Self {
            format: Format::from_file_name(name).ok_or_else(|| unknown_ending(name))?,
            soup: artifact.to_soup().ok_or_else(no_mesh)?,
            element: output.options.element.as_deref().map(element).transpose()?,
            midside: midside.map(tree).transpose()?,
            options: &output.options,
            name,
            content,
        })
    }

    fn encode(&self, binary: bool) -> Result<Vec<u8>, StepFailure> {
        let tree = self.midside.as_ref();
        let project = tree.map(|tree| move |p: DVec3| tree.closest(p).map_or(p, |closest| closest.nearest.point));
        let options = WriteOptions {
            element: self.element,
            midside: project.as_ref().map(|project| project as &(dyn Fn(DVec3) -> DVec3 + Sync)),
            binary,
            precision: self.options.precision.map(|digits| digits as usize),
            first_id: self.options.first_id,
            header: header(self.content),
        };
        format::write(self.format, &self.soup, &options).map_err(|error| {
            let remedy = error.remedy.clone();
            let failure = StepFailure::failed(format!("cannot write {}: {error}", self.name));
            if let Some(remedy) = remedy { failure.with_help(remedy) } else { failure }
        })
    }
}

fn element(name: &str) -> Result<Element, StepFailure> {
    serde_json::from_value(serde_json::Value::from(name))
        .map_err(|_| StepFailure::failed(format!("unknown element `{name}`")).with_help("use S3, S4, S6 or S8R"))
}

fn unknown_ending(name: &str) -> StepFailure {
    let known: Vec<&str> = Format::ALL.iter().flat_map(|format| format.endings()).copied().collect();
    StepFailure::failed(format!("`{name}` names no format that can be written"))
        .with_help(format!("use one of the endings {}", known.join(", ")))
}

/// The faces at fault as a mesh of their own, with one face group for each check that failed.
fn faults_soup(shared: &Shared<'_>, gate: &Gate, reports: &[&GateReport]) -> Result<Soup, Finished> {
    let mut soup = Soup::default();
    let target = shared.artifact(gate.target)?.to_soup();
    for (task, report) in gate.tasks.iter().zip(reports) {
        let inputs = shared.plan.inputs(*task);
        let reference = inputs.iter().find(|(name, _)| *name == "reference").map(|(_, input)| shared.artifact(*input));
        let reference = reference.transpose()?.and_then(|artifact| artifact.to_soup());
        for row in &report.rows {
            let of_kind = |kind| row.faults.iter().filter(move |fault| fault.kind == kind).map(|fault| fault.id);
            if let Some(target) = &target {
                let vertices: BTreeSet<u32> = of_kind(FaultKind::Vertex).collect();
                let touched = target
                    .faces
                    .enumerate()
                    .filter(|(_, facet)| facet.corners().iter().any(|corner| vertices.contains(&corner.raw())));
                let mut faces: BTreeSet<u32> = of_kind(FaultKind::Face).collect();
                if !vertices.is_empty() {
                    faces.extend(touched.map(|(face, _)| face.raw()));
                }
                append(&mut soup, target, &faces, &row.metric);
            }
            if let Some(reference) = &reference {
                append(&mut soup, reference, &of_kind(FaultKind::ReferenceFace).collect(), &row.metric);
            }
        }
    }
    Ok(soup)
}

/// Adds some faces of a mesh, with points of their own, to the group `name`.
fn append(soup: &mut Soup, from: &Soup, faces: &BTreeSet<u32>, name: &str) {
    let mut points: IdVec<_, Option<VertexId>> =
        IdVec::filled(None, if faces.is_empty() { 0 } else { from.points.len() });
    for face in faces {
        let Some(mut facet) = from.faces.get(FaceId::from_raw(*face)).copied() else { continue };
        for corner in facet.corners_mut() {
            let known: &mut Option<VertexId> = &mut points[*corner];
            *corner = *known.get_or_insert_with(|| soup.points.push(from.points[*corner]));
        }
        let added = soup.faces.push(facet);
        soup.carried.groups.faces.entry(name.to_owned()).or_default().push(added);
    }
}
