//! Cubic step with zero slope at both ends.

/// `x^2 (3 - 2 x)` on `[0, 1]`; 0 below, 1 above.
pub(crate) fn smoothstep(x: f32) -> f32 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}
