//! Reads a mesh file.
//!
//! The format is told by the file's ending, else by its content; `format` overrides both. Nothing is repaired here:
//! points and faces come as the file has them, except that STL, which has no vertex numbers, is welded where
//! coordinates are identical, polygons with more than four corners are cut into triangles, and faces with fewer than
//! three corners are left out. Groups, regions and fields of the file are kept.
//!
//! Folklore; each format's own source stands in `format`.
//!
//! # Invariants
//! - Coordinates are finite, corners are in range.
//! - The same bytes give the same mesh.
//!
//! # Cost
//! Linear in the file.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::format::{self, Format, FormatError, Place, ReadCounts, Reason};
use crate::mesh::{Facet, Soup};
use crate::step::{
    Artifact, ElementRef, FileBytes, InputDef, Inputs, Locks, OutPort, OutputDef, Port, Produced, Step as StepContract,
    StepFailure,
};
use crate::watch::Watch;

/// Reads a mesh from a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct ReadParams {
    /// The file's format. Default: told by the file's ending, else by its content.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub format: Option<Format>,
    /// Every coordinate is multiplied by this number, for example 25.4 from inches to millimetres. Above 0; default 1.
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub scale: f64,
}

fn one() -> f64 {
    1.0
}

impl Default for ReadParams {
    fn default() -> Self {
        Self { format: None, scale: one() }
    }
}

/// What was read.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct ReadStats {
    /// The format the file was read as.
    pub format: Format,
    /// Vertices.
    pub points: usize,
    /// Triangles.
    pub triangles: usize,
    /// Quads.
    pub quads: usize,
    /// Named groups of faces, edges and vertices.
    pub groups: usize,
    /// Fields on vertices and faces.
    pub fields: usize,
    /// What reading did besides.
    #[serde(flatten)]
    pub counts: ReadCounts,
    /// All that the file has and the mesh has not, in words.
    pub left_out: Vec<String>,
}

/// Why a file was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReadError {
    /// The file is damaged or of an unknown format.
    #[error("{name}: {error}")]
    Format {
        /// The file's name.
        name: String,
        /// What and where.
        error: Box<FormatError>,
    },
    /// The scale is zero, negative or not finite.
    #[error("scale must be positive and finite, got {0}")]
    BadScale(f64),
    /// A coordinate is beyond the range of numbers after scaling.
    #[error("vertex {vertex} is no longer finite when it is scaled by {scale}")]
    ScaledTooFar {
        /// The vertex.
        vertex: usize,
        /// The scale.
        scale: f64,
    },
}

/// Reads `file`.
///
/// # Errors
/// [`ReadError::Format`] with the line or byte where the file is wrong, and the scale errors.
pub fn read(file: &FileBytes, params: &ReadParams, watch: &Watch) -> Result<(Soup, ReadStats), ReadError> {
    if !(params.scale > 0.0 && params.scale.is_finite()) {
        return Err(ReadError::BadScale(params.scale));
    }
    let (format, mut soup, counts) = read_format(file, params, watch)
        .map_err(|error| ReadError::Format { name: file.name.clone(), error: Box::new(error) })?;
    scale_points(&mut soup, params.scale)?;
    let stats = stats(format, &soup, counts);
    Ok((soup, stats))
}

fn read_format(
    file: &FileBytes,
    params: &ReadParams,
    watch: &Watch,
) -> Result<(Format, Soup, ReadCounts), FormatError> {
    let format = match params.format {
        Some(format) => format,
        None => Format::detect(&file.name, &file.bytes)?,
    };
    let (soup, counts) = format::read(format, &file.bytes, watch)?;
    Ok((format, soup, counts))
}

fn scale_points(soup: &mut Soup, scale: f64) -> Result<(), ReadError> {
    if scale == 1.0 {
        return Ok(());
    }
    for (vertex, point) in soup.points.iter_mut().enumerate() {
        *point *= scale;
        if !point.is_finite() {
            return Err(ReadError::ScaledTooFar { vertex, scale });
        }
    }
    Ok(())
}

fn stats(format: Format, soup: &Soup, counts: ReadCounts) -> ReadStats {
    let triangles = soup.faces.iter().filter(|f| matches!(f, Facet::Tri(_))).count();
    ReadStats {
        format,
        points: soup.points.len(),
        triangles,
        quads: soup.faces.len() - triangles,
        groups: soup.carried.groups.list().count(),
        fields: soup.carried.fields.len(),
        left_out: counts.left_out(),
        counts,
    }
}

