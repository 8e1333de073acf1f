//! Gmsh meshes (`.msh`), versions 2.2, 4.0 and 4.1, text and binary.
//!
//! Layout after C. Geuzaine, J.-F. Remacle: Gmsh, a 3-D finite element mesh generator with built-in pre- and
//! post-processing facilities, International Journal for Numerical Methods in Engineering 79, 2009, and the file format
//! chapter of Gmsh's reference manual.
//!
//! Reading: triangles and quads of any order become faces (only corners are used), lines edges, points vertices;
//! volumes are left out, except where there is nothing else: then their skin is the mesh, with their groups. A physical
//! group becomes a face, edge or vertex group after its dimension, `physical_TAG` where it has no name. A file without
//! physical groups gives its elementary entities as groups: `surface_TAG` where there are several surfaces, and
//! `curve_TAG`. In version 2 an element of several groups is written once for each of them: elements of equal nodes and
//! entity in different groups are one face. The pieces of a partitioned mesh count as the entities that they are pieces
//! of; elements of an entity that the file does not define are an error. Node numbers may have gaps and any order;
//! parameters of nodes are skipped. `NodeData` and `ElementData` become fields, of several time steps the last one.
//!
//! Writing: version 4.1 (`msh`) or 2.2 (`msh22`). Faces in the same groups are one entity; groups and regions are
//! physical groups with names. In version 4.1 faces of no group are the physical group `(no group)` where there are
//! groups at all, since some readers (meshio 5) want all elements in groups or none, and Gmsh itself saves only what is
//! in one; reading takes it back. Faces keep their order. Fields are written padded with zeros to 3 or 9 components,
//! the widths that Gmsh knows; wider ones, marks and pins are not written.
//!
//! Linear in the size of the file.

/// The physical group of faces that are in none.
const NO_GROUP: &str = "(no group)";

mod model;
mod read;
mod v2;
mod v4;
mod write;

use super::FormatDef;

/// Version 4.1.
pub(super) const DEF: FormatDef =
    FormatDef { name: "msh", title: "Gmsh", endings: &["msh"], sniff, read: read::read, write: write::write_v4 };

/// Version 2.2, for programs that do not read 4.1; reading takes both.
pub(super) const DEF_22: FormatDef =
    FormatDef { name: "msh22", title: "Gmsh 2.2", endings: &["msh2"], sniff, read: read::read, write: write::write_v2 };

fn sniff(bytes: &[u8]) -> bool {
    bytes.trim_ascii_start().starts_with(b"$MeshFormat")
}

/// Element types with their dimension and number of nodes.
const ELEMENT_TYPES: [(i64, u8, usize); 38] = [
    (15, 0, 1),
    (1, 1, 2),
    (8, 1, 3),
    (26, 1, 4),
    (27, 1, 5),
    (28, 1, 6),
    (2, 2, 3),
    (9, 2, 6),
    (20, 2, 9),
    (21, 2, 10),
    (23, 2, 15),
    (24, 2, 12),
    (25, 2, 21),
    (3, 2, 4),
    (16, 2, 8),
    (10, 2, 9),
    (36, 2, 16),
    (37, 2, 25),
    (38, 2, 36),
    (39, 2, 12),
    (40, 2, 16),
    (41, 2, 20),
    (4, 3, 4),
    (5, 3, 8),
    (6, 3, 6),
    (7, 3, 5),
    (11, 3, 10),
    (12, 3, 27),
    (13, 3, 18),
    (14, 3, 14),
    (17, 3, 20),
    (18, 3, 15),
    (19, 3, 13),
    (29, 3, 20),
    (30, 3, 35),
    (31, 3, 56),
    (92, 3, 64),
    (93, 3, 125),
];

/// The dimension and the number of nodes of an element type.
fn element_type(number: i64) -> Option<(u8, usize)> {
    ELEMENT_TYPES.iter().find(|&&(n, ..)| n == number).map(|&(_, dimension, nodes)| (dimension, nodes))
}

/// The corners of a three-dimensional element type.
fn volume_corners(number: i64) -> usize {
    match number {
        4 | 11 | 29..=31 => 4,
        7 | 14 | 19 => 5,
        6 | 13 | 18 => 6,
        _ => 8,
    }
}

/// Whether a two-dimensional element type has four corners.
fn is_quad(number: i64) -> bool {
    matches!(number, 3 | 10 | 16 | 36..=41)
}
