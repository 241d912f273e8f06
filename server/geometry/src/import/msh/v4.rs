//! Sections of MSH 4.1: entities carry the physical groups, nodes and elements come in blocks by entity.

use nalgebra::Point3;

use super::MshContent;
use super::elements::Element;
use super::reader::Reader;
use crate::import::assemble::READ;
use crate::import::error::{DAMAGED, Fault, fault};

/// `$Entities`: points, curves, surfaces, volumes, each with its box, physical groups and boundary.
pub(super) fn read_entities(content: &mut MshContent, reader: &mut Reader<'_>) -> Result<(), Fault> {
    let mut counts = [0; 4];
    for count in &mut counts {
        *count = reader.number::<u64>()?;
    }
    for (dimension, count) in (0..).zip(counts) {
        for _ in 0..count {
            let tag = reader.number::<i32>()?;
            let n_coordinates = if dimension == 0 { 3 } else { 6 };
            for _ in 0..n_coordinates {
                reader.number::<f64>()?;
            }
            let physical = read_tags(reader)?;
            content.physical_of_entity.insert((dimension, tag), physical);
            if dimension > 0 {
                read_tags(reader)?;
            }
        }
    }
    reader.end_section("Entities")
}

/// A count, then that many numbers.
fn read_tags(reader: &mut Reader<'_>) -> Result<Vec<i32>, Fault> {
    let n = reader.number::<u64>()?;
    (0..n).map(|_| reader.number()).collect()
}

/// `$Nodes`: per block first the tags, then the positions, each followed by parameters where the block says so.
pub(super) fn read_nodes(content: &mut MshContent, reader: &mut Reader<'_>) -> Result<(), Fault> {
    let [n_blocks, n_nodes, _, _] = read_header(reader)?;
    let room = reader.room_for(n_nodes, 8);
    content.points.reserve(room);
    content.point_of_tag.reserve(room);
    for _ in 0..n_blocks {
        let dimension = reader.number::<i32>()?;
        let _entity = reader.number::<i32>()?;
        let is_parametric = reader.number::<i32>()? != 0;
        let n_in_block = reader.number::<u64>()?;
        let mut tags = Vec::with_capacity(reader.room_for(n_in_block, 2));
        for _ in 0..n_in_block {
            tags.push(reader.number::<u64>()?);
        }
        let n_parameters = if is_parametric { dimension.clamp(0, 3) } else { 0 };
        for tag in tags {
            let x = Point3::new(reader.number()?, reader.number()?, reader.number()?);
            for _ in 0..n_parameters {
                reader.number::<f64>()?;
            }
            content.add_point(reader, tag, x)?;
        }
    }
    reader.end_section("Nodes")
}

/// `$Elements`: per block the entity and the type, then every element's tag and nodes.
pub(super) fn read_elements(content: &mut MshContent, reader: &mut Reader<'_>) -> Result<(), Fault> {
    let [n_blocks, n_elements, _, _] = read_header(reader)?;
    content.cells.reserve(reader.room_for(n_elements, 8));
    for _ in 0..n_blocks {
        let entity = (reader.number::<i32>()?, reader.number::<i32>()?);
        let code = reader.number::<i32>()?;
        let n_in_block = reader.number::<u64>()?;
        let Some(element) = Element::by_code(code) else {
            return fault(reader.place(), format!("element type {code} is not known"), format!("{READ} are read"));
        };
        let groups = content.physical_of_entity.get(&entity).cloned().unwrap_or_default();
        let mut tags = vec![0; element.n_nodes];
        for _ in 0..n_in_block {
            let number = reader.number()?;
            for tag in &mut tags {
                *tag = reader.number::<u64>()?;
            }
            content.add_element(reader, element, number, &tags, &groups)?;
        }
    }
    reader.end_section("Elements")
}

/// Numbers of blocks and entries, least and largest tag.
fn read_header(reader: &mut Reader<'_>) -> Result<[u64; 4], Fault> {
    let header = [reader.number()?, reader.number()?, reader.number()?, reader.number()?];
    if header[1] > u64::from(u32::MAX) {
        return fault(reader.place(), format!("{} nodes or elements", header[1]), DAMAGED);
    }
    Ok(header)
}
