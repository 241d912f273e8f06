//! Tracks of poses over an hour, without anything to touch: drift of the source's clock, rate, delay.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use nalgebra::Isometry3;

use super::{PoseSample, PoseTrack};
use crate::description::{Coupling, Sampling, ToolDescription, ToolShape};

/// Length of a tick [s].
const H: f64 = 1e-3;
/// Speed of the device along x [m/s].
const SPEED: f64 = 0.3;
/// Least latency of a sample [s].
const LATENCY_S: f64 = 2e-3;

fn tool(delay_s: f64) -> ToolDescription {
    ToolDescription {
        name: "probe".into(),
        shape: ToolShape::Ball { radius_m: 1e-3 },
        coupling: Coupling::Rigid,
        friction: 0.0,
        sampling: Sampling::Interpolate { delay_s },
        max_tool_speed_m_per_s: 3.0,
        stale_after_s: 0.2,
        world_from_tracker: Isometry3::identity(),
        tool_from_marker: Isometry3::identity(),
        position_scale: 1.0,
    }
}

/// A tracker whose clock runs fast by `drift`, seen through packets that are late by up to `jitter_s` more than the least.
struct Tracker {
    rate_hz: f64,
    drift: f64,
    jitter_s: f64,
}

/// A tick of a run: when, and where the tool was.
struct Played {
    clock_s: f64,
    x_m: f64,
}

impl Tracker {
    /// Plays a device that moves along x for some seconds.
    fn play(&self, delay_s: f64, seconds: f64) -> Vec<Played> {
        let tool = tool(delay_s);
        let mut track = PoseTrack::new(&tool);
        let mut played = Vec::new();
        let mut next = 0_u64;
        for tick in 0..(seconds / H).round() as u64 {
            let clock_s = tick as f64 * H;
            while self.arrival_s(next) <= clock_s + 1e-9 {
                assert!(track.push(&tool, &self.sample(next), clock_s));
                next += 1;
            }
            if let Some(target) = track.advance(&tool, clock_s, H) {
                played.push(Played { clock_s, x_m: target.pose.translation.x });
            }
        }
        assert_eq!(track.placements, 0);
        played
    }

    /// When sample `n` was taken, on the caller's clock.
    fn taken_s(&self, n: u64) -> f64 {
        n as f64 / self.rate_hz
    }

    fn arrival_s(&self, n: u64) -> f64 {
        // A sequence without a period that matters, the least latency once in a while.
        let late = self.jitter_s * f64::from((n.wrapping_mul(2_654_435_761) >> 16) as u8) / 255.0;
        self.taken_s(n) + LATENCY_S + late
    }

    fn sample(&self, n: u64) -> PoseSample {
        let source_s = 1_700_000_000.0 * 1e9 + self.taken_s(n) * (1.0 + self.drift) * 1e9;
        PoseSample {
            sequence: n + 1,
            source_time_ns: Some(source_s.round() as u64),
            valid: true,
            pose: Isometry3::translation(SPEED * self.taken_s(n), 0.0, 0.0),
        }
    }
}

/// Largest change from one step of the tool to the next, between two times [m].
fn largest_change_of_step(played: &[Played], from_s: f64, to_s: f64) -> f64 {
    let window: Vec<f64> = played.iter().filter(|p| (from_s..to_s).contains(&p.clock_s)).map(|p| p.x_m).collect();
    let steps: Vec<f64> = window.windows(2).map(|x| x[1] - x[0]).collect();
    steps.windows(2).map(|step| (step[1] - step[0]).abs()).fold(0.0, f64::max)
}

/// How far behind the device the tool is [s].
fn lag_s(p: &Played) -> f64 {
    p.clock_s - p.x_m / SPEED
}

