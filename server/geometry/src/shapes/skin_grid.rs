//! Skins of the generated shapes: a regular grid on top, side walls that share its rim, a coarse bottom.

use nalgebra::Point3;

use super::{Wedge, block_as_wedge, lattice};
use crate::index::VertexIdx;
use crate::skin::Skin;

/// Rows of quads on a side wall.
const N_WALL_ROWS: usize = 6;

/// Row `r` of a wall lies at the depth `(r / 6)^1.5` of the height: rows are finer near the top.
const WALL_GRADING: f64 = 1.5;

/// The bottom's spacing in spacings of the top.
const BOTTOM_COARSENING: f64 = 5.0;

/// A closed skin of [`super::block`], made like [`wedge_skin`].
///
/// # Panics
/// If a size or the spacing is not positive and finite.
pub fn block_skin(size_m: [f64; 3], spacing_m: f64) -> Skin {
    wedge_skin(&block_as_wedge(size_m), spacing_m)
}

/// A closed skin of the wedge; every vertex lies on the wedge's boundary.
///
/// The top is a regular grid of about `spacing_m` \[m\] whose diagonals alternate, so that no direction is favoured;
/// side walls hang from its rim in six graded rows; the bottom is five times coarser, joined to the walls
/// by a strip of triangles. The number of vertices grows with `1 / spacing_m^2`: the caller bounds it.
///
/// # Panics
/// If a size or the spacing is not positive and finite.
pub fn wedge_skin(wedge: &Wedge, spacing_m: f64) -> Skin {
    wedge.check();
    assert!(spacing_m.is_finite() && spacing_m > 0.0, "the spacing must be positive and finite, it is {spacing_m} m");
    let grid = SkinGrid::new(wedge, spacing_m);
    let mut triangles = grid.top_triangles();
    triangles.extend(grid.wall_triangles());
    triangles.extend(grid.bottom_triangles());
    let positions = grid.positions(wedge);
    triangles.extend(grid.zipper_triangles(&positions));
    Skin::new(positions, triangles).expect("a wedge of positive sizes has a closed skin")
}

/// Numbers of cells along x and y. Vertices are listed as top grid, wall rows from the top down, inside of the bottom.
struct SkinGrid {
    top: [usize; 2],
    bottom: [usize; 2],
}

impl SkinGrid {
    fn new(wedge: &Wedge, spacing_m: f64) -> Self {
        let cells = |spacing: f64, least: usize| {
            [wedge.length_m, wedge.width_m].map(|size| ((size / spacing).round() as usize).max(least))
        };
        Self { top: cells(spacing_m, 1), bottom: cells(BOTTOM_COARSENING * spacing_m, 2) }
    }

    fn n_rim(&self) -> usize {
        2 * (self.top[0] + self.top[1])
    }

    /// Grid coordinates of the `m`-th rim vertex, counter-clockwise seen from above.
    fn rim(&self, m: usize) -> [usize; 2] {
        let [n_x, n_y] = self.top;
        match m % self.n_rim() {
            m if m < n_x => [m, 0],
            m if m < n_x + n_y => [n_x, m - n_x],
            m if m < 2 * n_x + n_y => [2 * n_x + n_y - m, n_y],
            m => [0, self.n_rim() - m],
        }
    }

    fn top_vertex(&self, [i, j]: [usize; 2]) -> VertexIdx {
        VertexIdx::from_index(i + (self.top[0] + 1) * j)
    }

    /// Row 0 is the top's rim, row [`N_WALL_ROWS`] the bottom's.
    fn wall_vertex(&self, m: usize, row: usize) -> VertexIdx {
        if row == 0 {
            return self.top_vertex(self.rim(m));
        }
        let n_top = (self.top[0] + 1) * (self.top[1] + 1);
        VertexIdx::from_index(n_top + (row - 1) * self.n_rim() + m % self.n_rim())
    }

    /// Vertices inside the bottom: `i` and `j` run from 1 to the number of cells less 1.
    fn bottom_vertex(&self, [i, j]: [usize; 2]) -> VertexIdx {
        let n_top = (self.top[0] + 1) * (self.top[1] + 1);
        VertexIdx::from_index(n_top + N_WALL_ROWS * self.n_rim() + (i - 1) + (self.bottom[0] - 1) * (j - 1))
    }

