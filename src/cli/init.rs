//! `meshmill init`: a commented recipe for a mesh, with sizes that suit it.
//!
//! The recipe is `pipelines/fe-surface.toml` with other values: there is one template, and what that recipe gains, this
//! one gains too. The mesh is looked at as the recipe will see it, after `repair`: a CAD tessellation whose faces share
//! no vertices is closed.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::convert::read_mesh;
use super::exit::{Exit, Fault, say};
use super::signals::Interrupt;
use crate::mesh::Soup;
use crate::metric::{Measurement, Value, measure};
use crate::report::measure::number_text;
use crate::run::{Silent, write_named};
use crate::steps::repair::{NonManifold, RepairError, RepairParams, RepairStats, repair};
use crate::watch::Watch;

/// Measure a mesh and write a commented recipe with sensible sizes for it. Asks nothing.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The mesh.
    mesh: PathBuf,
    /// The recipe. Default: the name of the mesh with `.toml`, in the working folder.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Replace a recipe that is there already.
    #[arg(long)]
    force: bool,
}

/// Elements that a first mesh of a part should have: enough for its shape, few enough to look at soon.
const ELEMENTS: f64 = 10_000.0;

/// The recipe that is filled in.
const TEMPLATE: &str = include_str!("../../pipelines/fe-surface.toml");

pub(super) fn run(arguments: &Arguments) -> Result<Exit, Fault> {
    let stem = arguments.mesh.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let name = folder_name(&stem);
    let out = arguments.out.clone().unwrap_or_else(|| PathBuf::from(format!("{name}.toml")));
    if out.exists() && !arguments.force {
        let message = format!("{} is there already", out.display());
        return Err(Fault::usage(message).help("name another file with --out, or replace it with --force"));
    }
    let soup = read_mesh(&arguments.mesh)?;
    if soup.faces.is_empty() {
        return Err(Fault::usage(format!("{} has no face", arguments.mesh.display())));
    }
    let interrupt = Interrupt::listen();
    let watch = Watch::new(Arc::new(Silent), Arc::clone(&interrupt.cancelled));
    let params = RepairParams { non_manifold: NonManifold::Seam, ..RepairParams::default() };
    let (repaired, stats) = match repair(&soup, &params, &watch) {
        Ok(repaired) => repaired,
        Err(RepairError::Cancelled(_)) => return Ok(interrupt.exit()),
        Err(error) => {
            let message = format!("{}: {error}", arguments.mesh.display());
            return Err(Fault::usage(message).help("the recipe would find no surface in it"));
        }
    };
    let Ok(metrics) = measure(&repaired.to_soup(), None, &watch) else { return Ok(interrupt.exit()) };
    let input = super::context::relative(&arguments.mesh, out.parent().unwrap_or(Path::new("")));
    let look = Look::of(&metrics);
    // The smallest and the largest lengths whose squares are numbers.
    if !(1e-100..1e100).contains(&look.diagonal) {
        let message = format!("{} has a diagonal of {}", arguments.mesh.display(), look.diagonal);
        return Err(Fault::usage(message).help("the recipe would find no surface in it"));
    }
    let text = recipe((&name, &out.display().to_string()), &input, &findings(&soup, &stats, &look), &look);
    write_named(&out, text.as_bytes())?;
    say(&format!("{}: written; `meshmill run {}` makes the mesh", out.display(), out.display()));
    Ok(Exit::Done)
}

/// What of the measurement of the repaired mesh a recipe is made of.
struct Look {
    diagonal: f64,
    area: f64,
    min_stretch: f64,
    mean_edge: f64,
    closed: bool,
    loops: u64,
    shells: u64,
    intersecting: u64,
}

impl Look {
    fn of(metrics: &Measurement) -> Self {
        let number = |name: &str| metrics.get(name).map_or(0.0, Value::as_f64);
        Self {
            diagonal: number("diagonal"),
            area: number("area"),
            min_stretch: number("min-stretch"),
            mean_edge: number("mean-edge"),
            closed: number("closed") > 0.0,
            loops: number("boundary-loops") as u64,
            shells: number("shells") as u64,
            intersecting: number("self-intersecting-faces") as u64,
        }
    }

    /// Edge length in percent of the diagonal: the edge of [`ELEMENTS`] equilateral triangles over the area, between
    /// half a percent and five.
    fn size(&self) -> f64 {
        let edge = (self.area / (ELEMENTS * 3.0_f64.sqrt() / 4.0)).sqrt();
        let percent = if self.diagonal > 0.0 { edge / self.diagonal * 100.0 } else { 2.0 };
        let percent = if percent.is_finite() { percent.clamp(0.5, 5.0) } else { 2.0 };
        (percent * 10.0).round() / 10.0
    }
}

