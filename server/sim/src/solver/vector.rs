//! Sums and products over nodal vectors. A node is padded to four floats and the padding is zero, so a vector is one flat
//! slice of floats.

use crate::lanes::{F, LANES, Node};

/// `a . b`, summed in sixteen lanes: the order is fixed, so the result is the same on every machine.
#[inline(always)]
pub(crate) fn dot(a: &[Node], b: &[Node]) -> f32 {
    let (a, b) = (a.as_flattened(), b.as_flattened());
    let (a_chunks, a_rest) = a.as_chunks::<LANES>();
    let (b_chunks, b_rest) = b.as_chunks::<LANES>();
    let mut sum = F::ZERO;
    for (x, y) in a_chunks.iter().zip(b_chunks) {
        sum = F::new(*x).mul_add(F::new(*y), sum);
    }
    let rest: f32 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    sum.to_array().iter().sum::<f32>() + rest
}

/// `a . a`
#[inline(always)]
pub(crate) fn norm_squared(a: &[Node]) -> f32 {
    dot(a, a)
}

/// `y += s x`
#[inline(always)]
pub(crate) fn add_scaled(y: &mut [Node], s: f32, x: &[Node]) {
    for (y, x) in y.as_flattened_mut().iter_mut().zip(x.as_flattened()) {
        *y = s.mul_add(*x, *y);
    }
}

/// `y = x + s y`
#[inline(always)]
pub(crate) fn scale_and_add(y: &mut [Node], s: f32, x: &[Node]) {
    for (y, x) in y.as_flattened_mut().iter_mut().zip(x.as_flattened()) {
        *y = s.mul_add(*y, *x);
    }
}

#[inline(always)]
pub(crate) fn set_zero(v: &mut [Node]) {
    v.fill([0.0; 4]);
}
