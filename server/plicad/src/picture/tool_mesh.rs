//! Triangles of a tool's shape, for drawing only.

use std::f64::consts::{PI, TAU};

use nalgebra::{Isometry3, Point3, Vector3};
use plica_geometry::ConvexPolytope;
use plica_sim::ToolShape;

/// Steps around a round shape.
const AROUND: usize = 64;
/// Steps from pole to pole.
const ALONG: usize = 40;

/// A shape in the world.
#[derive(Debug, Clone, Default)]
pub(super) struct ToolMesh {
    pub(super) positions: Vec<Point3<f64>>,
    pub(super) normals: Vec<Vector3<f64>>,
    pub(super) triangles: Vec<[usize; 3]>,
}

pub(super) fn tessellate(shape: &ToolShape, pose: &Isometry3<f64>) -> ToolMesh {
    let mut mesh = match shape {
        ToolShape::Ball { radius_m } => round(*radius_m, 0.0),
        ToolShape::Capsule { radius_m, length_m } => round(*radius_m, *length_m),
        ToolShape::Cuboid { .. } | ToolShape::ConvexHull { .. } | ToolShape::Compound { .. } => {
            let polytopes = shape.polytopes().unwrap_or_default();
            polytopes.iter().map(faceted).fold(ToolMesh::default(), joined)
        }
    };
    mesh.positions.iter_mut().for_each(|p| *p = pose * *p);
    mesh.normals.iter_mut().for_each(|n| *n = pose * *n);
    mesh
}

/// A ball whose upper half is moved up by `length_m`.
fn round(radius_m: f64, length_m: f64) -> ToolMesh {
    let mut mesh = ToolMesh::default();
    for i in 0..=ALONG {
        let latitude = equator_twice(i);
        let z = if i > ALONG / 2 { length_m } else { 0.0 };
        for j in 0..AROUND {
            let longitude = TAU * j as f64 / AROUND as f64;
            let n = Vector3::new(latitude.cos() * longitude.cos(), latitude.cos() * longitude.sin(), latitude.sin());
            mesh.positions.push(Point3::from(radius_m * n + Vector3::new(0.0, 0.0, z)));
            mesh.normals.push(n);
        }
    }
    for i in 0..ALONG {
        for j in 0..AROUND {
            let [a, b] = [i * AROUND + j, i * AROUND + (j + 1) % AROUND];
            mesh.triangles.push([a, b, b + AROUND]);
            mesh.triangles.push([a, b + AROUND, a + AROUND]);
        }
    }
    mesh
}

/// Latitude of ring `i` of `ALONG + 1`, the two in the middle both at the equator.
fn equator_twice(i: usize) -> f64 {
    let half = ALONG / 2;
    let share = if i <= half { i as f64 / half as f64 - 1.0 } else { (i - half - 1) as f64 / (half - 1) as f64 };
    0.5 * PI * share
}

/// Triangles with one normal each.
fn faceted(polytope: &ConvexPolytope) -> ToolMesh {
    let mut mesh = ToolMesh::default();
    for [a, b, c] in polytope.triangles().iter().map(|t| t.map(|v| polytope.vertices()[v])) {
        let Some(normal) = (b - a).cross(&(c - a)).try_normalize(0.0) else { continue };
        let first = mesh.positions.len();
        mesh.positions.extend([a, b, c]);
        mesh.normals.extend([normal; 3]);
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    mesh
}

fn joined(mut a: ToolMesh, b: ToolMesh) -> ToolMesh {
    let first = a.positions.len();
    a.positions.extend(b.positions);
    a.normals.extend(b.normals);
    a.triangles.extend(b.triangles.iter().map(|t| t.map(|v| v + first)));
    a
}
