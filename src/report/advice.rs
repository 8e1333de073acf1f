//! What to turn when a gate fails: the step and the parameter that its cause depends on.
//!
//! The cause is what the gate found out about the faces at fault; the parameters are those of the steps that the mesh
//! came through, nearest first.

use serde_json::Value as Json;

use crate::metric::Value;
use crate::metric::gate::{Cause, GateRow};
use crate::metric::number::number_text;
use crate::run::{Plan, StepTask, Task, TaskId};
use crate::step::parameters::ParameterSchema;

/// A step that the judged mesh came through.
struct Upstream<'a> {
    name: String,
    task: &'a StepTask,
    /// What it takes its lengths from, where that is not its main input.
    reference: Option<String>,
}

impl Upstream<'_> {
    fn takes(&self, parameter: &str) -> bool {
        ParameterSchema::of(self.task.def).properties.contains_key(parameter)
    }
}

/// A line for each failed check: what to turn. `name` says what a task is called.
pub(super) fn advice(
    plan: &Plan,
    target: TaskId,
    references: &[String],
    rows: &[GateRow],
    name: &dyn Fn(TaskId) -> String,
) -> Vec<String> {
    if rows.iter().all(|row| row.passed) {
        return Vec::new();
    }
    let chain = Chain { steps: chain(plan, target, name), references };
    let failed = rows.iter().filter(|row| !row.passed);
    failed.filter_map(|row| Some(format!("{}: {}", row.metric, chain.of(row)?))).collect()
}

/// The steps from the mesh back to its file, along their main inputs.
fn chain<'a>(plan: &'a Plan, target: TaskId, name: &dyn Fn(TaskId) -> String) -> Vec<Upstream<'a>> {
    let (mut steps, mut next) = (Vec::new(), Some(target));
    while let Some(id) = next {
        let inputs = plan.inputs(id);
        let input = |wanted: &str| inputs.iter().find(|(name, _)| *name == wanted).map(|(_, task)| *task);
        if let Task::Step(task) = &plan.node(id).task {
            steps.push(Upstream { name: name(id), task, reference: input("reference").map(name) });
        }
        // A further output hangs on the main one of its step.
        next = input("from").or_else(|| input("main"));
    }
    steps
}

struct Chain<'a> {
    steps: Vec<Upstream<'a>>,
    references: &'a [String],
}

