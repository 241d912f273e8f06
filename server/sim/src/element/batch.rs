//! Corotated kernels over batches of sixteen hexahedra, structure of arrays.
//!
//! Force `f = -R K (R^T x - X)` and stiffness product `y = R K R^T p` \[MG04\], one rotation per element, `K` the rest stiffness.

use nalgebra::Vector3;
use plica_geometry::HexMesh;

use super::stiffness::{center_gradients, rest_stiffness};
use crate::description::{ElementKind, Material};
use crate::lanes::{F, LANES, Mat3, Node, Vec3, gather, mul, mul_transpose, scatter_add};
use crate::rotation::{Quaternions, warm_polar};

/// Entries of a symmetric 24x24 matrix: upper triangle, row by row.
const SYMMETRIC_24: usize = 300;

/// Elements in batches of [`LANES`]; the last batch is filled with copies of an element whose stiffness is zero.
#[derive(Debug, Clone)]
pub(crate) struct ElementBatches {
    batches: Vec<Batch>,
}

#[derive(Debug, Clone)]
struct Batch {
    /// Internal node of each corner.
    nodes: [[u32; LANES]; 8],
    /// Rest corners relative to the element's centre \[m\].
    rest: [Vec3; 8],
    /// Gradients of the corner functions at the centre \[1/m\].
    gradients: [Vec3; 8],
    /// Rest stiffness \[N/m\].
    stiffness: Box<[F; SYMMETRIC_24]>,
}

impl ElementBatches {
    /// `internal_of_node[mesh node]` renumbers nodes; `materials` is `[n_hexes]`.
    pub(crate) fn new(mesh: &HexMesh, internal_of_node: &[u32], materials: &[Material], kind: ElementKind) -> Self {
        let elements: Vec<usize> = (0..mesh.n_hexes()).collect();
        let batches = elements.chunks(LANES).map(|c| Batch::new(mesh, c, internal_of_node, materials, kind)).collect();
        Self { batches }
    }

    pub(crate) fn n_batches(&self) -> usize {
        self.batches.len()
    }

    /// Bytes that one product reads.
    pub(crate) fn bytes_per_product(&self) -> usize {
        self.batches.len() * LANES * 4 * (SYMMETRIC_24 + 8 + 9)
    }

    /// Floating-point operations of one product.
    pub(crate) fn flops_per_product(&self) -> usize {
        self.batches.len() * LANES * 2 * (24 * 24 + 2 * 8 * 9)
    }

    /// Warm polar decomposition per element: `rotations` follow the deformation gradient at the centre.
    /// `u` are nodal displacements.
    pub(crate) fn update_rotations(&self, u: &[Node], quaternions: &mut [Quaternions], rotations: &mut [Mat3]) {
        for ((batch, q), r) in self.batches.iter().zip(quaternions).zip(rotations) {
            *r = warm_polar(q, &batch.deformation_gradient(u));
        }
    }

    /// `out += scale * f(u + dt v)`, elastic forces at displaced positions.
    pub(crate) fn add_forces(&self, u: &[Node], v: &[Node], dt: f32, scale: f32, rotations: &[Mat3], out: &mut [Node]) {
        for (batch, r) in self.batches.iter().zip(rotations) {
            batch.add_force(u, v, F::splat(dt), F::splat(-scale), r, out);
        }
    }

    /// `out += scale * sum_e R K R^T p`.
    pub(crate) fn add_product(&self, p: &[Node], scale: f32, rotations: &[Mat3], out: &mut [Node]) {
        for (batch, r) in self.batches.iter().zip(rotations) {
            batch.add_product(p, F::splat(scale), r, out);
        }
    }

    /// Mean element rotation at each node as a quaternion (not normalised), `[n_nodes]`.
    pub(crate) fn add_node_quaternions(&self, quaternions: &[Quaternions], out: &mut [Node]) {
        for (batch, q) in self.batches.iter().zip(quaternions) {
            let lanes = q.map(|c| c.to_array());
            for corner in &batch.nodes {
                for lane in 0..LANES {
                    let n = &mut out[corner[lane] as usize];
                    let sign = if n[3] * lanes[3][lane]
                        + n[0] * lanes[0][lane]
                        + n[1] * lanes[1][lane]
                        + n[2] * lanes[2][lane]
                        < 0.0
                    {
                        -1.0
                    } else {
                        1.0
                    };
                    for k in 0..4 {
                        n[k] += sign * lanes[k][lane];
                    }
                }
            }
        }
    }
}

