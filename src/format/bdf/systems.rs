//! Coordinate systems of a deck: grid points given in them become points of the basic system.
//!
//! Source: MSC Nastran Quick Reference Guide, `CORD1R`, `CORD1C`, `CORD1S`, `CORD2R`, `CORD2C`, `CORD2S`. A system has
//! an origin A, a point B on its z axis and a point C in its half plane of x and z: three grid points (`CORD1x`), or
//! nine numbers in another system (`CORD2x`). Coordinates are x, y, z; or r, θ, z; or r, θ from the z axis, φ; angles
//! in degrees. Systems may be defined in any order and in each other, not in a circle. Cost: each system is found once.

use std::collections::BTreeMap;

use glam::DVec3;
use libm::{cos, sin};

use super::cards::Card;
use crate::format::{FormatError, Place, Reason};

/// Systems may lie in each other so deep; real decks go two or three deep.
const DEEPEST: usize = 100;

/// What the three coordinates mean.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Rectangular,
    Cylindrical,
    Spherical,
}

/// How a system is given.
#[derive(Clone, Debug)]
enum Given {
    Grids([i64; 3]),
    Points { within: i64, points: [DVec3; 3] },
}

#[derive(Clone, Debug)]
struct Definition {
    kind: Kind,
    given: Given,
    line: u64,
}

/// A system in basic coordinates.
#[derive(Clone, Copy, Debug)]
struct Frame {
    kind: Kind,
    origin: DVec3,
    axes: [DVec3; 3],
}

impl Frame {
    /// The basic system.
    const BASIC: Self = Self { kind: Kind::Rectangular, origin: DVec3::ZERO, axes: DVec3::AXES };

    fn basic(&self, p: DVec3) -> DVec3 {
        let (second, third) = (p.y.to_radians(), p.z.to_radians());
        let local = match self.kind {
            Kind::Rectangular => p,
            Kind::Cylindrical => DVec3::new(p.x * cos(second), p.x * sin(second), p.z),
            Kind::Spherical => p.x * DVec3::new(sin(second) * cos(third), sin(second) * sin(third), cos(second)),
        };
        self.origin + local.x * self.axes[0] + local.y * self.axes[1] + local.z * self.axes[2]
    }

    /// The frame through an origin, a point on z and a point in the plane of x and z; `None` where these lie on a line.
    fn through(kind: Kind, [a, b, c]: [DVec3; 3]) -> Option<Self> {
        let z = (b - a).try_normalize()?;
        let y = z.cross(c - a).try_normalize()?;
        Some(Self { kind, origin: a, axes: [y.cross(z), y, z] })
    }
}

/// A grid point as its card gives it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    pub(super) point: DVec3,
    /// The number of its system; `None` where the card leaves it to the default of all.
    pub(super) system: Option<i64>,
    pub(super) line: u64,
}

/// The systems of a deck, and the default that `GRDSET` sets.
#[derive(Debug, Default)]
pub(super) struct Systems {
    given: BTreeMap<i64, Definition>,
    found: BTreeMap<i64, Frame>,
    default: Option<i64>,
}

impl Systems {
    /// Takes a card that defines systems or the default; false where it is another card.
    pub(super) fn card(&mut self, card: &Card) -> Result<bool, FormatError> {
        let kind = match card.name.as_bytes() {
            b"GRDSET" => {
                let system = card.integer(1, "a coordinate system")?.unwrap_or(0);
                if self.default.is_some_and(|before| before != system) {
                    let what = "a second GRDSET, with another coordinate system,".to_owned();
                    return Err(FormatError::new(card.place(), Reason::Unsupported(what)));
                }
                self.default = Some(system);
                return Ok(true);
            }
            [b'C', b'O', b'R', b'D', b'1' | b'2', kind] => match kind {
                b'R' => Kind::Rectangular,
                b'C' => Kind::Cylindrical,
                b'S' => Kind::Spherical,
                _ => return Err(unsupported(card)),
            },
            [b'C', b'O', b'R', b'D', ..] => return Err(unsupported(card)),
            _ => return Ok(false),
        };
        if card.name.as_bytes()[4] == b'1' {
            // One card may define two.
            for first in [0, 4] {
                let Some(id) = card.integer(first, "a coordinate system")? else { continue };
                let mut grids = [0; 3];
                for (position, grid) in grids.iter_mut().enumerate() {
                    *grid = required(card, first + 1 + position, "a grid number")?;
                }
                self.define(id, Definition { kind, given: Given::Grids(grids), line: card.line })?;
            }
        } else {
            let id = required(card, 0, "a coordinate system")?;
            let within = card.integer(1, "a coordinate system")?.unwrap_or(0);
            let mut points = [DVec3::ZERO; 3];
            for position in 0..9 {
                points[position / 3][position % 3] = card.number(2 + position, "a coordinate")?;
            }
            self.define(id, Definition { kind, given: Given::Points { within, points }, line: card.line })?;
        }
        Ok(true)
    }

