//! Bytes to mesh and back, one file a format, reader and writer together. Opens no files itself.
//!
//! Every reader takes any bytes: damage gives a [`FormatError`] with its place and never a panic, and no count in a
//! file makes a reader allocate more than the file could hold. A format is one entry here and one file: a variant of
//! [`Format`], an arm in `Format::def`, a `FormatDef` beside its reader and writer.

mod bdf;
mod binary;
mod builder;
mod counts;
mod csv;
mod element;
mod error;
mod group_text;
pub mod include;
mod inp;
mod kept;
mod mixed;
mod msh;
mod obj;
mod off;
mod ply;
mod polygon;
mod sets;
mod skin;
mod stl;
mod text;
mod vtk;
mod vtu;
mod weld;

use glam::DVec3;
use serde::{Deserialize, Serialize};

pub use counts::ReadCounts;
pub use error::{FormatError, Place, Reason};
pub use kept::{groups_not_kept, not_kept};
pub use sets::welded_seams;

use crate::mesh::Soup;
use crate::watch::Watch;

/// A file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Format {
    /// Stereolithography, text or binary.
    Stl,
    /// Wavefront OBJ.
    Obj,
    /// Polygon file format, Stanford PLY.
    Ply,
    /// Geomview's object file format.
    Off,
    /// VTK XML, unstructured grids; reading takes polygonal data as well.
    Vtu,
    /// VTK XML, polygonal data; reading takes unstructured grids as well.
    Vtp,
    /// Abaqus and CalculiX input.
    Inp,
    /// Gmsh 4.1; reading takes 2.2 as well.
    Msh,
    /// Gmsh 2.2.
    Msh22,
    /// Nastran bulk data.
    Bdf,
    /// Legacy VTK.
    Vtk,
    /// Comma-separated points with values, no faces.
    Csv,
}

/// What a format is and does; one beside each reader and writer.
struct FormatDef {
    /// The name in recipes and on the command line.
    name: &'static str,
    /// The name in messages.
    title: &'static str,
    /// File endings without the dot, lower case; the first one is the usual one.
    endings: &'static [&'static str],
    /// Whether the content looks like this format. Only the distinctive first bytes count.
    sniff: fn(&[u8]) -> bool,
    read: fn(&[u8], &Watch) -> ReadResult,
    write: fn(&Soup, &WriteOptions<'_>) -> Result<Vec<u8>, FormatError>,
}

/// The mesh of a file, and what the reader did besides reading; or why there is none.
pub type ReadResult = Result<(Soup, ReadCounts), FormatError>;

/// Shell elements of solver formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub enum Element {
    /// Triangle with 3 nodes; a quad becomes an S4.
    S3,
    /// Triangle with 6 nodes; a quad becomes an S8R.
    S6,
    /// Quad with 4 nodes; a triangle becomes an S3.
    S4,
    /// Quad with 8 nodes, reduced integration; a triangle becomes an S6.
    S8R,
}

impl Element {
    /// Whether edges carry a mid-side node.
    pub fn is_quadratic(self) -> bool {
        matches!(self, Self::S6 | Self::S8R)
    }
}

/// How a file is written.
#[derive(Clone, Default)]
pub struct WriteOptions<'a> {
    /// The element type of solver formats; without it, linear shells.
    pub element: Option<Element>,
    /// Where a mid-side node lies, given the middle of its edge; without it, the middle itself.
    pub midside: Option<&'a (dyn Fn(DVec3) -> DVec3 + Sync)>,
    /// Binary, where the format has both.
    pub binary: bool,
    /// Significant digits of text numbers; without it, as many as reading back exactly takes.
    pub precision: Option<usize>,
    /// The number of the first node and element of solver formats; without it, 1.
    pub first_id: Option<u64>,
    /// Version and artifact key, written as a comment where the format has comments.
    pub header: String,
}

impl std::fmt::Debug for WriteOptions<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("WriteOptions")
            .field("element", &self.element)
            .field("midside", &self.midside.is_some())
            .field("binary", &self.binary)
            .field("precision", &self.precision)
            .field("first_id", &self.first_id)
            .field("header", &self.header)
            .finish()
    }
}

