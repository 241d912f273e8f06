//! Upper surface of an object, for fitting motions.

use crate::workspace::Workspace;

/// Cells of the look-up along x and along y.
const N_CELLS: usize = 64;
/// Tolerance of the shares of a point on a triangle's edge.
const ON_RIM: f64 = 1e-9;

/// A surface of triangles seen from above, z up.
#[derive(Debug, Clone)]
pub struct Terrain {
    triangles: Vec<[[f64; 3]; 3]>,
    bounds: Workspace,
    /// Triangles over each cell of the bounds, `N_CELLS` x `N_CELLS`.
    cells: Vec<Vec<usize>>,
}

impl Terrain {
    /// From positions `[n][3]` in metres and triangles of either orientation; `None` without a triangle, or if a vertex index is
    /// out of range.
    pub fn new(positions_m: &[[f32; 3]], triangles: &[[u32; 3]]) -> Option<Self> {
        let corner = |v: u32| positions_m.get(v as usize).map(|p| p.map(f64::from));
        let triangles = triangles.iter().map(|&[a, b, c]| Some([corner(a)?, corner(b)?, corner(c)?]));
        let triangles = triangles.collect::<Option<Vec<_>>>()?;
        let bounds = Workspace::around(triangles.iter().flatten())?;
        let mut terrain = Self { triangles, bounds, cells: vec![Vec::new(); N_CELLS * N_CELLS] };
        for (i, triangle) in terrain.triangles.iter().enumerate() {
            let [low, high] = [f64::min, f64::max].map(|of| {
                let edge = |axis: usize| triangle.iter().map(|p| p[axis]).reduce(of).unwrap_or_default();
                terrain.cell([edge(0), edge(1)])
            });
            for (x, y) in (low[0]..=high[0]).flat_map(|x| (low[1]..=high[1]).map(move |y| (x, y))) {
                terrain.cells[x * N_CELLS + y].push(i);
            }
        }
        Some(terrain)
    }

    /// Bounding box.
    pub fn bounds(&self) -> Workspace {
        self.bounds
    }

    /// Height of the topmost triangle at `[x, y]`, in metres; `None` beside the surface.
    ///
    /// ```text
    /// z = w_a z_a + w_b z_b + w_c z_c     w: shares of the triangle's area in the plane, none below 0
    /// ```
    pub fn height_m(&self, [x, y]: [f64; 2]) -> Option<f64> {
        let height = |&i: &usize| {
            let [a, b, c] = self.triangles[i];
            let area = cross(a, b, c);
            let p = [x, y, 0.0];
            let shares = [cross(p, b, c) / area, cross(a, p, c) / area, cross(a, b, p) / area];
            let above = shares.iter().all(|w| *w >= -ON_RIM);
            above.then(|| shares[0] * a[2] + shares[1] * b[2] + shares[2] * c[2])
        };
        let [cx, cy] = self.cell([x, y]);
        self.cells[cx * N_CELLS + cy].iter().filter_map(height).reduce(f64::max)
    }

    /// Cell of a point; the nearest cell for a point outside of the bounds.
    fn cell(&self, place: [f64; 2]) -> [usize; 2] {
        let Workspace { min_m, max_m } = self.bounds;
        std::array::from_fn(|i| {
            let share = (place[i] - min_m[i]) / (max_m[i] - min_m[i]);
            ((share * N_CELLS as f64) as usize).min(N_CELLS - 1)
        })
    }
}

/// Twice the signed area of a triangle in the plane.
fn cross(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

    use super::*;

    /// A roof of 2 x 1 m whose height is x, over a floor at 0, and a wall.
    fn roof() -> Terrain {
        let positions =
            [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0], [2.0, 0.0, 2.0], [2.0, 1.0, 2.0]];
        let triangles = [[0, 2, 1], [0, 3, 2], [0, 4, 5], [0, 5, 3], [1, 2, 5], [1, 5, 4]];
        Terrain::new(&positions, &triangles).unwrap()
    }

    #[test]
    fn the_topmost_triangle_counts() {
        let roof = roof();
        for (x, y) in [(0.0, 0.0), (0.3, 0.7), (1.0, 0.5), (1.999, 0.001), (2.0, 1.0)] {
            assert!((roof.height_m([x, y]).unwrap() - x).abs() < 1e-12, "{x}, {y}");
        }
        assert_eq!(roof.height_m([-0.1, 0.5]), None);
        assert_eq!(roof.height_m([1.0, 1.5]), None);
        assert_eq!(roof.bounds(), Workspace { min_m: [0.0; 3], max_m: [2.0, 1.0, 2.0] });
    }

    #[test]
    fn what_is_no_surface() {
        assert!(Terrain::new(&[[0.0; 3]], &[]).is_none());
        assert!(Terrain::new(&[[0.0; 3]], &[[0, 0, 1]]).is_none());
    }
}
