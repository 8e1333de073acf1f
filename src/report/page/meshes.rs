//! Everything that a page needs of its meshes, one mesh in memory at a time.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::Serialize;
use serde_json::{Value as Json, json};

use super::column::{self, Reference, columns};
use super::criteria::{self, Judged};
use super::outline::{CaseMesh, Outline, has_mesh};
use super::pack::Blobs;
use super::shown::{MeshData, shown};
use super::worst::{Worst, worst};
use super::{Library, MOST_BYTES, MOST_FACES};
use crate::mesh::geometry::triangle_angles;
use crate::mesh::{Facet, Soup, Surface};
use crate::metric::element::ElementMetric;
use crate::metric::{self, Measurement, element, quad_shape::quad_shape};
use crate::report::CaseReport;
use crate::report::picture::{self, ramp};
use crate::run::VERSION;
use crate::step::Artifact;
use crate::watch::Watch;

/// Size of the small pictures of steps, twice as fine as they are shown.
const PICTURE: [u32; 2] = [480, 360];

/// Values of all elements, for charts.
#[derive(Clone, Debug, Default)]
pub(super) struct Shapes {
    /// Of triangles, and of quads.
    pub(super) stretch: Vec<f64>,
    pub(super) size: Vec<f64>,
    /// Every angle of every face.
    pub(super) angles: Vec<f64>,
    /// Of quads.
    pub(super) jacobian: Vec<f64>,
}

/// What is known of one mesh.
#[derive(Clone, Debug, Default)]
pub(super) struct Gathered {
    /// By step; steps with equal results share their mesh.
    pub(super) meshes: BTreeMap<String, Arc<Known>>,
    /// Meshes as the viewer reads them, by content.
    data: BTreeMap<String, MeshData>,
    /// Packed arrays.
    pub(super) blobs: Blobs,
    /// The limit on faces that was applied.
    pub(super) limit: usize,
}

/// A mesh with what was found out about it.
#[derive(Clone, Debug)]
pub(super) struct Known {
    pub(super) content: String,
    pub(super) faces: usize,
    pub(super) shapes: Shapes,
    pub(super) worst: Vec<Worst>,
    pub(super) measurement: Measurement,
    /// A PNG file.
    pub(super) picture: Vec<u8>,
}

/// A mesh as steps, metrics and colours want it.
struct Mesh {
    soup: Arc<Soup>,
    surface: Option<Arc<Surface>>,
}

fn open(library: &dyn Library, content: &str) -> Option<Mesh> {
    let artifact = library.artifact(content)?;
    let soup = artifact.to_soup()?;
    let surface = match artifact {
        Artifact::Surface(surface) => Some(surface),
        Artifact::File(_)
        | Artifact::Soup(_)
        | Artifact::Hierarchy(_)
        | Artifact::Quads(_)
        | Artifact::Patches(_)
        | Artifact::Metrics(_) => None,
    };
    Some(Mesh { soup, surface })
}

/// Gathers all meshes of a case. The limit on faces falls until the arrays fit.
pub(super) fn gather(case: &CaseReport, outline: &Outline, library: &dyn Library) -> Gathered {
    let reference = open_reference(case, outline, library);
    let mut limit = MOST_FACES;
    let mut gathered = Gathered { limit, ..Gathered::default() };
    let mut known: BTreeMap<String, Arc<Known>> = BTreeMap::new();
    for step in case.steps.iter().filter(|step| has_mesh(step)) {
        let Some(content) = &step.content else { continue };
        if !known.contains_key(content)
            && let Some(found) = find_out(&step.name, content, library, reference.as_ref())
        {
            known.insert(content.clone(), Arc::new(found));
        }
        if let Some(found) = known.get(content) {
            gathered.meshes.insert(step.name.clone(), Arc::clone(found));
        }
    }
    for case in &outline.cases {
        let drawn = known.get(&case.content).cloned().or_else(|| draw(case, library).map(Arc::new));
        if let Some(found) = drawn {
            known.insert(case.content.clone(), Arc::clone(&found));
            gathered.meshes.insert(case.name.clone(), found);
        }
    }
    limit = first_limit(&gathered, outline);
    let judged = judged(case, library);
    let judged = Judges { judged: &judged, case };
    while pack(&mut gathered, outline, library, (reference.as_ref(), &judged), limit) > MOST_BYTES && limit > 1000 {
        limit /= 2;
    }
    gathered
}

