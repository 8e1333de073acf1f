//! What a sweep or a search measures of each case: metrics of a step's mesh, each one a cached task.
//!
//! A column is a gate without a limit, or with one that only the caller looks at; so it is measured by the same code,
//! once for every mesh, and a column that is added later measures nothing but itself.

use std::collections::BTreeMap;

use super::bind::BoundDecl;
use super::case::CaseContext;
use super::gates::{GateDecl, is_mesh};
use super::outputs::OutputDecl;
use super::wire::{Producer, Wiring, producer};
use crate::metric::gate::{Check, Limit};
use crate::metric::registry::{METRICS, MetricDef, Needs, find};
use crate::recipe::suggest::did_you_mean;
use crate::recipe::{Diagnostic, Node, Span, Tree, is_full};
use crate::step::Port;

/// The keys of a column's table.
pub const COLUMN_KEYS: [&str; 3] = ["metric", "of", "to"];

/// A metric that is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnRequest {
    /// The step whose mesh is measured; the result of the recipe where none is named.
    pub of: Option<(String, Span)>,
    /// The metric.
    pub metric: (String, Span),
    /// The step compared with; found out where the metric needs one and none is named.
    pub to: Option<(String, Span)>,
    /// What the value should be, for a search.
    pub at_least: Option<Limit>,
    /// What the value should be, for a search.
    pub at_most: Option<Limit>,
}

impl ColumnRequest {
    /// A metric of the result, or `STEP.METRIC`.
    pub fn parse(text: &str, span: Span) -> Self {
        let (of, metric) = match text.rsplit_once('.') {
            Some((step, metric)) => (Some((step.to_owned(), span)), metric),
            None => (None, text),
        };
        Self { of, metric: (metric.to_owned(), span), to: None, at_least: None, at_most: None }
    }

    /// Reads an item of `sweep.columns`.
    pub(super) fn read(item: &Tree, problems: &mut Vec<Diagnostic>) -> Option<Self> {
        let table = match &item.value {
            Node::Text(text) => return Some(Self::parse(text, item.span)),
            Node::Table(table) => table,
            other => {
                let message = format!("a column is \"STEP.METRIC\" or a table, got {}", other.kind());
                problems.push(Diagnostic::error(item.span, message));
                return None;
            }
        };
        let mut texts: BTreeMap<&str, (String, Span)> = BTreeMap::new();
        for (key, entry) in table.in_order() {
            if is_full(problems) {
                break;
            }
            match &entry.value.value {
                Node::Text(text) if COLUMN_KEYS.contains(&key) => {
                    texts.insert(key, (text.clone(), entry.value.span));
                }
                _ if COLUMN_KEYS.contains(&key) => {
                    problems.push(Diagnostic::error(entry.value.span, format!("`{key}` is a name")));
                }
                _ => {
                    let help = did_you_mean(key, "keys", COLUMN_KEYS);
                    problems.push(Diagnostic::error(entry.key, format!("a column has no key `{key}`")).help_opt(help));
                }
            }
        }
        let Some(metric) = texts.remove("metric") else {
            problems.push(Diagnostic::error(item.span, "this column does not name its `metric`"));
            return None;
        };
        Some(Self { of: texts.remove("of"), metric, to: texts.remove("to"), at_least: None, at_most: None })
    }
}

/// A column whose meshes are known.
pub(super) struct ColumnDecl {
    pub(super) name: String,
    pub(super) step: String,
    pub(super) metric: &'static MetricDef,
    pub(super) target: Producer,
    pub(super) reference: Option<Producer>,
    pub(super) check: Check,
}

/// The step whose mesh is the result: the first one that is written and is a mesh, else the last mesh.
pub(super) fn result(steps: &[BoundDecl<'_>], wiring: &Wiring, outputs: &[OutputDecl]) -> Option<(String, Producer)> {
    let mesh = |producer: &Producer| wiring.port(*producer).is_some_and(is_mesh);
    let written = outputs.iter().find_map(|output| Some((output.step.clone(), output.producer.filter(mesh)?)));
    let last = || {
        let main = |step: &usize| Some(Producer { step: *step, output: steps[*step].def.outputs.first()? });
        let last = wiring.order.iter().rev().filter_map(main).find(mesh)?;
        Some((steps[last.step].decl.name.clone(), last))
    };
    written.or_else(last)
}

/// Everything at hand while columns are read.
pub(super) struct Columns<'a, 'r> {
    pub(super) steps: &'a [BoundDecl<'r>],
    pub(super) wiring: &'a Wiring,
    pub(super) gates: &'a [GateDecl],
    pub(super) result: Option<(String, Producer)>,
}

