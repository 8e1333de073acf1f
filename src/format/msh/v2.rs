//! The sections of version 2.2 that differ from version 4.

use glam::DVec3;
use rustc_hash::FxHashMap;
use smallvec::SmallVec;

use super::super::element::Placed;
use super::super::error::{FormatError, Place, Reason};
use super::super::mixed::Input;
use super::element_type;
use super::model::Model;

/// `$Nodes` or `$ParametricNodes`.
pub(super) fn nodes(input: &mut Input<'_>, model: &mut Model<'_>, parametric: bool) -> Result<(), FormatError> {
    let count = input.text_integer("a number of nodes")?;
    input.end_line();
    let count = input.claim(count, 8, 28, "nodes")?;
    for _ in 0..count {
        let place = input.place();
        let tag = input.int("a node number")?;
        let point = point(input)?;
        if parametric {
            let dimension = input.int("the dimension of a node's entity")?;
            input.int("the tag of a node's entity")?;
            for _ in 0..if matches!(dimension, 1 | 2) { dimension } else { 0 } {
                input.float("a parameter of a node")?;
            }
        }
        model.node(tag, point, place)?;
    }
    model.end_of_nodes();
    Ok(())
}

/// Three coordinates.
pub(super) fn point(input: &mut Input<'_>) -> Result<DVec3, FormatError> {
    let mut next = || input.float("a coordinate");
    Ok(DVec3::new(next()?, next()?, next()?))
}

/// An element's place and the physical groups it was found in.
type Found = (Placed, SmallVec<[i64; 2]>);

/// Elements by their first nodes, type and entity: the same one may come once for each of its groups.
#[derive(Default)]
struct Seen(FxHashMap<([u32; 4], i64, i64), Found>);

/// `$Elements`.
pub(super) fn elements(input: &mut Input<'_>, model: &mut Model<'_>) -> Result<(), FormatError> {
    let count = input.text_integer("a number of elements")?;
    input.end_line();
    let mut left = input.claim(count, 6, 8, "elements")?;
    let mut seen = Seen::default();
    while left > 0 {
        if input.order.is_none() {
            let tag = input.int("an element number")?;
            let kind = input.int("an element type")?;
            let tags = input.int("a number of tags")?;
            element(input, model, &mut seen, [tag, kind, tags])?;
            left -= 1;
            continue;
        }
        let kind = input.int("an element type")?;
        let place = input.place();
        let block = input.int("a number of elements")?;
        let tags = input.int("a number of tags")?;
        let Some(block) = usize::try_from(block).ok().filter(|&b| b > 0 && b <= left) else {
            return Err(FormatError::unexpected(
                place,
                "a number of elements within the section",
                block.to_string().as_bytes(),
            ));
        };
        for _ in 0..block {
            let tag = input.int("an element number")?;
            element(input, model, &mut seen, [tag, kind, tags])?;
        }
        left -= block;
    }
    Ok(())
}

fn element(
    input: &mut Input<'_>,
    model: &mut Model<'_>,
    seen: &mut Seen,
    [tag, kind, tags]: [i64; 3],
) -> Result<(), FormatError> {
    let place = input.place();
    let (mut physical, mut entity) = (0, 0);
    for i in 0..tags {
        let value = input.int("a tag")?;
        match i {
            0 => physical = value,
            1 => entity = value,
            _ => {}
        }
    }
    let Some((_, nodes)) = element_type(kind) else { return Err(unknown(kind, place)) };
    let mut positions: SmallVec<[u32; 8]> = SmallVec::new();
    for _ in 0..nodes {
        let node = input.int("a node number")?;
        positions.push(model.position(node, place)?);
    }
    if physical == 0 {
        model.element(tag, kind, Some(entity), &positions)?;
        return Ok(());
    }
    let mut key = [u32::MAX; 4];
    key.iter_mut().zip(&positions).for_each(|(k, &p)| *k = p);
    if let Some((placed, groups)) = seen.0.get_mut(&(key, kind, entity)).filter(|(_, g)| !g.contains(&physical)) {
        groups.push(physical);
        model.group(kind, physical, placed)?;
        return Ok(());
    }
    let placed = model.element(tag, kind, Some(entity), &positions)?;
    model.group(kind, physical, &placed)?;
    seen.0.insert((key, kind, entity), (placed, smallvec::smallvec![physical]));
    Ok(())
}

/// The error for an element type whose number of nodes is not known.
pub(super) fn unknown(kind: i64, place: Place) -> FormatError {
    FormatError::new(place, Reason::Unsupported(format!("element type {kind}")))
        .with_remedy("save the mesh with elements of first or second order")
}
