//! Reads a Gmsh file section by section into a model.

use super::super::ReadCounts;
use super::super::binary::ByteOrder;
use super::super::error::{FormatError, Reason, excerpt};
use super::super::mixed::Input;
use super::model::Model;
use super::{v2, v4};
use crate::mesh::{Soup, Support};
use crate::watch::Watch;

/// Sections that are not read and say nothing about the mesh.
const HARMLESS: [&[u8]; 6] =
    [b"Comments", b"GhostElements", b"Periodic", b"Parametrizations", b"InterpolationScheme", b"PostFormat"];

/// Reads a Gmsh file.
pub(super) fn read(bytes: &[u8], watch: &Watch) -> Result<(Soup, ReadCounts), FormatError> {
    let mut input = Input::new(bytes);
    let mut model = Model::new(watch);
    let version = mesh_format(&mut input)?;
    let version_4 = version != Version::Two;
    model.old = version == Version::Four;
    while let Some(word) = input.word() {
        let Some(name) = word.strip_prefix(b"$") else {
            return Err(FormatError::unexpected(input.place(), "the beginning of a section", word));
        };
        match name {
            b"PhysicalNames" => model.physical_names(&mut input)?,
            b"Entities" if version_4 => v4::entities(&mut input, &mut model)?,
            b"PartitionedEntities" if version_4 => v4::partitioned_entities(&mut input, &mut model)?,
            b"Nodes" if version_4 => v4::nodes(&mut input, &mut model)?,
            b"Elements" if version_4 => v4::elements(&mut input, &mut model)?,
            b"Nodes" => v2::nodes(&mut input, &mut model, false)?,
            b"ParametricNodes" => v2::nodes(&mut input, &mut model, true)?,
            b"Elements" => v2::elements(&mut input, &mut model)?,
            b"NodeData" => model.data(&mut input, Support::Vertex)?,
            b"ElementData" => model.data(&mut input, Support::Face)?,
            _ => {
                if !input.skip_behind(&[b"$End", name].concat()) {
                    return Err(FormatError::new(input.place(), Reason::Truncated { within: "a section" }));
                }
                if !HARMLESS.contains(&name) {
                    model.elements.counts.note(&format!("section `${}`", excerpt(name)));
                }
                continue;
            }
        }
        let end = input.need_word("a section")?;
        if end.strip_prefix(b"$End") != Some(name) {
            return Err(FormatError::unexpected(input.place(), "the end of the section", end));
        }
    }
    model.finish()
}

/// Versions as they differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Version {
    /// 2.0 to 2.2.
    Two,
    /// 4.0.
    Four,
    /// 4.1.
    FourOne,
}

/// Reads the head.
fn mesh_format(input: &mut Input<'_>) -> Result<Version, FormatError> {
    let first = input.need_word("the head")?;
    if first != b"$MeshFormat" {
        let error = FormatError::unexpected(input.place(), "$MeshFormat", first);
        return Err(match first {
            b"$NOD" => error.with_remedy("the file has version 1: save it in Gmsh anew: gmsh -save -format msh41 FILE"),
            _ => error,
        });
    }
    let version = input.need_word("the version")?;
    let version = match version {
        b"2" | b"2.0" | b"2.1" | b"2.2" => Version::Two,
        b"4" | b"4.0" => Version::Four,
        b"4.1" => Version::FourOne,
        other => {
            let what = format!("version {}", String::from_utf8_lossy(other));
            return Err(FormatError::new(input.place(), Reason::Unsupported(what))
                .with_remedy("save it in Gmsh as version 4.1 or 2.2: gmsh -save -format msh41 FILE"));
        }
    };
    let binary = input.text_integer("the file type")? == 1;
    let size = input.text_integer("the data size")?;
    if size != 8 {
        return Err(FormatError::new(input.place(), Reason::Unsupported(format!("a data size of {size}"))));
    }
    if binary {
        input.end_line();
        input.order = Some(ByteOrder::Little);
        input.order = match input.int("the mark of the byte order")? {
            1 => Some(ByteOrder::Little),
            0x0100_0000 => Some(ByteOrder::Big),
            other => {
                return Err(FormatError::unexpected(
                    input.place(),
                    "a one that tells the byte order",
                    other.to_string().as_bytes(),
                ));
            }
        };
    }
    match input.need_word("the head")? {
        b"$EndMeshFormat" => Ok(version),
        other => Err(FormatError::unexpected(input.place(), "$EndMeshFormat", other)),
    }
}
