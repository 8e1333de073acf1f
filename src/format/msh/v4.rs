//! The sections of versions 4.0 and 4.1 that differ from version 2.
//!
//! Version 4.0 has the tag of an entity before its dimension, a box of six numbers at points too, node and element
//! numbers of 32 bits, each node's number beside its coordinates, and fewer counts.

use smallvec::SmallVec;

use super::super::error::FormatError;
use super::super::mixed::Input;
use super::element_type;
use super::model::Model;
use super::v2::{point, unknown};

/// `$Entities`: only the physical groups of each entity matter.
pub(super) fn entities(input: &mut Input<'_>, model: &mut Model<'_>) -> Result<(), FormatError> {
    input.end_line();
    for (dimension, count) in (0..).zip(entity_counts(input)?) {
        for _ in 0..count {
            let tag = input.int("the tag of an entity")?;
            let groups = bounds_and_groups(input, dimension, model.old)?;
            model.entity((dimension, tag), groups);
        }
    }
    Ok(())
}

/// `$PartitionedEntities`: pieces of entities, and the interfaces between them. A piece is in the groups of its own and
/// stands for the entity that it is a piece of; an interface is of a higher entity and stands for none.
pub(super) fn partitioned_entities(input: &mut Input<'_>, model: &mut Model<'_>) -> Result<(), FormatError> {
    input.end_line();
    input.size("a number of partitions")?;
    let ghosts = input.size("a number of ghost entities")?;
    for _ in 0..input.claim(ghosts, 4, 8, "ghost entities")? {
        input.int("the tag of a ghost entity")?;
        input.int("a partition")?;
    }
    for (dimension, count) in (0..).zip(entity_counts(input)?) {
        for _ in 0..count {
            let tag = input.int("the tag of an entity")?;
            let parent = (input.int("the dimension of a whole entity")?, input.int("the tag of a whole entity")?);
            let partitions = input.size("a number of partitions")?;
            for _ in 0..input.claim(partitions, 2, 4, "partitions")? {
                input.int("a partition")?;
            }
            let groups = bounds_and_groups(input, dimension, model.old)?;
            model.piece((dimension, tag), parent, groups);
        }
    }
    Ok(())
}

/// How many points, curves, surfaces and volumes follow.
fn entity_counts(input: &mut Input<'_>) -> Result<[usize; 4], FormatError> {
    let mut counts = [0; 4];
    for count in &mut counts {
        let announced = input.size("a number of entities")?;
        *count = input.claim(announced, 10, 36, "entities")?;
    }
    Ok(counts)
}

/// The physical groups of an entity; what bounds it is not used.
fn bounds_and_groups(input: &mut Input<'_>, dimension: i64, old: bool) -> Result<Vec<i64>, FormatError> {
    for _ in 0..if dimension == 0 && !old { 3 } else { 6 } {
        // Boxes of entities without nodes may be infinite.
        input.any_float("a bound of an entity")?;
    }
    let announced = input.size("a number of physical tags")?;
    let count = input.claim(announced, 2, 4, "physical tags")?;
    let mut groups = Vec::with_capacity(count);
    for _ in 0..count {
        groups.push(input.int("a physical tag")?);
    }
    if dimension > 0 {
        let announced = input.size("a number of bounding entities")?;
        for _ in 0..input.claim(announced, 2, 4, "bounding entities")? {
            input.int("the tag of a bounding entity")?;
        }
    }
    Ok(groups)
}

/// The head of a section: how many blocks there are.
fn blocks(input: &mut Input<'_>, what: &'static str, old: bool) -> Result<usize, FormatError> {
    input.end_line();
    let blocks = input.size("a number of blocks")?;
    for _ in 0..if old { 1 } else { 3 } {
        input.size(what)?;
    }
    input.claim(blocks, 8, 20, "blocks")
}

/// The dimension and the tag of a block's entity.
fn block_entity(input: &mut Input<'_>, old: bool) -> Result<(i64, i64), FormatError> {
    let first = input.int("a dimension or tag of an entity")?;
    let second = input.int("a dimension or tag of an entity")?;
    Ok(if old { (second, first) } else { (first, second) })
}

/// A node or element number.
fn number(input: &mut Input<'_>, what: &'static str, old: bool) -> Result<i64, FormatError> {
    if old { input.int(what) } else { input.size(what) }
}

/// `$Nodes`.
pub(super) fn nodes(input: &mut Input<'_>, model: &mut Model<'_>) -> Result<(), FormatError> {
    let old = model.old;
    for _ in 0..blocks(input, "a number of nodes", old)? {
        let (dimension, _) = block_entity(input, old)?;
        let parametric = input.int("whether nodes have parameters")? != 0;
        let announced = input.size("a number of nodes")?;
        let count = input.claim(announced, 8, if old { 28 } else { 32 }, "nodes")?;
        let place = input.place();
        let mut tags = Vec::with_capacity(if old { 0 } else { count });
        for _ in 0..if old { 0 } else { count } {
            tags.push(input.size("a node number")?);
        }
        let mut tags = tags.into_iter();
        for _ in 0..count {
            let tag = match tags.next() {
                Some(tag) => tag,
                None => input.int("a node number")?,
            };
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
    let old = model.old;
    for _ in 0..blocks(input, "a number of elements", old)? {
        let place = input.place();
        let entity = block_entity(input, old)?;
        let kind = input.int("an element type")?;
        let announced = input.size("a number of elements")?;
        let Some((_, nodes)) = element_type(kind) else { return Err(unknown(kind, place)) };
        let (whole, groups) = model.groups_of(entity, place)?;
        let bytes = if old { 4 + 4 * nodes } else { 8 + 8 * nodes };
        for _ in 0..input.claim(announced, 2 + 2 * nodes, bytes, "elements")? {
            let place = input.place();
            let tag = number(input, "an element number", old)?;
            let mut positions: SmallVec<[u32; 8]> = SmallVec::new();
            for _ in 0..nodes {
                let node = number(input, "a node number", old)?;
                positions.push(model.position(node, place)?);
            }
            let placed = model.element(tag, kind, whole, &positions)?;
            for &group in &groups {
                model.group(kind, group, &placed)?;
            }
        }
    }
    Ok(())
}