impl Batch {
    fn new(
        mesh: &HexMesh,
        elements: &[usize],
        internal_of_node: &[u32],
        materials: &[Material],
        kind: ElementKind,
    ) -> Self {
        let mut nodes = [[0; LANES]; 8];
        let mut rest = [[[0.0_f32; LANES]; 3]; 8];
        let mut gradients = [[[0.0_f32; LANES]; 3]; 8];
        let mut stiffness = [[0.0_f32; LANES]; SYMMETRIC_24];
        for lane in 0..LANES {
            let is_padding = lane >= elements.len();
            let element = elements[if is_padding { 0 } else { lane }];
            let corners = mesh.hexes()[element].map(|n| mesh.nodes()[n.index()]);
            let center = corners.iter().map(|c| c.coords).sum::<Vector3<f64>>() / 8.0;
            let element_gradients = center_gradients(&corners);
            for a in 0..8 {
                nodes[a][lane] = internal_of_node[mesh.hexes()[element][a].index()];
                for k in 0..3 {
                    rest[a][k][lane] = (corners[a].coords - center)[k] as f32;
                    gradients[a][k][lane] = element_gradients[a][k] as f32;
                }
            }
            if !is_padding {
                let full = rest_stiffness(&corners, &materials[element], kind);
                for (entry, (i, j)) in upper_triangle().enumerate() {
                    stiffness[entry][lane] = full[(i, j)] as f32;
                }
            }
        }
        let lanes = |v: [[f32; LANES]; 3]| v.map(F::new);
        Self {
            nodes,
            rest: rest.map(lanes),
            gradients: gradients.map(lanes),
            stiffness: Box::new(stiffness.map(F::new)),
        }
    }

    /// `F = I + sum_a u_a g_a^T`
    #[inline(always)]
    fn deformation_gradient(&self, u: &[Node]) -> Mat3 {
        let mut f = [[F::ZERO; 3]; 3];
        for i in 0..3 {
            f[i][i] = F::ONE;
        }
        for a in 0..8 {
            let ua = gather(u, &self.nodes[a]);
            for i in 0..3 {
                for j in 0..3 {
                    f[i][j] = ua[i].mul_add(self.gradients[a][j], f[i][j]);
                }
            }
        }
        f
    }

    /// `out += scale * R K (R^T (X + u + dt v) - X)`
    #[inline(always)]
    fn add_force(&self, u: &[Node], v: &[Node], dt: F, scale: F, r: &Mat3, out: &mut [Node]) {
        let mut local = [F::ZERO; 24];
        for a in 0..8 {
            let (ua, va) = (gather(u, &self.nodes[a]), gather(v, &self.nodes[a]));
            let x = self.rest[a];
            let deformed: Vec3 = std::array::from_fn(|k| va[k].mul_add(dt, ua[k]) + x[k]);
            let back = mul_transpose(r, deformed);
            for k in 0..3 {
                local[3 * a + k] = back[k] - x[k];
            }
        }
        self.scatter_stiffness(&local, scale, r, out);
    }

    /// `out += scale * R K R^T p`
    #[inline(always)]
    fn add_product(&self, p: &[Node], scale: F, r: &Mat3, out: &mut [Node]) {
        let mut local = [F::ZERO; 24];
        for a in 0..8 {
            let back = mul_transpose(r, gather(p, &self.nodes[a]));
            local[3 * a..3 * a + 3].copy_from_slice(&back);
        }
        self.scatter_stiffness(&local, scale, r, out);
    }

    /// `out += scale * R (K local)`, reading the upper triangle of `K` once.
    #[inline(always)]
    fn scatter_stiffness(&self, local: &[F; 24], scale: F, r: &Mat3, out: &mut [Node]) {
        let mut y = [F::ZERO; 24];
        let mut entry = 0;
        for i in 0..24 {
            let xi = local[i];
            let mut yi = self.stiffness[entry].mul_add(xi, y[i]);
            for j in i + 1..24 {
                let k = self.stiffness[entry + j - i];
                yi = k.mul_add(local[j], yi);
                y[j] = k.mul_add(xi, y[j]);
            }
            y[i] = yi;
            entry += 24 - i;
        }
        for a in 0..8 {
            let turned = mul(r, [y[3 * a], y[3 * a + 1], y[3 * a + 2]]);
            scatter_add(out, &self.nodes[a], turned.map(|c| c * scale));
        }
    }
}

/// Index pairs `(i, j >= i)` of the upper triangle, row by row.
fn upper_triangle() -> impl Iterator<Item = (usize, usize)> {
    (0..24).flat_map(|i| (i..24).map(move |j| (i, j)))
}