    fn define(&mut self, id: i64, definition: Definition) -> Result<(), FormatError> {
        let place = Place::Line(definition.line);
        match self.given.insert(id, definition) {
            None => Ok(()),
            Some(_) => Err(FormatError::new(place, Reason::Duplicate { what: "coordinate system", id })),
        }
    }

    /// The grid points in the basic system. `grid` finds a point by its number.
    pub(super) fn place(
        mut self,
        grids: &[Grid],
        grid: &dyn Fn(i64) -> Option<usize>,
    ) -> Result<Vec<DVec3>, FormatError> {
        let mut points = Vec::with_capacity(grids.len());
        for given in grids {
            let point = self.point(*given, grids, grid, 0)?;
            if !point.is_finite() {
                let (what, found) = ("a coordinate in the basic system", point.to_string());
                return Err(FormatError::new(Place::Line(given.line), Reason::NotFinite { what, found }));
            }
            points.push(point);
        }
        Ok(points)
    }

    fn point(
        &mut self,
        given: Grid,
        grids: &[Grid],
        grid: &dyn Fn(i64) -> Option<usize>,
        depth: usize,
    ) -> Result<DVec3, FormatError> {
        let frame = self.frame(given.system.or(self.default).unwrap_or(0), given.line, grids, grid, depth)?;
        Ok(frame.basic(given.point))
    }

    fn frame(
        &mut self,
        id: i64,
        line: u64,
        grids: &[Grid],
        grid: &dyn Fn(i64) -> Option<usize>,
        depth: usize,
    ) -> Result<Frame, FormatError> {
        if id == 0 {
            return Ok(Frame::BASIC);
        }
        if let Some(frame) = self.found.get(&id) {
            return Ok(*frame);
        }
        let place = Place::Line(line);
        let missing = |what, id| {
            FormatError::new(place, Reason::Unsupported(format!("{what} {id}, which the file does not define,")))
        };
        let definition = self.given.get(&id).cloned().ok_or_else(|| missing("coordinate system", id))?;
        if depth > DEEPEST {
            let what = format!("coordinate system {id}, defined in itself or more than {DEEPEST} deep,");
            return Err(FormatError::new(Place::Line(definition.line), Reason::Unsupported(what)));
        }
        let points = match definition.given {
            Given::Grids(numbers) => {
                let mut points = [DVec3::ZERO; 3];
                for (point, number) in points.iter_mut().zip(numbers) {
                    let at = grid(number).ok_or_else(|| missing("grid point", number))?;
                    *point = self.point(grids[at], grids, grid, depth + 1)?;
                }
                points
            }
            Given::Points { within, points } => {
                let outer = self.frame(within, definition.line, grids, grid, depth + 1)?;
                points.map(|p| outer.basic(p))
            }
        };
        let frame = Frame::through(definition.kind, points).ok_or_else(|| {
            let what = format!("coordinate system {id}, whose three points lie on a line,");
            FormatError::new(Place::Line(definition.line), Reason::Unsupported(what))
        })?;
        self.found.insert(id, frame);
        Ok(frame)
    }
}

fn required(card: &Card, position: usize, what: &'static str) -> Result<i64, FormatError> {
    card.integer(position, what)?.ok_or_else(|| FormatError::unexpected(card.place(), what, b""))
}

fn unsupported(card: &Card) -> FormatError {
    FormatError::new(card.place(), Reason::Unsupported(format!("`{}`", card.name)))
        .with_remedy("export in the basic coordinate system")
}
