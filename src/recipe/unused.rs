//! Parameters that nothing uses: nearly always a misspelt one, above all where a recipe extends another and means to
//! change a value of it.

use std::collections::BTreeSet;

use super::Recipe;
use super::diagnostic::{Diagnostic, MOST};
use super::expression;
use super::suggest::did_you_mean;
use super::tree::{Node, Table, Tree};

/// One problem for each parameter that no expression and no output name uses. None at all while an expression is wrong,
/// since nobody knows what it was meant to use.
pub(super) fn unused(recipe: &Recipe) -> Vec<Diagnostic> {
    let mut used = BTreeSet::new();
    let steps = recipe.steps.iter().map(|step| &step.table);
    let Recipe { params, gates, criteria, limits, outputs, sweep, .. } = recipe;
    let sections = [params, gates, criteria, limits, outputs, sweep];
    if !steps.chain(sections).all(|table| table_uses(table, &mut used)) {
        return Vec::new();
    }
    let of = |(name, _): &(&str, _)| !used.contains(*name);
    let params = recipe.params.in_order().into_iter().filter(of);
    params
        .take(MOST)
        .map(|(name, entry)| {
            let help = did_you_mean(name, "the recipe uses", used.iter().map(String::as_str));
            Diagnostic::error(entry.key, format!("nothing uses the parameter `{name}`")).help_opt(help)
        })
        .collect()
}

/// The parameters that the values of a table use; none while an expression is wrong.
pub fn names_used(table: &Table) -> Option<BTreeSet<String>> {
    let mut used = BTreeSet::new();
    table_uses(table, &mut used).then_some(used)
}

/// Notes the names that the values of a table use; false where an expression is wrong.
fn table_uses(table: &Table, used: &mut BTreeSet<String>) -> bool {
    table.entries.values().all(|entry| uses(&entry.value, used))
}

fn uses(tree: &Tree, used: &mut BTreeSet<String>) -> bool {
    match &tree.value {
        Node::Text(text) => {
            // An output's name holds parameters in braces.
            used.extend(
                text.split('{').skip(1).filter_map(|rest| rest.split_once('}')).map(|(name, _)| name.to_owned()),
            );
            let Some(formula) = text.strip_prefix('=').filter(|formula| !formula.starts_with('=')) else { return true };
            let Ok(formula) = expression::parse(formula) else { return false };
            used.extend(formula.names().into_iter().map(|(name, _)| name.to_owned()));
            true
        }
        Node::List(items) => items.iter().all(|item| uses(item, used)),
        Node::Table(table) => table_uses(table, used),
        Node::Number(_) | Node::Bool(_) | Node::Date(_) | Node::File(_) => true,
    }
}