impl Columns<'_, '_> {
    /// The columns asked for, or the usual ones of the result.
    pub(super) fn of(&self, requests: &[ColumnRequest], context: &mut CaseContext<'_>) -> Vec<ColumnDecl> {
        if requests.is_empty() {
            let port = self.result.as_ref().and_then(|(_, result)| self.wiring.port(*result));
            let usual: &[&str] = match port {
                Some(Port::Quads) => &["faces", "triangle-share", "min-scaled-jacobian"],
                Some(_) => &["faces", "min-stretch", "mean-stretch"],
                None => &[],
            };
            let requests: Vec<_> = usual.iter().map(|name| ColumnRequest::parse(name, Span::default())).collect();
            return requests.iter().filter_map(|request| self.column(request, context)).collect();
        }
        requests.iter().filter_map(|request| self.column(request, context)).collect()
    }

    fn column(&self, request: &ColumnRequest, context: &mut CaseContext<'_>) -> Option<ColumnDecl> {
        if is_full(&context.problems) {
            return None;
        }
        let (name, span) = &request.metric;
        let Some(metric) = find(name) else {
            let help = did_you_mean(name, "metrics", METRICS.iter().map(|metric| metric.name));
            context.problems.push(Diagnostic::error(*span, format!("there is no metric `{name}`")).help_opt(help));
            return None;
        };
        let (step, target) = match &request.of {
            Some((name, span)) => (name.clone(), self.mesh(name, *span, context)?),
            None => self.result.clone().or_else(|| {
                context.problems.push(Diagnostic::error(*span, "the recipe gives no mesh to measure"));
                None
            })?,
        };
        let reference = match &request.to {
            Some((name, span)) => Some((name.clone(), self.mesh(name, *span, context)?)),
            None if metric.needs == Needs::Reference => Some(self.inferred(&step, target, metric, *span, context)?),
            None => None,
        };
        let to = reference.as_ref().map(|(name, _)| name);
        let check = Check {
            metric: metric.name.to_owned(),
            at_least: request.at_least,
            at_most: request.at_most,
            reference: to.map(|_| "reference".to_owned()),
            ..Check::default()
        };
        let name = match &request.to {
            Some((to, _)) => format!("{step}.{} to {to}", metric.name),
            None => format!("{step}.{}", metric.name),
        };
        Some(ColumnDecl { name, step, metric, target, reference: reference.map(|(_, producer)| producer), check })
    }

    fn mesh(&self, name: &str, span: Span, context: &mut CaseContext<'_>) -> Option<Producer> {
        let found = producer(name, span, self.steps, context)?;
        match self.wiring.port(found) {
            Some(port) if !is_mesh(port) => {
                let message = format!("`{name}` gives {port}, and metrics are measured on meshes");
                context.problems.push(Diagnostic::error(span, message));
                None
            }
            _ => Some(found),
        }
    }

    /// What the step's gate compares with, or the step itself.
    fn inferred(
        &self,
        step: &str,
        target: Producer,
        metric: &MetricDef,
        span: Span,
        context: &mut CaseContext<'_>,
    ) -> Option<(String, Producer)> {
        let named = |producer: Producer| (self.steps[producer.step].decl.name.clone(), producer);
        let mut gates = self.gates.iter().filter(|gate| gate.step == step).flat_map(|gate| &gate.groups);
        let by_gate = gates.find_map(|group| group.reference);
        let links = || self.wiring.producers[target.step].iter().find(|(link, _)| link.input == "reference");
        if let Some(found) = by_gate.or_else(|| links().map(|(_, producer)| *producer)) {
            return Some(named(found));
        }
        let metric = metric.name;
        let message = format!("`{metric}` compares two meshes, and nothing says what `{step}` is compared with");
        let help = format!("write {{ metric = \"{metric}\", of = \"{step}\", to = \"STEP\" }}");
        context.problems.push(Diagnostic::error(span, message).help(help));
        None
    }
}