/// A name that a recipe and its folder can have.
fn folder_name(stem: &str) -> String {
    let mut name = String::new();
    for letter in stem.chars().take(60) {
        let letter = if letter.is_alphanumeric() || letter == '_' { letter } else { '-' };
        if !(letter == '-' && name.ends_with('-')) {
            name.push(letter);
        }
    }
    let name = name.trim_matches('-');
    if name.starts_with(char::is_alphabetic) {
        name.to_owned()
    } else {
        format!("part-{name}").trim_end_matches('-').to_owned()
    }
}

fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

fn recipe((name, file): (&str, &str), input: &Path, found: &str, look: &Look) -> String {
    let size = look.size();
    let length = |percent: f64| number_text(look.diagonal * percent / 100.0);
    let percent = |percent: f64| format!("\"{}%\"", number_text(percent));
    let input = quoted(&input.to_string_lossy().replace('\\', "/"));
    let body = TEMPLATE.split_once("\nname = ").map_or(TEMPLATE, |(_, body)| body);
    let body = body.split_once('\n').map_or(body, |(_, body)| body);
    let diagonal = number_text(look.diagonal);
    let aimed = format!("aimed edge length, in percent of the diagonal ({diagonal}), here {}", length(size));
    let allowed = format!("largest distance to the repaired input, both ways, here {}", length(size / 10.0));
    let closed =
        if look.closed { "closed = true" } else { "# closed = true   # it is open; fill-holes = \"all\" closes it" };
    let lists =
        [(size / 2.0, size / 10.0), (size, size / 5.0), (size * 2.0, 0.0)].map(|(a, b)| (percent(a), percent(b)));
    let [(fine, tight), (middle, wide), (coarse, _)] = &lists;
    let mut text = format!(
        "# Finite-element surface mesh of {input}.\n#\n{found}#\n\
         #   meshmill run {file}                  makes the mesh, in out/{name}\n\
         #   meshmill run {file} --set size=3%    coarser\n\
         #   meshmill sweep {file}                compares a few sizes and tolerances\n\
         #   meshmill steps NAME                  explains a step\n\
         #\n# A number without % is in mesh units. {elements} elements of the size below would cover the part.\n\
         name = \"{name}\"\n{body}",
        elements = number_text(ELEMENTS),
    );
    for (section, key, line) in [
        ("", "description", format!("description = {}", quoted(&format!("Finite-element surface mesh of {name}")))),
        ("inputs", "part", format!("part = {input}")),
        ("params", "size", format!("size = {:<15}# {aimed}", percent(size))),
        ("params", "tolerance", format!("tolerance = {:<10}# {allowed}", percent(size / 10.0))),
        ("gates.fe", "oriented", format!("oriented = true\n{closed}")),
        ("sweep.axes", "size", format!("size = [{fine}, {middle}, {coarse}]")),
        ("sweep.axes", "tolerance", format!("tolerance = [{tight}, {wide}]")),
    ] {
        text = with_line(&text, section, key, &line);
    }
    text
}

/// The recipe with the line of a key in a section replaced.
fn with_line(recipe: &str, section: &str, key: &str, line: &str) -> String {
    let (mut text, mut here) = (String::new(), "");
    for old in recipe.lines() {
        if let Some(head) = old.strip_prefix('[').and_then(|rest| rest.split_once(']')) {
            here = head.0;
        }
        let is_it = here == section && old.split_once('=').is_some_and(|(name, _)| name.trim() == key);
        text.push_str(if is_it { line } else { old });
        text.push('\n');
    }
    text
}

/// What was found, as comments, with what the recipe does about it.
fn findings(soup: &Soup, stats: &RepairStats, look: &Look) -> String {
    let mut text = String::new();
    let mut line = |words: String| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "# - {words}");
    };
    let bodies = if look.shells == 1 { "body" } else { "bodies" };
    line(format!("{} faces, {} vertices, {} {bodies}", soup.faces.len(), soup.points.len(), look.shells));
    line(format!("mean edge {}, smallest stretch {}", number_text(look.mean_edge), number_text(look.min_stretch)));
    if look.closed {
        line("closed".to_owned());
    } else {
        line(format!("open, with {} boundary loops", look.loops));
    }
    let joined = stats.vertices_merged + stats.vertices_welded + stats.t_junctions;
    if joined > 0 {
        line(format!("{joined} vertices lie on others or beside edges: `repair` joins them"));
    }
    if stats.non_manifold_edges_cut + stats.vertices_cut > 0 {
        line("not manifold: `repair` cuts it there and keeps the sheets joined".to_owned());
    }
    if stats.faces_turned + stats.components_turned > 0 {
        line("not oriented: `repair` turns faces outward".to_owned());
    }
    if look.intersecting > 0 {
        line(format!(
            "{} faces intersect others: look at them with `meshmill run pipelines/inspect.toml`",
            look.intersecting
        ));
    }
    if !soup.carried.groups.faces.is_empty() {
        let names: Vec<&str> = soup.carried.groups.faces.keys().take(8).map(String::as_str).collect();
        line(format!("face groups, which are kept: {}", names.join(", ").replace(|c: char| c.is_control(), " ")));
    }
    text
}
