//! Abaqus and CalculiX input files (`.inp`): nodes, shell elements, and the sets and surfaces on them.
//!
//! Keywords after Dassault Systèmes, Abaqus Keywords Reference Guide, and G. Dhondt, CalculiX CrunchiX User's Manual.
//!
//! Reading: all three- and four-sided elements of shells, membranes, plane and rigid families become faces, of a
//! second-order element only the corners are used; beams and trusses become edges, masses vertices, where a set names
//! them; other elements are left out and counted. `*ELSET` becomes a face group (and an edge group where it holds
//! beams), `*NSET` a vertex group, `*SURFACE` a face group, of nodes a vertex group, of element sides `E1` to `E4` an
//! edge group. Sets may list numbers, ranges (`GENERATE`) and other sets. Names are compared without regard to case,
//! and keep the case of their first use. Parts have numbers of their own. Each instance of a part is moved, then
//! turned, and has the sets of the part; where sets of two instances have one name, it follows the name of the instance
//! and a point. A set named `Eall` or `Nall` that holds everything is no group. `*INCLUDE` is followed where files are
//! opened (see `format::include`), and refused here. So are cards that make, copy or move nodes or elements, by name:
//! passed over, they would leave another mesh. Cards that are neither read nor known to be harmless are passed over and
//! named.
//!
//! Writing: nodes, elements by type in the set `Eall`, an `*ELSET` and a `*SURFACE` (positive side) for each face group
//! and region, an `*NSET` for each vertex group and for the nodes of each edge group, since no solver agrees with
//! another on sets of edges. Names are cut to what both solvers take: letters, digits, `_`, `-`, `.`, 80 characters at
//! most, the first a letter; two that become equal are numbered.
//! A coordinate has at most 20 characters, as far as CalculiX reads, which rounds some beyond their 13th digit. Fields
//! are not written.
//!
//! Linear in the size of the file; sets may hold at most 64 times as many members as there are nodes and elements.

mod elements;
mod harmless;
mod instance;
mod read;
mod scope;
mod sets;
mod write;

use super::FormatDef;

pub(super) const DEF: FormatDef = FormatDef {
    name: "inp",
    title: "Abaqus/CalculiX input",
    endings: &["inp"],
    sniff,
    read: read::read,
    write: write::write,
};

fn sniff(bytes: &[u8]) -> bool {
    let start = bytes[..bytes.len().min(4096)].to_ascii_uppercase();
    start.starts_with(b"*") && start.windows(5).any(|w| w == b"*NODE" || w == b"*HEAD" || w == b"*PART")
}
