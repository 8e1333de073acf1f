//! Which cards of bulk data may be passed over, and which may not.
//!
//! A card that makes, copies or mirrors grid points or elements is refused by name: passed over, it would leave another
//! mesh. Properties, materials, loads, constraints, matrices and tables are harmless. Elements that are not read, and
//! cards that are neither, are passed over and named. After MSC Software, "MSC Nastran Quick Reference Guide".

/// Cards that make geometry from other cards: generators, superelements, p-version geometry.
const MAKES_GEOMETRY: [&str; 14] = [
    "CGEN", "EGRID", "GRIDG", "GRIDD", "GRIDU", "GRIDMOD", "SEBULK", "SELOC", "SEMPLN", "CSUPER", "GMCURV", "GMSURF",
    "GRIDB", "RINGAX",
];

/// What the names of harmless cards begin with. No element is called so.
const BEGINS: [&str; 52] = [
    "P", "M", "D", "T", "B", "SE", "FORCE", "SPC", "LOAD", "EIG", "RB", "RROD", "RTRPLT", "RSPLINE", "RSSCON",
    "RJOINT", "RSCON", "RGYRO", "RANDPS", "RANDT1", "RCROSS", "RLOAD", "RFORCE", "RVDOF", "ASET", "QSET", "OMIT",
    "SUPORT", "USET", "GRAV", "ACCEL", "FREQ", "FLSYM", "FLUTTER", "FLFACT", "FLOAD", "FSI", "NLP", "NLS", "NLAUTO",
    "NLCYCL", "NOLIN", "AE", "AC", "AS", "SPLINE", "SLOAD", "VARVEL", "VIEW", "QBDY", "QHBDY", "QVOL",
];

/// Whole names of further harmless cards, and of elements without a side.
const NAMES: [&str; 44] = [
    "CELAS1", "CELAS2", "CELAS3", "CELAS4", "CDAMP1", "CDAMP2", "CDAMP3", "CDAMP4", "CDAMP5", "CMASS1", "CMASS2",
    "CMASS3", "CMASS4", "CBUSH", "CBUSH1D", "CBUSH2D", "CONM1", "CONM2", "CVISC", "CGAP", "CFAST", "CWELD", "CSEAM",
    "CONV", "CONVM", "CHBDYE", "CHBDYG", "CHBDYP", "CSET", "CSET1", "CREEP", "CBARAO", "SPOINT", "EPOINT", "SEQGP",
    "BAROR", "BEAMOR", "ENDDATA", "BEGIN", "VECTOR", "GENEL", "GUST", "ECHOON", "ECHOOFF",
];

/// What a card that is not read means for the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unread {
    /// Nothing.
    Harmless,
    /// It makes geometry.
    MakesGeometry,
    /// An element that is left out.
    Element,
    /// Nobody knows.
    Unknown,
}

/// Judges the name of a card that is not read. A name that begins with `=` or `*(` repeats the card before it.
pub(super) fn judge(name: &str) -> Unread {
    if MAKES_GEOMETRY.contains(&name) || name.starts_with('=') || name.starts_with("*(") {
        Unread::MakesGeometry
    } else if NAMES.contains(&name) || BEGINS.iter().any(|begin| name.starts_with(begin)) {
        Unread::Harmless
    } else if name.starts_with('C') && !name.starts_with("CAERO") && !name.starts_with("CAABSF") {
        Unread::Element
    } else if name.starts_with('C') {
        Unread::Harmless
    } else {
        Unread::Unknown
    }
}