impl Format {
    /// All formats.
    pub const ALL: &'static [Self] = &[
        Self::Stl,
        Self::Obj,
        Self::Ply,
        Self::Off,
        Self::Vtu,
        Self::Vtp,
        Self::Inp,
        Self::Msh,
        Self::Msh22,
        Self::Bdf,
        Self::Vtk,
        Self::Csv,
    ];

    fn def(self) -> &'static FormatDef {
        match self {
            Self::Stl => &stl::DEF,
            Self::Obj => &obj::DEF,
            Self::Ply => &ply::DEF,
            Self::Off => &off::DEF,
            Self::Vtu => &vtu::DEF,
            Self::Vtp => &vtu::DEF_POLYGONAL,
            Self::Inp => &inp::DEF,
            Self::Msh => &msh::DEF,
            Self::Msh22 => &msh::DEF_22,
            Self::Bdf => &bdf::DEF,
            Self::Vtk => &vtk::DEF,
            Self::Csv => &csv::DEF,
        }
    }

    /// The name in recipes and on the command line: `stl`.
    pub fn name(self) -> &'static str {
        self.def().name
    }

    /// The name in messages: `STL`.
    pub fn title(self) -> &'static str {
        self.def().title
    }

    /// File endings without the dot, the usual one first.
    pub fn endings(self) -> &'static [&'static str] {
        self.def().endings
    }

    /// Whether a file is binary where nobody says otherwise: wherever the format has it, but for OFF, whose binary kind
    /// few programs read.
    pub fn is_binary_by_default(self) -> bool {
        self != Self::Off
    }

    /// Whether a file holds elements with mid-side nodes.
    pub fn holds_second_order(self) -> bool {
        matches!(self, Self::Vtu | Self::Inp | Self::Msh | Self::Msh22 | Self::Bdf | Self::Vtk)
    }

    /// The format that the ending of a file name tells, in any case.
    pub fn from_file_name(file_name: &str) -> Option<Self> {
        let (_, ending) = file_name.rsplit_once('.')?;
        Self::ALL.iter().copied().find(|f| f.endings().iter().any(|e| e.eq_ignore_ascii_case(ending)))
    }

    /// The format that the content looks like.
    pub fn from_content(bytes: &[u8]) -> Option<Self> {
        let text = text::without_mark(bytes);
        Self::ALL.iter().copied().find(|f| (f.def().sniff)(text))
    }

    /// The format of a file: by its ending, else by its content.
    pub fn detect(file_name: &str, bytes: &[u8]) -> Result<Self, FormatError> {
        Self::from_file_name(file_name).or_else(|| Self::from_content(bytes)).ok_or_else(|| {
            let known: Vec<&str> = Self::ALL.iter().flat_map(|f| f.endings()).copied().collect();
            FormatError::new(Place::File, Reason::Unknown)
                .with_remedy(format!("name the format, or use one of the endings {}", known.join(", ")))
        })
    }
}

/// Reads a mesh.
///
/// # Errors
/// Where the file is damaged, with the line or byte; when `watch` is cancelled.
pub fn read(format: Format, bytes: &[u8], watch: &Watch) -> ReadResult {
    let binary_stl = format == Format::Stl && stl::binary_size_fits(bytes);
    if !binary_stl && text::is_utf16(bytes) {
        return Err(FormatError::new(Place::File, Reason::Unsupported("UTF-16".to_owned()))
            .in_format(format)
            .with_remedy("the file is UTF-16: save it as UTF-8"));
    }
    let bytes = if binary_stl { bytes } else { text::without_mark(bytes) };
    (format.def().read)(bytes, watch).map_err(|error| {
        let mut error = error.in_format(format);
        if let (true, Place::Line(line)) = (format.has_includes(), error.place) {
            let (included, line) = include::locate(bytes, line);
            (error.included, error.place) = (included, Place::Line(line));
        }
        match Format::from_content(bytes) {
            Some(other) if other != format && error.reason != Reason::Cancelled => {
                let (title, name) = (other.title(), other.name());
                error.with_remedy(format!(
                    "the content looks like {title}: name the file so, or give `format = \"{name}\"` to `read`"
                ))
            }
            _ => error,
        }
    })
}

/// Writes a mesh, its seams welded again. Equal meshes and options give equal bytes.
///
/// # Errors
/// When the format cannot say what the mesh is.
pub fn write(format: Format, soup: &Soup, options: &WriteOptions<'_>) -> Result<Vec<u8>, FormatError> {
    (format.def().write)(&welded_seams(soup), options).map_err(|error| error.in_format(format))
}
