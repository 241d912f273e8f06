//! VTK's unstructured grids in XML (`.vtu`): text, base64 or raw data, inline or appended, plain or compressed.
//!
//! Kept beside vtkio, which writes these files in `export`: vtkio is a release candidate, and errors here carry place,
//! cause and advice like those of all mesh imports.

mod arrays;
mod blocks;
mod cells;
mod numbers;

use std::collections::BTreeMap;

use nalgebra::Point3;
use roxmltree::Node;

use super::assemble::{Content, Labels};
use super::error::{DAMAGED, Fault, Place, fault};
use arrays::{Array, Source};

/// Largest number of different values of an array that names groups.
const MAX_VALUES: usize = 256;
/// Largest number of points or cells.
const MAX_COUNT: u64 = 100_000_000;

pub(super) fn parse(bytes: &[u8]) -> Result<Content, Fault> {
    let (head, appended) = arrays::split_appended(bytes);
    let Ok(text) = std::str::from_utf8(&head) else {
        return fault(Place::File, "is not UTF-8 text", DAMAGED);
    };
    let document = roxmltree::Document::parse(text)
        .map_err(|e| Fault::new(Place::Line(e.pos().row as usize), format!("is not well-formed XML: {e}"), DAMAGED))?;
    let source = Source::new(document.root_element(), appended)?;
    let piece = find_piece(&document)?;
    let n_points = count(piece, "NumberOfPoints")?;
    let n_cells = count(piece, "NumberOfCells")?;
    let points = read_points(&source, piece, n_points)?;
    let cells = cells::read(&source, piece, n_points, n_cells)?;
    let mut labels = Labels::default();
    for (i, name) in group_names(&source, piece, "CellData", n_cells)? {
        labels.add(name, cells[i].shape.dimension(), i);
    }
    let mut point_labels: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (i, name) in group_names(&source, piece, "PointData", n_points)? {
        point_labels.entry(name).or_default().push(i);
    }
    let point_labels = point_labels.into_iter().collect();
    Ok(Content { points, cells, cell_labels: labels.into_vec(), point_labels })
}

fn find_piece<'a, 'input>(document: &'a roxmltree::Document<'input>) -> Result<Node<'a, 'input>, Fault> {
    let root = document.root_element();
    let kind = root.attribute("type").unwrap_or_default();
    if root.tag_name().name() != "VTKFile" || kind != "UnstructuredGrid" {
        let problem = format!("holds `{}` of type `{kind}`, not an unstructured grid", root.tag_name().name());
        return fault(
            arrays::place(root, "VTKFile"),
            problem,
            "save the mesh as VTK unstructured grid (.vtu) of hexahedra",
        );
    }
    let mut pieces = document.descendants().filter(|node| node.has_tag_name("Piece"));
    match (pieces.next(), pieces.count()) {
        (Some(piece), 0) => Ok(piece),
        (first, others) => {
            let problem = format!("holds {} pieces, one is read", others + usize::from(first.is_some()));
            fault(Place::File, problem, "merge them: in ParaView save with one process, or `meshio convert`")
        }
    }
}

fn count(piece: Node<'_, '_>, name: &str) -> Result<usize, Fault> {
    let text = piece.attribute(name).unwrap_or_default();
    match text.trim().parse::<u64>() {
        Ok(n) if n <= MAX_COUNT => Ok(n as usize),
        _ => fault(arrays::place(piece, name), format!("`{text}` is not a number up to {MAX_COUNT}"), DAMAGED),
    }
}

fn child<'a, 'input>(piece: Node<'a, 'input>, name: &str) -> Result<Node<'a, 'input>, Fault> {
    match piece.children().find(|node| node.has_tag_name(name)) {
        Some(node) => Ok(node),
        None => fault(arrays::place(piece, "Piece"), format!("has no <{name}>"), DAMAGED),
    }
}

fn read_points(source: &Source<'_>, piece: Node<'_, '_>, n_points: usize) -> Result<Vec<Point3<f64>>, Fault> {
    let node = child(piece, "Points")?;
    let Some(array) = Array::all(node).next() else {
        return fault(arrays::place(node, "Points"), "has no DataArray", DAMAGED);
    };
    let values = source.numbers(&array, n_points, 3)?;
    Ok(values.chunks_exact(3).map(|x| Point3::new(x[0], x[1], x[2])).collect())
}

/// Group of each entry of every array with one component and few different values.
fn group_names(source: &Source<'_>, piece: Node<'_, '_>, table: &str, n: usize) -> Result<Vec<(usize, String)>, Fault> {
    let tables = piece.children().filter(|node| node.has_tag_name(table));
    let arrays = tables.flat_map(Array::all).filter(|array| array.n_components() == 1 && array.is_numeric());
    let mut names = Vec::new();
    for array in arrays {
        let values = source.numbers(&array, n, 1)?;
        if let Some(known) = few_values(&values) {
            let name =
                |value: &f64| known.get(&value.to_bits()).cloned().map(|value| format!("{}={value}", array.name()));
            names.extend(values.iter().enumerate().filter_map(|(i, value)| Some((i, name(value)?))));
        }
    }
    Ok(names)
}

/// Different values as text; `None` if there are too many.
fn few_values(values: &[f64]) -> Option<BTreeMap<u64, String>> {
    let mut known = BTreeMap::new();
    for value in values {
        known.entry(value.to_bits()).or_insert_with(|| value.to_string());
        if known.len() > MAX_VALUES {
            return None;
        }
    }
    Some(known)
}
