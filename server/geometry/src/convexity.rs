//! How far the convex hull of a surface stands off it.

use nalgebra::{Point3, Vector3};

use crate::box_tree::{Aabb, BoxTree};
use crate::convex_polytope::ConvexPolytope;
use crate::triangle::distance_to_triangle;

/// Samples of the hull along its extent.
const FINENESS: f64 = 24.0;

/// Largest distance from the surface of `hull` to the nearest of `triangles`, which index `points` \[m\]: 0 for a convex surface
/// without holes. Looks at points a twenty-fourth of the extent apart.
pub fn hull_stand_off(hull: &ConvexPolytope, points: &[Point3<f64>], triangles: &[[usize; 3]]) -> f64 {
    let surface: Vec<[Point3<f64>; 3]> = triangles.iter().map(|corners| corners.map(|v| points[v])).collect();
    if surface.is_empty() {
        return 0.0;
    }
    let tree = BoxTree::new(surface.iter().map(|corners| Aabb::around(corners)).collect());
    let extent = Aabb::around(points).diagonal();
    let distance = |x: &Point3<f64>| {
        let mut reach = 1e-3 * extent;
        loop {
            let near = tree.within(x, reach);
            let nearest = near.iter().map(|&(number, _)| distance_to_triangle(x, &surface[number]));
            let nearest = nearest.fold(f64::INFINITY, f64::min);
            if nearest <= reach || reach > 2.0 * extent {
                return nearest;
            }
            reach *= 2.0;
        }
    };
    let faces = hull.triangles().iter().map(|corners| corners.map(|v| hull.vertices()[v]));
    faces.flat_map(|corners| samples(&corners, extent / FINENESS)).map(|x| distance(&x)).fold(0.0, f64::max)
}

/// Points of a triangle at most `spacing` apart, none of them on its rim.
fn samples([a, b, c]: &[Point3<f64>; 3], spacing: f64) -> Vec<Point3<f64>> {
    let longest = [b - a, c - b, a - c].iter().map(Vector3::norm).fold(0.0, f64::max);
    let n = (longest / spacing).ceil().clamp(1.0, 2.0 * FINENESS) as usize;
    let at = |i: usize, j: usize| {
        let [u, v] = [i, j].map(|k| (k as f64 + 1.0 / 3.0) / n as f64);
        a + (b - a) * u + (c - a) * v
    };
    (0..n).flat_map(|i| (0..n - i).map(move |j| [i, j])).map(|[i, j]| at(i, j)).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;

    #[test]
    fn the_hull_of_an_open_box_stands_off_by_half_of_its_opening() {
        let hull = ConvexPolytope::cuboid([0.01; 3]).unwrap();
        let (points, all) = (hull.vertices().to_vec(), hull.triangles().to_vec());
        assert!(hull_stand_off(&hull, &points, &all) < 1e-12);
        let is_top = |corners: &[usize; 3]| corners.iter().all(|v| points[*v].z > 0.0);
        let open: Vec<_> = all.iter().filter(|corners| !is_top(corners)).copied().collect();
        let off = hull_stand_off(&hull, &points, &open);
        assert!((0.009..=0.01).contains(&off), "{off}");
    }
}
