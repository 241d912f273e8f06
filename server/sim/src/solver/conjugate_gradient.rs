//! Preconditioned conjugate gradients \[Saad03, alg. 9.1\], matrix-free.

use super::vector::{add_scaled, dot, norm_squared, scale_and_add};
use crate::lanes::Node;

/// Scratch vectors; `p` has a zero tail for fixed nodes, as the product reads all nodes.
#[derive(Debug, Clone)]
pub(crate) struct CgScratch {
    z: Vec<Node>,
    p: Vec<Node>,
    product: Vec<Node>,
}

impl CgScratch {
    pub(crate) fn new(n_nodes: usize, n_free: usize) -> Self {
        Self { z: vec![[0.0; 4]; n_free], p: vec![[0.0; 4]; n_nodes], product: vec![[0.0; 4]; n_nodes] }
    }
}

/// Stopping criteria.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CgStop {
    /// Norm of the residual at which the solve has converged \[N s\].
    pub(crate) residual: f32,
    /// Largest number of iterations.
    pub(crate) max_iterations: u32,
}

/// Statistics of a solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CgInfo {
    pub(crate) iterations: u32,
    pub(crate) converged: bool,
}

/// Solves `A x = b`, given `x` and `residual = b - A x`; both are updated over the free nodes.
///
/// `multiply(p, out)` writes `A p` for all nodes; what it writes for fixed nodes is ignored. `precondition(r, z)`.
#[inline(always)]
pub(crate) fn conjugate_gradient(
    x: &mut [Node],
    residual: &mut [Node],
    mut multiply: impl FnMut(&[Node], &mut [Node]),
    mut precondition: impl FnMut(&[Node], &mut [Node]),
    stop: CgStop,
    scratch: &mut CgScratch,
) -> CgInfo {
    let n_free = scratch.z.len();
    let (x, r) = (&mut x[..n_free], &mut residual[..n_free]);
    let bound_squared = stop.residual * stop.residual;
    let mut rho = 0.0;
    for iteration in 0..stop.max_iterations {
        if norm_squared(r) <= bound_squared {
            return CgInfo { iterations: iteration, converged: true };
        }
        precondition(r, &mut scratch.z);
        let rho_before = std::mem::replace(&mut rho, dot(r, &scratch.z));
        if iteration == 0 {
            // Copied, since zero times a non-finite direction is not zero.
            scratch.p[..n_free].copy_from_slice(&scratch.z);
        } else {
            scale_and_add(&mut scratch.p[..n_free], rho / rho_before, &scratch.z);
        }
        multiply(&scratch.p, &mut scratch.product);
        let curvature = dot(&scratch.p[..n_free], &scratch.product[..n_free]);
        if curvature.is_nan() || curvature <= 0.0 {
            return CgInfo { iterations: iteration, converged: false };
        }
        let alpha = rho / curvature;
        add_scaled(x, alpha, &scratch.p[..n_free]);
        add_scaled(r, -alpha, &scratch.product[..n_free]);
    }
    CgInfo { iterations: stop.max_iterations, converged: norm_squared(r) <= bound_squared }
}
