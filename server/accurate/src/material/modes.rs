//! Negative eigenvalues of an isotropic tangent, in the frame of the singular values.

use nalgebra::{Matrix3, Vector3};

/// Eigenvalues above minus this share of `2 psi_I` count as 0: at rest three of them are.
const ROUNDING: f64 = 1e-13;

/// Factors of a tangent `identity 1 + along_f F (x) F + along_both (F (x) C + C (x) F) + along_cofactor C (x) C + curvature d^2 J`.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Factors {
    pub(super) identity: f64,
    pub(super) along_f: f64,
    pub(super) along_both: f64,
    pub(super) along_cofactor: f64,
    pub(super) curvature: f64,
}

/// Eigenpairs of a tangent with a negative eigenvalue: at most three of the stretches, three flips and three twists.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct NegativeModes {
    modes: [(f64, Matrix3<f64>); 9],
    n: usize,
}

impl NegativeModes {
    /// Of a tangent with the given [`Factors`] \[SGK19\]. With
    /// `F = U diag(s) V^T`, `U` and `V` rotations:
    ///
    /// * flips `U (e_i e_j^T + e_j e_i^T) V^T / sqrt 2` and twists `U (e_i e_j^T - e_j e_i^T) V^T / sqrt 2` have eigenvalues
    ///   `identity -+ curvature s_k`, `k` being the third axis;
    /// * stretches `U diag(y) V^T` have those of `A = identity I + along_f s s^T + along_both (s c^T + c s^T) + along_cofactor c
    ///   c^T + curvature S`, `c_k = s_i s_j`, `S_ij = s_k`.
    pub(super) fn new(f: &Matrix3<f64>, factors: &Factors) -> Self {
        let Factors { identity, along_f, along_both, along_cofactor, curvature } = *factors;
        let mut found = Self::default();
        let (u, s, v) = singular_values(f);
        for k in 0..3 {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let cross = |sign: f64| {
                let (ij, ji) = (u.column(i) * v.column(j).transpose(), u.column(j) * v.column(i).transpose());
                (ij + ji * sign) * std::f64::consts::FRAC_1_SQRT_2
            };
            found.add(identity, identity - curvature * s[k], || cross(1.0));
            found.add(identity, identity + curvature * s[k], || cross(-1.0));
        }
        let c = Vector3::new(s.y * s.z, s.z * s.x, s.x * s.y);
        let third = Matrix3::new(0.0, s.z, s.y, s.z, 0.0, s.x, s.y, s.x, 0.0);
        let mut stretch = Matrix3::from_diagonal_element(identity)
            + s * s.transpose() * along_f
            + c * c.transpose() * along_cofactor
            + third * curvature;
        if along_both != 0.0 {
            stretch += (s * c.transpose() + c * s.transpose()) * along_both;
        }
        let eigen = stretch.symmetric_eigen();
        for (value, y) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            found.add(identity, *value, || u * Matrix3::from_diagonal(&y.into_owned()) * v.transpose());
        }
        found
    }

    pub(super) fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// The block of gradients `a` and `b` that lifts the negative eigenvalues to 0.
    pub(super) fn lift(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> Matrix3<f64> {
        let modes = self.modes[..self.n].iter();
        modes.fold(Matrix3::zeros(), |sum, (lift, mode)| sum + mode * a * (mode * b).transpose() * *lift)
    }

    fn add(&mut self, scale: f64, eigenvalue: f64, mode: impl FnOnce() -> Matrix3<f64>) {
        if eigenvalue < -ROUNDING * scale {
            self.modes[self.n] = (-eigenvalue, mode());
            self.n += 1;
        }
    }
}

/// `F = U diag(s) V^T` with rotations `U` and `V`; `s_1 >= s_2 >= |s_3|`, the last with the sign of `det F`. One-sided
/// Jacobi rotations \[GVL13, 8.6.3\]: small singular values keep their accuracy, and singular `F` need no care.
pub(super) fn singular_values(f: &Matrix3<f64>) -> (Matrix3<f64>, Vector3<f64>, Matrix3<f64>) {
    const MAX_SWEEPS: usize = 30;
    let (mut a, mut v) = (*f, Matrix3::identity());
    for _ in 0..MAX_SWEEPS {
        let turned = [(0, 1), (0, 2), (1, 2)].map(|(p, q)| orthogonalise(&mut a, &mut v, p, q));
        if turned == [false; 3] {
            break;
        }
    }
    sort_columns(&mut a, &mut v);
    let first = unit_or(a.column(0).into_owned(), Vector3::x());
    let across = a.column(1) - first * first.dot(&a.column(1));
    let second = unit_or(across, any_normal(&first));
    let third = first.cross(&second);
    let u = Matrix3::from_columns(&[first, second, third]);
    (u, Vector3::new(a.column(0).norm(), second.dot(&a.column(1)), third.dot(&a.column(2))), v)
}

/// Turns columns `p` and `q` of `a` (and `v`) so that those of `a` are orthogonal; whether they were not.
fn orthogonalise(a: &mut Matrix3<f64>, v: &mut Matrix3<f64>, p: usize, q: usize) -> bool {
    let (x, y) = (a.column(p).into_owned(), a.column(q).into_owned());
    let (xx, yy, xy) = (x.norm_squared(), y.norm_squared(), x.dot(&y));
    if xy.abs() <= f64::EPSILON * (xx * yy).sqrt() || xy == 0.0 {
        return false;
    }
    let zeta = (yy - xx) / (2.0 * xy);
    let t = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
    let c = 1.0 / t.hypot(1.0);
    for m in [a, v] {
        let (x, y) = (m.column(p).into_owned(), m.column(q).into_owned());
        m.set_column(p, &((x - y * t) * c));
        m.set_column(q, &((x * t + y) * c));
    }
    true
}

/// Longest column first; swaps keep `v` a rotation.
fn sort_columns(a: &mut Matrix3<f64>, v: &mut Matrix3<f64>) {
    for (p, q) in [(0, 1), (0, 2), (1, 2)] {
        if a.column(p).norm_squared() < a.column(q).norm_squared() {
            for m in [&mut *a, &mut *v] {
                m.swap_columns(p, q);
                m.column_mut(q).neg_mut();
            }
        }
    }
}

fn unit_or(x: Vector3<f64>, otherwise: Vector3<f64>) -> Vector3<f64> {
    x.try_normalize(f64::MIN_POSITIVE).unwrap_or(otherwise)
}

fn any_normal(x: &Vector3<f64>) -> Vector3<f64> {
    let axis = Vector3::from_fn(|k, _| if k == x.iamin() { 1.0 } else { 0.0 });
    x.cross(&axis).normalize()
}