impl From<ReadError> for StepFailure {
    fn from(error: ReadError) -> Self {
        let message = error.to_string();
        match error {
            ReadError::Format { error, .. } if error.reason == Reason::Cancelled => crate::watch::Cancelled.into(),
            ReadError::Format { error, .. } => {
                let failure = Self::bad_input(message).with_elements(place_element(error.place));
                match error.remedy {
                    Some(remedy) => failure.with_help(remedy),
                    None => failure,
                }
            }
            ReadError::BadScale(_) | ReadError::ScaledTooFar { .. } => {
                Self::bad_input(message).with_help("`scale` multiplies every coordinate: 25.4 turns inches into mm")
            }
        }
    }
}

fn place_element(place: Place) -> Vec<ElementRef> {
    let element = |kind: &str, id| vec![ElementRef { kind: kind.into(), id, at: None }];
    match place {
        Place::Line(line) => element("line", line),
        Place::Byte(byte) => element("byte", byte),
        Place::File => Vec::new(),
    }
}

/// The room's entry in the catalog.
pub struct Step;

impl StepContract for Step {
    const NAME: &'static str = "read";
    const REVISION: u32 = 4;
    const INPUTS: &'static [InputDef] =
        &[InputDef { name: "file", accepts: &[Port::File], required: true, doc: "the mesh file" }];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::Is(Port::Soup), derive: None }];
    const CARRIES: &'static str = "Takes groups, regions and fields from the file, as far as its format has them.";
    const EXAMPLE: &'static str = "use = \"read\"\nfile = \"=inputs.part\"\n";

    type Params = ReadParams;
    type Stats = ReadStats;

    fn run(
        inputs: &Inputs,
        _output: &str,
        params: &ReadParams,
        _locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<ReadStats>, StepFailure> {
        let Artifact::File(file) = inputs.require("file")? else {
            return Err(StepFailure::bad_input("the input `file` of `read` is not a file"));
        };
        let (soup, stats) = read(file, params, watch)?;
        Ok(Produced { artifact: Artifact::Soup(Arc::new(soup)), stats })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::step::FailureKind;

    const TRIANGLE: &str = "g Top\nv 0 0 0\nv 2 0 0\nv 0 2 0\nf 1 2 3\n";

    fn file(name: &str, text: &str) -> FileBytes {
        FileBytes { name: name.into(), bytes: text.as_bytes().to_vec() }
    }

    fn run(name: &str, text: &str, params: &ReadParams) -> Result<Produced<ReadStats>, StepFailure> {
        let inputs = Inputs::new(vec![("file", Artifact::File(Arc::new(file(name, text))))]);
        Step::run(&inputs, "main", params, &Locks::default(), &Watch::silent())
    }

    #[test]
    fn scale_multiplies_every_coordinate_and_stats_say_what_was_read() {
        let params = ReadParams { scale: 25.4, ..ReadParams::default() };
        let (soup, stats) = read(&file("part.OBJ", TRIANGLE), &params, &Watch::silent()).expect("a triangle");
        assert_eq!(soup.points.as_slice()[1].to_array(), [50.8, 0.0, 0.0]);
        assert_eq!((stats.format, stats.points, stats.triangles, stats.groups), (Format::Obj, 3, 1, 1));
    }

    #[test]
    fn the_format_parameter_overrides_the_ending() {
        let params = ReadParams { format: Some(Format::Obj), ..ReadParams::default() };
        assert!(run("part.stl", TRIANGLE, &params).is_ok());
        let failure = run("part.stl", TRIANGLE, &ReadParams::default()).expect_err("no STL");
        assert_eq!(
            failure.help.as_deref(),
            Some("the content looks like OBJ: name the file so, or give `format = \"obj\"` to `read`")
        );
    }

    #[test]
    fn a_damaged_file_is_bad_input_with_its_line() {
        let failure = run("part.obj", "v 0 0 0\nv 1 x 0\n", &ReadParams::default()).expect_err("a wrong number");
        assert_eq!(failure.kind, FailureKind::BadInput);
        assert_eq!(failure.message, "part.obj: OBJ, line 2: expected a coordinate, found \"x\"");
        assert_eq!(failure.elements, [ElementRef { kind: "line".into(), id: 2, at: None }]);
    }

    #[test]
    fn a_scale_that_is_no_size_is_refused() {
        for scale in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let params = ReadParams { scale, ..ReadParams::default() };
            assert_eq!(run("part.obj", TRIANGLE, &params).map(|_| ()).map_err(|f| f.kind), Err(FailureKind::BadInput));
        }
        let params = ReadParams { scale: 1e300, ..ReadParams::default() };
        let far = file("part.obj", &TRIANGLE.replace("v 2", "v 2e10"));
        assert_eq!(read(&far, &params, &Watch::silent()), Err(ReadError::ScaledTooFar { vertex: 1, scale: 1e300 }));
    }
}
