//! The same implicit corotational step in `f64`, written again: rotations by singular values, the assembled matrix factored in
//! every step, contact solved exactly in contact space. Shares with the crate the rest stiffness, the lumped mass and the
//! embedding, and no solver or contact code.
#![allow(dead_code, unreachable_pub, clippy::unwrap_used, reason = "each test binary uses a part of this")]

pub mod ball;
mod banded;

use nalgebra::{Matrix3, Point3, SMatrix, SVector, Vector3};
use plica_geometry::isoparametric::{jacobian, shape_gradients};
use plica_sim::*;

use banded::{Banded, Factor};

/// One hexahedron.
struct Element {
    nodes: [usize; 8],
    /// Rest positions from the element's centre [m].
    rest: [Vector3<f64>; 8],
    /// `du/dX` at the centre is `sum u_a g_a^T` [1/m].
    gradients: [Vector3<f64>; 8],
    stiffness: SMatrix<f64, 24, 24>,
}

/// The object and its state.
pub struct Reference {
    description: ModelDescription,
    elements: Vec<Element>,
    /// Lumped mass of each node [kg].
    masses: Vec<f64>,
    /// First degree of freedom of each node that can move.
    dof_of_node: Vec<Option<usize>>,
    n_dofs: usize,
    bandwidth: usize,
    /// Displacements `[n_nodes]` [m].
    pub u: Vec<Vector3<f64>>,
    /// Velocities `[n_nodes]` [m/s].
    pub v: Vec<Vector3<f64>>,
}

impl Reference {
    pub fn new(description: &ModelDescription) -> Self {
        let d = description.clone();
        let elements: Vec<Element> = d
            .mesh
            .hexes()
            .iter()
            .zip(&d.materials)
            .map(|(hex, m)| {
                let corners = hex.map(|n| d.mesh.nodes()[n.index()]);
                Element::new(hex.map(|n| n.index()), &corners, m, d.element)
            })
            .collect();
        let mut masses = vec![0.0; d.mesh.n_nodes()];
        for (element, material) in elements.iter().zip(&d.materials) {
            let corners = element.nodes.map(|n| d.mesh.nodes()[n]);
            let shares = lumped_mass(&corners, material.density_kg_per_m3);
            element.nodes.iter().zip(shares).for_each(|(&n, share)| masses[n] += share);
        }
        let (dof_of_node, n_dofs) = number_dofs(&d);
        let of_element = |e: &Element| {
            let dofs: Vec<usize> = e.nodes.iter().filter_map(|&n| dof_of_node[n]).collect();
            dofs.iter().max().unwrap_or(&0) - dofs.iter().min().unwrap_or(&0) + 2
        };
        let bandwidth = elements.iter().map(of_element).max().unwrap();
        let zero = vec![Vector3::zeros(); d.mesh.n_nodes()];
        Self { elements, masses, dof_of_node, n_dofs, bandwidth, u: zero.clone(), v: zero, description: d }
    }

    /// One implicit Euler step [MG04]: `(M (1 + h alpha) + h^2 K) dv = h f(x + h v) + h M (g - alpha v)`, rotations at its start.
    pub fn step(&mut self) {
        let step = self.prepare();
        let mut dv = step.residual.clone();
        step.factor.solve(&mut dv);
        self.advance(&dv);
    }

    /// Matrix, factored, and right-hand side of a step without contact.
    fn prepare(&self) -> Step {
        let (h, alpha) = (self.description.timestep_s, self.description.mass_damping_per_s);
        let rotations = self.rotations();
        let ahead: Vec<Vector3<f64>> = self.u.iter().zip(&self.v).map(|(u, v)| u + v * h).collect();
        let gravity = self.description.gravity_m_per_s2;
        let forces = self.forces(&ahead, &rotations);
        let loads: Vec<Vector3<f64>> =
            (0..forces.len()).map(|n| (forces[n] + (gravity - self.v[n] * alpha) * self.masses[n]) * h).collect();
        let factor = self.matrix(&rotations, 1.0 + h * alpha, h * h).factor();
        Step { factor, residual: self.to_dofs(&loads) }
    }

    fn advance(&mut self, dv: &[f64]) {
        let h = self.description.timestep_s;
        for (node, dof) in self.dof_of_node.iter().enumerate() {
            if let Some(dof) = *dof {
                self.v[node] += Vector3::new(dv[dof], dv[dof + 1], dv[dof + 2]);
                let v = self.v[node];
                self.u[node] += v * h;
            }
        }
    }

    /// Polar rotation of each element's deformation gradient at its centre.
    fn rotations(&self) -> Vec<Matrix3<f64>> {
        self.elements.iter().map(|e| polar_rotation(&e.deformation_gradient(&self.u))).collect()
    }

