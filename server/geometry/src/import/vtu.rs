//! VTK's unstructured grids in XML (`.vtu`): text, base64 or raw data, inline or appended, plain or compressed.
//!
//! Kept beside vtkio, which writes these files in `export`: vtkio is a release candidate, and errors here carry place,
//! cause and advice like those of all mesh imports.

mod arrays;
mod blocks;
mod cells;
mod numbers;

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};
use roxmltree::Node;

use super::assemble::{Cell, Content, Labels};
use super::error::{DAMAGED, Fault, Place, fault};
use super::named_mesh::CellVectors;
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
    let mut content = Content::default();
    let mut cell_arrays = NamedValues::default();
    let mut point_arrays = NamedValues::default();
    let pieces = find_pieces(&document)?;
    for piece in pieces {
        let n_points = count(piece, "NumberOfPoints")?;
        let n_cells = count(piece, "NumberOfCells")?;
        if n_cells == 0 {
            continue;
        }
        let [first_point, first_cell] = [content.points.len(), content.cells.len()];
        content.pieces.push(first_point);
        content.points.extend(read_points(&source, piece, n_points)?);
        check_count(piece, content.points.len())?;
        let cells = cells::read(&source, piece, n_points, n_cells)?;
        let is_ghost = ghosts(&source, piece, n_cells)?;
        let kept = |i: &usize| !is_ghost.as_ref().is_some_and(|ghosts| ghosts[*i]);
        let offset = |mut cell: Cell| {
            cell.nodes[..cell.shape.n_nodes()].iter_mut().for_each(|node| *node += first_point as u32);
            cell
        };
        let kept_cells: Vec<usize> = (0..n_cells).filter(kept).collect();
        content.cells.extend(kept_cells.iter().map(|&i| offset(cells[i])));
        cell_arrays
            .add(&source, piece, "CellData", n_cells, |i| Some(first_cell + kept_cells.binary_search(&i).ok()?))?;
        add_vectors(&mut content, &source, piece, n_cells, &kept_cells)?;
        point_arrays.add(&source, piece, "PointData", n_points, |i| Some(first_point + i))?;
    }
    let mut labels = Labels::default();
    for (i, name) in cell_arrays.groups() {
        labels.add(name, content.cells[i].shape.dimension(), i);
    }
    let mut point_labels: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (i, name) in point_arrays.groups() {
        point_labels.entry(name).or_default().push(i);
    }
    content.cell_labels = labels.into_vec();
    content.point_labels = point_labels.into_iter().collect();
    Ok(content)
}

fn find_pieces<'a, 'input>(document: &'a roxmltree::Document<'input>) -> Result<Vec<Node<'a, 'input>>, Fault> {
    let root = document.root_element();
    let kind = root.attribute("type").unwrap_or_default();
    if root.tag_name().name() != "VTKFile" || kind != "UnstructuredGrid" {
        let problem = format!("holds `{}` of type `{kind}`, not an unstructured grid", root.tag_name().name());
        let advice = match kind {
            "PUnstructuredGrid" => "it only names the files of its pieces: open it in ParaView and save it as one .vtu",
            _ => "save the mesh as VTK unstructured grid (.vtu) of hexahedra or tetrahedra",
        };
        return fault(arrays::place(root, "VTKFile"), problem, advice);
    }
    let pieces: Vec<_> = document.descendants().filter(|node| node.has_tag_name("Piece")).collect();
    if pieces.is_empty() {
        return fault(Place::File, "has no <Piece>", DAMAGED);
    }
    Ok(pieces)
}

/// The sum over pieces has the bound of one.
fn check_count(piece: Node<'_, '_>, n_points: usize) -> Result<(), Fault> {
    if n_points as u64 > MAX_COUNT {
        return fault(arrays::place(piece, "Piece"), format!("more than {MAX_COUNT} points in all"), DAMAGED);
    }
    Ok(())
}