impl Chain<'_> {
    fn of(&self, row: &GateRow) -> Option<String> {
        match row.metric.as_str() {
            "min-stretch"
            | "mean-stretch"
            | "min-angle"
            | "max-angle"
            | "max-aspect-ratio"
            | "low-stretch-faces"
            | "low-stretch-share"
            | "min-scaled-jacobian"
            | "mean-scaled-jacobian"
            | "inverted-quads" => self.shape(row),
            "distance"
            | "distance-to-reference"
            | "distance-from-reference"
            | "outer-distance"
            | "outer-distance-from-reference"
            | "feature-deviation" => self.distance(),
            "max-size" | "mean-size" | "max-edge" | "mean-edge" => {
                self.turn("lower", &["max-size", "max-edge", "size", "interval"])
            }
            "max-valence" => self.turn("lower", &["max-valence"]),
            "faces" | "triangles" | "quads" | "vertices" => {
                self.turn("raise", &["max-size", "size", "max-edge", "interval", "tolerance"])
            }
            "volume-drift" => {
                let first = self.turn("lower", &["tolerance"])?;
                Some(format!(
                    "{first}: where it is larger than a wall, the sides of the wall come to lie on each other"
                ))
            }
            "closed" | "boundary-edges" | "boundary-loops" => self.holes(),
            "manifold" | "edge-manifold" | "vertex-manifold" | "oriented" | "non-manifold-edges" | "components" => {
                self.turn("look at the statistics of `repair`, and turn", &["weld", "non-manifold"])
            }
            "self-intersections" | "self-intersecting-faces" => {
                let first = self.turn("lower", &["tolerance"])?;
                Some(format!("{first}: it must be smaller than the walls and gaps of the part"))
            }
            "groups-kept" => Some("name the groups in `keep` or `on-curve` of the steps between".to_owned()),
            _ => None,
        }
    }

    /// The nearest step with one of these parameters.
    fn find(&self, parameters: &[&str]) -> Option<(&Upstream<'_>, String)> {
        self.steps.iter().find_map(|step| {
            let parameter = parameters.iter().find(|parameter| step.takes(parameter))?;
            Some((step, (*parameter).to_owned()))
        })
    }

    fn turn(&self, verb: &str, parameters: &[&str]) -> Option<String> {
        let (step, parameter) = self.find(parameters)?;
        Some(format!("{verb} `{parameter}` of `{}`{}", step.name, now(step, &parameter)))
    }

    fn shape(&self, row: &GateRow) -> Option<String> {
        let lowered = match (&row.measured, row.metric.as_str()) {
            (Some(Value::Number(measured)), "min-stretch" | "min-angle" | "min-scaled-jacobian") => {
                format!(", or lower the limit to {}", number_text(round_down(*measured)))
            }
            _ => String::new(),
        };
        let cause = match row.cause {
            Some(Cause::BetweenCurves(faces)) => self
                .turn("raise", &["min-gap"])
                .map(|turn| format!("{} between marked edges that run close together: {turn}", count(faces))),
            Some(Cause::AtCurves(faces)) => self.turn("raise", &["angle"]).map(|turn| {
                format!("{} where marked edges meet sharply: {turn}, so that fewer are marked", count(faces))
            }),
            None => None,
        };
        let own = [row.metric.as_str(), "min-stretch"];
        let cause = cause.or_else(|| {
            let (step, parameter) = self.find(&own)?;
            Some(format!("raise `{parameter}` of `{}`{}, or give more `tolerance`", step.name, now(step, &parameter)))
        });
        Some(cause.or_else(|| self.turn("give more", &["tolerance"]))? + &lowered)
    }

    fn distance(&self) -> Option<String> {
        let foreign = self.steps.iter().find(|step| {
            let other = step.reference.as_ref().is_some_and(|reference| !self.references.contains(reference));
            step.takes("tolerance") && (other || step.reference.is_none() && step.task.def.name != "repair")
        });
        if let (Some(step), Some(reference)) = (foreign, self.references.first())
            && step.task.def.inputs.iter().any(|input| input.name == "reference")
            && step.name != *reference
        {
            let own = step.reference.as_deref().map_or_else(|| "its own input".to_owned(), |name| format!("`{name}`"));
            return Some(format!(
                "`{}` measures its tolerance against {own}: write reference = \"{reference}\" there",
                step.name
            ));
        }
        self.turn("lower", &["tolerance", "weld"])
    }

    fn holes(&self) -> Option<String> {
        let repair = self.steps.iter().find(|step| step.takes("fill-holes"))?;
        Some(format!(
            "write fill-holes = \"all\" in `{0}`, or raise `weld` of `{0}` where edges only nearly meet",
            repair.name
        ))
    }
}

/// The value that a parameter has now.
fn now(step: &Upstream<'_>, parameter: &str) -> String {
    match step.task.bound.canonical().get(parameter) {
        Some(Json::Number(number)) => format!(", now {}", number.as_f64().map(number_text).unwrap_or_default()),
        Some(Json::String(text)) => format!(", now {text}"),
        Some(Json::Null | Json::Bool(_) | Json::Array(_) | Json::Object(_)) | None => String::new(),
    }
}

fn count(faces: u64) -> String {
    if faces == 1 { "1 face".to_owned() } else { format!("{faces} faces") }
}

/// Two digits, not above the number.
fn round_down(number: f64) -> f64 {
    if !(number.is_finite() && number > 0.0) {
        return 0.0;
    }
    let unit = libm::pow(10.0, libm::floor(libm::log10(number)) - 1.0);
    (number / unit).floor() * unit
}
