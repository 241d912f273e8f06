//! The clock of a source of poses, followed on the caller's clock: offset and drift.
//!
//! A sample taken at `s` on the source's clock arrives at `a = s + o(s) + latency`, `latency >= 0`, where the offset `o`
//! changes by `drift` per second. Its least values over a sliding window tell both:
//!
//! ```text
//! least of each block      m_i = min (a - s),   t_i: when
//! drift                    slope of the line through (t_i, m_i) of the window, least squares
//! offset                   o(t) = min_i m_i + drift (t - t_i)
//! followed                 x' = drift + (o - x) / tau,   |x'| at most MAX_RATE
//! ```
//! The followed offset has no steps, so that what is played back has none. While too little is known the least value so far is
//! taken as it is; a clock that was set anew is taken over at once.

/// Length of a block \[s\].
const BLOCK_S: f64 = 0.5;
/// Blocks of the window.
const N_BLOCKS: usize = 64;
/// Blocks from which on a drift is believed.
const ENOUGH_BLOCKS: usize = 8;
/// How long the least value so far is taken as it is \[s\].
const BEGINNING_S: f64 = 2.0;
/// Time constant of following \[s\].
const TAU_S: f64 = 10.0;
/// Fastest change of the followed offset, and largest drift \[-\].
const MAX_RATE: f64 = 5e-3;
/// A clock that is off by more than this was set \[s\].
const SET_S: f64 = 0.25;

/// The least difference between arrival and source time in a block, and when that sample arrived \[s\].
#[derive(Debug, Clone, Copy)]
struct Least {
    at_s: f64,
    difference_s: f64,
}

/// A line in time.
#[derive(Debug, Clone, Copy)]
struct Line {
    at_s: f64,
    offset_s: f64,
}

/// What a sample said of its source's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Observed {
    /// It goes on, or it is the first time.
    Known,
    /// It was set forward; earlier times are on another clock.
    ClockWasSet,
}

/// Follows the clock of one source.
#[derive(Debug, Clone)]
pub(crate) struct SourceClock {
    began_s: f64,
    blocks: [Least; N_BLOCKS],
    n_blocks: usize,
    block: Option<Least>,
    block_end_s: f64,
    line: Line,
    drift: f64,
    /// The offset in use; none before the first sample.
    followed_s: Option<f64>,
}

impl SourceClock {
    pub(crate) fn new() -> Self {
        let nothing = Least { at_s: 0.0, difference_s: 0.0 };
        Self {
            began_s: 0.0,
            blocks: [nothing; N_BLOCKS],
            n_blocks: 0,
            block: None,
            block_end_s: 0.0,
            line: Line { at_s: 0.0, offset_s: 0.0 },
            drift: 0.0,
            followed_s: None,
        }
    }

    /// Caller's clock less source clock, as it is followed now \[s\].
    pub(crate) fn offset_s(&self) -> f64 {
        self.followed_s.unwrap_or(0.0)
    }

    /// A sample with a source time has arrived.
    pub(crate) fn observe(&mut self, arrival_s: f64, source_s: f64) -> Observed {
        let seen = Least { at_s: arrival_s, difference_s: arrival_s - source_s };
        let Some(followed_s) = self.followed_s else {
            self.begin(seen);
            return Observed::Known;
        };
        if seen.difference_s < followed_s - SET_S {
            self.begin(seen);
            return Observed::ClockWasSet;
        }
        if arrival_s >= self.block_end_s {
            self.close_block(arrival_s);
        }
        let least = self.block.filter(|block| block.difference_s <= seen.difference_s);
        self.block = Some(least.unwrap_or(seen));
        if seen.difference_s < self.line_at(arrival_s) {
            self.line = Line { at_s: arrival_s, offset_s: seen.difference_s };
        }
        if arrival_s < self.began_s + BEGINNING_S {
            self.followed_s = Some(followed_s.min(seen.difference_s));
        }
        Observed::Known
    }

    /// Goes on by `dt` seconds, to `clock_s`.
    pub(crate) fn advance(&mut self, clock_s: f64, dt: f64) {
        let Some(followed_s) = self.followed_s else { return };
        if clock_s < self.began_s + BEGINNING_S {
            return;
        }
        let ahead_s = self.line_at(clock_s) - followed_s;
        let rate = (self.drift + ahead_s / TAU_S).clamp(-MAX_RATE, MAX_RATE);
        self.followed_s = Some(if ahead_s.abs() > SET_S { followed_s + ahead_s } else { followed_s + rate * dt });
    }

    fn begin(&mut self, seen: Least) {
        *self = Self {
            began_s: seen.at_s,
            block: Some(seen),
            block_end_s: seen.at_s + BLOCK_S,
            line: Line { at_s: seen.at_s, offset_s: seen.difference_s },
            followed_s: Some(seen.difference_s),
            ..Self::new()
        };
    }

    fn line_at(&self, clock_s: f64) -> f64 {
        self.line.offset_s + self.drift * (clock_s - self.line.at_s)
    }

    /// Puts the block that has ended into the window, and draws the line through the window anew.
    fn close_block(&mut self, now_s: f64) {
        if let Some(block) = self.block.take() {
            if self.n_blocks == N_BLOCKS {
                self.blocks.rotate_left(1);
                self.n_blocks -= 1;
            }
            self.blocks[self.n_blocks] = block;
            self.n_blocks += 1;
        }
        self.block_end_s = now_s + BLOCK_S;
        let window_s = BLOCK_S * N_BLOCKS as f64;
        let n_old = self.blocks[..self.n_blocks].iter().take_while(|b| b.at_s < now_s - 2.0 * window_s).count();
        self.blocks.copy_within(n_old..self.n_blocks, 0);
        self.n_blocks -= n_old;
        let blocks = &self.blocks[..self.n_blocks];
        if blocks.len() >= ENOUGH_BLOCKS {
            self.drift = slope(blocks).clamp(-MAX_RATE, MAX_RATE);
        }
        let offset_now = |b: &Least| b.difference_s + self.drift * (now_s - b.at_s);
        if let Some(offset_s) = blocks.iter().map(offset_now).reduce(f64::min) {
            self.line = Line { at_s: now_s, offset_s };
        }
    }
}

/// Least-squares slope.
fn slope(blocks: &[Least]) -> f64 {
    let n = blocks.len() as f64;
    let mean = |of: fn(&Least) -> f64| blocks.iter().map(of).sum::<f64>() / n;
    let (t, d) = (mean(|b| b.at_s), mean(|b| b.difference_s));
    let (mut covariance, mut variance) = (0.0, 0.0);
    for block in blocks {
        covariance += (block.at_s - t) * (block.difference_s - d);
        variance += (block.at_s - t).powi(2);
    }
    if variance > 0.0 { covariance / variance } else { 0.0 }
}
