//! The published surface in single precision, and its normals.

use crate::skin::Skin;

/// Published form of a skin.
#[derive(Debug, Clone)]
pub struct DisplaySurface {
    /// Rest positions `[n_skin]` \[m\].
    pub rest: Vec<[f32; 3]>,
    /// Vertices of each triangle, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl DisplaySurface {
    /// Rounds a skin.
    pub fn new(skin: &Skin) -> Self {
        Self {
            rest: skin.positions().iter().map(|p| [p.x as f32, p.y as f32, p.z as f32]).collect(),
            triangles: skin.triangles().iter().map(|t| t.map(|v| v.0)).collect(),
        }
    }
}

/// Unit normals `[n_skin]`, the mean of the adjacent triangles' normals weighted by area.
pub fn vertex_normals_into(triangles: &[[u32; 3]], positions: &[[f32; 3]], normals: &mut [[f32; 3]]) {
    normals.fill([0.0; 3]);
    for triangle in triangles {
        let [a, b, c] = triangle.map(|v| positions[v as usize]);
        let n = cross(sub(b, a), sub(c, a));
        for v in triangle {
            let sum = &mut normals[*v as usize];
            *sum = [sum[0] + n[0], sum[1] + n[1], sum[2] + n[2]];
        }
    }
    for n in normals {
        let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        *n = if length > 0.0 { n.map(|x| x / length) } else { [0.0, 0.0, 1.0] };
    }
}

fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_point_outwards_and_have_unit_length() {
        let skin = crate::shapes::block_skin([0.04, 0.04, 0.02], 0.005);
        let surface = DisplaySurface::new(&skin);
        let mut normals = vec![[0.0; 3]; surface.rest.len()];
        vertex_normals_into(&surface.triangles, &surface.rest, &mut normals);
        for (n, p) in normals.iter().zip(&surface.rest) {
            let length = n.iter().map(|x| x * x).sum::<f32>().sqrt();
            assert!((length - 1.0).abs() < 1e-5);
            let outwards = n[0] * (p[0] - 0.02) + n[1] * (p[1] - 0.02) + n[2] * (p[2] - 0.01);
            assert!(outwards > 0.0);
        }
    }
}
