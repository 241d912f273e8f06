//! The trilinear map from the reference cube `[-1, 1]^3` to a hexahedron, and its inverse.
//!
//! Corners are in the order of `VTK_HEXAHEDRON`: counter-clockwise around the bottom face seen from above,
//! then the same around the top face.

use nalgebra::{Matrix3, Point3, Vector3};

/// Reference coordinates of the eight corners, `xi_a`.
pub const CORNERS: [[f64; 3]; 8] = [
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
];

/// `N_a(xi) = 1/8 prod_k (1 + xi_a,k xi_k)`, one value per corner; they sum to 1.
#[inline]
pub fn shape_functions(xi: [f64; 3]) -> [f64; 8] {
    CORNERS.map(|c| 0.125 * (1.0 + c[0] * xi[0]) * (1.0 + c[1] * xi[1]) * (1.0 + c[2] * xi[2]))
}

/// `dN_a / dxi_k`, one row per corner; every column sums to 0.
#[inline]
pub fn shape_gradients(xi: [f64; 3]) -> [[f64; 3]; 8] {
    CORNERS.map(|c| {
        let f = [1.0 + c[0] * xi[0], 1.0 + c[1] * xi[1], 1.0 + c[2] * xi[2]];
        [0.125 * c[0] * f[1] * f[2], 0.125 * c[1] * f[0] * f[2], 0.125 * c[2] * f[0] * f[1]]
    })
}

/// `X(xi) = sum_a N_a(xi) X_a` \[m\].
pub fn map(corners: &[Point3<f64>; 8], xi: [f64; 3]) -> Point3<f64> {
    let weights = shape_functions(xi);
    let sum = corners.iter().zip(weights).fold(Vector3::zeros(), |sum, (x, n)| sum + n * x.coords);
    Point3::from(sum)
}

/// `J = dX / dxi = sum_a X_a (dN_a / dxi)^T` \[m\]; its determinant is positive in a valid element.
pub fn jacobian(corners: &[Point3<f64>; 8], xi: [f64; 3]) -> Matrix3<f64> {
    let gradients = shape_gradients(xi);
    corners.iter().zip(gradients).fold(Matrix3::zeros(), |sum, (x, g)| sum + x.coords * Vector3::from(g).transpose())
}

/// Volume \[m^3\]: the integral of `det J` by 2 x 2 x 2 Gauss points, which is exact (`det J` is at most quadratic
/// in each coordinate).
pub fn volume(corners: &[Point3<f64>; 8]) -> f64 {
    let g = 1.0 / 3.0_f64.sqrt();
    CORNERS.iter().map(|c| jacobian(corners, c.map(|x| x * g)).determinant()).sum()
}

/// Area of a bilinear quadrilateral \[m^2\]: the integral of `|dX/dxi x dX/deta|` by 2 x 2 Gauss points; exact where it is flat.
pub fn quad_area([a, b, c, d]: &[Point3<f64>; 4]) -> f64 {
    let g = 1.0 / 3.0_f64.sqrt();
    let at = |xi: f64, eta: f64| {
        let by_xi = ((b - a) * (1.0 - eta) + (c - d) * (1.0 + eta)) / 4.0;
        let by_eta = ((d - a) * (1.0 - xi) + (c - b) * (1.0 + xi)) / 4.0;
        by_xi.cross(&by_eta).norm()
    };
    at(-g, -g) + at(g, -g) + at(g, g) + at(-g, g)
}

/// The longest of the twelve edges \[m\].
pub fn longest_edge(corners: &[Point3<f64>; 8]) -> f64 {
    EDGES.iter().map(|&[a, b]| (corners[a] - corners[b]).norm()).fold(0.0, f64::max)
}

const EDGES: [[usize; 2]; 12] =
    [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];

