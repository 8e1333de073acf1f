//! Steps joined to a graph: which step each input names, in what order they run, and whether the ports fit.

use std::collections::BTreeMap;

use super::bind::{BoundDecl, Link};
use super::case::CaseContext;
use crate::recipe::suggest::did_you_mean;
use crate::recipe::{Diagnostic, Recipe, Span, is_full, order};
use crate::step::{OutPort, OutputDef, Port, StepDef};

/// An output of a step: the position of the step and the output's entry.
#[derive(Clone, Copy, Debug)]
pub(super) struct Producer {
    pub(super) step: usize,
    pub(super) output: &'static OutputDef,
}

/// The graph of a case.
pub(super) struct Wiring {
    /// Positions of steps, each after those it needs; steps in or behind a circle are missing.
    pub(super) order: Vec<usize>,
    /// By step, the producer of each link that has one.
    pub(super) producers: Vec<Vec<(Link, Producer)>>,
    /// Ports of outputs, where known, by step and output name.
    ports: BTreeMap<(usize, &'static str), Port>,
}

/// Finds the step and output that a text names. `None` when it names none, which is reported, or one whose kind is
/// unknown, which has been.
pub(super) fn producer(
    target: &str,
    span: Span,
    steps: &[BoundDecl<'_>],
    context: &mut CaseContext<'_>,
) -> Option<Producer> {
    let (name, output) = target.split_once('.').unwrap_or((target, "main"));
    let Some(step) = context.places.get(name).copied() else {
        if !is_full(&context.problems) && context.recipe.step(name).is_none() {
            context.problems.push(unknown_step(target, name, span, context.recipe));
        }
        return None;
    };
    let def = steps[step].def;
    let Some(output) = def.output(output) else {
        let help = did_you_mean(output, "outputs", def.outputs.iter().map(|output| output.name));
        let message = format!("the step `{name}` ({}) has no output `{output}`", def.name);
        context.problems.push(Diagnostic::error(span, message).help_opt(help));
        return None;
    };
    Some(Producer { step, output })
}

fn unknown_step(target: &str, name: &str, span: Span, recipe: &Recipe) -> Diagnostic {
    let problem = Diagnostic::error(span, format!("there is no step `{name}`"));
    if recipe.inputs.get(name).is_some() {
        return problem.help(format!(
            "`{target}` is an input: a step with use = \"read\" and file = \"=inputs.{name}\" reads it"
        ));
    }
    problem.help_opt(did_you_mean(name, "steps", recipe.steps.iter().map(|step| step.name.as_str())))
}

/// Joins the steps and checks the graph.
pub(super) fn wire(steps: &[BoundDecl<'_>], context: &mut CaseContext<'_>) -> Wiring {
    let mut producers = Vec::with_capacity(steps.len());
    for step in steps {
        let mut found = Vec::new();
        for link in &step.links {
            if let Some(from) = producer(&link.target, link.span, steps, context) {
                found.push((link.clone(), from));
            }
        }
        producers.push(found);
    }
    let needs: Vec<Vec<usize>> = producers
        .iter()
        .map(|links: &Vec<(Link, Producer)>| links.iter().map(|(_, from)| from.step).collect())
        .collect();
    let found = order(&needs);
    for path in &found.circles {
        context.problems.push(circle_problem(path, steps, &producers));
    }
    let mut wiring = Wiring { order: found.sorted, producers, ports: BTreeMap::new() };
    wiring.check_ports(steps, context);
    wiring
}

fn circle_problem(path: &[usize], steps: &[BoundDecl<'_>], producers: &[Vec<(Link, Producer)>]) -> Diagnostic {
    let name = |index: &usize| steps[*index].decl.name.as_str();
    let mut shown: Vec<&str> = path.iter().chain(path.first()).take(12).map(name).collect();
    if path.len() >= 12 {
        shown.push("…");
    }
    let message = format!("steps need each other in a circle: {}", shown.join(" -> "));
    let mut problem = Diagnostic { labels: Vec::new(), ..Diagnostic::error(Span::default(), message) };
    for (at, step) in path.iter().enumerate().take(6) {
        let next = path[(at + 1) % path.len()];
        if let Some((link, _)) = producers[*step].iter().find(|(_, from)| from.step == next) {
            problem = problem.label(link.span, format!("`{}` needs `{}`", name(step), name(&next)));
        }
    }
    problem.help("a step can only use what was made before it")
}

impl Wiring {
    /// The port of an output, where the graph above it is sound.
    pub(super) fn port(&self, producer: Producer) -> Option<Port> {
        self.ports.get(&(producer.step, producer.output.name)).copied()
    }

    fn check_ports(&mut self, steps: &[BoundDecl<'_>], context: &mut CaseContext<'_>) {
        for &step in &self.order {
            let mut from = None;
            for (link, producer) in &self.producers[step] {
                let Some(port) = self.ports.get(&(producer.step, producer.output.name)).copied() else { continue };
                if link.input == "from" {
                    from = Some(port);
                }
                if !link.accepts.contains(&port) {
                    context.problems.push(misfit(&steps[step], &steps[producer.step], link, port, context.catalog));
                }
            }
            for output in steps[step].def.outputs {
                let port = match output.port {
                    OutPort::Is(port) => Some(port),
                    OutPort::SameAsFrom => from,
                };
                if let Some(port) = port {
                    self.ports.insert((step, output.name), port);
                }
            }
        }
    }
}

fn misfit(
    user: &BoundDecl<'_>,
    maker: &BoundDecl<'_>,
    link: &Link,
    port: Port,
    catalog: &'static [StepDef],
) -> Diagnostic {
    let wanted = link.accepts.iter().map(ToString::to_string).collect::<Vec<_>>().join(" or a ");
    let message = format!(
        "the step `{}` ({}) needs a {wanted} as `{}`, but `{}` gives a {port}",
        user.decl.name, user.def.name, link.input, link.target
    );
    let problem = Diagnostic::error(link.span, message)
        .note(format!("this is a {port}"))
        .label(maker.decl.kind_place, format!("`{}` gives a {port}", maker.def.name));
    match converter(port, link.accepts, catalog) {
        Some(step) => problem.help(format!(
            "put a step with use = \"{step}\" and from = \"{}\" between them: it makes a {wanted} of a {port}",
            link.target
        )),
        None => problem,
    }
}

/// The first step of the catalog that makes one of the wanted ports of this one.
fn converter(port: Port, wanted: &[Port], catalog: &'static [StepDef]) -> Option<&'static str> {
    let converts = |def: &&StepDef| {
        let takes = def.inputs.first().is_some_and(|input| input.name == "from" && input.accepts.contains(&port));
        let gives = def.outputs.first().is_some_and(|output| match output.port {
            OutPort::Is(port) => wanted.contains(&port),
            OutPort::SameAsFrom => false,
        });
        takes && gives
    };
    catalog.iter().find(converts).map(|def| def.name)
}
