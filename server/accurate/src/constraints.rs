//! Dirichlet conditions: given coordinates and their targets.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

/// Part of a direction that earlier conditions of a node leave open, below which they determine it.
const DETERMINED: f64 = 1e-6;
/// Share of a coordinate below which the distance from an oblique target is rounding.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Given positions: `target[n][k]` holds where `is_given[n][k]`, along axis `k` of the node's frame; that frame is x, y, z
/// unless an oblique direction of the node is given.
#[derive(Debug, Clone, PartialEq)]
pub struct Constraints {
    is_given: Vec<[bool; 3]>,
    target: Vec<Vector3<f64>>,
    /// Orthonormal axes, as columns, of nodes with an oblique condition.
    frames: BTreeMap<usize, Matrix3<f64>>,
}

impl Constraints {
    /// Nothing given, `[n_nodes]`.
    pub fn none(n_nodes: usize) -> Self {
        Self { is_given: vec![[false; 3]; n_nodes], target: vec![Vector3::zeros(); n_nodes], frames: BTreeMap::new() }
    }

    /// Gives one coordinate of a node \[m\]; a later call for the same one replaces it, unless an oblique direction of the
    /// node is given.
    pub fn give(&mut self, node: usize, axis: usize, position_m: f64) {
        if self.frames.contains_key(&node) {
            self.give_along(node, &unit(axis), position_m);
            return;
        }
        self.is_given[node][axis] = true;
        self.target[node][axis] = position_m;
    }

    /// Gives all coordinates of a node \[m\].
    pub fn hold(&mut self, node: usize, position_m: &Vector3<f64>) {
        (0..3).for_each(|axis| self.give(node, axis, position_m[axis]));
    }

    /// Gives the coordinate `direction . x` of a node \[m\], for a unit vector of any direction. Where earlier conditions of the
    /// node determine it, nothing changes, and what `position_m` exceeds theirs by is returned \[m\].
    pub fn give_along(&mut self, node: usize, direction: &Vector3<f64>, position_m: f64) -> Option<f64> {
        let given: Vec<_> = (0..3).filter(|&k| self.is_given[node][k]).map(|k| self.axis(node, k)).collect();
        let targets: Vec<_> = (0..3).filter(|&k| self.is_given[node][k]).map(|k| self.target[node][k]).collect();
        let (mut open, mut position) = (*direction, position_m);
        for (axis, target) in given.iter().zip(&targets) {
            open -= axis * axis.dot(direction);
            position -= target * axis.dot(direction);
        }
        let size = open.norm();
        if size <= DETERMINED {
            return Some(position);
        }
        let (open, position) = (open / size, position / size);
        let along = (0..3).find(|&k| open == unit(k) && !self.frames.contains_key(&node));
        if let Some(axis) = along {
            self.give(node, axis, position);
            return None;
        }
        let axes: Vec<_> = given.into_iter().chain([open]).collect();
        self.frames.insert(node, frame(&axes));
        self.is_given[node] = std::array::from_fn(|k| k < axes.len());
        self.target[node] = Vector3::from_iterator(targets.into_iter().chain([position, 0.0, 0.0]).take(3));
        None
    }

    /// Number of nodes.
    pub fn n_nodes(&self) -> usize {
        self.is_given.len()
    }

    /// Whether each coordinate of a node is given, along the axes of its frame.
    pub fn is_given(&self, node: usize) -> [bool; 3] {
        self.is_given[node]
    }

    /// Axis `k` of a node's frame, a unit vector.
    pub fn axis(&self, node: usize, k: usize) -> Vector3<f64> {
        self.frames.get(&node).map_or_else(|| unit(k), |frame| frame.column(k).into_owned())
    }

    /// Frames other than x, y, z, by node.
    pub(crate) fn frames(&self) -> &BTreeMap<usize, Matrix3<f64>> {
        &self.frames
    }

    /// Sets the given components of a vector at a node to 0.
    pub(crate) fn clear_given(&self, node: usize, v: &mut Vector3<f64>) {
        for k in (0..3).filter(|&k| self.is_given[node][k]) {
            match self.frames.get(&node) {
                None => v[k] = 0.0,
                Some(frame) => *v -= frame.column(k) * frame.column(k).dot(v),
            }
        }
    }

    /// Remaining motion of the given coordinates of a node from `x` to their targets \[m\]; 0 along free axes.
    pub(crate) fn remaining(&self, node: usize, x: &Vector3<f64>) -> Vector3<f64> {
        let (given, target) = (self.is_given[node], &self.target[node]);
        let Some(frame) = self.frames.get(&node) else {
            return Vector3::from_fn(|k, _| if given[k] { target[k] - x[k] } else { 0.0 });
        };
        let rounding = ROUNDING * x.amax();
        let left = target - frame.tr_mul(x);
        frame * Vector3::from_fn(|k, _| if given[k] && left[k].abs() > rounding { left[k] } else { 0.0 })
    }

    /// Sets the given coordinates of `x` to their targets, without the rounding of a step.
    pub(crate) fn place(&self, x: &mut [Vector3<f64>]) {
        for (node, x) in x.iter_mut().enumerate() {
            let given = self.is_given[node];
            if self.frames.contains_key(&node) {
                *x += self.remaining(node, x);
            } else {
                (0..3).filter(|&k| given[k]).for_each(|k| x[k] = self.target[node][k]);
            }
        }
    }
}

fn unit(axis: usize) -> Vector3<f64> {
    Vector3::from_fn(|k, _| if k == axis { 1.0 } else { 0.0 })
}

/// Orthonormal columns that begin with the one to three orthonormal `axes`.
fn frame(axes: &[Vector3<f64>]) -> Matrix3<f64> {
    let first = axes[0];
    let second = axes.get(1).copied().unwrap_or_else(|| first.cross(&unit(first.iamin())).normalize());
    let third = axes.get(2).copied().unwrap_or_else(|| first.cross(&second));
    Matrix3::from_columns(&[first, second, third])
}
