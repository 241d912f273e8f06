//! The `<Cells>` of a VTU file: connectivity, offsets, types.

use roxmltree::Node;

use super::arrays::{Array, Source, place};
use super::child;
use crate::import::assemble::{Cell, MAX_NODES, READ, Shape};
use crate::import::error::{DAMAGED, Fault, fault};

/// Import of a VTK cell type.
enum Kind {
    Taken(Shape),
    /// A hexahedron whose corners run in x, then y, then z.
    Voxel,
    /// A quad whose corners run in x, then y.
    Pixel,
    Other(&'static str),
    HighOrder(&'static str),
}

/// Corners of `VTK_VOXEL` in the order of `VTK_HEXAHEDRON`.
const VOXEL_CORNERS: [usize; MAX_NODES] = [0, 1, 3, 2, 4, 5, 7, 6, 8, 9];

/// Corners of `VTK_PIXEL` in the order of `VTK_QUAD`.
const PIXEL_CORNERS: [usize; MAX_NODES] = [0, 1, 3, 2, 4, 5, 6, 7, 8, 9];

/// Cells of Lagrange (68 to 74) and Bezier (75 to 81) kind and the older ones of any order (60 to 67) have their corners first,
/// in the order of the plain cell; with no more points than corners they are that cell.
fn kind(code: u64, n_points: usize) -> Kind {
    match (code, n_points) {
        (1, _) => Kind::Taken(Shape::Point),
        (21, 3) => Kind::Taken(Shape::CurvedLine),
        (3 | 21 | 35 | 60 | 68 | 75, _) | (4, 2) => Kind::Taken(Shape::Line),
        (22, 6) => Kind::Taken(Shape::CurvedTriangle),
        (5 | 22 | 34 | 61 | 69 | 76, _) | (6 | 7, 3) => Kind::Taken(Shape::Triangle),
        (9 | 23 | 28 | 62 | 70 | 77, _) | (7, 4) => Kind::Taken(Shape::Quad),
        (12, _) | (67 | 72 | 79, 8) => Kind::Taken(Shape::Hexahedron),
        (8, _) => Kind::Pixel,
        (11, _) => Kind::Voxel,
        (10, _) | (64 | 71 | 78, 4) => Kind::Taken(Shape::Tetrahedron),
        // Lagrange tetrahedra of second order have the nodes of the plain ones.
        (24, _) | (71, 10) => Kind::Taken(Shape::QuadraticTetrahedron),
        (13, _) | (65 | 73 | 80, 6) => Kind::Other("wedges (prisms)"),
        (14, _) | (66 | 74 | 81, 5) => Kind::Other("pyramids"),
        (42, _) => Kind::Other("polyhedra"),
        (25 | 29 | 33 | 67 | 72 | 79, _) => Kind::HighOrder("hexahedra of second or higher order"),
        (64 | 71 | 78, _) => Kind::HighOrder("tetrahedra of higher order or Bezier kind"),
        (26 | 31 | 32 | 65 | 73 | 80, _) => Kind::HighOrder("wedges (prisms) of second or higher order"),
        (27 | 37 | 66 | 74 | 81, _) => Kind::HighOrder("pyramids of second or higher order"),
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
    let mut ranges = Vec::with_capacity(n_cells);
    let mut begin = 0;
    for (i, &end) in offsets.iter().enumerate() {
        let range = usize::try_from(begin).ok().zip(usize::try_from(end).ok());
        let Some(points) = range.and_then(|(begin, end)| connectivity.get(begin..end)) else {
            let problem = format!("cell {i} runs from {begin} to {end} of {} entries", connectivity.len());
            return fault(place(node, "offsets"), problem, DAMAGED);
        };
        ranges.push(points);
        begin = end;
    }
    refuse_unfit(node, &types, &ranges)?;
    let cells = types.iter().zip(&ranges).enumerate();
    cells.map(|(i, (&code, points))| cell(node, i, code, points, n_points)).collect()
}

/// A mesh with other volumes than those read would have holes where they are.
fn refuse_unfit(node: Node<'_, '_>, types: &[u64], ranges: &[&[u64]]) -> Result<(), Fault> {
    let kinds = || types.iter().zip(ranges).map(|(&code, points)| kind(code, points.len()));
    let Some(i) = kinds().position(|kind| matches!(kind, Kind::Other(_) | Kind::HighOrder(_))) else { return Ok(()) };
    let (code, n_points) = (types[i], ranges[i].len());
    let n_same = types.iter().zip(ranges).filter(|(other, points)| **other == code && points.len() == n_points).count();
    let volume = |kind: Kind| match kind {
        Kind::Voxel => Some(Shape::Hexahedron),
        Kind::Taken(shape) => (shape.dimension() == 3).then_some(shape),
        _ => None,
    };
    let n_read = kinds().filter_map(volume).count();
    let beside =
        kinds().find_map(volume).map(|shape| format!(" beside {n_read} {}", shape.plural())).unwrap_or_default();
    let (name, advice) = match kind(code, n_points) {
        Kind::HighOrder(name) => (name, "save hexahedra with first order, tetrahedra with second"),
        Kind::Other(name) if n_read > 0 => (
            name,
            "mesh the whole body with tetrahedra or with hexahedra (in Gmsh: Recombine, or Mesh.SubdivisionAlgorithm = 2, which \
             splits all cells alike): without these cells the body would have holes",
        ),
        Kind::Other(name) => {
            (name, "mesh the body with tetrahedra or hexahedra (in Gmsh: Recombine, or Mesh.SubdivisionAlgorithm = 2)")
        }
        _ => ("cells", DAMAGED),
    };
    let problem = format!("holds {n_same} {name}{beside} (cell {i}, type {code}); {READ} are read");
    fault(place(node, "types"), problem, advice)
}

fn cell(node: Node<'_, '_>, i: usize, code: u64, points: &[u64], n_points: usize) -> Result<Cell, Fault> {
    let (shape, order) = match kind(code, points.len()) {
        Kind::Taken(shape) => (shape, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]),
        Kind::Pixel => (Shape::Quad, PIXEL_CORNERS),
        Kind::Voxel => (Shape::Hexahedron, VOXEL_CORNERS),
        Kind::Other(name) | Kind::HighOrder(name) => {
            return fault(place(node, "types"), format!("cell {i} belongs to {name} (type {code})"), DAMAGED);
        }
    };
    if points.len() < shape.n_nodes() {
        let problem = format!("cell {i} of type {code} has {} points", points.len());
        return fault(place(node, "offsets"), problem, DAMAGED);
    }
    let mut nodes = [0; MAX_NODES];
    for k in 0..shape.n_nodes() {
        let point = points[order[k]];
        if point >= n_points as u64 {
            let problem = format!("cell {i} names point {point}, there are {n_points}");
            return fault(place(node, "connectivity"), problem, DAMAGED);
        }
        nodes[k] = point as u32;
    }
    Ok(Cell { shape, nodes, number: i as u64 })
}
