//! Dirichlet conditions: given coordinates and their targets.

use nalgebra::Vector3;

/// Given positions: `target[n][k]` holds where `is_given[n][k]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Constraints {
    is_given: Vec<[bool; 3]>,
    target: Vec<Vector3<f64>>,
}

impl Constraints {
    /// Nothing given, `[n_nodes]`.
    pub fn none(n_nodes: usize) -> Self {
        Self { is_given: vec![[false; 3]; n_nodes], target: vec![Vector3::zeros(); n_nodes] }
    }

    /// Gives one coordinate of a node \[m\]; a later call for the same one replaces it.
    pub fn give(&mut self, node: usize, axis: usize, position_m: f64) {
        self.is_given[node][axis] = true;
        self.target[node][axis] = position_m;
    }

    /// Gives all coordinates of a node \[m\].
    pub fn hold(&mut self, node: usize, position_m: &Vector3<f64>) {
        (0..3).for_each(|axis| self.give(node, axis, position_m[axis]));
    }

    /// Number of nodes.
    pub fn n_nodes(&self) -> usize {
        self.is_given.len()
    }

    /// Whether each coordinate of a node is given.
    pub fn is_given(&self, node: usize) -> [bool; 3] {
        self.is_given[node]
    }

    /// Remaining motion of the given coordinates of a node from `x` to their targets \[m\]; 0 for free ones.
    pub(crate) fn remaining(&self, node: usize, x: &Vector3<f64>) -> Vector3<f64> {
        let given = self.is_given[node];
        Vector3::from_fn(|k, _| if given[k] { self.target[node][k] - x[k] } else { 0.0 })
    }

    /// Sets the given coordinates of `x` to their targets, without the rounding of a step.
    pub(crate) fn place(&self, x: &mut [Vector3<f64>]) {
        for (x, (given, target)) in x.iter_mut().zip(self.is_given.iter().zip(&self.target)) {
            (0..3).filter(|&k| given[k]).for_each(|k| x[k] = target[k]);
        }
    }
}
