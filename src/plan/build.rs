//! Plans the cases of a recipe: binds, wires and checks each one, and merges their tasks.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;

use super::bind::{BoundDecl, bind};
use super::case::{CaseContext, CaseSpec, Context};
use super::columns::{ColumnDecl, ColumnRequest, Columns, result};
use super::gates::{GateDecl, Group, gates};
use super::limits::Limits;
use super::merge::PlanBuilder;
use super::outputs::{OutputDecl, outputs};
use super::task::{GateTask, StepTask, TaskId};
use super::wire::{Producer, Wiring, wire};
use super::{Case, Column, Gate, Output, OutputOptions, Plan};
use crate::recipe::{Diagnostic, Diagnostics, Recipe, Span, Value, is_full};
use crate::step::OutputDef;

/// Plans a recipe as it is.
///
/// # Errors
/// Everything that is wrong with the recipe, at once.
pub fn plan(recipe: &Recipe, context: &Context<'_>) -> Result<Plan, Diagnostics> {
    plan_cases(recipe, &[CaseSpec::default()], None, context)
}

/// Plans several cases of a recipe as one graph. `columns` says what is measured of each: nothing, or the metrics asked
/// for, or the usual ones where none is.
///
/// # Errors
/// Everything that is wrong with the recipe in any of the cases, at once.
pub fn plan_cases(
    recipe: &Recipe,
    cases: &[CaseSpec],
    columns: Option<&[ColumnRequest]>,
    context: &Context<'_>,
) -> Result<Plan, Diagnostics> {
    let mut builder = PlanBuilder::default();
    let mut problems = recipe.problems.clone();
    let mut state = CaseContext::new(recipe, context);
    for spec in cases {
        plan_case(spec, columns, &mut state, &mut builder);
        state.scope.blame(&mut state.problems, &recipe.sources);
        problems.append(&mut state.problems);
        // The faults of the first wrong cases are enough to go on with.
        if is_full(&problems) {
            break;
        }
    }
    if problems.is_empty() {
        problems = recipe.unused();
    }
    if problems.is_empty() {
        Ok(builder.finish())
    } else {
        Err(Diagnostics::new(Arc::clone(&recipe.sources), problems))
    }
}

fn plan_case(
    spec: &CaseSpec,
    columns: Option<&[ColumnRequest]>,
    context: &mut CaseContext<'_>,
    builder: &mut PlanBuilder,
) {
    let recipe = context.recipe;
    context.scope = recipe.scope(&spec.params, &mut context.problems);
    if recipe.steps.is_empty() && recipe.problems.is_empty() {
        let message = format!("the recipe `{}` has no steps", recipe.name);
        let help = "write [steps.raw] and below it use = \"read\"; `meshmill init` writes a recipe to begin with";
        context
            .problems
            .push(Diagnostic { labels: Vec::new(), ..Diagnostic::error(Span::default(), message).help(help) });
        return;
    }
    let steps: Vec<BoundDecl<'_>> = recipe.steps.iter().filter_map(|decl| bind(decl, context)).collect();
    // Of two steps of one name, which is reported, the first one counts.
    context.places = steps.iter().enumerate().rev().map(|(place, step)| (step.decl.name.as_str(), place)).collect();
    let wiring = wire(&steps, context);
    let gates = gates(&steps, &wiring, context);
    let limits = Limits::read(&steps, context);
    let outputs = outputs(&steps, &wiring, context);
    let result = result(&steps, &wiring, &outputs);
    let reader = Columns { steps: &steps, wiring: &wiring, gates: &gates, result };
    let columns = columns.map(|requests| reader.of(requests, context)).unwrap_or_default();
    let result = reader.result;
    if context.problems.is_empty() && recipe.problems.is_empty() {
        let parts = Parts { gates, outputs, columns, result };
        let nodes = Nodes::add(&steps, &wiring, &parts, builder);
        for ((step, output), id) in &nodes.ids {
            builder.limit(*id, limits.of(&steps[*step], output));
        }
        let case = nodes.case(spec, context, parts, builder);
        builder.case(case);
    }
}

/// What hangs on the steps of a case.
struct Parts {
    gates: Vec<GateDecl>,
    outputs: Vec<OutputDecl>,
    columns: Vec<ColumnDecl>,
    result: Option<(String, Producer)>,
}

