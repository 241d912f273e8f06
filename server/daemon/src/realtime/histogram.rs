//! A histogram that one thread writes and any thread reads, without lock or allocation.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Buckets per power of two: values are known to 3 %.
const PER_OCTAVE: u64 = 32;
const OCTAVES: u64 = 36;
const N_BUCKETS: usize = ((OCTAVES + 1) * PER_OCTAVE) as usize;

/// Counts of durations in nanoseconds, in logarithmic buckets up to about a minute.
#[derive(Debug)]
pub struct AtomicHistogram {
    buckets: Box<[AtomicU64]>,
    min_ns: AtomicU64,
    max_ns: AtomicU64,
}

/// Summary of a histogram. Times in nanoseconds; zero without samples.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Summary {
    /// Number of samples.
    pub count: u64,
    /// Least, exactly.
    pub min_ns: u64,
    /// Median.
    pub p50_ns: u64,
    /// 90th percentile.
    pub p90_ns: u64,
    /// 99th percentile.
    pub p99_ns: u64,
    /// 99.9th percentile.
    pub p999_ns: u64,
    /// Greatest, exactly.
    pub max_ns: u64,
}

impl AtomicHistogram {
    /// Empty.
    pub fn new() -> Self {
        let buckets = (0..N_BUCKETS).map(|_| AtomicU64::new(0)).collect();
        Self { buckets, min_ns: AtomicU64::new(u64::MAX), max_ns: AtomicU64::new(0) }
    }

    /// Adds a sample. Meant for one writing thread.
    pub fn record(&self, ns: u64) {
        self.buckets[bucket_of(ns)].fetch_add(1, Relaxed);
        self.min_ns.fetch_min(ns, Relaxed);
        self.max_ns.fetch_max(ns, Relaxed);
    }

    /// Summary of the samples so far.
    pub fn summary(&self) -> Summary {
        let counts: Vec<u64> = self.buckets.iter().map(|b| b.load(Relaxed)).collect();
        let count: u64 = counts.iter().sum();
        if count == 0 {
            return Summary::default();
        }
        let (min_ns, max_ns) = (self.min_ns.load(Relaxed), self.max_ns.load(Relaxed));
        let percentile = |share: f64| {
            let rank = ((share * count as f64).ceil() as u64).max(1);
            let mut seen = 0;
            let bucket = counts.iter().position(|c| {
                seen += c;
                seen >= rank
            });
            middle_of(bucket.unwrap_or(0)).clamp(min_ns.min(max_ns), max_ns)
        };
        Summary {
            count,
            min_ns,
            p50_ns: percentile(0.5),
            p90_ns: percentile(0.9),
            p99_ns: percentile(0.99),
            p999_ns: percentile(0.999),
            max_ns,
        }
    }
}

impl Default for AtomicHistogram {
    fn default() -> Self {
        Self::new()
    }
}

/// Values below 32 have a bucket each; above, the five bits after the leading one choose among 32.
fn bucket_of(ns: u64) -> usize {
    if ns < PER_OCTAVE {
        return ns as usize;
    }
    let octave = u64::from(ns.ilog2()) - 5;
    let index = (octave + 1) * PER_OCTAVE + ((ns >> octave) - PER_OCTAVE);
    (index as usize).min(N_BUCKETS - 1)
}

fn middle_of(bucket: usize) -> u64 {
    let bucket = bucket as u64;
    if bucket < PER_OCTAVE {
        return bucket;
    }
    let octave = bucket / PER_OCTAVE - 1;
    let start = (PER_OCTAVE + bucket % PER_OCTAVE) << octave;
    start + (1 << octave) / 2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_are_in_order_and_middles_are_within_three_percent() {
        let mut last = 0;
        for ns in (0..40).chain((40..2_000_000_000).step_by(1_234_567)) {
            let bucket = bucket_of(ns);
            assert!(bucket >= last, "{ns}");
            last = bucket;
            let error = middle_of(bucket).abs_diff(ns) as f64;
            assert!(error <= 0.032 * ns as f64 + 0.5, "{ns}: {}", middle_of(bucket));
        }
    }

    #[test]
    fn percentiles_of_a_ramp() {
        let histogram = AtomicHistogram::new();
        (1..=100_000).for_each(|ns| histogram.record(ns));
        let s = histogram.summary();
        assert_eq!((s.count, s.min_ns, s.max_ns), (100_000, 1, 100_000));
        for (found, expected) in [(s.p50_ns, 50_000), (s.p90_ns, 90_000), (s.p99_ns, 99_000), (s.p999_ns, 99_900)] {
            assert!(found.abs_diff(expected) < expected / 25, "{found} for {expected}");
        }
    }

    #[test]
    fn huge_values_do_not_leave_the_table() {
        let histogram = AtomicHistogram::new();
        histogram.record(u64::MAX);
        assert_eq!(histogram.summary().max_ns, u64::MAX);
        assert_eq!(AtomicHistogram::new().summary(), Summary::default());
    }
}