fn open_reference(case: &CaseReport, outline: &Outline, library: &dyn Library) -> Option<Reference> {
    let name = outline.reference.as_ref()?;
    let content = case.steps.iter().find(|step| &step.name == name)?.content.clone()?;
    let tree = column::tree_of(&open(library, &content)?.soup)?;
    Some(Reference { step: name.clone(), content, tree })
}

/// A limit that leaves about enough room, so that meshes need not be packed twice as a rule.
fn first_limit(gathered: &Gathered, outline: &Outline) -> usize {
    /// Characters that a face takes with its colours, from experience.
    const BYTES_A_FACE: usize = 14;
    let faces: BTreeMap<&str, usize> = outline
        .shown
        .iter()
        .filter_map(|name| gathered.meshes.get(name))
        .map(|known| (known.content.as_str(), known.faces))
        .collect();
    let mut limit = MOST_FACES;
    while limit > 1000 && faces.values().map(|faces| BYTES_A_FACE * faces.min(&limit)).sum::<usize>() > MOST_BYTES {
        limit -= limit / 8;
    }
    limit
}

/// The little that is said of a case's result: its table says the rest.
fn draw(case: &CaseMesh, library: &dyn Library) -> Option<Known> {
    let mesh = open(library, &case.content)?;
    let note = format!("meshmill {VERSION}, {}", case.name);
    Some(Known {
        content: case.content.clone(),
        faces: mesh.soup.faces.len(),
        shapes: Shapes::default(),
        worst: worst(&mesh.soup, &columns(&mesh.soup, None, None)),
        measurement: Measurement::default(),
        picture: picture::png(&mesh.soup, PICTURE, &note).unwrap_or_default(),
    })
}

fn find_out(name: &str, content: &str, library: &dyn Library, reference: Option<&Reference>) -> Option<Known> {
    let mesh = open(library, content)?;
    let of_reference = reference.map(|reference| reference.content.as_str()).filter(|other| *other != content);
    let against = || of_reference.and_then(|other| open(library, other));
    let mut measure = || {
        let against = against();
        metric::measure(&mesh.soup, against.as_ref().map(|mesh| &*mesh.soup), &Watch::default()).ok()
    };
    let measurement = library.measurement(content, of_reference, &mut measure).unwrap_or_default();
    let note = format!("meshmill {VERSION}, {name}");
    Some(Known {
        content: content.to_owned(),
        faces: mesh.soup.faces.len(),
        shapes: shapes(&mesh.soup),
        worst: worst(&mesh.soup, &columns(&mesh.soup, None, reference)),
        measurement,
        picture: picture::png(&mesh.soup, PICTURE, &note).unwrap_or_default(),
    })
}

/// The standards that judged steps of a case, by step.
struct Judges<'a> {
    judged: &'a [(&'a str, Judged<'a>)],
    case: &'a CaseReport,
}

impl<'a> Judges<'a> {
    /// Those that judged this result, under whatever name of a step; each once.
    fn of(&self, content: &str) -> impl Iterator<Item = &'a Judged<'a>> {
        let is_of = |step: &str| {
            let found = self.case.steps.iter().find(|other| other.name == step);
            found.is_some_and(|step| step.content.as_deref() == Some(content))
        };
        let mut names: Vec<&str> = Vec::new();
        let mut all: Vec<&Judged<'_>> = Vec::new();
        for (step, judged) in self.judged {
            if is_of(step) && !names.contains(&judged.report.name.as_str()) {
                names.push(&judged.report.name);
                all.push(judged);
            }
        }
        all.into_iter()
    }
}

