//! Plans the cases of a recipe: binds, wires and checks each one, and merges their tasks.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::bind::{BoundDecl, bind};
use super::case::{CaseContext, CaseSpec, Context};
use super::gates::{GateDecl, gates};
use super::merge::PlanBuilder;
use super::outputs::{OutputDecl, outputs};
use super::task::{GateTask, StepTask, TaskId};
use super::wire::{Producer, Wiring, wire};
use super::{Case, Gate, Output, OutputOptions, Plan};
use crate::recipe::{Diagnostic, Diagnostics, Recipe, Span, Value};

/// Plans a recipe as it is.
///
/// # Errors
/// Everything that is wrong with the recipe, at once.
pub fn plan(recipe: &Recipe, context: &Context<'_>) -> Result<Plan, Diagnostics> {
    plan_cases(recipe, &[CaseSpec::default()], context)
}

/// Plans several cases of a recipe as one graph.
///
/// # Errors
/// Everything that is wrong with the recipe in any of the cases, at once.
pub fn plan_cases(recipe: &Recipe, cases: &[CaseSpec], context: &Context<'_>) -> Result<Plan, Diagnostics> {
    let mut builder = PlanBuilder::default();
    let mut problems = recipe.problems.clone();
    for spec in cases {
        let mut state = CaseContext::new(recipe, context);
        plan_case(spec, &mut state, &mut builder);
        problems.extend(state.problems);
        // The faults of the first wrong cases are enough to go on with.
        if problems.len() > 1000 {
            break;
        }
    }
    if problems.is_empty() {
        Ok(builder.finish())
    } else {
        Err(Diagnostics::new(Arc::clone(&recipe.sources), problems))
    }
}

fn plan_case(spec: &CaseSpec, context: &mut CaseContext<'_>, builder: &mut PlanBuilder) {
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
    let wiring = wire(&steps, context);
    let gates = gates(&steps, &wiring, context);
    let outputs = outputs(&steps, &wiring, context);
    if context.problems.is_empty() && recipe.problems.is_empty() {
        let nodes = Nodes::add(&steps, &wiring, &gates, &outputs, builder);
        let case = nodes.case(spec, context, gates, outputs, builder);
        builder.case(case);
    }
}

/// The nodes of a case's outputs.
struct Nodes<'a, 'r> {
    steps: &'a [BoundDecl<'r>],
    ids: BTreeMap<(usize, &'static str), TaskId>,
}

impl<'a, 'r> Nodes<'a, 'r> {
    /// Adds a task for every output in use: by another step, a gate, an output file, or the main one of a step that
    /// nothing else uses.
    fn add(
        steps: &'a [BoundDecl<'r>],
        wiring: &Wiring,
        gates: &[GateDecl],
        outputs: &[OutputDecl],
        builder: &mut PlanBuilder,
    ) -> Self {
        let links = wiring.producers.iter().flatten().map(|(_, producer)| *producer);
        let gated = gates
            .iter()
            .flat_map(|gate| gate.groups.iter().filter_map(|(reference, _)| *reference).chain([gate.target]));
        let written = outputs.iter().flat_map(|output| output.producer.into_iter().chain(output.midside_on));
        let mut used: BTreeSet<(usize, &'static str)> =
            links.chain(gated).chain(written).map(|producer| (producer.step, producer.output.name)).collect();
        for (index, step) in steps.iter().enumerate() {
            if !used.iter().any(|(user, _)| *user == index)
                && let Some(main) = step.def.outputs.first()
            {
                used.insert((index, main.name));
            }
        }
        let mut nodes = Self { steps, ids: BTreeMap::new() };
        for &index in &wiring.order {
            for output in steps[index].def.outputs {
                if used.contains(&(index, output.name)) {
                    nodes.add_output(index, output.name, wiring, builder);
                }
            }
        }
        nodes
    }

    fn add_output(&mut self, index: usize, output: &'static str, wiring: &Wiring, builder: &mut PlanBuilder) {
        let step = &self.steps[index];
        let Some(bound) = &step.bound else { return };
        let mut inputs = Vec::new();
        let mut endings = Vec::new();
        for (name, path) in &step.files {
            inputs.push((*name, builder.source(path)));
            let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
            endings.push((*name, ending));
        }
        for (link, producer) in &wiring.producers[index] {
            if let Some(id) = self.id(*producer) {
                inputs.push((link.input, id));
            }
        }
        let task = StepTask { def: step.def, output, bound: Arc::clone(bound), locks: step.locks.clone(), endings };
        let id = builder.step(&label(&step.decl.name, output), task, &inputs);
        self.ids.insert((index, output), id);
    }

    fn id(&self, producer: Producer) -> Option<TaskId> {
        self.ids.get(&(producer.step, producer.output.name)).copied()
    }

    fn case(
        &self,
        spec: &CaseSpec,
        context: &CaseContext<'_>,
        gates: Vec<GateDecl>,
        outputs: Vec<OutputDecl>,
        builder: &mut PlanBuilder,
    ) -> Case {
        let value =
            |(name, value): (&String, &Option<Value>)| Some((name.clone(), value.as_ref().map(ToString::to_string)?));
        Case {
            name: spec.name.clone(),
            params: context.scope.params.iter().filter_map(value).collect(),
            steps: self
                .ids
                .iter()
                .map(|((step, output), id)| (label(&self.steps[*step].decl.name, output), *id))
                .collect(),
            outputs: outputs.into_iter().filter_map(|output| self.output(output)).collect(),
            gates: gates.into_iter().filter_map(|gate| self.gate(gate, builder)).collect(),
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
        for (reference, checks) in gate.groups {
            let mut inputs = vec![("target", target)];
            inputs.extend(reference.and_then(|reference| self.id(reference)).map(|id| ("reference", id)));
            tasks.push(builder.gate(&format!("gate {}", gate.step), GateTask { checks }, &inputs));
        }
        Some(Gate { step: gate.step, target, tasks })
    }
}

/// How the recipe names an output of a step.
fn label(step: &str, output: &str) -> String {
    if output == "main" { step.to_owned() } else { format!("{step}.{output}") }
}
