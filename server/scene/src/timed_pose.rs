//! A pose with the time at which it is played.

use plica_sim::PoseSample;

/// A pose and its time of arrival.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedPose {
    /// Time \[s\].
    pub time_s: f64,
    /// Index of the tool.
    pub tool: usize,
    /// The pose, numbered from 1 on for each tool.
    pub sample: PoseSample,
}
