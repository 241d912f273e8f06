//! Faces of elements in space: bilinear quadrilaterals, plane and quadratic triangles.

use nalgebra::Vector3;
use plica_geometry::Face;

/// Most nodes of a face.
pub(super) const MAX_FACE_NODES: usize = 6;

/// Shape functions `N_a` and their derivatives at a Gauss point of a reference face; those beyond the nodes are 0.
#[derive(Debug, Clone, Copy)]
pub(super) struct FacePoint {
    pub(super) weight: f64,
    pub(super) shape: [f64; MAX_FACE_NODES],
    pub(super) by_xi: [f64; MAX_FACE_NODES],
    pub(super) by_eta: [f64; MAX_FACE_NODES],
}

/// Positions of the nodes of a face; those beyond the nodes are 0.
pub(super) type FacePositions = [Vector3<f64>; MAX_FACE_NODES];

const CORNERS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

const NOTHING: FacePoint = FacePoint {
    weight: 0.0,
    shape: [0.0; MAX_FACE_NODES],
    by_xi: [0.0; MAX_FACE_NODES],
    by_eta: [0.0; MAX_FACE_NODES],
};

/// The 2 x 2 Gauss points of `[-1, 1]^2`.
const QUAD_POINTS: [FacePoint; 4] = {
    const G: f64 = 0.577_350_269_189_625_8; // 1 / sqrt 3
    let mut points = [NOTHING; 4];
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
        points[q].weight = 1.0;
        q += 1;
    }
    points
};

/// One Gauss point of the reference triangle per permutation of barycentric coordinates `(a, b, b)`, with its weight.
struct Orbit {
    a: f64,
    b: f64,
    weight: f64,
}

/// Three points, exact for second degree.
const SECOND_DEGREE: Orbit = Orbit { a: 2.0 / 3.0, b: 1.0 / 6.0, weight: 1.0 / 6.0 };

/// Six points, exact for fourth degree \[Dun85\]: a shape function times the normal of a quadratic triangle.
const FOURTH_DEGREE: [Orbit; 2] = [
    Orbit { a: 0.108_103_018_168_070_2, b: 0.445_948_490_915_964_9, weight: 0.111_690_794_839_005_73 },
    Orbit { a: 0.816_847_572_980_458_5, b: 0.091_576_213_509_770_74, weight: 0.054_975_871_827_660_93 },
];

const TRIANGLE_POINTS: [FacePoint; 3] =
    [triangle_point(&SECOND_DEGREE, 0), triangle_point(&SECOND_DEGREE, 1), triangle_point(&SECOND_DEGREE, 2)];

const CURVED_TRIANGLE_POINTS: [FacePoint; 6] = [
    curved_triangle_point(&FOURTH_DEGREE[0], 0),
    curved_triangle_point(&FOURTH_DEGREE[0], 1),
    curved_triangle_point(&FOURTH_DEGREE[0], 2),
    curved_triangle_point(&FOURTH_DEGREE[1], 0),
    curved_triangle_point(&FOURTH_DEGREE[1], 1),
    curved_triangle_point(&FOURTH_DEGREE[1], 2),
];

/// Derivatives of barycentric coordinates `1 - xi - eta`, `xi`, `eta`.
const BY_XI: [f64; 3] = [-1.0, 1.0, 0.0];
const BY_ETA: [f64; 3] = [-1.0, 0.0, 1.0];

const fn barycentric(orbit: &Orbit, turn: usize) -> [f64; 3] {
    let mut l = [orbit.b; 3];
    l[turn] = orbit.a;
    l
}

const fn triangle_point(orbit: &Orbit, turn: usize) -> FacePoint {
    let mut point = NOTHING;
    let l = barycentric(orbit, turn);
    let mut a = 0;
    while a < 3 {
        point.shape[a] = l[a];
        point.by_xi[a] = BY_XI[a];
        point.by_eta[a] = BY_ETA[a];
        a += 1;
    }
    point.weight = orbit.weight;
    point
}

/// `N = L (2 L - 1)` at corners, `4 L_a L_b` on the edges `ab`, `bc`, `ca`.
const fn curved_triangle_point(orbit: &Orbit, turn: usize) -> FacePoint {
    let mut point = NOTHING;
    let l = barycentric(orbit, turn);
    let mut a = 0;
    while a < 3 {
        let b = (a + 1) % 3;
        point.shape[a] = l[a] * (2.0 * l[a] - 1.0);
        point.by_xi[a] = (4.0 * l[a] - 1.0) * BY_XI[a];
        point.by_eta[a] = (4.0 * l[a] - 1.0) * BY_ETA[a];
        point.shape[3 + a] = 4.0 * l[a] * l[b];
        point.by_xi[3 + a] = 4.0 * (l[a] * BY_XI[b] + l[b] * BY_XI[a]);
        point.by_eta[3 + a] = 4.0 * (l[a] * BY_ETA[b] + l[b] * BY_ETA[a]);
        a += 1;
    }
    point.weight = orbit.weight;
    point
}

/// Gauss points of a face.
pub(super) fn gauss_points(face: &Face) -> &'static [FacePoint] {
    match face {
        Face::Quad(_) => &QUAD_POINTS,
        Face::Triangle(_) => &TRIANGLE_POINTS,
        Face::CurvedTriangle(_) => &CURVED_TRIANGLE_POINTS,
    }
}

pub(super) fn positions(x: &[Vector3<f64>], face: &Face) -> FacePositions {
    let mut positions = [Vector3::zeros(); MAX_FACE_NODES];
    positions.iter_mut().zip(face.nodes()).for_each(|(position, node)| *position = x[node.index()]);
    positions
}

/// Tangents `dx/dxi` and `dx/deta` \[m\].
pub(super) fn tangents(positions: &FacePositions, n_nodes: usize, point: &FacePoint) -> [Vector3<f64>; 2] {
    [point.by_xi, point.by_eta].map(|by| positions[..n_nodes].iter().zip(by).map(|(x, n)| x * n).sum())
}

/// `n da` of a Gauss point, `dx/dxi x dx/deta` times its weight \[m^2\].
pub(super) fn normal(positions: &FacePositions, n_nodes: usize, point: &FacePoint) -> Vector3<f64> {
    let [s, t] = tangents(positions, n_nodes, point);
    s.cross(&t) * point.weight
}
