//! The linear solve of the implicit step: conjugate gradients on `A dv = r`, `A = M (1 + h alpha) + h^2 K(R) + contact`,
//! preconditioned with the inverse of the rest matrix `A_0`.
//!
//! A truncated solve with a rest-state preconditioner injects energy when elements are inverted; truncated block Jacobi
//! never did. So a solve that does not converge is restored and repeated with block Jacobi (see [`crate::tick`]).

mod block_jacobi;
mod block_tridiagonal;
mod conjugate_gradient;
mod ordering;
mod rest_matrix;
mod vector;

pub(crate) use block_jacobi::BlockJacobi;
pub(crate) use block_tridiagonal::{BlockTridiagonal, WarpScratch};
pub(crate) use conjugate_gradient::{CgInfo, CgScratch, CgStop, conjugate_gradient};
pub(crate) use ordering::NodeOrder;
pub(crate) use rest_matrix::RestMatrix;
pub(crate) use vector::{norm_squared, set_zero};
