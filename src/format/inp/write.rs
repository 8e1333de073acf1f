//! Writes input files.

use std::collections::BTreeSet;

use super::super::element::{Elevated, elevate_for};
use super::super::error::{FormatError, Place, Reason};
use super::super::sets::face_sets;
use super::super::text::{push_integer, push_number};
use super::super::{Element, WriteOptions};
use crate::mesh::{Facet, Soup};

/// Both solvers take at most this many numbers on a line of a set.
const ON_A_LINE: usize = 16;
const LONGEST_NAME: usize = 80;
/// Abaqus takes numbers up to here, CalculiX twice as many.
const LAST_ID: u64 = 999_999_999;

/// Writes `soup`.
pub(super) fn write(soup: &Soup, options: &WriteOptions<'_>) -> Result<Vec<u8>, FormatError> {
    let elevated = elevate_for(soup, options);
    let first = options.first_id.unwrap_or(1);
    let nodes_in_all = soup.points.len() + elevated.as_ref().map_or(0, |e| e.points.len());
    let last = first.saturating_add(nodes_in_all.max(soup.faces.len()) as u64);
    if first == 0 || last > LAST_ID {
        let found = format!("{first} to {last}");
        let reason = Reason::Unexpected { expected: "numbers of nodes and elements from 1 to 999 999 999", found };
        return Err(
            FormatError::new(Place::File, reason).with_remedy("set `first-id` to a smaller number of at least 1")
        );
    }
    let mut out = Vec::with_capacity(64 * (soup.points.len() + soup.faces.len()));
    for line in options.header.lines() {
        text(&mut out, &format!("** {line}\n"));
    }
    if let Some(elevated) = elevated.as_ref().filter(|_| options.midside.is_some()) {
        let (straight, all) = (elevated.kept_straight, elevated.points.len());
        text(
            &mut out,
            &format!("** {straight} of {all} mid-side nodes kept straight, where the surface would fold an element\n"),
        );
    }
    nodes(&mut out, soup, elevated.as_ref(), first, options.precision);
    elements(&mut out, soup, elevated.as_ref(), first, options.element.unwrap_or(Element::S3));
    sets(&mut out, soup, first);
    Ok(out)
}

fn text(out: &mut Vec<u8>, text: &str) {
    out.extend_from_slice(text.as_bytes());
}

fn nodes(out: &mut Vec<u8>, soup: &Soup, elevated: Option<&Elevated>, first: u64, precision: Option<usize>) {
    text(out, "*NODE, NSET=Nall\n");
    let midside = elevated.iter().flat_map(|e| &e.points);
    for (id, point) in (first..).zip(soup.points.iter().chain(midside)) {
        push_integer(out, id);
        for axis in 0..3 {
            out.extend_from_slice(b", ");
            coordinate(out, point[axis], precision);
        }
        out.push(b'\n');
    }
}

/// A coordinate in at most 20 characters, which is as far as CalculiX reads; it would cut off an exponent.
fn coordinate(out: &mut Vec<u8>, value: f64, precision: Option<usize>) {
    const WIDEST: usize = 20;
    let start = out.len();
    push_number(out, value, precision);
    for digits in (12..=17).rev() {
        if out.len() - start <= WIDEST {
            return;
        }
        out.truncate(start);
        push_number(out, value, Some(digits));
    }
}

/// Elements keep the order of the faces; a card begins wherever the type changes.
fn elements(out: &mut Vec<u8>, soup: &Soup, elevated: Option<&Elevated>, first: u64, element: Element) {
    let mut current = "";
    for (i, face) in soup.faces.iter().enumerate() {
        let kind = match (face, element.is_quadratic()) {
            (Facet::Tri(_), false) => "S3",
            (Facet::Tri(_), true) => "S6",
            (Facet::Quad(_), false) => "S4",
            (Facet::Quad(_), true) => "S8R",
        };
        if kind != current {
            text(out, &format!("*ELEMENT, TYPE={kind}, ELSET=Eall\n"));
            current = kind;
        }
        push_integer(out, first + i as u64);
        let corners = face.corners();
        let midside = elevated.map_or(&[][..], |e| e.of(i, corners.len()));
        for node in corners.iter().map(|v| v.raw()).chain(midside.iter().copied()) {
            out.extend_from_slice(b", ");
            push_integer(out, first + u64::from(node));
        }
        out.push(b'\n');
    }
}

fn sets(out: &mut Vec<u8>, soup: &Soup, first: u64) {
    let mut names = Names::default();
    for (name, members) in face_sets(soup) {
        let name = names.elements(&name);
        text(out, &format!("*ELSET, ELSET={name}\n"));
        numbers(out, members.iter().map(|f| first + u64::from(f.raw())));
        text(out, &format!("*SURFACE, NAME={name}, TYPE=ELEMENT\n{name}, SPOS\n"));
    }
    for (name, members) in &soup.carried.groups.vertices {
        text(out, &format!("*NSET, NSET={}\n", names.nodes(name)));
        numbers(out, members.iter().map(|v| first + u64::from(v.raw())));
    }
    for (name, edges) in &soup.carried.groups.edges {
        let ends: BTreeSet<u32> = edges.iter().flatten().map(|v| v.raw()).collect();
        text(out, &format!("** nodes of the edges {name}\n*NSET, NSET={}\n", names.nodes(name)));
        numbers(out, ends.into_iter().map(|v| first + u64::from(v)));
    }
}

fn numbers(out: &mut Vec<u8>, numbers: impl Iterator<Item = u64>) {
    let mut on_line = 0;
    for number in numbers {
        if on_line > 0 {
            out.extend_from_slice(if on_line == ON_A_LINE { b",\n" } else { b", " });
        }
        on_line = on_line % ON_A_LINE + 1;
        push_integer(out, number);
    }
    out.push(b'\n');
}

/// Names that the solvers take, each once.
#[derive(Default)]
struct Names {
    nodes: BTreeSet<String>,
    elements: BTreeSet<String>,
}

impl Names {
    fn nodes(&mut self, name: &str) -> String {
        unique(&mut self.nodes, name)
    }

    fn elements(&mut self, name: &str) -> String {
        unique(&mut self.elements, name)
    }
}

fn unique(taken: &mut BTreeSet<String>, name: &str) -> String {
    let allowed = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
    let mut plain: String = name.chars().map(|c| if allowed(c) { c } else { '_' }).collect();
    if !plain.starts_with(|c: char| c.is_ascii_alphabetic()) {
        plain.insert_str(0, "S_");
    }
    plain.truncate(LONGEST_NAME);
    let mut candidate = plain.clone();
    let mut number = 2;
    while matches!(candidate.to_ascii_uppercase().as_str(), "EALL" | "NALL")
        || !taken.insert(candidate.to_ascii_uppercase())
    {
        let suffix = format!("_{number}");
        candidate = format!("{}{suffix}", &plain[..plain.len().min(LONGEST_NAME - suffix.len())]);
        number += 1;
    }
    candidate
}
