//! The sections of version 4.1 that differ from version 2.

use smallvec::SmallVec;

use super::super::error::FormatError;
use super::super::mixed::Input;
use super::element_type;
use super::read::Model;
use super::v2::{point, unknown};

/// `$Entities`: only the physical groups of each entity matter.
pub(super) fn entities(input: &mut Input<'_>, model: &mut Model<'_>) -> Result<(), FormatError> {
    input.end_line();
    let mut counts = [0; 4];
    for count in &mut counts {
        let announced = input.size("a number of entities")?;
        *count = input.claim(announced, 10, 36, "entities")?;
    }
    for (dimension, count) in (0..).zip(counts) {
        for _ in 0..count {
            let tag = input.int("the tag of an entity")?;
            for _ in 0..if dimension == 0 { 3 } else { 6 } {
                // Boxes of entities without nodes may be infinite; they are not used.
                input.any_float("a bound of an entity")?;
            }
            let announced = input.size("a number of physical tags")?;
            let mut groups = Vec::with_capacity(input.claim(announced, 2, 4, "physical tags")?);
            for _ in 0..announced {
                groups.push(input.int("a physical tag")?);
            }
            model.physicals.insert((dimension, tag), groups);
            if dimension > 0 {
                let announced = input.size("a number of bounding entities")?;
                for _ in 0..input.claim(announced, 2, 4, "bounding entities")? {
                    input.int("the tag of a bounding entity")?;
                }
            }
        }
    }
    Ok(())
}

/// `$Nodes`.
pub(super) fn nodes(input: &mut Input<'_>, model: &mut Model<'_>) -> Result<(), FormatError> {
    input.end_line();
    let blocks = input.size("a number of blocks")?;
    for _ in 0..3 {
        input.size("a number of nodes")?;
    }
    for _ in 0..input.claim(blocks, 8, 20, "blocks of nodes")? {
        let dimension = input.int("a dimension")?;
        input.int("the tag of an entity")?;
        let parametric = input.int("whether nodes have parameters")? != 0;
        let announced = input.size("a number of nodes")?;
        let count = input.claim(announced, 8, 32, "nodes")?;
        let place = input.place();
        let mut tags = Vec::with_capacity(count);
        for _ in 0..count {
            tags.push(input.size("a node number")?);
        }
        for tag in tags {
            let point = point(input)?;
            for _ in 0..if parametric { dimension.clamp(0, 3) } else { 0 } {
                input.float("a parameter of a node")?;
            }
            model.node(tag, point, place)?;
        }
    }
    model.end_of_nodes();
    Ok(())
}

/// `$Elements`.
pub(super) fn elements(input: &mut Input<'_>, model: &mut Model<'_>) -> Result<(), FormatError> {
    input.end_line();
    let blocks = input.size("a number of blocks")?;
    for _ in 0..3 {
        input.size("a number of elements")?;
    }
    for _ in 0..input.claim(blocks, 8, 20, "blocks of elements")? {
        let dimension = input.int("a dimension")?;
        let entity = input.int("the tag of an entity")?;
        let place = input.place();
        let kind = input.int("an element type")?;
        let announced = input.size("a number of elements")?;
        let Some((_, nodes)) = element_type(kind) else { return Err(unknown(kind, place)) };
        let groups = model.physicals.get(&(dimension, entity)).cloned().unwrap_or_default();
        for _ in 0..input.claim(announced, 2 + 2 * nodes, 8 + 8 * nodes, "elements")? {
            let place = input.place();
            let tag = input.size("an element number")?;
            let mut positions: SmallVec<[u32; 8]> = SmallVec::new();
            for _ in 0..nodes {
                let node = input.size("a node number")?;
                positions.push(model.position(node, place)?);
            }
            let placed = model.element(tag, kind, entity, &positions)?;
            for &group in &groups {
                model.group(kind, group, &placed)?;
            }
        }
    }
    Ok(())
}