/// Cells that another piece owns, by ParaView's array `vtkGhostType` or the older `vtkGhostLevels`; `None` without one.
fn ghosts(source: &Source<'_>, piece: Node<'_, '_>, n_cells: usize) -> Result<Option<Vec<bool>>, Fault> {
    const DUPLICATE_CELL: u64 = 1;
    let arrays = || piece.children().filter(|node| node.has_tag_name("CellData")).flat_map(Array::all);
    if let Some(array) = arrays().find(|array| array.name() == "vtkGhostType") {
        let values = source.indices(&array, Some(n_cells))?;
        return Ok(Some(values.iter().map(|value| value & DUPLICATE_CELL != 0).collect()));
    }
    let Some(array) = arrays().find(|array| array.name() == "vtkGhostLevels") else { return Ok(None) };
    Ok(Some(source.indices(&array, Some(n_cells))?.iter().map(|level| *level > 0).collect()))
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
    let values = source.positions(&array, n_points)?;
    Ok(values.chunks_exact(3).map(|x| Point3::new(x[0], x[1], x[2])).collect())
}

/// Appends cell arrays of three components; cells of pieces without one have none.
fn add_vectors(
    content: &mut Content,
    source: &Source<'_>,
    piece: Node<'_, '_>,
    n_cells: usize,
    kept_cells: &[usize],
) -> Result<(), Fault> {
    const N_COMPONENTS: usize = 3;
    let first_cell = content.cells.len() - kept_cells.len();
    let tables = piece.children().filter(|node| node.has_tag_name("CellData"));
    for array in tables.flat_map(Array::all).filter(|array| array.n_components() == N_COMPONENTS && array.is_numeric())
    {
        let values = source.numbers(&array, n_cells, N_COMPONENTS)?;
        let name = array.name();
        let known = content.cell_vectors.iter().position(|vectors| vectors.name == name).unwrap_or_else(|| {
            content.cell_vectors.push(CellVectors { name: name.to_owned(), values: Vec::new() });
            content.cell_vectors.len() - 1
        });
        let all = &mut content.cell_vectors[known].values;
        all.resize(first_cell, Vector3::zeros());
        all.extend(kept_cells.iter().map(|&i| Vector3::from_column_slice(&values[N_COMPONENTS * i..][..N_COMPONENTS])));
    }
    Ok(())
}

/// Values of arrays of one component, over all pieces, by name.
#[derive(Default)]
struct NamedValues {
    arrays: Vec<(String, Vec<(usize, f64)>)>,
}

impl NamedValues {
    /// Adds the arrays of a piece's `table` of `n` entries; `place` is where an entry went.
    fn add(
        &mut self,
        source: &Source<'_>,
        piece: Node<'_, '_>,
        table: &str,
        n: usize,
        place: impl Fn(usize) -> Option<usize>,
    ) -> Result<(), Fault> {
        let tables = piece.children().filter(|node| node.has_tag_name(table));
        for array in tables.flat_map(Array::all).filter(|array| array.n_components() == 1 && array.is_numeric()) {
            let values = source.numbers(&array, n, 1)?;
            let placed = values.into_iter().enumerate().filter_map(|(i, value)| Some((place(i)?, value)));
            match self.arrays.iter_mut().find(|(name, _)| name == array.name()) {
                Some((_, known)) => known.extend(placed),
                None => self.arrays.push((array.name().to_owned(), placed.collect())),
            }
        }
        Ok(())
    }

    /// For every array of few values: which entry belongs to which group.
    fn groups(&self) -> impl Iterator<Item = (usize, String)> + '_ {
        let few = self.arrays.iter().filter_map(|(name, values)| Some((name, values, few_values(values)?)));
        few.flat_map(|(name, values, known)| {
            let text = move |value: f64| known.get(&value.to_bits()).cloned().unwrap_or_default();
            values.iter().map(move |&(i, value)| (i, format!("{name}={}", text(value))))
        })
    }
}

/// Different values as text; `None` if there are too many.
fn few_values(values: &[(usize, f64)]) -> Option<BTreeMap<u64, String>> {
    let mut known = BTreeMap::new();
    for (_, value) in values {
        known.entry(value.to_bits()).or_insert_with(|| value.to_string());
        if known.len() > MAX_VALUES {
            return None;
        }
    }
    Some(known)
}
