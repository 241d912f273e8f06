//! Point location: the hexahedron that contains a point.

use nalgebra::Point3;

use crate::box_tree::{Aabb, BoxTree};
use crate::hex_mesh::HexMesh;
use crate::index::HexIdx;
use crate::isoparametric::{closest_point, inverse_map, inverse_map_from, map};

/// Reference coordinates may exceed 1 by this much before a point counts as outside.
const INSIDE_TOLERANCE: f64 = 1e-9;
/// Share of a hexahedron's box by which a point that counts as inside may lie outside the box.
const BOX_TOLERANCE: f64 = 10.0 * INSIDE_TOLERANCE;
/// Relative rounding of distances: boxes nearer than the best distance within it are searched too.
const ROUNDING: f64 = 1e-9;
/// Reference coordinates beyond this usually belong to another branch of the inverse map.
const FAR_OUTSIDE: f64 = 3.0;

/// Location of a point in a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Location {
    /// The containing hexahedron, or the nearest one.
    pub hex: HexIdx,
    /// Reference coordinates in it; beyond `[-1, 1]` for a point outside the mesh.
    pub xi: [f64; 3],
    /// Distance to the hexahedron \[m\], 0 inside.
    pub distance_m: f64,
}

/// The hexahedron that contains `x` (the one of least index when several do), otherwise the nearest one within
/// `max_distance_m` of `x` (ties: least index); `None` if there is none.
///
/// Tests every hexahedron; a [`Locator`] gives the same locations faster for more than a few points.
pub fn locate(mesh: &HexMesh, x: &Point3<f64>, max_distance_m: f64) -> Option<Location> {
    let boxes: Vec<_> = mesh.hex_indices().map(|hex| (hex, Aabb::around(&mesh.corner_positions(hex)))).collect();
    let touched = boxes.iter().filter(|(_, bounds)| bounds.distance(x) <= BOX_TOLERANCE * bounds.diagonal());
    containing(mesh, x, touched.map(|&(hex, _)| hex)).or_else(|| {
        let near = boxes.iter().map(|(hex, bounds)| (*hex, bounds.distance(x)));
        nearest(mesh, x, max_distance_m, near.filter(|&(_, distance)| distance <= max_distance_m).collect())
    })
}

/// Finds hexahedra of one mesh for many points.
#[derive(Clone, Debug)]
pub struct Locator<'a> {
    mesh: &'a HexMesh,
    tree: BoxTree,
    /// Largest distance outside its box at which a hexahedron contains a point \[m\].
    slack_m: f64,
}

impl<'a> Locator<'a> {
    /// Sorts the hexahedra of `mesh` into a tree of boxes.
    pub fn new(mesh: &'a HexMesh) -> Self {
        let boxes: Vec<_> = mesh.hex_indices().map(|hex| Aabb::around(&mesh.corner_positions(hex))).collect();
        let slack_m = BOX_TOLERANCE * boxes.iter().map(Aabb::diagonal).fold(0.0, f64::max);
        Self { mesh, tree: BoxTree::new(boxes), slack_m }
    }

    /// Same location as [`locate`].
    pub fn locate(&self, x: &Point3<f64>, max_distance_m: f64) -> Option<Location> {
        let near = |distance_m| self.tree.within(x, distance_m).into_iter().map(|(i, d)| (HexIdx::from_index(i), d));
        containing(self.mesh, x, near(self.slack_m).map(|(hex, _)| hex))
            .or_else(|| nearest(self.mesh, x, max_distance_m, near(max_distance_m).collect()))
    }
}

/// The first of `hexes` that contains `x`.
fn containing(mesh: &HexMesh, x: &Point3<f64>, mut hexes: impl Iterator<Item = HexIdx>) -> Option<Location> {
    hexes.find_map(|hex| {
        let xi = inverse_map(&mesh.corner_positions(hex), x)?;
        let is_inside = xi.iter().all(|c| c.abs() <= 1.0 + INSIDE_TOLERANCE);
        is_inside.then_some(Location { hex, xi, distance_m: 0.0 })
    })
}

/// Nearest of the hexahedra, each given with the distance to its box.
fn nearest(mesh: &HexMesh, x: &Point3<f64>, max_distance_m: f64, mut near: Vec<(HexIdx, f64)>) -> Option<Location> {
    near.sort_unstable_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    let mut best: Option<Location> = None;
    for (hex, to_box) in near {
        if best.is_some_and(|best| to_box > best.distance_m * (1.0 + ROUNDING)) {
            break;
        }
        let is_nearer =
            |found: &Location| best.is_none_or(|best| (found.distance_m, found.hex) < (best.distance_m, best.hex));
        best = locate_outside(&mesh.corner_positions(hex), hex, x).filter(is_nearer).or(best);
    }
    best.filter(|found| found.distance_m <= max_distance_m)
}

/// Location in a hexahedron of a point outside it; `None` where the map cannot be continued to the point.
fn locate_outside(corners: &[Point3<f64>; 8], hex: HexIdx, x: &Point3<f64>) -> Option<Location> {
    let from_centre = inverse_map(corners, x).filter(|xi| xi.iter().all(|c| c.abs() <= FAR_OUTSIDE));
    let start = from_centre.map_or([0.0; 3], |xi| xi.map(|c| c.clamp(-1.0, 1.0)));
    let closest = closest_point(corners, x, start);
    let xi = from_centre.or_else(|| inverse_map_from(corners, x, closest))?;
    Some(Location { hex, xi, distance_m: (map(corners, closest) - x).norm() })
}