/// An input of a task, by its name.
type Link = (&'static str, TaskId);
/// The ending of an input that is a file, by its name.
type Ending = (&'static str, String);

/// The nodes of a case's outputs.
struct Nodes<'a, 'r> {
    steps: &'a [BoundDecl<'r>],
    ids: BTreeMap<(usize, &'static str), TaskId>,
}

impl<'a, 'r> Nodes<'a, 'r> {
    /// Adds a task for every output in use: by another step, a gate, an output file, or the main one of a step that
    /// nothing else uses.
    fn add(steps: &'a [BoundDecl<'r>], wiring: &Wiring, parts: &Parts, builder: &mut PlanBuilder) -> Self {
        let links = wiring.producers.iter().flatten().map(|(_, producer)| *producer);
        let gated = parts
            .gates
            .iter()
            .flat_map(|gate| gate.groups.iter().filter_map(|group| group.reference).chain([gate.target]));
        let measured = parts.columns.iter().flat_map(|column| column.reference.into_iter().chain([column.target]));
        let written = parts.outputs.iter().flat_map(|output| output.producer.into_iter().chain(output.midside_on));
        let mut used: BTreeSet<(usize, &'static str)> = links
            .chain(gated)
            .chain(measured)
            .chain(written)
            .map(|producer| (producer.step, producer.output.name))
            .collect();
        let users: BTreeSet<usize> = used.iter().map(|(user, _)| *user).collect();
        for (index, step) in steps.iter().enumerate() {
            if !users.contains(&index)
                && let Some(main) = step.def.outputs.first()
            {
                used.insert((index, main.name));
            }
        }
        let mut nodes = Self { steps, ids: BTreeMap::new() };
        for &index in &wiring.order {
            for output in steps[index].def.outputs {
                if used.contains(&(index, output.name)) {
                    nodes.add_output(index, output, wiring, builder);
                }
            }
        }
        nodes
    }

    fn add_output(&mut self, index: usize, output: &OutputDef, wiring: &Wiring, builder: &mut PlanBuilder) {
        let step = &self.steps[index];
        let Some(bound) = &step.bound else { return };
        if self.ids.contains_key(&(index, output.name)) {
            return;
        }
        let (inputs, endings) = match (output.derive, step.def.outputs.first()) {
            (Some(_), Some(main)) => {
                self.add_output(index, main, wiring, builder);
                (self.ids.get(&(index, main.name)).map(|id| (main.name, *id)).into_iter().collect(), Vec::new())
            }
            _ => self.inputs(index, wiring, builder),
        };
        let (bound, locks) = (Arc::clone(bound), step.locks.clone());
        let task = StepTask { def: step.def, output: output.name, bound, locks, endings };
        let id = builder.step(&label(&step.decl.name, output.name), task, &inputs);
        self.ids.insert((index, output.name), id);
    }

    /// The inputs of a step by name, and the endings of those that are files.
    fn inputs(&self, index: usize, wiring: &Wiring, builder: &mut PlanBuilder) -> (Vec<Link>, Vec<Ending>) {
        let mut inputs = Vec::new();
        let mut endings = Vec::new();
        for (name, path) in &self.steps[index].files {
            inputs.push((*name, builder.source(path)));
            let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
            endings.push((*name, ending));
        }
        for (link, producer) in &wiring.producers[index] {
            if let Some(id) = self.id(*producer) {
                inputs.push((link.input, id));
            }
        }
        (inputs, endings)
    }

    fn id(&self, producer: Producer) -> Option<TaskId> {
        self.ids.get(&(producer.step, producer.output.name)).copied()
    }

    fn case(&self, spec: &CaseSpec, context: &CaseContext<'_>, parts: Parts, builder: &mut PlanBuilder) -> Case {
        let value =
            |(name, value): (&String, &Option<Value>)| Some((name.clone(), value.as_ref().map(ToString::to_string)?));
        let file =
            |(name, path): (&String, &Option<PathBuf>)| Some((name.clone(), path.as_ref()?.display().to_string()));
        Case {
            name: spec.name.clone(),
            params: context.scope.params.iter().filter_map(value).collect(),
            steps: self
                .ids
                .iter()
                .map(|((step, output), id)| (label(&self.steps[*step].decl.name, output), *id))
                .collect(),
            outputs: parts.outputs.into_iter().filter_map(|output| self.output(output)).collect(),
            gates: parts.gates.into_iter().filter_map(|gate| self.gate(gate, builder)).collect(),
            inputs: context.scope.inputs.iter().filter_map(file).collect(),
            columns: parts.columns.into_iter().filter_map(|column| self.column(column, builder)).collect(),
            result: parts.result.and_then(|(step, producer)| Some((step, self.id(producer)?))),
        }
    }

    fn output(&self, output: OutputDecl) -> Option<Output> {
        Some(Output {
            step: output.step,
            task: self.id(output.producer?)?,
            file: output.file,
            options: OutputOptions {
                element: output.element,
                midside_on: output.midside_on.and_then(|producer| self.id(producer)),
                binary: output.binary,
                precision: output.precision,
                first_id: output.first_id,
            },
        })
    }

    fn gate(&self, gate: GateDecl, builder: &mut PlanBuilder) -> Option<Gate> {
        let target = self.id(gate.target)?;
        let mut tasks = Vec::new();
        for Group { reference, task } in gate.groups {
            let mut inputs = vec![("target", target)];
            inputs.extend(reference.and_then(|reference| self.id(reference)).map(|id| ("reference", id)));
            let mut label = format!("gate {}", gate.step);
            if let Some(criteria) = &task.criteria {
                label = format!("{label} by {}", criteria.name);
            }
            if let Some(reference) = reference {
                let other = self::label(&self.steps[reference.step].decl.name, reference.output.name);
                label = format!("{label} to {other}");
            }
            tasks.push(builder.gate(&label, task, &inputs));
        }
        Some(Gate { step: gate.step, target, tasks })
    }

    fn column(&self, column: ColumnDecl, builder: &mut PlanBuilder) -> Option<Column> {
        let mut inputs = vec![("target", self.id(column.target)?)];
        if let Some(reference) = column.reference {
            inputs.push(("reference", self.id(reference)?));
        }
        let task = GateTask { checks: vec![column.check], criteria: None };
        let task = builder.gate(&format!("measure {}", column.name), task, &inputs);
        Some(Column { name: column.name, step: column.step, metric: column.metric, task })
    }
}

/// How the recipe names an output of a step.
fn label(step: &str, output: &str) -> String {
    if output == "main" { step.to_owned() } else { format!("{step}.{output}") }
}