fn judged<'a>(case: &'a CaseReport, library: &dyn Library) -> Vec<(&'a str, Judged<'a>)> {
    let mut all = Vec::new();
    for gate in &case.gates {
        for report in &gate.criteria {
            let mut metrics = report.rows.iter().filter_map(|row| element::find(&row.metric));
            let compares = metrics.any(ElementMetric::needs_reference);
            let names = gate.references.iter().filter(|_| compares);
            let content = |name: &String| case.steps.iter().find(|step| step.name == *name)?.content.clone();
            let reference = names.filter_map(content).find_map(|content| open(library, &content));
            let reference = reference.map(|mesh| mesh.soup);
            all.push((gate.step.as_str(), Judged { report, reference }));
        }
    }
    all
}

/// Packs the meshes that are shown and gives the length of all arrays.
fn pack(
    gathered: &mut Gathered,
    outline: &Outline,
    library: &dyn Library,
    (reference, judges): (Option<&Reference>, &Judges<'_>),
    limit: usize,
) -> usize {
    let (mut blobs, mut packed) = (Blobs::default(), BTreeMap::<String, MeshData>::new());
    for known in outline.shown.iter().filter_map(|name| gathered.meshes.get(name)) {
        if !packed.contains_key(&known.content)
            && let Some(mesh) = open(library, &known.content)
        {
            let more = judges.of(&known.content).map(|judged| criteria::column(&mesh.soup, judged)).collect();
            let data = shown(&mesh.soup, mesh.surface.as_deref(), reference, more, limit).pack(&mut blobs);
            packed.insert(known.content.clone(), data);
        }
    }
    let length = blobs.len();
    (gathered.blobs, gathered.data, gathered.limit) = (blobs, packed, limit);
    length
}

fn shapes(mesh: &Soup) -> Shapes {
    let mut shapes = Shapes::default();
    for facet in &mesh.faces {
        match facet {
            Facet::Tri(corners) => {
                let corners = corners.map(|v| mesh.points[v]);
                shapes.stretch.push(crate::mesh::geometry::stretch(corners));
                shapes.size.push(crate::mesh::geometry::triangle_size(corners));
                shapes.angles.extend(triangle_angles(corners).map(f64::to_degrees));
            }
            Facet::Quad(corners) => {
                let corners = corners.map(|v| mesh.points[v]);
                let quad = quad_shape(corners);
                shapes.stretch.push(quad.stretch);
                shapes.size.push(quad.longest);
                shapes.jacobian.push(quad.scaled_jacobian);
                let angle = |i: usize| {
                    let (to, from) = (corners[(i + 1) % 4] - corners[i], corners[(i + 3) % 4] - corners[i]);
                    crate::mesh::geometry::angle(to, from).to_degrees()
                };
                shapes.angles.extend((0..4).map(angle));
            }
        }
    }
    shapes
}

/// What the viewer is told of a mesh.
#[derive(Serialize)]
struct Entry<'a> {
    name: &'a str,
    kind: &'a str,
    #[serde(flatten)]
    data: &'a MeshData,
    worst: &'a [Worst],
}

impl Gathered {
    /// Whether there is anything to turn about.
    pub(super) fn has_meshes(&self) -> bool {
        !self.data.is_empty()
    }

    /// The data of the viewer.
    pub(super) fn viewer(&self, outline: &Outline, case: &CaseReport) -> Json {
        let kind =
            |name: &str| case.steps.iter().find(|step| step.name == name).map_or("case", |step| step.kind.as_str());
        let entry = |name: &'_ String| {
            let known = self.meshes.get(name)?;
            let entry = Entry { name, kind: kind(name), data: self.data.get(&known.content)?, worst: &known.worst };
            serde_json::to_value(&entry).ok()
        };
        json!({
            "meshes": outline.shown.iter().filter_map(entry).collect::<Vec<Json>>(),
            "pair": outline.pair,
            "ramps": { "quality": ramp::QUALITY, "sequential": ramp::SEQUENTIAL, "diverging": ramp::DIVERGING },
        })
    }
}
