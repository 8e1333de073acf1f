//! `meshmill init`: a commented recipe for a mesh, with sizes that suit it.

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
    let Ok(metrics) = measure(&soup, None, &watch) else { return Ok(interrupt.exit()) };
    let input = super::context::relative(&arguments.mesh, out.parent().unwrap_or(Path::new("")));
    let look = Look::of(&metrics);
    // The smallest and the largest lengths whose squares are numbers.
    if !(1e-100..1e100).contains(&look.diagonal) {
        let message = format!("{} has a diagonal of {}", arguments.mesh.display(), look.diagonal);
        return Err(Fault::usage(message).help("the recipe would find no surface in it"));
    }
    let text = recipe((&name, &out.display().to_string()), &input, &soup, &look);
    write_named(&out, text.as_bytes())?;
    say(&format!("{}: written; `meshmill run {}` makes the mesh", out.display(), out.display()));
    Ok(Exit::Done)
}

/// What of a measurement a recipe is made of.
struct Look {
    faces: u64,
    diagonal: f64,
    area: f64,
    /// Of triangles; quads have none.
    min_stretch: Option<f64>,
    mean_edge: Option<f64>,
    closed: bool,
    manifold: bool,
    oriented: bool,
    loops: u64,
    shells: u64,
    intersecting: u64,
}

impl Look {
    fn of(metrics: &Measurement) -> Self {
        let number = |name: &str| metrics.get(name).map_or(0.0, Value::as_f64);
        Self {
            faces: number("faces") as u64,
            diagonal: number("diagonal"),
            area: number("area"),
            min_stretch: metrics.get("min-stretch").map(Value::as_f64),
            mean_edge: metrics.get("mean-edge").map(Value::as_f64),
            closed: number("closed") > 0.0,
            manifold: number("manifold") > 0.0,
            oriented: number("oriented") > 0.0,
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

fn recipe((name, file): (&str, &str), input: &Path, soup: &Soup, look: &Look) -> String {
    let size = look.size();
    let length = |percent: f64| number_text(look.diagonal * percent / 100.0);
    let found = findings(soup, look);
    let input = quoted(&input.to_string_lossy().replace('\\', "/"));
    let closed = if look.closed {
        "closed = true\n"
    } else {
        "# closed = true         # the mesh is open; fill-holes = \"all\" closes it\n"
    };
    let holes = if look.closed { "there are none" } else { "\"all\" closes them" };
    format!(
        r#"# Finite-element surface mesh of {input}.
#
{found}#
#   meshmill run {file}                  makes the mesh, in out/{name}
#   meshmill run {file} --set size=3%    coarser
#   meshmill sweep {file}                compares a few sizes and tolerances
#   meshmill steps NAME                       explains a step
name = "{name}"

[inputs]
part = {input}

[params]                  # percent of the diagonal, {diagonal}; a number without % is in mesh units
size = "{size}%"             # aimed edge length, here {aimed}; {elements} such triangles would cover the part
tolerance = "{tolerance}%"       # largest distance to the repaired input, here {allowed}
min-stretch = 0.2         # smallest element quality; 1 is equilateral
feature-angle = 30        # degrees; sharper edges stay where they are

[steps.raw]
use = "read"
file = "=inputs.part"

[steps.clean]             # a surface out of whatever the file holds
use = "repair"
from = "raw"
fill-holes = "none"       # holes: {holes}
non-manifold = "seam"

[steps.marked]            # sharp edges stay
use = "features"
from = "clean"
angle = "=feature-angle"
method = "auto"

[steps.improved]          # well-shaped triangles of the aimed size
use = "improve-quality"
from = "marked"
reference = "clean"
max-edge = "=size"
tolerance = "=tolerance"

[steps.dense]             # room to choose from
use = "subdivide"
from = "improved"

[steps.fe]                # as coarse as the limits allow
use = "control-properties"
from = "dense"
reference = "clean"
tolerance = "=tolerance"
min-stretch = "=min-stretch"
max-size = "=2*size"
max-valence = 10

[gates.fe]                # counted again on the result; a file is written only where they hold
min-stretch = {{ at-least = "=min-stretch" }}
max-size = {{ to = "clean", at-most = "=2*size" }}
distance = {{ to = "clean", at-most = "=tolerance" }}
manifold = true
oriented = true
{closed}
[outputs]
fe = ["result.vtu", "result.inp", "result.stl"]

[sweep]
columns = ["faces", "min-stretch", "mean-stretch", "distance"]

[sweep.axes]
size = ["{fine}%", "{size}%", "{coarse}%"]
tolerance = ["{tolerance}%", "{wide}%"]
"#,
        diagonal = number_text(look.diagonal),
        aimed = length(size),
        elements = number_text(ELEMENTS),
        tolerance = number_text(size / 10.0),
        allowed = length(size / 10.0),
        fine = number_text(size / 2.0),
        coarse = number_text(size * 2.0),
        wide = number_text(size / 5.0),
    )
}

/// What was found, as comments, with what the recipe does about it.
fn findings(soup: &Soup, look: &Look) -> String {
    let mut text = String::new();
    let mut line = |words: String| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "# - {words}");
    };
    let bodies = if look.shells == 1 { "body" } else { "bodies" };
    line(format!("{} faces, {} vertices, {} {bodies}", look.faces, soup.points.len(), look.shells));
    if let (Some(edge), Some(stretch)) = (look.mean_edge, look.min_stretch) {
        line(format!("mean edge {}, smallest stretch {}", number_text(edge), number_text(stretch)));
    }
    if look.closed {
        line("closed".to_owned());
    } else {
        line(format!("open, with {} boundary loops", look.loops));
    }
    if !look.manifold {
        line("not manifold: `repair` cuts it there and keeps the sheets joined".to_owned());
    }
    if !look.oriented {
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
