//! Tetrahedra of 4 and of 10 nodes over the reference simplex `xi, eta, zeta >= 0`, `xi + eta + zeta <= 1`.
//!
//! Nodes are in the order of `VTK_TETRA` and `VTK_QUADRATIC_TETRA`: corners 0 to 3, then the middles of the edges of [`EDGES`].

use nalgebra::{Matrix3, Point3, Vector3};

/// Corners of the six edges; node `4 + e` lies on edge `e`.
pub const EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];

/// Corners of the four faces, counter-clockwise seen from outside.
pub const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];

/// Reference coordinates of all ten nodes.
pub const NODES: [[f64; 3]; 10] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.5, 0.0, 0.0],
    [0.5, 0.5, 0.0],
    [0.0, 0.5, 0.0],
    [0.0, 0.0, 0.5],
    [0.5, 0.0, 0.5],
    [0.0, 0.5, 0.5],
];

/// Reference coordinates of the centroid.
pub const CENTROID: [f64; 3] = [0.25; 3];

/// Derivatives of the barycentric coordinates, `dL_i / dxi_k`.
const SLOPES: [[f64; 3]; 4] = [[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Barycentric coordinates `L_i`: the shape functions of 4 nodes.
pub fn barycentric([xi, eta, zeta]: [f64; 3]) -> [f64; 4] {
    [1.0 - xi - eta - zeta, xi, eta, zeta]
}

/// Derivatives of the shape functions of 4 nodes, one row per node.
pub fn linear_gradients(_xi: [f64; 3]) -> [[f64; 3]; 4] {
    SLOPES
}

/// Shape functions of 10 nodes: `L_i (2 L_i - 1)` at corners, `4 L_i L_j` on edges; they sum to 1.
pub fn quadratic_shapes(xi: [f64; 3]) -> [f64; 10] {
    let l = barycentric(xi);
    std::array::from_fn(|a| match a.checked_sub(4) {
        None => l[a] * (2.0 * l[a] - 1.0),
        Some(edge) => 4.0 * l[EDGES[edge][0]] * l[EDGES[edge][1]],
    })
}

/// Derivatives of the shape functions of 10 nodes, one row per node.
pub fn quadratic_gradients(xi: [f64; 3]) -> [[f64; 3]; 10] {
    let l = barycentric(xi);
    std::array::from_fn(|a| match a.checked_sub(4) {
        None => SLOPES[a].map(|slope| (4.0 * l[a] - 1.0) * slope),
        Some(edge) => {
            let [i, j] = EDGES[edge];
            std::array::from_fn(|k| 4.0 * (l[i] * SLOPES[j][k] + l[j] * SLOPES[i][k]))
        }
    })
}

/// Shape functions of 4 or 10 nodes.
pub fn shapes(n_nodes: usize, xi: [f64; 3]) -> Vec<f64> {
    if n_nodes == 4 { barycentric(xi).to_vec() } else { quadratic_shapes(xi).to_vec() }
}

/// `X(xi)` \[m\] of 4 or 10 nodes.
pub(crate) fn map(nodes: &[Point3<f64>], xi: [f64; 3]) -> Point3<f64> {
    let weighted = nodes.iter().zip(shapes(nodes.len(), xi)).map(|(x, n)| x.coords * n);
    Point3::from(weighted.sum::<Vector3<f64>>())
}

/// `dX/dxi` \[m\] of 4 or 10 nodes.
pub fn jacobian(nodes: &[Point3<f64>], xi: [f64; 3]) -> Matrix3<f64> {
    let outer = |(x, g): (&Point3<f64>, &[f64; 3])| x.coords * Vector3::from(*g).transpose();
    if nodes.len() == 4 {
        nodes.iter().zip(&linear_gradients(xi)).map(outer).sum()
    } else {
        nodes.iter().zip(&quadratic_gradients(xi)).map(outer).sum()
    }
}

/// Longest distance between two corners \[m\].
pub(crate) fn longest_edge(nodes: &[Point3<f64>]) -> f64 {
    EDGES.iter().map(|&[a, b]| (nodes[a] - nodes[b]).norm()).fold(0.0, f64::max)
}

/// Reference coordinates of `x`, by Newton's method from the centroid; `None` where it does not end.
pub(crate) fn inverse_map(nodes: &[Point3<f64>], x: &Point3<f64>) -> Option<[f64; 3]> {
    const MAX_STEPS: usize = 30;
    let tolerance = (1e-13 * longest_edge(nodes)).max(4.0 * f64::EPSILON * x.coords.amax());
    let mut xi = Vector3::from(CENTROID);
    for _ in 0..MAX_STEPS {
        let miss = x - map(nodes, xi.into());
        if miss.norm() <= tolerance {
            return Some(xi.into());
        }
        let step = jacobian(nodes, xi.into()).try_inverse()? * miss;
        xi += step * (1.0 / step.norm()).min(1.0);
        if xi.amax() > 10.0 {
            return None;
        }
    }
    None
}

/// The nearest point of the simplex in barycentric coordinates: negative ones become 0, the others share what is left.
pub(crate) fn clamped(xi: [f64; 3]) -> [f64; 3] {
    let l = barycentric(xi).map(|l| l.max(0.0));
    let sum: f64 = l.iter().sum();
    [l[1] / sum, l[2] / sum, l[3] / sum]
}

/// Volume \[m^3\] by 4 Gauss points: exact for plane faces and edges whose middles are in the middle.
pub(crate) fn volume(nodes: &[Point3<f64>]) -> f64 {
    QUADRATURE.iter().map(|&xi| jacobian(nodes, xi).determinant() / 24.0).sum()
}

/// The 4 Gauss points, exact for polynomials of second degree; each has a quarter of the volume.
pub const QUADRATURE: [[f64; 3]; 4] = {
    const A: f64 = 0.585_410_196_624_968_5; // (5 + 3 sqrt 5) / 20
    const B: f64 = 0.138_196_601_125_010_5; // (5 - sqrt 5) / 20
    [[B, B, B], [A, B, B], [B, A, B], [B, B, A]]
};
