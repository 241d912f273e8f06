//! Generated shapes of the scenes: hexahedral meshes here, their skins in `shapes/skin_grid.rs`.

mod skin_grid;

use nalgebra::Point3;

use crate::hex_mesh::{HexMesh, MeshError};
use crate::index::NodeIdx;
use crate::isoparametric;
pub use skin_grid::{block_skin, wedge_skin};

/// Top spacing that gives the default wedge a skin of about 6.9 k vertices \[m\].
pub const WEDGE_SKIN_SPACING_M: f64 = 1.22e-3;

/// Divisions of the default wedge's mesh along x, y, z.
pub const WEDGE_DIVISIONS: [usize; 3] = [8, 4, 4];

/// A slab with a flat bottom at z = 0 over `x in [0, length]`, `y in [0, width]`, whose height runs linearly along x
/// from `thick_height_m` to `thin_height_m`. The default is the wedge of the scenes, 120 x 60 mm, 40 to 10 mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wedge {
    /// Extent along x \[m\].
    pub length_m: f64,
    /// Extent along y \[m\].
    pub width_m: f64,
    /// Height at x = 0 \[m\].
    pub thick_height_m: f64,
    /// Height at x = `length_m` \[m\].
    pub thin_height_m: f64,
}

impl Default for Wedge {
    fn default() -> Self {
        Self { length_m: 0.12, width_m: 0.06, thick_height_m: 0.04, thin_height_m: 0.01 }
    }
}

impl Wedge {
    /// Height of the top at `x` \[m\].
    pub fn height_m(&self, x: f64) -> f64 {
        let share = x / self.length_m;
        self.thick_height_m * (1.0 - share) + self.thin_height_m * share
    }

    fn check(&self) {
        let sizes = [self.length_m, self.width_m, self.thick_height_m, self.thin_height_m];
        let valid = sizes.iter().all(|size| size.is_finite() && *size > 0.0);
        assert!(valid, "sizes of a shape must be positive and finite, they are {sizes:?} m");
    }
}

/// A box of `size_m` \[m\] with its least corner at the origin, `divisions` hexahedra along x, y, z.
///
/// # Panics
/// If a size is not positive and finite or a division is 0.
pub fn block(size_m: [f64; 3], divisions: [usize; 3]) -> HexMesh {
    wedge(&block_as_wedge(size_m), divisions)
}

/// The wedge's mesh: `divisions` hexahedra along x, y, z; node `(i, j, k)` has the index
/// `i + (n_x + 1) (j + (n_y + 1) k)`, hexahedra likewise.
///
/// # Panics
/// If a size is not positive and finite or a division is 0.
pub fn wedge(wedge: &Wedge, divisions: [usize; 3]) -> HexMesh {
    graded_wedge(wedge, divisions, [1.0; 3])
}

/// The same with hexahedra whose lengths along x, y, z grow as those of [`hexahedron`].
///
/// # Panics
/// If a size or a grading is not positive and finite or a division is 0.
pub fn graded_wedge(wedge: &Wedge, divisions: [usize; 3], grading: [f64; 3]) -> HexMesh {
    wedge.check();
    check_grading(&grading);
    let share = |i: usize, axis: usize| graded_share(i, divisions[axis], grading[axis]);
    let nodes = lattice_nodes(divisions, |[i, j, k]| {
        let x = share(i, 0) * wedge.length_m;
        Point3::new(x, share(j, 1) * wedge.width_m, share(k, 2) * wedge.height_m(x))
    });
    lattice_mesh(nodes, divisions).expect("a wedge of positive sizes makes valid hexahedra")
}

/// Eight corners, and the divisions between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hexahedron {
    /// Corners \[m\] in `VTK_HEXAHEDRON` order.
    pub corners: [Point3<f64>; 8],
    /// Hexahedra along the edges 0-1, 1-2 and 0-4.
    pub divisions: [usize; 3],
    /// Length of the last hexahedron over that of the first along each of them; 1 divides evenly.
    pub grading: [f64; 3],
}

/// A hexahedron divided into hexahedra: the trilinear image of a graded lattice, numbered like [`wedge`].
///
/// Along an edge of `n` hexahedra with grading `g` their lengths grow by `q = g^(1 / (n - 1))`, so that node `i` lies at the
/// share `(q^i - 1) / (q^n - 1)`.
///
/// # Errors
/// [`MeshError`]: corners that make inverted or flat hexahedra, or are not finite.
///
/// # Panics
/// If a division is 0 or a grading is not positive and finite.
pub fn hexahedron(shape: &Hexahedron) -> Result<HexMesh, MeshError> {
    let Hexahedron { corners, divisions, grading } = shape;
    check_grading(grading);
    let nodes = lattice_nodes(*divisions, |at| {
        let xi = [0, 1, 2].map(|k| 2.0 * graded_share(at[k], divisions[k], grading[k]) - 1.0);
        isoparametric::map(corners, xi)
    });
    lattice_mesh(nodes, *divisions)
}

fn check_grading(grading: &[f64; 3]) {
    assert!(grading.iter().all(|g| g.is_finite() && *g > 0.0), "gradings must be positive, they are {grading:?}");
}

fn graded_share(i: usize, n: usize, grading: f64) -> f64 {
    if i == 0 || i == n || n == 1 || grading == 1.0 {
        return i as f64 / n as f64;
    }
    let log_q = grading.ln() / (n - 1) as f64;
    (i as f64 * log_q).exp_m1() / (n as f64 * log_q).exp_m1()
}

fn lattice_nodes(divisions: [usize; 3], node: impl Fn([usize; 3]) -> Point3<f64>) -> Vec<Point3<f64>> {
    assert!(divisions.iter().all(|&n| n > 0), "divisions must be at least 1, they are {divisions:?}");
    lattice(divisions.map(|n| n + 1)).map(node).collect()
}

fn lattice_mesh(nodes: Vec<Point3<f64>>, divisions: [usize; 3]) -> Result<HexMesh, MeshError> {
    HexMesh::new(nodes, lattice(divisions).map(|cell| hex_corners(cell, divisions)).collect())
}

fn block_as_wedge([length_m, width_m, height_m]: [f64; 3]) -> Wedge {
    Wedge { length_m, width_m, thick_height_m: height_m, thin_height_m: height_m }
}

/// `[i, j, k]` with `i` running fastest.
fn lattice([n_x, n_y, n_z]: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    (0..n_z).flat_map(move |k| (0..n_y).flat_map(move |j| (0..n_x).map(move |i| [i, j, k])))
}

fn hex_corners([i, j, k]: [usize; 3], [n_x, n_y, _]: [usize; 3]) -> [NodeIdx; 8] {
    let node = |di, dj, dk| NodeIdx::from_index((i + di) + (n_x + 1) * ((j + dj) + (n_y + 1) * (k + dk)));
    [
        node(0, 0, 0),
        node(1, 0, 0),
        node(1, 1, 0),
        node(0, 1, 0),
        node(0, 0, 1),
        node(1, 0, 1),
        node(1, 1, 1),
        node(0, 1, 1),
    ]
}