    /// `f = -R K (R^T x - X)`, `[n_nodes]` [N].
    fn forces(&self, u: &[Vector3<f64>], rotations: &[Matrix3<f64>]) -> Vec<Vector3<f64>> {
        let mut out = vec![Vector3::zeros(); u.len()];
        for (e, r) in self.elements.iter().zip(rotations) {
            let local = |a: usize| r.transpose() * (e.rest[a] + u[e.nodes[a]]) - e.rest[a];
            let strain = SVector::<f64, 24>::from_fn(|i, _| local(i / 3)[i % 3]);
            let force = e.stiffness * strain;
            (0..8).for_each(|a| out[e.nodes[a]] -= r * force.fixed_rows::<3>(3 * a));
        }
        out
    }

    /// `m M + k K(R)` over the degrees of freedom.
    fn matrix(&self, rotations: &[Matrix3<f64>], m: f64, k: f64) -> Banded {
        let mut out = Banded::zeros(self.n_dofs, self.bandwidth);
        for (e, r) in self.elements.iter().zip(rotations) {
            for (a, b) in (0..8).flat_map(|a| (0..8).map(move |b| (a, b))) {
                let (Some(i), Some(j)) = (self.dof_of_node[e.nodes[a]], self.dof_of_node[e.nodes[b]]) else { continue };
                let block = r * e.stiffness.fixed_view::<3, 3>(3 * a, 3 * b) * r.transpose() * k;
                (0..9).for_each(|x| out.add(i + x / 3, j + x % 3, block[(x / 3, x % 3)]));
            }
        }
        for (node, dof) in self.dof_of_node.iter().enumerate() {
            if let Some(dof) = dof {
                (0..3).for_each(|x| out.add(dof + x, dof + x, m * self.masses[node]));
            }
        }
        out
    }

    fn to_dofs(&self, nodal: &[Vector3<f64>]) -> Vec<f64> {
        let mut out = vec![0.0; self.n_dofs];
        for (value, dof) in nodal.iter().zip(&self.dof_of_node) {
            if let Some(dof) = *dof {
                out[dof..dof + 3].copy_from_slice(value.as_slice());
            }
        }
        out
    }
}

struct Step {
    factor: Factor,
    residual: Vec<f64>,
}

impl Element {
    fn new(nodes: [usize; 8], corners: &[Point3<f64>; 8], material: &Material, kind: ElementKind) -> Self {
        let center = corners.iter().map(|c| c.coords).sum::<Vector3<f64>>() / 8.0;
        let inverse_transpose = jacobian(corners, [0.0; 3]).try_inverse().unwrap().transpose();
        Self {
            nodes,
            rest: corners.map(|c| c.coords - center),
            gradients: shape_gradients([0.0; 3]).map(|g| inverse_transpose * Vector3::from(g)),
            stiffness: rest_stiffness(corners, material, kind),
        }
    }

    fn deformation_gradient(&self, u: &[Vector3<f64>]) -> Matrix3<f64> {
        let term = |(n, g): (&usize, &Vector3<f64>)| u[*n] * g.transpose();
        Matrix3::identity() + self.nodes.iter().zip(&self.gradients).map(term).sum::<Matrix3<f64>>()
    }
}

/// The rotation nearest to `f`.
pub fn polar_rotation(f: &Matrix3<f64>) -> Matrix3<f64> {
    let svd = f.svd(true, true);
    let (mut u, v_t) = (svd.u.unwrap(), svd.v_t.unwrap());
    if (u * v_t).determinant() < 0.0 {
        let weakest = svd.singular_values.imin();
        u.column_mut(weakest).neg_mut();
    }
    u * v_t
}

/// Degrees of freedom of the free nodes, counted along the longest axis so that the band is narrow.
fn number_dofs(d: &ModelDescription) -> (Vec<Option<usize>>, usize) {
    let extent = |axis: usize| d.mesh.nodes().iter().map(|x| x[axis]).fold(0.0, f64::max);
    let axis = (0..3).max_by(|&a, &b| extent(a).total_cmp(&extent(b))).unwrap();
    let mut free: Vec<usize> = (0..d.mesh.n_nodes()).filter(|&n| !d.fixed[n]).collect();
    free.sort_by(|&a, &b| d.mesh.nodes()[a][axis].total_cmp(&d.mesh.nodes()[b][axis]).then(a.cmp(&b)));
    let mut dofs = vec![None; d.mesh.n_nodes()];
    free.iter().enumerate().for_each(|(i, &n)| dofs[n] = Some(3 * i));
    (dofs, 3 * free.len())
}