    fn positions(&self, wedge: &Wedge) -> Vec<Point3<f64>> {
        let at = |[i, j]: [usize; 2], [n_x, n_y]: [usize; 2], height_share: f64| {
            let x = wedge.length_m * (i as f64 / n_x as f64);
            Point3::new(x, wedge.width_m * (j as f64 / n_y as f64), wedge.height_m(x) * height_share)
        };
        let [n_x, n_y] = self.top;
        let top = lattice([n_x + 1, n_y + 1, 1]).map(|[i, j, _]| at([i, j], self.top, 1.0));
        let walls = (1..=N_WALL_ROWS).flat_map(|row| {
            let depth = (row as f64 / N_WALL_ROWS as f64).powf(WALL_GRADING);
            (0..self.n_rim()).map(move |m| at(self.rim(m), self.top, 1.0 - depth))
        });
        let inside = lattice([self.bottom[0] - 1, self.bottom[1] - 1, 1]);
        let bottom = inside.map(|[i, j, _]| at([i + 1, j + 1], self.bottom, 0.0));
        top.chain(walls).chain(bottom).collect()
    }

    fn top_triangles(&self) -> Vec<[VertexIdx; 3]> {
        let quads = lattice([self.top[0], self.top[1], 1]).map(|[i, j, _]| {
            let v = |di, dj| self.top_vertex([i + di, j + dj]);
            ([v(0, 0), v(1, 0), v(1, 1), v(0, 1)], i + j)
        });
        quads.flat_map(|(quad, parity)| cut(quad, parity)).collect()
    }

    fn wall_triangles(&self) -> Vec<[VertexIdx; 3]> {
        let quads = lattice([self.n_rim(), N_WALL_ROWS, 1]).map(|[m, row, _]| {
            let v = |dm, below| self.wall_vertex(m + dm, row + below);
            ([v(0, 1), v(1, 1), v(1, 0), v(0, 0)], m + row)
        });
        quads.flat_map(|(quad, parity)| cut(quad, parity)).collect()
    }

    /// The inside of the bottom, facing down.
    fn bottom_triangles(&self) -> Vec<[VertexIdx; 3]> {
        let quads = lattice([self.bottom[0] - 2, self.bottom[1] - 2, 1]).map(|[i, j, _]| {
            let v = |di, dj| self.bottom_vertex([i + 1 + di, j + 1 + dj]);
            ([v(0, 0), v(0, 1), v(1, 1), v(1, 0)], i + j)
        });
        quads.flat_map(|(quad, parity)| cut(quad, parity)).collect()
    }

    /// The strip between the walls' lowest row and the inside of the bottom, side by side.
    fn zipper_triangles(&self, positions: &[Point3<f64>]) -> Vec<[VertexIdx; 3]> {
        let ([n_x, n_y], [b_x, b_y]) = (self.top, self.bottom);
        let outer = |first: usize, n: usize| (first..=first + n).map(|m| self.wall_vertex(m, N_WALL_ROWS)).collect();
        let inner = |path: Vec<[usize; 2]>| path.into_iter().map(|at| self.bottom_vertex(at)).collect();
        let sides: [(Vec<VertexIdx>, Vec<VertexIdx>); 4] = [
            (outer(0, n_x), inner((1..b_x).map(|i| [i, 1]).collect())),
            (outer(n_x, n_y), inner((1..b_y).map(|j| [b_x - 1, j]).collect())),
            (outer(n_x + n_y, n_x), inner((1..b_x).rev().map(|i| [i, b_y - 1]).collect())),
            (outer(2 * n_x + n_y, n_y), inner((1..b_y).rev().map(|j| [1, j]).collect())),
        ];
        sides.iter().flat_map(|(outer, inner)| zip_down(positions, outer, inner)).collect()
    }
}

/// A quad, counter-clockwise seen from outside, as two triangles; the diagonal alternates with `parity`.
fn cut([a, b, c, d]: [VertexIdx; 4], parity: usize) -> [[VertexIdx; 3]; 2] {
    if parity.is_multiple_of(2) { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
}

/// Triangles, facing down, between two parallel lines of vertices; the inner one lies left of the outer one seen
/// from above. Each step takes the shorter of the two next diagonals.
fn zip_down(positions: &[Point3<f64>], outer: &[VertexIdx], inner: &[VertexIdx]) -> Vec<[VertexIdx; 3]> {
    let length = |a: VertexIdx, b: VertexIdx| (positions[a.index()] - positions[b.index()]).norm();
    let (mut i, mut j) = (0, 0);
    let mut triangles = Vec::with_capacity(outer.len() + inner.len());
    while i + 1 < outer.len() || j + 1 < inner.len() {
        let along_outer = outer.get(i + 1).map_or(f64::INFINITY, |&next| length(next, inner[j]));
        let along_inner = inner.get(j + 1).map_or(f64::INFINITY, |&next| length(outer[i], next));
        if along_outer <= along_inner {
            triangles.push([outer[i + 1], outer[i], inner[j]]);
            i += 1;
        } else {
            triangles.push([outer[i], inner[j], inner[j + 1]]);
            j += 1;
        }
    }
    triangles
}
