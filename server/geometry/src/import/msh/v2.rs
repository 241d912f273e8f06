//! Sections of MSH 2.2: every element names its type and its groups.

use nalgebra::Point3;

use super::MshContent;
use super::elements::Element;
use super::reader::Reader;
use crate::import::assemble::READ;
use crate::import::error::{DAMAGED, Fault, fault};

/// `$Nodes`: a count as text, then tag and position of every node.
pub(super) fn read_nodes(content: &mut MshContent, reader: &mut Reader<'_>) -> Result<(), Fault> {
    let n_nodes = reader.count_line()?;
    let room = reader.room_for(n_nodes, 8);
    content.points.reserve(room);
    content.point_of_tag.reserve(room);
    for _ in 0..n_nodes {
        let tag = tag(reader)?;
        let x = Point3::new(reader.number()?, reader.number()?, reader.number()?);
        content.add_point(reader, tag, x)?;
    }
    reader.end_section("Nodes")
}

/// `$Elements`: a count as text, then the elements; in binary files in runs of one type and one number of group tags.
pub(super) fn read_elements(content: &mut MshContent, reader: &mut Reader<'_>) -> Result<(), Fault> {
    let n_elements = reader.count_line()?;
    content.cells.reserve(reader.room_for(n_elements, 8));
    let mut n_read = 0;
    while n_read < n_elements {
        n_read += if reader.is_binary() { read_run(content, reader)? } else { read_one(content, reader)? };
    }
    reader.end_section("Elements")
}

/// `type count n_tags`, then `tag groups.. nodes..` of each.
fn read_run(content: &mut MshContent, reader: &mut Reader<'_>) -> Result<u64, Fault> {
    let element = element(reader)?;
    let n_in_run = count(reader)?;
    let n_tags = count(reader)?;
    for _ in 0..n_in_run {
        let number = tag(reader)?;
        read_rest(content, reader, element, number, n_tags)?;
    }
    Ok(n_in_run)
}

/// `tag type n_tags groups.. nodes..`
fn read_one(content: &mut MshContent, reader: &mut Reader<'_>) -> Result<u64, Fault> {
    let number = tag(reader)?;
    let element = element(reader)?;
    let n_tags = count(reader)?;
    read_rest(content, reader, element, number, n_tags)?;
    Ok(1)
}

/// Group tags, the first of which is the physical group, and nodes.
fn read_rest(
    content: &mut MshContent,
    reader: &mut Reader<'_>,
    element: &'static Element,
    number: u64,
    n_tags: u64,
) -> Result<(), Fault> {
    let mut physical = 0;
    for i in 0..n_tags {
        let group = reader.number::<i32>()?;
        physical = if i == 0 { group } else { physical };
    }
    let mut nodes = vec![0; element.n_nodes];
    for node in &mut nodes {
        *node = tag(reader)?;
    }
    content.add_element(reader, element, number, &nodes, &[physical])
}

fn element(reader: &mut Reader<'_>) -> Result<&'static Element, Fault> {
    let code = reader.number::<i32>()?;
    match Element::by_code(code) {
        Some(element) => Ok(element),
        None => fault(reader.place(), format!("element type {code} is not known"), format!("{READ} are read")),
    }
}

fn tag(reader: &mut Reader<'_>) -> Result<u64, Fault> {
    count(reader)
}

/// A non-negative number stored as a signed one.
fn count(reader: &mut Reader<'_>) -> Result<u64, Fault> {
    let number = reader.number::<i32>()?;
    match u64::try_from(number) {
        Ok(number) => Ok(number),
        Err(_) => fault(reader.place(), format!("{number} where a number from 0 is expected"), DAMAGED),
    }
}