#[test]
fn a_drifting_clock_is_followed_for_an_hour_without_steps() {
    let delay_s = 0.05;
    for drift in [50e-6, 1e-3, -1e-3] {
        let played = Tracker { rate_hz: 60.0, drift, jitter_s: 5e-3 }.play(delay_s, 3600.0);
        let [beginning, minute, rest] =
            [(0.5, 60.0), (10.0, 60.0), (60.0, 3600.0)].map(|(from, to)| largest_change_of_step(&played, from, to));
        let lags = played.iter().filter(|p| p.clock_s > 60.0).map(|p| lag_s(p) - delay_s - LATENCY_S);
        let (low, high) =
            lags.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), lag| (low.min(lag), high.max(lag)));
        println!(
            "drift {:5.0} ppm: largest change of step {:.1e} of a step in the first minute, {:.1e} from its 10th second \
             on, {:.1e} in the hour after; delay off by {:.2} to {:.2} ms",
            1e6 * drift,
            beginning / (SPEED * H),
            minute / (SPEED * H),
            rest / (SPEED * H),
            1e3 * low,
            1e3 * high
        );
        assert!(rest <= beginning, "{rest} m after {beginning} m");
        assert!(rest < 1e-3 * SPEED * H, "a step changes by {rest} m");
        assert!(-1e-3 < low && high < 2e-3, "the delay is off by {low} to {high} s");
    }
}

#[test]
fn the_delay_asked_for_is_the_delay_there_is_at_any_rate() {
    for delay_s in [0.0, 0.02, 0.5] {
        for rate_hz in [60.0, 250.0, 1000.0, 5000.0] {
            let played = Tracker { rate_hz, drift: 0.0, jitter_s: 0.0 }.play(delay_s, 5.0);
            let late = played.iter().filter(|p| p.clock_s > 1.0);
            let lags: Vec<f64> = late.map(lag_s).collect();
            let mean_s = lags.iter().sum::<f64>() / lags.len() as f64;
            let most_s = lags.iter().copied().fold(0.0, f64::max);
            println!(
                "{:3.0} ms asked for at {rate_hz} Hz: {:.2} ms, at most {:.2} ms",
                1e3 * delay_s,
                1e3 * mean_s,
                1e3 * most_s
            );
            // A delay below one interval of the tracker cannot be had: the newest pose is held until the next one.
            let interval_s = 1.0 / rate_hz;
            let held_s = if delay_s < interval_s + H { interval_s } else { 0.0 };
            assert!(mean_s > delay_s + LATENCY_S - H && most_s < delay_s + LATENCY_S + held_s + 1.5 * H);
        }
    }
}

#[test]
fn a_clock_that_is_set_is_taken_over_with_the_delay() {
    let delay_s = 0.05;
    let tool = tool(delay_s);
    for set_by_s in [100.0, -100.0] {
        let (mut track, tracker) = (PoseTrack::new(&tool), Tracker { rate_hz: 100.0, drift: 0.0, jitter_s: 0.0 });
        let (mut next, mut worst_s) = (0, 0.0_f64);
        for tick in 0..8000_u64 {
            let clock_s = tick as f64 * H;
            while tracker.arrival_s(next) <= clock_s + 1e-9 {
                let mut sample = tracker.sample(next);
                let shift_ns = if next < 400 { 0.0 } else { 1e9 * set_by_s };
                sample.source_time_ns = sample.source_time_ns.map(|ns| (ns as f64 + shift_ns) as u64);
                track.push(&tool, &sample, clock_s);
                next += 1;
            }
            let target = track.advance(&tool, clock_s, H);
            if let Some(target) = target.filter(|_| !(4.0..4.2).contains(&clock_s) && clock_s > 0.2) {
                let played = Played { clock_s, x_m: target.pose.translation.x };
                worst_s = worst_s.max((lag_s(&played) - delay_s - LATENCY_S).abs());
            }
        }
        assert!(worst_s < 1.5 * H, "set by {set_by_s} s: the delay is off by {worst_s} s");
    }
}

#[test]
fn a_copy_of_a_track_goes_on_as_the_track_does() {
    let tool = tool(0.05);
    let tracker = Tracker { rate_hz: 60.0, drift: 1e-4, jitter_s: 3e-3 };
    let (mut track, mut copy) = (PoseTrack::new(&tool), PoseTrack::new(&tool));
    for n in 0..2000 {
        let clock_s = tracker.arrival_s(n);
        track.push(&tool, &tracker.sample(n), clock_s);
        if n == 1000 {
            copy.clone_from(&track);
        } else if n > 1000 {
            copy.push(&tool, &tracker.sample(n), clock_s);
            let [a, b] = [&mut track, &mut copy].map(|t| t.advance(&tool, clock_s, H).unwrap().pose);
            assert_eq!(a, b);
        } else {
            track.advance(&tool, clock_s, H);
        }
    }
}
