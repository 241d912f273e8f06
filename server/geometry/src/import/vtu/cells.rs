//! The `<Cells>` of a VTU file: connectivity, offsets, types.

use roxmltree::Node;

use super::arrays::{Array, Source, place};
use super::child;
use crate::import::assemble::{Cell, Shape};
use crate::import::error::{DAMAGED, Fault, Place, fault};

/// Import of a VTK cell type.
enum Kind {
    Taken(Shape),
    /// A hexahedron whose corners run in x, then y, then z.
    Voxel,
    Other(&'static str),
    HighOrder(&'static str),
}

/// Corners of `VTK_VOXEL` in the order of `VTK_HEXAHEDRON`.
const VOXEL_CORNERS: [usize; 8] = [0, 1, 3, 2, 4, 5, 7, 6];

fn kind(code: u64) -> Kind {
    match code {
        1 => Kind::Taken(Shape::Point),
        3 | 21 | 35 => Kind::Taken(Shape::Line),
        5 | 22 => Kind::Taken(Shape::Triangle),
        9 | 23 | 28 => Kind::Taken(Shape::Quad),
        12 => Kind::Taken(Shape::Hexahedron),
        11 => Kind::Voxel,
        10 => Kind::Other("tetrahedra"),
        13 => Kind::Other("wedges (prisms)"),
        14 => Kind::Other("pyramids"),
        42 => Kind::Other("polyhedra"),
        25 | 29 | 33 | 72 | 79 => Kind::HighOrder("hexahedra of second or higher order"),
        24 | 71 | 78 => Kind::HighOrder("tetrahedra of second or higher order"),
        _ => Kind::Other("cells that are neither points, lines, triangles, quads nor hexahedra"),
    }
}

pub(super) fn read(
    source: &Source<'_>,
    piece: Node<'_, '_>,
    n_points: usize,
    n_cells: usize,
) -> Result<Vec<Cell>, Fault> {
    let node = child(piece, "Cells")?;
    let whole = |name: &str, n: Option<usize>| {
        let Some(array) = Array::all(node).find(|array| array.name() == name) else {
            return fault(place(node, "Cells"), format!("has no DataArray `{name}`"), DAMAGED);
        };
        source.indices(&array, n)
    };
    let (offsets, types) = (whole("offsets", Some(n_cells))?, whole("types", Some(n_cells))?);
    let connectivity = whole("connectivity", None)?;
    let mut cells = Vec::with_capacity(n_cells);
    let mut begin = 0;
    for (i, (&end, &code)) in offsets.iter().zip(&types).enumerate() {
        let range = usize::try_from(begin).ok().zip(usize::try_from(end).ok());
        let Some(points) = range.and_then(|(begin, end)| connectivity.get(begin..end)) else {
            let problem = format!("cell {i} runs from {begin} to {end} of {} entries", connectivity.len());
            return fault(place(node, "offsets"), problem, DAMAGED);
        };
        cells.push(cell(node, i, code, points, n_points)?);
        begin = end;
    }
    Ok(cells)
}

fn cell(node: Node<'_, '_>, i: usize, code: u64, points: &[u64], n_points: usize) -> Result<Cell, Fault> {
    let (shape, order) = match kind(code) {
        Kind::Taken(shape) => (shape, [0, 1, 2, 3, 4, 5, 6, 7]),
        Kind::Voxel => (Shape::Hexahedron, VOXEL_CORNERS),
        Kind::Other(name) => {
            let advice = "mesh with hexahedra only, or extract them (ParaView: Extract Cells By Type)";
            return refuse(node, i, name, code, advice);
        }
        Kind::HighOrder(name) => return refuse(node, i, name, code, "save the mesh with cells of first order"),
    };
    if points.len() < shape.n_corners() {
        let problem = format!("cell {i} of type {code} has {} points", points.len());
        return fault(place(node, "offsets"), problem, DAMAGED);
    }
    let mut corners = [0; 8];
    for k in 0..shape.n_corners() {
        let point = points[order[k]];
        if point >= n_points as u64 {
            let problem = format!("cell {i} names point {point}, there are {n_points}");
            return fault(place(node, "connectivity"), problem, DAMAGED);
        }
        corners[k] = point as u32;
    }
    Ok(Cell { shape, corners, number: i as u64 })
}

fn refuse<T>(node: Node<'_, '_>, i: usize, name: &str, code: u64, advice: &str) -> Result<T, Fault> {
    let Place::Field(field, line) = place(node, "types") else { return fault(Place::File, name, advice) };
    let problem = format!("holds {name} (cell {i}, type {code}); 8-node hexahedra are read");
    fault(Place::Field(field, line), problem, advice)
}
