//! Rotation of each element: one warm analytic-polar step per tick \[KKB18\], more where an element turns fast or is inverted.
//!
//! `R` maximises `tr(R^T F)`. With `B = R^T F` and a further rotation `exp([omega])`, to second order
//! `tr = tr B + g . omega - 1/2 omega^T H omega`, `g = axial(B)`, `H = tr(B) I - sym(B)`; so `omega = H^-1 g`.
//! Where `H` is not positive definite (inverted or flat elements) the step follows `g / |B|` instead, and every step is
//! capped at a quarter turn, so that no input gives a value that is not finite.

use crate::lanes::{F, Mat3, Vec3, cross, dot};

/// One quaternion (x, y, z, w) per lane.
pub(crate) type Quaternions = [F; 4];

/// No rotation.
pub(crate) const IDENTITY: Quaternions = [F::ZERO, F::ZERO, F::ZERO, F::ONE];

/// A step that turns no lane by more than this leaves an error of the order of its square \[rad\].
const SMALL_TURN: f32 = 0.1;
/// Largest number of steps per call.
const MAX_STEPS: u32 = 8;

/// Turns `q` to the polar rotation of `f` and returns it as a matrix: one step, and more only after a large turn.
#[inline(always)]
pub(crate) fn warm_polar(q: &mut Quaternions, f: &Mat3) -> Mat3 {
    let mut r = matrix(q);
    for _ in 0..MAX_STEPS {
        let b = transpose_product(&r, f);
        let gradient = [b[2][1] - b[1][2], b[0][2] - b[2][0], b[1][0] - b[0][1]];
        let omega = cap(newton_step(&b, gradient));
        *q = turn(q, omega);
        r = matrix(q);
        if !dot(omega, omega).simd_gt(F::splat(SMALL_TURN * SMALL_TURN)).any() {
            break;
        }
    }
    r
}

/// `H^-1 g` where `H` is safely positive definite, else `g / |B|`.
#[inline(always)]
fn newton_step(b: &Mat3, g: Vec3) -> Vec3 {
    let half = F::splat(0.5);
    let rows = [
        [b[1][1] + b[2][2], -(b[0][1] + b[1][0]) * half, -(b[0][2] + b[2][0]) * half],
        [-(b[0][1] + b[1][0]) * half, b[0][0] + b[2][2], -(b[1][2] + b[2][1]) * half],
        [-(b[0][2] + b[2][0]) * half, -(b[1][2] + b[2][1]) * half, b[0][0] + b[1][1]],
    ];
    let columns = [cross(rows[1], rows[2]), cross(rows[2], rows[0]), cross(rows[0], rows[1])];
    let determinant = dot(rows[0], columns[0]);
    let norm = frobenius(b) + F::splat(1e-12);
    let small = F::splat(1e-2) * norm;
    let minor = rows[0][0].mul_sub(rows[1][1], rows[0][1] * rows[0][1]);
    let is_definite =
        rows[0][0].simd_gt(small) & minor.simd_gt(small * norm) & determinant.simd_gt(small * norm * norm);
    let safe = is_definite.select(determinant, F::ONE);
    let newton = [dot(columns[0], g) / safe, dot(columns[1], g) / safe, dot(columns[2], g) / safe];
    std::array::from_fn(|k| is_definite.select(newton[k], g[k] / norm))
}

/// At most a quarter turn: the update below turns by `2 atan(|omega| / 2)`.
#[inline(always)]
fn cap(omega: Vec3) -> Vec3 {
    let length = dot(omega, omega).sqrt();
    let two = F::splat(2.0);
    let factor = two.simd_lt(length).select(two / length.max(F::splat(1e-12)), F::ONE);
    omega.map(|c| c * factor)
}

/// `q (omega / 2, 1)`, normalised.
#[inline(always)]
fn turn(q: &Quaternions, omega: Vec3) -> Quaternions {
    let o = omega.map(|c| c * F::splat(0.5));
    let v = [q[0], q[1], q[2]];
    let vxo = cross(v, o);
    let turned = [
        q[3].mul_add(o[0], v[0]) + vxo[0],
        q[3].mul_add(o[1], v[1]) + vxo[1],
        q[3].mul_add(o[2], v[2]) + vxo[2],
        q[3] - dot(v, o),
    ];
    let squared =
        turned[3].mul_add(turned[3], dot([turned[0], turned[1], turned[2]], [turned[0], turned[1], turned[2]]));
    let inverse = F::ONE / squared.sqrt();
    turned.map(|c| c * inverse)
}

/// Rotation matrix of a unit quaternion.
#[inline(always)]
pub(crate) fn matrix(q: &Quaternions) -> Mat3 {
    let [x, y, z, w] = *q;
    let two = F::splat(2.0);
    [
        [F::ONE - two * (y * y + z * z), two * (x * y - z * w), two * (x * z + y * w)],
        [two * (x * y + z * w), F::ONE - two * (x * x + z * z), two * (y * z - x * w)],
        [two * (x * z - y * w), two * (y * z + x * w), F::ONE - two * (x * x + y * y)],
    ]
}

/// `a^T b`
#[inline(always)]
fn transpose_product(a: &Mat3, b: &Mat3) -> Mat3 {
    std::array::from_fn(|i| {
        std::array::from_fn(|j| a[0][i].mul_add(b[0][j], a[1][i].mul_add(b[1][j], a[2][i] * b[2][j])))
    })
}

#[inline(always)]
fn frobenius(m: &Mat3) -> F {
    (dot(m[0], m[0]) + dot(m[1], m[1]) + dot(m[2], m[2])).sqrt()
}
