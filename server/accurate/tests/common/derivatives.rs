//! The harness that every energy passes: its derivatives against finite differences, and its projected Hessian.

use nalgebra::{DMatrix, DVector, Vector3};
use plica_accurate::{Constraints, Energy, Hessian, Projection};

/// Allowed share of the largest entry. A difference of fourth order over 1e-4 of a length is good to 1e-9 or so.
const TOLERANCE: f64 = 1e-7;

/// Checks at `x`, moving nodes by up to 2e-4 of `length_m` \[m\]:
///
/// * the gradient is the derivative of the value, and the Hessian that of the gradient;
/// * the projected Hessian is positive semi-definite, and exceeds the exact one by a positive semi-definite matrix;
/// * of loads without a potential: Hessian and remainder are together the derivative of the gradient.
pub fn check_derivatives(name: &str, energy: &dyn Energy, x: &[Vector3<f64>], length_m: f64) {
    let step = 1e-4 * length_m;
    let gradient = gradient_of(energy, x);
    let exact = hessian_of(energy, x, Projection::Exact);
    let by_gradient = difference(x, step, |x| gradient_of(energy, x));
    let projected = hessian_of(energy, x, Projection::PositiveSemidefinite);
    assert_positive(name, "projected Hessian", &projected, exact.amax());
    if !energy.has_potential() {
        assert_eq!(energy.value(x), 0.0, "{name}");
        for (hessian, projection) in [(exact, Projection::Exact), (projected, Projection::PositiveSemidefinite)] {
            let derivative = hessian + remainder_of(energy, x, projection);
            assert_near(name, "Hessian and remainder", &derivative, &by_gradient, 0.0);
        }
        return;
    }
    let by_value = difference(x, step, |x| DVector::from_element(1, energy.value(x))).transpose();
    let gradient = DMatrix::from_column_slice(gradient.len(), 1, gradient.as_slice());
    assert_near(name, "gradient", &gradient, &by_value, exact.amax() * step);
    assert_near(name, "Hessian", &exact, &by_gradient, 0.0);
    assert_positive(name, "what projection adds", &(projected - &exact), exact.amax());
}

pub fn gradient_of(energy: &dyn Energy, x: &[Vector3<f64>]) -> DVector<f64> {
    let mut gradient = vec![Vector3::zeros(); x.len()];
    energy.add_gradient(x, &mut gradient);
    DVector::from_iterator(3 * x.len(), gradient.iter().flat_map(|g| [g.x, g.y, g.z]))
}

/// All second derivatives, `[3 n_nodes, 3 n_nodes]`.
pub fn hessian_of(energy: &dyn Energy, x: &[Vector3<f64>], projection: Projection) -> DMatrix<f64> {
    let hessian = Hessian::assemble(&[energy], &Constraints::none(x.len()), x, projection);
    dense(x.len(), |v| hessian.multiply(v))
}

fn remainder_of(energy: &dyn Energy, x: &[Vector3<f64>], projection: Projection) -> DMatrix<f64> {
    dense(x.len(), |v| {
        let mut product = vec![Vector3::zeros(); v.len()];
        energy.add_remainder_product(x, v, projection, &mut product);
        product
    })
}

/// The matrix that takes `v` to `multiply(v)`.
fn dense(n: usize, multiply: impl Fn(&[Vector3<f64>]) -> Vec<Vector3<f64>>) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(3 * n, 3 * n);
    for column in 0..3 * n {
        let mut unit = vec![Vector3::zeros(); n];
        unit[column / 3][column % 3] = 1.0;
        for (row, block) in multiply(&unit).iter().enumerate() {
            matrix.fixed_view_mut::<3, 1>(3 * row, column).copy_from(block);
        }
    }
    matrix
}

pub fn smallest_eigenvalue(matrix: &DMatrix<f64>) -> f64 {
    matrix.symmetric_eigenvalues().min()
}

/// `d f / dx` by central differences of fourth order, one column per coordinate.
fn difference(x: &[Vector3<f64>], step: f64, f: impl Fn(&[Vector3<f64>]) -> DVector<f64>) -> DMatrix<f64> {
    let columns: Vec<_> = (0..3 * x.len())
        .map(|i| {
            let at = |steps: f64| {
                let mut moved = x.to_vec();
                moved[i / 3][i % 3] += steps * step;
                f(&moved)
            };
            ((at(1.0) - at(-1.0)) * 8.0 - (at(2.0) - at(-2.0))) / (12.0 * step)
        })
        .collect();
    DMatrix::from_columns(&columns)
}

fn assert_near(name: &str, what: &str, found: &DMatrix<f64>, expected: &DMatrix<f64>, least_size: f64) {
    let (miss, size) = ((found - expected).amax(), expected.amax().max(least_size));
    assert!(miss <= TOLERANCE * size, "{what} of {name}: off by {miss:e}, largest entry {size:e}");
}

fn assert_positive(name: &str, what: &str, matrix: &DMatrix<f64>, size: f64) {
    let smallest = smallest_eigenvalue(matrix);
    assert!(smallest >= -1e-10 * size, "{what} of {name}: smallest eigenvalue {smallest:e}, largest entry {size:e}");
}
