//! The implicit matrix at rest, `A_0 = M (1 + h alpha) + h^2 K`, over free nodes; offline, `f64`.

use std::collections::BTreeMap;

use nalgebra::Matrix3;

use super::ordering::NodeOrder;
use crate::description::ModelDescription;
use crate::element::rest_stiffness;

/// Symmetric block-sparse matrix; `rows[i][j]` is the 3x3 block of free nodes `i`, `j` \[kg\].
#[derive(Debug, Clone)]
pub(crate) struct RestMatrix {
    pub(crate) rows: Vec<BTreeMap<usize, Matrix3<f64>>>,
}

impl RestMatrix {
    /// `node_mass` is `[n_nodes]` in internal order \[kg\]; `h` the step \[s\].
    pub(crate) fn new(description: &ModelDescription, order: &NodeOrder, node_mass: &[f64], h: f64) -> Self {
        let ModelDescription { mesh, materials, element, mass_damping_per_s: mass_damping, .. } = description;
        let n_free = order.n_free();
        let mut rows: Vec<BTreeMap<usize, Matrix3<f64>>> = vec![BTreeMap::new(); n_free];
        for (hex, material) in mesh.hexes().iter().zip(materials) {
            let stiffness = rest_stiffness(&hex.map(|n| mesh.nodes()[n.index()]), material, *element);
            let internal = hex.map(|n| order.internal_of_mesh[n.index()] as usize);
            for (a, &i) in internal.iter().enumerate().filter(|&(_, &i)| i < n_free) {
                for (b, &j) in internal.iter().enumerate().filter(|&(_, &j)| j < n_free) {
                    let block = stiffness.fixed_view::<3, 3>(3 * a, 3 * b) * (h * h);
                    *rows[i].entry(j).or_insert_with(Matrix3::zeros) += block;
                }
            }
        }
        for (i, row) in rows.iter_mut().enumerate() {
            *row.entry(i).or_insert_with(Matrix3::zeros) +=
                Matrix3::identity() * (node_mass[i] * (1.0 + h * mass_damping));
        }
        Self { rows }
    }

    /// The block of free nodes `i`, `j`; zero where they are not coupled.
    pub(crate) fn block(&self, i: usize, j: usize) -> Matrix3<f64> {
        self.rows[i].get(&j).copied().unwrap_or_else(Matrix3::zeros)
    }
}
