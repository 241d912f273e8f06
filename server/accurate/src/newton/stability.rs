//! Stability of an equilibrium: the signs of the tangent's eigenvalues, and its softest mode.

use nalgebra::{DMatrix, Vector3};

use super::{Problem, Solver, clear_given, dot};
use crate::constraints::Constraints;
use crate::energy::{Energy, Projection};
use crate::newton::report::Params;

/// Largest `|H v - b| / |b|` of a factor whose signs count.
const LARGEST_RESIDUAL: f64 = 1e-6;
/// Shifts of a matrix whose factor is not accurate, as shares of its mean diagonal.
const SMALL_SHIFTS: [f64; 3] = [0.0, 1e-12, -1e-12];
/// First shift that may make an indefinite matrix positive definite, as a share of its mean diagonal; every further one is ten
/// times larger.
const FIRST_SHIFT: f64 = 1e-9;
const MAX_SHIFTS: i32 = 10;
/// Vectors of the Krylov space in which the softest mode is found.
const KRYLOV: usize = 40;

/// Mode of a tangent: an eigenvector with the least eigenvalue.
#[derive(Debug, Clone, PartialEq)]
pub struct Mode {
    /// Directions of the nodes, `[n_nodes]`; the longest has length 1.
    pub shape: Vec<Vector3<f64>>,
    /// `v . H v / v . v` \[N/m\]: negative where the equilibrium is unstable.
    pub curvature: f64,
}

impl Solver {
    /// Number of negative eigenvalues of the tangent at `x: [n_nodes]` \[m\], on the coordinates that are free: 0 at a stable
    /// equilibrium. `None` where the factor is not accurate enough to tell. Loads without a potential count with the symmetric
    /// part of their derivative.
    ///
    /// The tangent is `L D L^T`, and the signs of `D` are those of its eigenvalues (Sylvester's law \[GVL13, 8.1.5\]).
    ///
    /// # Panics
    /// If the lengths of `x` and `constraints` are not those of the analysis.
    pub fn n_negative(
        &mut self,
        energies: &[&dyn Energy],
        constraints: &Constraints,
        x: &[Vector3<f64>],
    ) -> Option<usize> {
        assert_eq!((x.len(), constraints.n_nodes()), (self.gradient.len(), self.gradient.len()), "nodes");
        let problem = Problem { energies, constraints, params: &Params::default() };
        if self.factorise(&problem, [Projection::Exact; 2], false, x) {
            return Some(0);
        }
        let mut shifted = 0.0;
        SMALL_SHIFTS.iter().find_map(|share| {
            let shift = share * self.stiffness;
            self.hessian.add_diagonal(shift - shifted);
            shifted = shift;
            let n_negative = self.factor.factorise_indefinite(&self.hessian).ok()?;
            self.is_accurate(constraints).then_some(n_negative)
        })
    }

    /// Mode of the tangent at `x: [n_nodes]` \[m\] with the least eigenvalue, by Lanczos' method on the inverse of the tangent
    /// made positive definite by a shift \[GVL13, 10.1\]. `None` where no shift helps.
    ///
    /// # Panics
    /// If the lengths of `x` and `constraints` are not those of the analysis.
    pub fn softest_mode(
        &mut self,
        energies: &[&dyn Energy],
        constraints: &Constraints,
        x: &[Vector3<f64>],
    ) -> Option<Mode> {
        assert_eq!((x.len(), constraints.n_nodes()), (self.gradient.len(), self.gradient.len()), "nodes");
        let problem = Problem { energies, constraints, params: &Params::default() };
        let mut is_positive = self.factorise(&problem, [Projection::Exact; 2], false, x);
        let mut shift = 0.0;
        for power in (0..MAX_SHIFTS).take_while(|_| !is_positive).collect::<Vec<_>>() {
            if !is_positive {
                let next = FIRST_SHIFT * 10_f64.powi(power) * self.stiffness;
                self.hessian.add_diagonal(next - shift);
                shift = next;
                is_positive = self.factor.factorise(&self.hessian).is_ok();
            }
        }
        if !is_positive {
            return None;
        }
        let shape = self.largest_of_inverse(constraints);
        let curvature = dot(&shape, &self.hessian.multiply(&shape)) / dot(&shape, &shape) - shift;
        Some(Mode { shape, curvature })
    }

    /// Whether the factor solves an equation with the matrix that it was made of.
    fn is_accurate(&mut self, constraints: &Constraints) -> bool {
        let right = self.scattered(constraints);
        let mut found = right.clone();
        self.factor.solve(&self.hessian, &right, &mut found);
        let product = self.hessian.multiply(&found);
        let miss: Vec<_> = product.iter().zip(&right).map(|(a, b)| a - b).collect();
        dot(&miss, &miss).sqrt() <= LARGEST_RESIDUAL * dot(&right, &right).sqrt()
    }

    /// Eigenvector of the factorised matrix's inverse with the largest eigenvalue; the longest of its vectors has length 1.
    fn largest_of_inverse(&mut self, constraints: &Constraints) -> Vec<Vector3<f64>> {
        let mut basis = vec![self.scattered(constraints)];
        let size = dot(&basis[0], &basis[0]).sqrt();
        basis[0].iter_mut().for_each(|v| *v /= size);
        let mut projected = DMatrix::<f64>::zeros(KRYLOV, KRYLOV);
        let mut n = 0;
        while n < KRYLOV {
            let mut next = basis[n].clone();
            self.factor.solve(&self.hessian, &basis[n], &mut next);
            let length = dot(&next, &next).sqrt();
            // Twice, so that the basis stays orthogonal to rounding.
            for _ in 0..2 {
                for (i, v) in basis.iter().enumerate() {
                    let along = dot(&next, v);
                    projected[(i, n)] += along;
                    next.iter_mut().zip(v).for_each(|(next, v)| *next -= v * along);
                }
            }
            n += 1;
            let left = dot(&next, &next).sqrt();
            if left <= 1e-12 * length {
                break;
            }
            next.iter_mut().for_each(|v| *v /= left);
            basis.push(next);
        }
        // Entries below the diagonal are those above it.
        let square = DMatrix::from_fn(n, n, |i, j| projected[(i.min(j), i.max(j))]);
        let eigen = square.symmetric_eigen();
        let weights = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
        let mut shape = vec![Vector3::zeros(); basis[0].len()];
        for (v, weight) in basis.iter().zip(weights.iter()) {
            shape.iter_mut().zip(v).for_each(|(sum, v)| *sum += v * *weight);
        }
        let longest = shape.iter().map(Vector3::norm).fold(0.0, f64::max);
        shape.iter_mut().for_each(|v| *v /= longest);
        shape
    }

    /// Vectors without symmetry at the nodes, 0 along given axes.
    fn scattered(&self, constraints: &Constraints) -> Vec<Vector3<f64>> {
        // Multiples of irrational numbers, less their whole parts, are spread evenly.
        let spread =
            |n: usize| [0.618_033_988_75, 0.754_877_666_25, 0.569_840_290_998].map(|r| (n as f64 * r).fract() - 0.5);
        let mut vectors: Vec<_> = (1..=self.gradient.len()).map(|n| Vector3::from(spread(n))).collect();
        clear_given(&mut vectors, constraints);
        vectors
    }
}