/// The reference coordinates of `x`: solves `X(xi) = x` by Newton's method from the centre. Works outside the
/// element too, as far as the trilinear map can be inverted there.
///
/// # Errors
/// `None` when Newton's method does not reach `1e-13` of the longest edge (or what rounding of the coordinates allows)
/// in 50 steps, or meets a singular `J`: that happens only for points well outside a distorted element.
pub fn inverse_map(corners: &[Point3<f64>; 8], x: &Point3<f64>) -> Option<[f64; 3]> {
    inverse_map_from(corners, x, [0.0; 3])
}

/// [`inverse_map`] from a start other than the centre.
///
/// # Errors
/// As [`inverse_map`].
pub fn inverse_map_from(corners: &[Point3<f64>; 8], x: &Point3<f64>, start: [f64; 3]) -> Option<[f64; 3]> {
    const MAX_STEPS: usize = 50;
    const STEP_LIMIT: f64 = 2.0;
    let tolerance = (1e-13 * longest_edge(corners)).max(4.0 * f64::EPSILON * x.coords.amax());
    let mut xi = Vector3::from(start);
    for _ in 0..MAX_STEPS {
        let residual = x - map(corners, xi.into());
        let step = jacobian(corners, xi.into()).try_inverse()? * residual;
        xi += step * (STEP_LIMIT / step.norm()).min(1.0);
        let is_near = xi.amax() < 1e3;
        if !is_near {
            return None;
        }
        if residual.norm() <= tolerance {
            return Some(xi.into());
        }
    }
    None
}

/// Reference coordinates in `[-1, 1]^3` of the element's point nearest to `x`: minimises `1/2 |X(xi) - x|^2` by
/// projected Gauss-Newton steps `J_f^T J_f step = -J_f^T (X - x)`, `f` the coordinates that are free to move into the
/// element, from `start`.
pub fn closest_point(corners: &[Point3<f64>; 8], x: &Point3<f64>, start: [f64; 3]) -> [f64; 3] {
    const MAX_STEPS: usize = 50;
    const SMALL_STEP: f64 = 1e-12;
    let mut xi = Vector3::from(start);
    for _ in 0..MAX_STEPS {
        let residual = map(corners, xi.into()) - x;
        let step = projected_step(&jacobian(corners, xi.into()), &residual, &xi);
        let next = shorter_until_better(corners, x, &xi, &step, residual.norm());
        let moved = next.map_or(0.0, |next| (next - xi).amax());
        xi = next.unwrap_or(xi);
        if moved <= SMALL_STEP {
            break;
        }
    }
    xi.into()
}

/// The Gauss-Newton step over the coordinates that are not held at a face by the gradient `J^T r`.
fn projected_step(jacobian: &Matrix3<f64>, residual: &Vector3<f64>, xi: &Vector3<f64>) -> Vector3<f64> {
    let gradient = jacobian.transpose() * residual;
    let mut normal = jacobian.transpose() * jacobian;
    let mut right = -gradient;
    for k in 0..3 {
        let is_held = (xi[k] >= 1.0 && gradient[k] <= 0.0) || (xi[k] <= -1.0 && gradient[k] >= 0.0);
        if is_held {
            normal.row_mut(k).fill(0.0);
            normal.column_mut(k).fill(0.0);
            normal[(k, k)] = 1.0;
            right[k] = 0.0;
        }
    }
    normal.try_inverse().map_or_else(Vector3::zeros, |inverse| inverse * right)
}

/// The clamped end of the longest of `step`, `step / 2`, ... that comes nearer to `x` than `distance`.
fn shorter_until_better(
    corners: &[Point3<f64>; 8],
    x: &Point3<f64>,
    xi: &Vector3<f64>,
    step: &Vector3<f64>,
    distance: f64,
) -> Option<Vector3<f64>> {
    const MAX_HALVINGS: i32 = 12;
    let ends = (0..=MAX_HALVINGS).map(|halvings| (xi + step * 0.5_f64.powi(halvings)).map(|c| c.clamp(-1.0, 1.0)));
    ends.into_iter().find(|end| (map(corners, (*end).into()) - x).norm() < distance)
}
