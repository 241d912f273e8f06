//! The samples of one tool that a delay may look back to.

use nalgebra::Isometry3;

/// A sample in world coordinates with its arrival.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ReceivedPose {
    /// Counts samples, from 1.
    pub(crate) number: u64,
    pub(crate) arrival_s: f64,
    /// Time on the source's clock since its first sample, if it knows it.
    pub(crate) source_s: Option<f64>,
    pub(crate) world_from_tool: Isometry3<f64>,
    /// The tool cannot have moved here from the sample before: it is placed.
    pub(crate) is_jump: bool,
}

/// Samples kept without a delay.
const FEW: usize = 16;
/// Of samples that are kept, those two apart lie at least this far apart \[s\]: a source above 2 kHz is thinned out.
const SPACING_S: f64 = 1e-3;
/// How much further back than the delay the samples reach \[s\]: a slow tracker's interval, and late packets.
const MARGIN_S: f64 = 0.1;

/// The newest samples, in order of number. Its room is made when the ring is.
#[derive(Debug)]
pub(crate) struct PoseRing {
    /// The sample of number `n` lies at `n % samples.len()`.
    samples: Vec<Option<ReceivedPose>>,
    oldest: u64,
    newest: u64,
    spacing_s: f64,
}

impl PoseRing {
    /// A ring that reaches back by a delay \[s\] at any rate.
    pub(crate) fn new(delay_s: Option<f64>) -> Self {
        let n_samples = delay_s.map_or(0, |delay_s| (2.0 * (delay_s + MARGIN_S) / SPACING_S).ceil() as usize) + FEW;
        let spacing_s = delay_s.map_or(0.0, |_| SPACING_S);
        Self { samples: vec![None; n_samples], oldest: 1, newest: 0, spacing_s }
    }

    /// The newest sample.
    pub(crate) fn newest(&self) -> Option<&ReceivedPose> {
        self.get(self.newest)
    }

    /// The sample of a number, if it is kept.
    pub(crate) fn get(&self, number: u64) -> Option<&ReceivedPose> {
        self.samples[self.place(number)].as_ref().filter(|sample| sample.number == number)
    }

    /// Forgets all samples; numbers go on.
    pub(crate) fn clear(&mut self) {
        self.samples.fill(None);
        self.oldest = self.newest + 1;
    }

    /// Takes a sample in and numbers it. It replaces the newest one if that lies too close to the one before it, is no
    /// jump, and has not been `reached` by a target.
    pub(crate) fn push(&mut self, mut sample: ReceivedPose, reached: u64) {
        let is_spare = |newest: &ReceivedPose| newest.number > reached && !newest.is_jump && !sample.is_jump;
        let before = self.newest().filter(|newest| is_spare(newest)).and_then(|newest| self.get(newest.number - 1));
        if before.is_none_or(|before| time_between_s(before, &sample) >= self.spacing_s) {
            self.newest += 1;
        }
        sample.number = self.newest;
        let place = self.place(self.newest);
        self.samples[place] = Some(sample);
        self.oldest = self.oldest.max((self.newest + 1).saturating_sub(self.samples.len() as u64));
    }

    /// Whether any of the samples after number `after`, up to number `last`, is a jump.
    pub(crate) fn has_jump(&self, after: u64, last: u64) -> bool {
        let first = (after + 1).max(self.oldest);
        (first..=last).any(|number| self.get(number).is_some_and(|sample| sample.is_jump))
    }

    /// The last sample at which `time_of` is at most `time_s`, and the one after it; only the latter if there is none
    /// so old. Times must not fall along the ring.
    pub(crate) fn around(&self, time_s: f64, time_of: impl Fn(&ReceivedPose) -> f64) -> [Option<&ReceivedPose>; 2] {
        // The first number whose sample is after the time.
        let (mut low, mut high) = (self.oldest, self.newest + 1);
        while low < high {
            let middle = low + (high - low) / 2;
            let is_after = self.get(middle).is_none_or(|sample| time_of(sample) > time_s);
            if is_after {
                high = middle;
            } else {
                low = middle + 1;
            }
        }
        [self.get(low.wrapping_sub(1)), self.get(low)]
    }

    fn place(&self, number: u64) -> usize {
        (number % self.samples.len() as u64) as usize
    }
}

impl Clone for PoseRing {
    fn clone(&self) -> Self {
        let Self { samples, oldest, newest, spacing_s } = self;
        Self { samples: samples.clone(), oldest: *oldest, newest: *newest, spacing_s: *spacing_s }
    }

    /// Without allocating, for rings of one tool.
    fn clone_from(&mut self, other: &Self) {
        self.samples.clone_from(&other.samples);
        (self.oldest, self.newest, self.spacing_s) = (other.oldest, other.newest, other.spacing_s);
    }
}

/// By the source's clock where both know it.
fn time_between_s(from: &ReceivedPose, to: &ReceivedPose) -> f64 {
    to.source_s.zip(from.source_s).map_or(to.arrival_s - from.arrival_s, |(to, from)| to - from)
}
