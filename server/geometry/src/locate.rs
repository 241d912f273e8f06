//! Which hexahedron a point lies in.

use nalgebra::Point3;

use crate::hex_mesh::HexMesh;
use crate::index::HexIdx;
use crate::isoparametric::{inverse_map, map};

/// Reference coordinates may exceed 1 by this much before a point counts as outside.
const INSIDE_TOLERANCE: f64 = 1e-9;

/// Where a point lies in a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Location {
    /// The containing hexahedron, or the nearest one.
    pub hex: HexIdx,
    /// Reference coordinates in it; beyond `[-1, 1]` for a point outside the mesh.
    pub xi: [f64; 3],
    /// Distance to the hexahedron \[m\], 0 inside. Outside: to the image of the clamped reference coordinates.
    pub distance_m: f64,
}

/// The hexahedron that contains `x` (the one of least index when several do), otherwise the nearest one whose
/// bounding box is within `max_distance_m` of `x`; `None` if there is none.
pub fn locate(mesh: &HexMesh, x: &Point3<f64>, max_distance_m: f64) -> Option<Location> {
    let mut nearest: Option<Location> = None;
    for hex in mesh.hex_indices() {
        let corners = mesh.corner_positions(hex);
        let reach = nearest.map_or(max_distance_m, |found| found.distance_m);
        if distance_to_box(&corners, x) > reach {
            continue;
        }
        if let Some(found) = locate_in(&corners, hex, x) {
            if found.distance_m == 0.0 {
                return Some(found);
            }
            if nearest.is_none_or(|best| found.distance_m < best.distance_m) {
                nearest = Some(found);
            }
        }
    }
    nearest.filter(|found| found.distance_m <= max_distance_m)
}

fn locate_in(corners: &[Point3<f64>; 8], hex: HexIdx, x: &Point3<f64>) -> Option<Location> {
    let xi = inverse_map(corners, x)?;
    let inside = xi.iter().all(|c| c.abs() <= 1.0 + INSIDE_TOLERANCE);
    let distance_m = if inside { 0.0 } else { (map(corners, xi.map(|c| c.clamp(-1.0, 1.0))) - x).norm() };
    Some(Location { hex, xi, distance_m })
}

fn distance_to_box(corners: &[Point3<f64>; 8], x: &Point3<f64>) -> f64 {
    let lower = corners.iter().fold(corners[0], |a, c| a.inf(c));
    let upper = corners.iter().fold(corners[0], |a, c| a.sup(c));
    let nearest = x.sup(&lower).inf(&upper);
    (x - nearest).norm()
}
