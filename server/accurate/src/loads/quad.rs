//! A bilinear quadrilateral in space.

use nalgebra::Vector3;
use plica_geometry::NodeIdx;

/// Shape functions `N_a` and their derivatives at a Gauss point of `[-1, 1]^2`; its weight is 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct QuadPoint {
    pub(super) shape: [f64; 4],
    pub(super) by_xi: [f64; 4],
    pub(super) by_eta: [f64; 4],
}

const CORNERS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

/// The 2 x 2 Gauss points.
pub(super) const QUAD_GAUSS_POINTS: [QuadPoint; 4] = {
    const G: f64 = 0.577_350_269_189_625_8; // 1 / sqrt 3
    let mut points = [QuadPoint { shape: [0.0; 4], by_xi: [0.0; 4], by_eta: [0.0; 4] }; 4];
    let mut q = 0;
    while q < 4 {
        let (xi, eta) = (CORNERS[q][0] * G, CORNERS[q][1] * G);
        let mut a = 0;
        while a < 4 {
            let [s, t] = CORNERS[a];
            points[q].shape[a] = 0.25 * (1.0 + s * xi) * (1.0 + t * eta);
            points[q].by_xi[a] = 0.25 * s * (1.0 + t * eta);
            points[q].by_eta[a] = 0.25 * t * (1.0 + s * xi);
            a += 1;
        }
        q += 1;
    }
    points
};

pub(super) fn corners(x: &[Vector3<f64>], quad: &[NodeIdx; 4]) -> [Vector3<f64>; 4] {
    quad.map(|node| x[node.index()])
}

/// Tangents `dx/dxi` and `dx/deta` \[m\].
pub(super) fn tangents(corners: &[Vector3<f64>; 4], point: &QuadPoint) -> [Vector3<f64>; 2] {
    [point.by_xi, point.by_eta].map(|by| corners.iter().zip(by).map(|(x, n)| x * n).sum())
}

/// `n da/(dxi deta) = dx/dxi x dx/deta` \[m^2\].
pub(super) fn normal(corners: &[Vector3<f64>; 4], point: &QuadPoint) -> Vector3<f64> {
    let [s, t] = tangents(corners, point);
    s.cross(&t)
}
