//! From device poses to one target pose per tick: frames, ring, sampling, staleness, re-placement.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::description::{Sampling, ToolDescription};
use crate::pose_ring::{PoseRing, ReceivedPose};
use crate::source_clock::{Observed, SourceClock};

/// A device pose as the tracker reported it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseSample {
    /// Sequence number of its source.
    pub sequence: u64,
    /// Time on its source's clock \[ns\], if known; else the time of arrival.
    pub source_time_ns: Option<u64>,
    /// Whether the tracker saw the marker; an invalid sample is ignored.
    pub valid: bool,
    /// `tracker <- marker` \[m\].
    pub pose: Isometry3<f64>,
}

/// A pose for one tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToolPose {
    /// Index into the description's tools.
    pub tool: usize,
    /// The pose.
    pub sample: PoseSample,
}

/// The pose ring of one tool and the target that its proxy follows.
#[derive(Debug)]
pub(crate) struct PoseTrack {
    ring: PoseRing,
    clock: SourceClock,
    /// Source time that counts as 0, so that none loses digits \[ns\].
    source_origin_ns: Option<u64>,
    target: Option<Target>,
    pub(crate) sequence: u64,
    pub(crate) source_time_ns: u64,
    pub(crate) placements: u64,
    /// Number of the newest sample that a target has reached.
    reached: u64,
}

/// Motion of the device in this tick.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Target {
    pub(crate) pose: Isometry3<f64>,
    /// Pose at the start of the tick.
    pub(crate) before: Isometry3<f64>,
    /// The target jumped: no sweep between `before` and `pose`.
    pub(crate) placed: bool,
}

impl PoseTrack {
    pub(crate) fn new(tool: &ToolDescription) -> Self {
        Self {
            ring: PoseRing::new(delay_s(tool)),
            clock: SourceClock::new(),
            source_origin_ns: None,
            target: None,
            sequence: 0,
            source_time_ns: 0,
            placements: 0,
            reached: 0,
        }
    }

    /// Adds a sample. Returns false, without change, if a component is not finite.
    pub(crate) fn push(&mut self, tool: &ToolDescription, sample: &PoseSample, clock_s: f64) -> bool {
        if !is_finite(&sample.pose) {
            return false;
        }
        if !sample.valid {
            return true;
        }
        let mut received = ReceivedPose {
            number: 0,
            arrival_s: clock_s,
            source_s: sample.source_time_ns.map(|ns| self.since_origin_s(ns)),
            world_from_tool: world_from_tool(tool, &sample.pose),
            is_jump: false,
        };
        if let Some(last) = self.ring.newest().copied() {
            received.is_jump = is_jump(&last, &received, tool.max_tool_speed_m_per_s);
            if received.source_s.zip(last.source_s).is_some_and(|(now, before)| now < before) {
                self.forget_source();
                received.source_s = sample.source_time_ns.map(|ns| self.since_origin_s(ns));
            }
        }
        if delay_s(tool).is_some() {
            self.follow_clock(&received);
        }
        self.ring.push(received, self.reached);
        self.sequence = sample.sequence;
        self.source_time_ns = sample.source_time_ns.unwrap_or(0);
        true
    }

    /// Age of the newest sample \[s\]; infinite if there was none.
    pub(crate) fn age_s(&self, clock_s: f64) -> f64 {
        self.ring.newest().map_or(f64::INFINITY, |a| clock_s - a.arrival_s)
    }

    /// Moves the target on by one tick of `dt` seconds; `None` before the first sample.
    pub(crate) fn advance(&mut self, tool: &ToolDescription, clock_s: f64, dt: f64) -> Option<Target> {
        self.clock.advance(clock_s, dt);
        let (wanted, reached) = match tool.sampling {
            Sampling::Latest => self.ring.newest().map(|s| (s.world_from_tool, s.number))?,
            Sampling::Interpolate { delay_s } => self.interpolate(clock_s - delay_s)?,
        };
        let target = match self.target {
            Some(last) if !self.ring.has_jump(self.reached, reached) => {
                let max_distance = tool.max_tool_speed_m_per_s * dt;
                Target { pose: towards(&last.pose, &wanted, max_distance), before: last.pose, placed: false }
            }
            last => {
                self.placements += u64::from(last.is_some());
                Target { pose: wanted, before: wanted, placed: true }
            }
        };
        self.reached = self.reached.max(reached);
        self.target = Some(target);
        self.target
    }

    /// A source's time since the first one of its clock \[s\].
    fn since_origin_s(&mut self, ns: u64) -> f64 {
        let origin_ns = *self.source_origin_ns.get_or_insert(ns);
        (i128::from(ns) - i128::from(origin_ns)) as f64 * 1e-9
    }

