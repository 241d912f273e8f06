//! What this machine could do at best: bytes read and multiply-adds per second, on one core.

use std::hint::black_box;
use std::time::Instant;

/// How long each measurement lasts at least.
const SECONDS: f64 = 0.15;

/// Limits of one core.
#[derive(Debug, Clone, Copy)]
pub struct Roofline {
    /// Bytes per second that can be read from a buffer of the given size.
    pub bytes_per_s: f64,
    /// Single-precision operations per second (a multiply-add is two).
    pub flops_per_s: f64,
}

impl Roofline {
    /// Measures, with a buffer as large as a scene's tables.
    pub fn measure(table_bytes: usize) -> Self {
        Self { bytes_per_s: read_bandwidth(table_bytes), flops_per_s: fma_rate() }
    }

    /// The least time in which something that reads `bytes` and computes `flops` can be done \[s\].
    pub fn limit_s(&self, bytes: f64, flops: f64) -> f64 {
        (bytes / self.bytes_per_s).max(flops / self.flops_per_s)
    }
}

/// Best of several passes: adds up the buffer in 64 independent sums, which keeps every load port busy.
fn read_bandwidth(bytes: usize) -> f64 {
    let buffer = vec![1.0_f32; (bytes / 4).max(4096)];
    best_rate(|| {
        let mut sums = [0.0_f32; 64];
        for block in black_box(&buffer).chunks_exact(64) {
            for (sum, x) in sums.iter_mut().zip(block) {
                *sum += x;
            }
        }
        black_box(sums);
        4.0 * buffer.len() as f64
    })
}

/// Best of several passes of independent multiply-adds that never leave the registers.
fn fma_rate() -> f64 {
    const LANES: usize = 80;
    const ROUNDS: usize = 20_000;
    best_rate(|| {
        let mut sums = black_box([1.0_f32; LANES]);
        let (a, b) = (black_box(0.999_f32), black_box(1e-3_f32));
        for _ in 0..ROUNDS {
            for sum in &mut sums {
                *sum = sum.mul_add(a, b);
            }
        }
        black_box(sums);
        (2 * LANES * ROUNDS) as f64
    })
}

/// Largest work per second over repeated passes; `pass` returns its work.
fn best_rate(mut pass: impl FnMut() -> f64) -> f64 {
    let begin = Instant::now();
    let mut best = 0.0_f64;
    while begin.elapsed().as_secs_f64() < SECONDS {
        let start = Instant::now();
        let work = pass();
        best = best.max(work / start.elapsed().as_secs_f64());
    }
    best
}
