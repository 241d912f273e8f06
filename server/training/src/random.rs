//! Random numbers that are the same on every machine.
//!
//! The generator is ChaCha with 8 rounds \[Bernstein08\]: a fixed cipher, not "the default of this year". Key: the seed as eight
//! little-endian bytes, then zeros. Every draw has a stream of its own, numbered by set and candidate, so that one candidate
//! does not depend on how many numbers another one took. Only +, -, *, / and comparisons turn its bits into coordinates,
//! which round alike everywhere.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};

/// What the generator is, for the metadata of a database.
pub const GENERATOR: &str =
    "chacha8, key = seed (u64 le) then zeros, stream = set << 32 | candidate, f64 = u64 >> 11 * 2^-53";

/// A stream of random numbers.
#[derive(Debug, Clone)]
pub(crate) struct Draws {
    generator: ChaCha8Rng,
}

impl Draws {
    /// The stream of one candidate of one set of interactions.
    pub(crate) fn new(seed: u64, set: u32, candidate: u32) -> Self {
        let mut key = [0; 32];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        let mut generator = ChaCha8Rng::from_seed(key);
        generator.set_stream(u64::from(set) << 32 | u64::from(candidate));
        Self { generator }
    }

    /// Uniform in `[0, 1)`, a multiple of 2^-53.
    pub(crate) fn unit(&mut self) -> f64 {
        (self.generator.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in `[least, most)`.
    pub(crate) fn between(&mut self, [least, most]: [f64; 2]) -> f64 {
        least + (most - least) * self.unit()
    }

    /// A uniform direction in the plane: a point of the unit disc, pushed to its rim.
    pub(crate) fn direction(&mut self) -> [f64; 2] {
        loop {
            let (x, y) = (self.between([-1.0, 1.0]), self.between([-1.0, 1.0]));
            let squared = x * x + y * y;
            if (1e-4..=1.0).contains(&squared) {
                let norm = squared.sqrt();
                return [x / norm, y / norm];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The numbers themselves: a database made on one machine can be made again on another.
    #[test]
    fn the_stream_is_pinned() {
        let mut draws = Draws::new(1, 0, 0);
        let first: Vec<u64> = (0..3).map(|_| (draws.unit() * (1_u64 << 53) as f64) as u64).collect();
        assert_eq!(first, PINNED);
    }

    const PINNED: [u64; 3] = [3_436_151_158_611_243, 2_656_469_188_983_456, 7_190_035_062_109_342];

    #[test]
    fn streams_differ_by_seed_set_and_candidate() {
        let first = |seed, set, candidate| Draws::new(seed, set, candidate).unit();
        let all = [first(1, 0, 0), first(2, 0, 0), first(1, 1, 0), first(1, 0, 1)];
        for (i, a) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|b| a != b), "{all:?}");
        }
        assert_eq!(first(1, 0, 0), all[0]);
    }

    #[test]
    fn directions_are_uniform_and_of_unit_length() {
        let mut draws = Draws::new(3, 0, 0);
        let mut sum = [0.0; 2];
        for _ in 0..4000 {
            let [x, y] = draws.direction();
            assert!((x * x + y * y - 1.0).abs() < 1e-12);
            (sum[0], sum[1]) = (sum[0] + x, sum[1] + y);
        }
        // Four standard deviations of the mean of 4000.
        let bound = 4.0 * (0.5_f64 / 4000.0).sqrt();
        assert!(sum.iter().all(|s| (s / 4000.0).abs() < bound), "{sum:?}");
    }
}