    /// Tells the source's clock; samples of a clock that was set anew are no neighbours of earlier ones.
    fn follow_clock(&mut self, received: &ReceivedPose) {
        let Some(source_s) = received.source_s else { return };
        if self.clock.observe(received.arrival_s, source_s) == Observed::ClockWasSet {
            self.ring.clear();
        }
    }

    /// Drops all samples: the source's clock went back, so it restarted.
    fn forget_source(&mut self) {
        self.ring.clear();
        self.clock = SourceClock::new();
        self.source_origin_ns = None;
    }

    /// Pose at `time_s` on the caller's clock, from the two samples around it, and the number of the earlier one; held at
    /// either end of the ring, and before a jump.
    fn interpolate(&self, time_s: f64) -> Option<(Isometry3<f64>, u64)> {
        let [before, after] = self.ring.around(time_s, |sample| self.clock_time_s(sample));
        let Some(before) = before else { return after.map(|a| (a.world_from_tool, a.number)) };
        let at_s = self.clock_time_s(before);
        let share = |next: &ReceivedPose| (time_s - at_s) / (self.clock_time_s(next) - at_s).max(1e-9);
        let pose = after.filter(|a| !a.is_jump).map_or(before.world_from_tool, |next| {
            blend(&before.world_from_tool, &next.world_from_tool, share(next).clamp(0.0, 1.0))
        });
        Some((pose, before.number))
    }

    /// When a sample was taken, on the caller's clock: its source's time shifted by the offset that is followed \[s\].
    fn clock_time_s(&self, sample: &ReceivedPose) -> f64 {
        sample.source_s.map_or(sample.arrival_s, |s| s + self.clock.offset_s())
    }
}

impl Clone for PoseTrack {
    fn clone(&self) -> Self {
        Self { ring: self.ring.clone(), clock: self.clock.clone(), ..*self }
    }

    /// Without allocating, for tracks of one tool.
    fn clone_from(&mut self, other: &Self) {
        let Self { ring, clock, source_origin_ns, target, sequence, source_time_ns, placements, reached } = other;
        self.ring.clone_from(ring);
        self.clock.clone_from(clock);
        (self.source_origin_ns, self.target, self.sequence) = (*source_origin_ns, *target, *sequence);
        (self.source_time_ns, self.placements, self.reached) = (*source_time_ns, *placements, *reached);
    }
}

/// How far in the past a tool is played; none for the newest pose.
fn delay_s(tool: &ToolDescription) -> Option<f64> {
    match tool.sampling {
        Sampling::Latest => None,
        Sampling::Interpolate { delay_s } => Some(delay_s),
    }
}

/// Pose of a tool from a tracked pose: `world_from_tracker * scaled(tracker_from_marker) * tool_from_marker^-1`.
pub fn world_from_tool(tool: &ToolDescription, tracker_from_marker: &Isometry3<f64>) -> Isometry3<f64> {
    let scaled = Translation3::from(tracker_from_marker.translation.vector * tool.position_scale);
    tool.world_from_tracker
        * Isometry3::from_parts(scaled, tracker_from_marker.rotation)
        * tool.tool_from_marker.inverse()
}

/// Whether the motion between two samples exceeds the speed limit.
fn is_jump(from: &ReceivedPose, to: &ReceivedPose, max_speed: f64) -> bool {
    let distance = (to.world_from_tool.translation.vector - from.world_from_tool.translation.vector).norm();
    let by_source = to.source_s.zip(from.source_s).map_or(0.0, |(to, from)| to - from);
    let elapsed = by_source.max(to.arrival_s - from.arrival_s);
    distance > max_speed * elapsed.max(1e-3)
}

/// From `from` to `to`, at most `max_distance`; a turn counts as the path of a point at 50 mm.
fn towards(from: &Isometry3<f64>, to: &Isometry3<f64>, max_distance: f64) -> Isometry3<f64> {
    const LEVER_M: f64 = 0.05;
    let distance = (to.translation.vector - from.translation.vector).norm();
    let path = distance.max(LEVER_M * from.rotation.angle_to(&to.rotation));
    if path <= max_distance { *to } else { blend(from, to, max_distance / path) }
}

fn blend(from: &Isometry3<f64>, to: &Isometry3<f64>, share: f64) -> Isometry3<f64> {
    let translation = from.translation.vector.lerp(&to.translation.vector, share);
    let rotation = from.rotation.try_slerp(&to.rotation, share, 1e-12).unwrap_or(to.rotation);
    Isometry3::from_parts(translation.into(), rotation)
}

fn is_finite(pose: &Isometry3<f64>) -> bool {
    let translation: &Vector3<f64> = &pose.translation.vector;
    let rotation: &UnitQuaternion<f64> = &pose.rotation;
    translation.iter().chain(rotation.coords.iter()).all(|c| c.is_finite())
}

#[cfg(test)]
mod tests;
