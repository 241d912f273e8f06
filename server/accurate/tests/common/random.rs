//! Reproducible random numbers.

use nalgebra::{Matrix3, Vector3};

/// The splitmix64 generator.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform in `[-bound, bound]`.
    pub fn within(&mut self, bound: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bound * (2.0 * ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64 - 1.0)
    }

    pub fn vector(&mut self, bound: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.within(bound))
    }

    pub fn matrix(&mut self, bound: f64) -> Matrix3<f64> {
        Matrix3::from_fn(|_, _| self.within(bound))
    }

    /// The points moved by up to `bound` along each axis.
    pub fn scatter(&mut self, x: &[Vector3<f64>], bound: f64) -> Vec<Vector3<f64>> {
        x.iter().map(|x| x + self.vector(bound)).collect()
    }
}
