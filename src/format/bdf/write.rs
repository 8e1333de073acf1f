//! Writes bulk data.

use std::io::Write;

use super::super::WriteOptions;
use super::super::element::elevate_for;
use super::super::error::{FormatError, Place, Reason};
use super::super::sets::partition;
use super::super::text::{push_name, push_number};
use crate::mesh::{Facet, Soup};

/// The largest number that fits a short field.
const LAST_ID: u64 = 99_999_999;

pub(super) fn write(soup: &Soup, options: &WriteOptions<'_>) -> Result<Vec<u8>, FormatError> {
    let elevated = elevate_for(soup, options);
    let midside = elevated.as_ref().map_or(&[][..], |e| &e.points);
    let first = options.first_id.unwrap_or(1);
    let most = (soup.points.len() + midside.len()).max(soup.faces.len()) as u64;
    if first == 0 || first.saturating_add(most) > LAST_ID {
        let found = format!("{first} to {}", first.saturating_add(most));
        let reason = Reason::Unexpected { expected: "numbers from 1 to 99 999 999", found };
        return Err(FormatError::new(Place::File, reason).with_remedy("set `first-id` to a smaller number"));
    }
    let mut out = Vec::with_capacity(96 * soup.points.len() + 48 * soup.faces.len() + 256);
    for line in options.header.lines() {
        out.extend_from_slice(b"$ ");
        push_name(&mut out, line, false);
        out.push(b'\n');
    }
    out.extend_from_slice(b"BEGIN BULK\n");
    for (id, point) in (first..).zip(soup.points.iter().chain(midside)) {
        let [x, y, z] = point.to_array().map(|c| coordinate(c, options.precision));
        push(&mut out, format_args!("GRID*   {id:>16}{:16}{x:>16}{y:>16}\n*       {z:>16}\n", ""));
    }
    let mut property_of = vec![0; soup.faces.len()];
    for (property, (name, faces)) in (1..).zip(partition(soup)) {
        push(&mut out, format_args!("$HMNAME PROP {property:>12}\""));
        // The name ends at the next quote.
        push_name(&mut out, &name.replace('"', "'"), false);
        out.extend_from_slice(b"\"\n");
        for face in faces {
            property_of[face.index()] = property;
        }
    }
    for ((face, facet), property) in soup.faces.iter().enumerate().zip(property_of) {
        let sides = elevated.as_ref().map_or(&[][..], |e| e.of(face, facet.corners().len()));
        push_element(&mut out, first, face, facet, property, sides);
    }
    out.extend_from_slice(b"ENDDATA\n");
    Ok(out)
}

fn push_element(out: &mut Vec<u8>, first: u64, face: usize, facet: &Facet, property: u32, sides: &[u32]) {
    let kind = match (facet, sides.is_empty()) {
        (Facet::Tri(_), true) => "CTRIA3",
        (Facet::Tri(_), false) => "CTRIA6",
        (Facet::Quad(_), true) => "CQUAD4",
        (Facet::Quad(_), false) => "CQUAD8",
    };
    push(out, format_args!("{kind:<8}{:>8}{property:>8}", first + face as u64));
    let nodes = facet.corners().iter().map(|v| v.raw()).chain(sides.iter().copied());
    for (position, node) in nodes.enumerate() {
        // Six nodes fit the first line after the two numbers.
        out.extend_from_slice(if position == 6 { b"\n        " } else { b"" });
        push(out, format_args!("{:>8}", first + u64::from(node)));
    }
    out.push(b'\n');
}

fn push(out: &mut Vec<u8>, text: std::fmt::Arguments<'_>) {
    let written = out.write_fmt(text);
    debug_assert!(written.is_ok(), "writing to memory does not fail");
}

/// A real number in at most 16 characters; it must have a point.
fn coordinate(value: f64, precision: Option<usize>) -> String {
    const WIDEST: usize = 16;
    let mut text = String::new();
    for digits in std::iter::once(precision).chain((1..=16).rev().map(Some)) {
        let mut raw = Vec::new();
        push_number(&mut raw, value, digits);
        text = with_point(&String::from_utf8_lossy(&raw));
        if text.len() <= WIDEST {
            break;
        }
    }
    text
}

fn with_point(text: &str) -> String {
    let (mantissa, exponent) = text.split_once('e').map_or((text, None), |(m, e)| (m, Some(e)));
    let mut mantissa = if mantissa.contains('.') { mantissa.to_owned() } else { format!("{mantissa}.") };
    if mantissa.trim_start_matches('-').starts_with("0.") && mantissa.trim_start_matches('-').len() > 2 {
        mantissa = mantissa.replacen("0.", ".", 1);
    }
    match exponent {
        Some(exponent) => format!("{mantissa}E{exponent}"),
        None => mantissa,
    }
}
