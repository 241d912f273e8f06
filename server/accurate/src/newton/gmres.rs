//! Newton's equation with loads that have no potential, by GMRES on the factorised Hessian of the rest.

use nalgebra::{DMatrix, DVector, Vector3};

/// Residual, as a share of the first, at which iterations end.
const TOLERANCE: f64 = 1e-8;
const MAX_ITERATIONS: usize = 60;

/// Solves `(H + R) d = b` for `d`, which starts as `H^-1 b`; `apply(v, out)` is `out = H^-1 R v` \[Saad03, alg. 6.9\].
///
/// `R` acts on the loaded faces and is small against `H` short of an instability, so that a few iterations suffice. If
/// they do not, `d` is the best direction found.
pub(super) fn solve(d: &mut [Vector3<f64>], mut apply: impl FnMut(&[Vector3<f64>], &mut [Vector3<f64>])) {
    let size = norm(d);
    if size == 0.0 {
        return;
    }
    let mut basis = vec![scaled(d, 1.0 / size)];
    let mut hessenberg = DMatrix::<f64>::zeros(MAX_ITERATIONS + 1, MAX_ITERATIONS);
    let mut weights = DVector::zeros(0);
    for k in 0..MAX_ITERATIONS {
        let mut next = vec![Vector3::zeros(); d.len()];
        apply(&basis[k], &mut next);
        add(&mut next, &basis[k], 1.0);
        for (i, v) in basis.iter().enumerate() {
            hessenberg[(i, k)] = dot(&next, v);
            add(&mut next, v, -hessenberg[(i, k)]);
        }
        hessenberg[(k + 1, k)] = norm(&next);
        let left;
        (weights, left) = least_squares(&hessenberg.view((0, 0), (k + 2, k + 1)).into_owned(), size);
        if left <= TOLERANCE * size || hessenberg[(k + 1, k)] == 0.0 {
            break;
        }
        basis.push(scaled(&next, 1.0 / hessenberg[(k + 1, k)]));
    }
    d.fill(Vector3::zeros());
    basis.iter().zip(weights.iter()).for_each(|(v, w)| add(d, v, *w));
}

/// `y` that minimises `|beta e_1 - H y|`, and that norm.
fn least_squares(hessenberg: &DMatrix<f64>, beta: f64) -> (DVector<f64>, f64) {
    let mut right_hand_side = DVector::zeros(hessenberg.nrows());
    right_hand_side[0] = beta;
    let qr = hessenberg.clone().qr();
    let reduced = qr.q().tr_mul(&right_hand_side);
    let y = qr.r().solve_upper_triangular(&reduced).unwrap_or_else(|| DVector::zeros(hessenberg.ncols()));
    let left = (right_hand_side - hessenberg * &y).norm();
    (y, left)
}

fn dot(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

fn norm(a: &[Vector3<f64>]) -> f64 {
    dot(a, a).sqrt()
}

fn scaled(a: &[Vector3<f64>], factor: f64) -> Vec<Vector3<f64>> {
    a.iter().map(|a| a * factor).collect()
}

fn add(sum: &mut [Vector3<f64>], a: &[Vector3<f64>], factor: f64) {
    sum.iter_mut().zip(a).for_each(|(sum, a)| *sum += a * factor);
}
