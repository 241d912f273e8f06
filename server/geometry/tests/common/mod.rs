//! Meshes and small tools that several tests share.
#![allow(dead_code, reason = "every test file uses its own part")]

pub(crate) mod vtu;

use nalgebra::{Point3, Vector3};
use plica_geometry::shapes::{WEDGE_DIVISIONS, WEDGE_SKIN_SPACING_M, Wedge, block, wedge, wedge_skin};
use plica_geometry::{HexIdx, HexMesh, NodeIdx, Skin};

pub(crate) const SPACING_M: f64 = WEDGE_SKIN_SPACING_M;

pub(crate) fn default_wedge() -> HexMesh {
    wedge(&Wedge::default(), WEDGE_DIVISIONS)
}

pub(crate) fn default_skin() -> Skin {
    wedge_skin(&Wedge::default(), SPACING_M)
}

/// A block whose nodes are moved by up to 20 % of a cell, the same way every time.
pub(crate) fn distorted_block() -> HexMesh {
    let mesh = block([0.04, 0.03, 0.03], [4, 3, 3]);
    let mut random = Random(7);
    let moved = mesh.nodes().iter().map(|x| x + 0.002 * random.vector());
    HexMesh::new(moved.collect(), mesh.hexes().to_vec()).unwrap()
}

/// Two arms that stand on a base: 5 x 2 x 6 cells of 10 mm; the middle column of cells (x from 20 to 30 mm) is
/// missing above the first layer (z > 10 mm).
pub(crate) fn u_shape() -> HexMesh {
    let full = block([0.05, 0.02, 0.06], [5, 2, 6]);
    keep_cells(&full, |centre| !(centre.x > 0.02 && centre.x < 0.03 && centre.z > 0.01))
}

pub(crate) fn centre(mesh: &HexMesh, hex: HexIdx) -> Point3<f64> {
    let sum = mesh.corner_positions(hex).iter().fold(Vector3::zeros(), |sum, x| sum + x.coords);
    Point3::from(sum / 8.0)
}

/// The hexahedra whose centre `keep` accepts, with the nodes they use.
fn keep_cells(mesh: &HexMesh, keep: impl Fn(Point3<f64>) -> bool) -> HexMesh {
    let kept: Vec<_> =
        mesh.hex_indices().filter(|&hex| keep(centre(mesh, hex))).map(|hex| mesh.hexes()[hex.index()]).collect();
    let mut used: Vec<NodeIdx> = kept.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let nodes = used.iter().map(|node| mesh.nodes()[node.index()]).collect();
    let renamed = |node: NodeIdx| NodeIdx::from_index(used.binary_search(&node).unwrap());
    HexMesh::new(nodes, kept.iter().map(|hex| hex.map(renamed)).collect()).unwrap()
}

/// A small generator of repeatable numbers (an LCG, upper bits).
pub(crate) struct Random(pub u64);

impl Random {
    /// In [-1, 1).
    pub(crate) fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    pub(crate) fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.number(), self.number(), self.number())
    }

    pub(crate) fn vectors(&mut self, n: usize) -> Vec<Vector3<f64>> {
        (0..n).map(|_| self.vector()).collect()
    }
}
