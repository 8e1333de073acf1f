//! Resolves a [`Sizing`] on a surface: one length, or lengths at the corners of its faces.

use super::failure::StepFailure;
use super::length::Sizing;
use crate::mesh::{Support, Surface};

/// Lengths on a surface.
#[derive(Clone, Debug, PartialEq)]
pub enum ResolvedSizing {
    /// The same everywhere.
    Uniform(f64),
    /// At the three corners of each face.
    Corners(Vec<[f64; 3]>),
}

impl ResolvedSizing {
    /// The smallest length anywhere.
    pub fn least(&self) -> f64 {
        match self {
            Self::Uniform(length) => *length,
            Self::Corners(values) => values.iter().flatten().copied().fold(f64::INFINITY, f64::min),
        }
    }
}

impl Sizing {
    /// The lengths on `surface`; percents refer to `diagonal`.
    ///
    /// # Errors
    /// A field or face group that the surface does not carry, and field values that are no positive lengths.
    pub fn resolve(&self, surface: &Surface, diagonal: f64) -> Result<ResolvedSizing, StepFailure> {
        match self {
            Self::Uniform(length) => Ok(ResolvedSizing::Uniform(length.resolve(diagonal))),
            Self::Field(name) => from_field(surface, name),
            Self::Groups { default, groups } => {
                let mut values = vec![[default.resolve(diagonal); 3]; surface.faces.len()];
                let mut named = vec![false; surface.faces.len()];
                for (name, length) in groups {
                    let members = surface.carried.groups.faces.get(name).ok_or_else(|| unknown_group(surface, name))?;
                    let length = length.resolve(diagonal);
                    for f in members {
                        let old = values[f.index()][0];
                        let least = if named[f.index()] { old.min(length) } else { length };
                        values[f.index()] = [least; 3];
                        named[f.index()] = true;
                    }
                }
                Ok(ResolvedSizing::Corners(values))
            }
        }
    }
}

fn from_field(surface: &Surface, name: &str) -> Result<ResolvedSizing, StepFailure> {
    let carried = &surface.carried;
    let field = carried.field(Support::Vertex, name).or_else(|| carried.field(Support::Face, name));
    let Some(field) = field else {
        let known: Vec<&str> = carried.fields.iter().map(|f| f.name.as_str()).collect();
        let help = if known.is_empty() { "the mesh carries no field".to_owned() } else { known.join(", ") };
        return Err(StepFailure::failed(format!("there is no field `{name}`")).with_help(help));
    };
    if field.components != 1 || field.values.iter().any(|x| !(x.is_finite() && *x > 0.0)) {
        return Err(StepFailure::failed(format!("the field `{name}` does not hold one positive length an element")));
    }
    let at = |index: usize| field.values.get(index).copied().unwrap_or(f64::INFINITY);
    let corners = surface.faces.enumerate().map(|(f, corners)| match field.support {
        Support::Vertex => corners.map(|v| at(v.index())),
        Support::Face => [at(f.index()); 3],
    });
    Ok(ResolvedSizing::Corners(corners.collect()))
}

fn unknown_group(surface: &Surface, name: &str) -> StepFailure {
    let known: Vec<&str> = surface.carried.groups.faces.keys().map(String::as_str).collect();
    StepFailure::failed(format!("there is no face group `{name}`"))
        .with_help(format!("face groups: {}", if known.is_empty() { "none".to_owned() } else { known.join(", ") }))
}
