//! Gmsh's MSH files, versions 4.1 and 2.2, ASCII and binary \[GR09\].

mod elements;
mod reader;
mod v2;
mod v4;

use std::collections::HashMap;

use nalgebra::Point3;

use super::assemble::{Cell, Content, Labels, MAX_NODES, READ, Shape};
use super::error::{DAMAGED, Fault, Place, fault};
use elements::{Element, Kind};
use reader::Reader;

/// Content of the file read so far.
#[derive(Default)]
struct MshContent {
    points: Vec<Point3<f64>>,
    point_of_tag: HashMap<u64, u32>,
    cells: Vec<Cell>,
    labels: Labels,
    /// Names of physical groups by dimension and number.
    names: HashMap<(i32, i32), String>,
    /// MSH 4.1: physical groups of each entity by dimension and number.
    physical_of_entity: HashMap<(i32, i32), Vec<i32>>,
    /// Number of unused elements by type.
    unsupported: Vec<(&'static Element, usize)>,
}

/// Most bytes before `$MeshFormat`.
const LONGEST_COMMENT: usize = 1 << 16;

/// Supported version.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Version {
    V2,
    V4,
}

/// Whether a file is Gmsh's: its first section is `$MeshFormat`, or comments come before.
pub(super) fn is_msh(bytes: &[u8]) -> bool {
    const FORMAT: &[u8] = b"$MeshFormat";
    let begin = &bytes[..bytes.len().min(LONGEST_COMMENT)];
    bytes.starts_with(b"$") || begin.windows(FORMAT.len()).any(|window| window == FORMAT)
}

pub(super) fn parse(bytes: &[u8]) -> Result<Content, Fault> {
    let mut reader = Reader::new(bytes);
    let version = read_format(&mut reader)?;
    let mut content = MshContent::default();
    while let Some(section) = reader.next_section()? {
        match (section, version) {
            ("PhysicalNames", _) => content.read_names(&mut reader)?,
            ("PartitionedEntities", _) => {
                let advice = "save the mesh unpartitioned: Mesh > Unpartition, then export";
                return fault(reader.place(), "the mesh is partitioned", advice);
            }
            ("Entities", Version::V4) => v4::read_entities(&mut content, &mut reader)?,
            ("Nodes", Version::V4) => v4::read_nodes(&mut content, &mut reader)?,
            ("Elements", Version::V4) => v4::read_elements(&mut content, &mut reader)?,
            ("Nodes", Version::V2) => v2::read_nodes(&mut content, &mut reader)?,
            ("Elements", Version::V2) => v2::read_elements(&mut content, &mut reader)?,
            _ => reader.skip_section(section)?,
        }
    }
    content.refuse_unsupported()?;
    Ok(Content {
        points: content.points,
        cells: content.cells,
        cell_labels: content.labels.into_vec(),
        point_labels: Vec::new(),
        pieces: Vec::new(),
        cell_vectors: Vec::new(),
    })
}

/// `$MeshFormat`: version, ASCII or binary, size of numbers, byte order.
fn read_format(reader: &mut Reader<'_>) -> Result<Version, Fault> {
    reader.skip_comments()?;
    match reader.next_section()? {
        Some("MeshFormat") => {}
        Some(first) => return fault(reader.place(), format!("begins with ${first} in place of $MeshFormat"), DAMAGED),
        None => return fault(reader.place(), "has no $MeshFormat", DAMAGED),
    }
    let line = reader.line()?;
    let words: Vec<&str> = line.split_ascii_whitespace().collect();
    let [version, mode, size] = words[..] else {
        return fault(reader.place(), format!("`{line}` is not a version, a mode and a size"), DAMAGED);
    };
    let known = match version {
        "2" | "2.0" | "2.1" | "2.2" => Version::V2,
        "4.1" => Version::V4,
        _ => {
            let advice = "versions 4.1 and 2.2 are read: in Gmsh set Mesh.MshFileVersion = 4.1 and export again";
            return fault(reader.place(), format!("MSH version {version}"), advice);
        }
    };
    if !["0", "1"].contains(&mode) || size != "8" {
        return fault(reader.place(), format!("mode {mode}, number size {size}; 0 or 1, and 8 are read"), DAMAGED);
    }
    if mode == "1" {
        reader.start_binary()?;
    }
    reader.end_section("MeshFormat")?;
    Ok(known)
}

impl MshContent {
    /// `$PhysicalNames`: a count, then `dimension number "name"` on a line each; text in binary files too.
    fn read_names(&mut self, reader: &mut Reader<'_>) -> Result<(), Fault> {
        let n_names = reader.count_line()?;
        for _ in 0..n_names {
            let line = reader.line()?;
            let named = line.split_once('"').and_then(|(numbers, rest)| Some((numbers, rest.rsplit_once('"')?.0)));
            let numbers: Vec<i32> = named.iter().flat_map(|(n, _)| n.split_whitespace()).flat_map(str::parse).collect();
            let (Some((_, name)), [dimension, number]) = (named, &numbers[..]) else {
                return fault(reader.place(), format!("`{line}` is not a dimension, a number and a \"name\""), DAMAGED);
            };
            self.names.insert((*dimension, *number), name.to_owned());
        }
        reader.end_section("PhysicalNames")
    }

    fn add_point(&mut self, reader: &Reader<'_>, tag: u64, x: Point3<f64>) -> Result<(), Fault> {
        let point = self.points.len() as u32;
        if self.point_of_tag.insert(tag, point).is_some() {
            return fault(reader.place(), format!("node {tag} is given twice"), DAMAGED);
        }
        self.points.push(x);
        Ok(())
    }

    /// Adds an element by its nodes, with its physical groups.
    fn add_element(
        &mut self,
        reader: &Reader<'_>,
        element: &'static Element,
        number: u64,
        tags: &[u64],
        groups: &[i32],
    ) -> Result<(), Fault> {
        let Kind::Supported(shape) = element.kind else {
            self.count_unsupported(element);
            return Ok(());
        };
        let mut nodes = [0; MAX_NODES];
        for (k, tag) in tags[..shape.n_nodes()].iter().enumerate() {
            let Some(&point) = self.point_of_tag.get(tag) else {
                let problem = format!("element {number} names node {tag}, which the file does not give");
                return fault(reader.place(), problem, DAMAGED);
            };
            nodes[elements::place(shape, k)] = point;
        }
        self.cells.push(Cell { shape, nodes, number });
        self.label_last(shape, groups);
        Ok(())
    }

    fn label_last(&mut self, shape: Shape, groups: &[i32]) {
        let cell = self.cells.len() - 1;
        for &group in groups.iter().filter(|group| **group != 0) {
            let dimension = i32::from(shape.dimension());
            let name = self.names.get(&(dimension, group.saturating_abs()));
            let name = name.cloned().unwrap_or_else(|| group.saturating_abs().to_string());
            self.labels.add(name, shape.dimension(), cell);
        }
    }

    fn count_unsupported(&mut self, element: &'static Element) {
        match self.unsupported.iter_mut().find(|(known, _)| known.code == element.code) {
            Some((_, count)) => *count += 1,
            None => self.unsupported.push((element, 1)),
        }
    }

    /// Refuses volumes that are not read: leaving them out would make holes.
    fn refuse_unsupported(&self) -> Result<(), Fault> {
        let Some((element, count)) = self.unsupported.first() else { return Ok(()) };
        let problem = format!("holds {count} {}; {READ} are read", element.name);
        fault(Place::Field("$Elements".into(), None), problem, element.advice())
    }
}
