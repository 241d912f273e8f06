//! Edges where a surface turns sharply: drawn as the outline, and not shaded over.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};
use plica_geometry::DisplaySurface;

/// Triangles that turn by more than this are parted by an edge \[cosine\].
const SHARP: f64 = 0.8;

/// Edges of the rest shape that are sharp.
pub(super) fn sharp_edges(surface: &DisplaySurface) -> Vec<[Point3<f64>; 2]> {
    let mut sides: HashMap<(u32, u32), Vector3<f64>> = HashMap::new();
    let mut sharp = Vec::new();
    for (t, normal) in surface.triangles.iter().zip(face_normals(surface, &surface.rest)) {
        let normal = normal.normalize();
        for (v, w) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            match sides.insert((v.min(w), v.max(w)), normal) {
                Some(other) if other.dot(&normal) < SHARP => {
                    sharp.push([v, w].map(|v| Point3::from(surface.rest[v as usize]).cast()));
                }
                _ => {}
            }
        }
    }
    sharp
}

/// Unit normals of each triangle's corners: the mean, weighted by area, over the triangles around the vertex that face the
/// same way at rest.
pub(super) fn corner_normals(surface: &DisplaySurface, positions: &[[f32; 3]]) -> Vec<[[f32; 3]; 3]> {
    let rest: Vec<_> = face_normals(surface, &surface.rest).iter().map(Vector3::normalize).collect();
    let deformed = face_normals(surface, positions);
    let mut around: Vec<Vec<usize>> = vec![Vec::new(); positions.len()];
    for (i, t) in surface.triangles.iter().enumerate() {
        t.iter().for_each(|v| around[*v as usize].push(i));
    }
    let corner = |face: usize, v: u32| -> [f32; 3] {
        let same_side = around[v as usize].iter().filter(|other| rest[**other].dot(&rest[face]) >= SHARP);
        let sum: Vector3<f64> = same_side.map(|other| deformed[*other]).sum();
        sum.try_normalize(1e-30).unwrap_or(rest[face]).cast::<f32>().into()
    };
    surface.triangles.iter().enumerate().map(|(face, t)| t.map(|v| corner(face, v))).collect()
}

/// Normals whose length is twice the area.
fn face_normals(surface: &DisplaySurface, positions: &[[f32; 3]]) -> Vec<Vector3<f64>> {
    let normal = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| Point3::from(positions[v as usize]).cast::<f64>());
        (b - a).cross(&(c - a))
    };
    surface.triangles.iter().map(normal).collect()
}
