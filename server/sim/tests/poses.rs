//! From device poses to the tool's pose in each tick: frames, ring, sampling, jumps, staleness, refusals.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use std::f64::consts::{FRAC_PI_2, PI};

use common::{E, Run, Scene, at, ball, turned};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};
use plica_geometry::shapes::{block, block_skin};
use plica_sim::*;

const H: f64 = 1e-3;

/// A single element, out of the way, and one rigid ball.
fn scene(change: impl FnOnce(&mut ToolDescription)) -> Run {
    let size = [0.01; 3];
    let mut tool = ball(1e-3);
    change(&mut tool);
    Scene::on(block(size, [1; 3]), block_skin(size, 5e-3), E, 0.3).tool(tool).run()
}

/// Positions are given along x, 0.1 m above the object.
fn along(x: f64) -> Isometry3<f64> {
    at(Point3::new(x, 0.0, 0.1))
}

fn sample(source_time_s: f64, pose: Isometry3<f64>) -> PoseSample {
    PoseSample { sequence: 1, source_time_ns: Some((source_time_s * 1e9).round() as u64), valid: true, pose }
}

/// One tick at the run's clock with these samples for tool 0.
fn tick_with(run: &mut Run, samples: &[PoseSample]) -> TickReport {
    let poses: Vec<ToolPose> = samples.iter().map(|&sample| ToolPose { tool: 0, sample }).collect();
    let input = TickInput { clock_s: run.clock_s, poses: &poses };
    let report = tick(&run.model, input, &mut run.state, &mut run.workspace, &mut NoProbe);
    run.clock_s += H;
    report
}

fn reading(run: &Run) -> ToolReading {
    run.state.tools()[0]
}

fn x(run: &Run) -> f64 {
    reading(run).proxy.translation.x
}

#[test]
fn tool_is_absent_until_its_first_pose() {
    let mut run = scene(|_| {});
    tick_with(&mut run, &[]);
    let absent = reading(&run);
    assert!(!absent.present && absent.stale && absent.pose_age_s.is_infinite() && !absent.in_contact);
    tick_with(&mut run, &[sample(0.0, along(0.03))]);
    let present = reading(&run);
    assert!(present.present && !present.stale && present.pose_age_s == 0.0);
    assert_eq!((x(&run), present.placements), (0.03, 0));
}

#[test]
fn latest_pose_is_approached_at_the_allowed_speed() {
    let mut run = scene(|t| t.max_tool_speed_m_per_s = 0.5);
    tick_with(&mut run, &[sample(0.0, along(0.0))]);
    for _ in 0..15 {
        tick_with(&mut run, &[]);
    }
    // 8 mm in 16 ms: at the speed limit, so it is followed, half a millimetre per tick.
    let start = x(&run);
    tick_with(&mut run, &[sample(0.016, along(0.008))]);
    for k in 1..=18 {
        let expected = (f64::from(k) * 0.5e-3).min(0.008);
        assert!((x(&run) - start - expected).abs() < 1e-9, "tick {k}: {}", x(&run));
        tick_with(&mut run, &[]);
    }
    assert_eq!(reading(&run).placements, 0);
}

#[test]
fn turn_is_capped_like_a_path_at_50_mm() {
    let mut run = scene(|t| t.max_tool_speed_m_per_s = 0.5);
    tick_with(&mut run, &[sample(0.0, along(0.0))]);
    let quarter = Vector3::z() * std::f64::consts::FRAC_PI_2;
    tick_with(&mut run, &[sample(0.001, turned(Point3::new(0.0, 0.0, 0.1), quarter))]);
    let first = reading(&run).proxy.rotation.angle();
    assert!((first - 0.5e-3 / 0.05).abs() < 1e-9, "{first} rad");
    for _ in 0..200 {
        tick_with(&mut run, &[]);
    }
    assert!((reading(&run).proxy.rotation.scaled_axis() - quarter).norm() < 1e-12);
}

#[test]
fn jump_places_the_tool_and_is_counted() {
    for coupling in [Coupling::Rigid, Coupling::Spring(SpringCoupling::default())] {
        let mut run = scene(|t| (t.max_tool_speed_m_per_s, t.coupling) = (2.0, coupling));
        tick_with(&mut run, &[sample(0.0, along(0.0))]);
        for (k, target) in [0.03, -0.05, 0.2].into_iter().enumerate() {
            tick_with(&mut run, &[sample(1e-3 * (k + 1) as f64, along(target))]);
            assert!(
                (x(&run) - target).abs() < 1e-12 && reading(&run).placements == k as u64 + 1,
                "{:?}",
                reading(&run)
            );
        }
        tick_with(&mut run, &[sample(5e-3, along(0.201))]);
        assert_eq!(reading(&run).placements, 3, "a step within the allowed speed is no jump");
    }
}

#[test]
fn jump_across_the_object_leaves_it_alone() {
    for coupling in [Coupling::Rigid, Coupling::Spring(SpringCoupling::default())] {
        let mut tool = ball(0.01);
        tool.coupling = coupling;
        let mut run = Scene::wedge(E, 0.45).tool(tool).run();
        let sides = [Point3::new(0.05, -0.03, 0.015), Point3::new(0.05, 0.09, 0.015)];
        for k in 0..20 {
            run.tick(&[(0, at(sides[k % 2]))]);
            assert!((run.state.tools()[0].proxy.translation.vector - sides[k % 2].coords).norm() < 1e-12);
        }
        assert_eq!(run.state.tools()[0].placements, 19);
        assert!(run.offsets().iter().all(|o| o.norm() == 0.0));
    }
}

#[test]
fn pose_after_a_gap_of_the_tracker_is_no_jump() {
    let mut run = scene(|t| t.max_tool_speed_m_per_s = 1.0);
    tick_with(&mut run, &[sample(0.0, along(0.0))]);
    for _ in 0..109 {
        tick_with(&mut run, &[]);
    }
    tick_with(&mut run, &[sample(0.110, along(0.1))]);
    assert_eq!((reading(&run).placements, x(&run)), (0, 1e-3));
}

/// A device that moves along x at 0.3 m/s and is seen at 60 Hz on a clock of its own, each sample 2 to 7 ms late.
struct Tracker {
    /// Caller's clock less source clock [s].
    offset_s: f64,
    next: u32,
}

impl Tracker {
    const LEAST_LATENCY_S: f64 = 2e-3;
    /// Time of its first sample, not 0, which means unknown [s].
    const START_S: f64 = 10.0;

    /// A tracker whose first sample is taken when the caller's clock says `clock_s`.
    fn starting_at(clock_s: f64) -> Self {
        Self { offset_s: clock_s - Self::START_S, next: 0 }
    }

    fn position(source_s: f64) -> f64 {
        0.3 * (source_s - Self::START_S)
    }

    /// Time of the sample that a track with this delay is at [s].
    fn played_s(&self, clock_s: f64, delay_s: f64) -> f64 {
        clock_s - self.offset_s - Self::LEAST_LATENCY_S - delay_s
    }

    /// Samples that have arrived by `clock_s`.
    fn arrived(&mut self, clock_s: f64) -> Vec<PoseSample> {
        let mut out = Vec::new();
        loop {
            let source_s = Self::START_S + f64::from(self.next) / 60.0;
            let late = Self::LEAST_LATENCY_S + 1e-3 * f64::from(self.next % 6);
            if source_s + self.offset_s + late > clock_s + 1e-9 {
                return out;
            }
            out.push(sample(source_s, along(Self::position(source_s))));
            self.next += 1;
        }
    }
}

#[test]
fn interpolation_follows_the_source_clock_through_jitter() {
    for start_s in [0.0, 1234.5] {
        let delay_s = 0.030;
        let mut run = scene(|t| t.sampling = Sampling::Interpolate { delay_s });
        run.clock_s = start_s;
        let mut tracker = Tracker::starting_at(start_s);
        let mut worst = 0.0_f64;
        for _ in 0..1000 {
            let clock_s = run.clock_s;
            let samples = tracker.arrived(clock_s);
            tick_with(&mut run, &samples);
            let source_s = tracker.played_s(clock_s, delay_s);
            if source_s > Tracker::START_S + 0.05 {
                worst = worst.max((x(&run) - Tracker::position(source_s)).abs());
            }
        }
        // Arrival is seen in whole ticks, so the offset is known to one of them.
        println!("started at {start_s} s: {worst:.1e} m off the delayed device");
        assert!(worst <= 0.3 * H + 1e-9, "{worst} m");
        assert_eq!(reading(&run).placements, 0);
    }
}

#[test]
fn interpolation_moves_and_turns_between_two_samples() {
    let mut run = scene(|t| t.sampling = Sampling::Interpolate { delay_s: 0.010 });
    let turn = Vector3::new(0.3, -0.2, 0.5);
    let (from, to) = (Point3::new(0.0, 0.0, 0.1), Point3::new(0.004, 0.002, 0.1));
    tick_with(&mut run, &[sample(0.0, at(from))]);
    for _ in 1..10 {
        tick_with(&mut run, &[]);
    }
    tick_with(&mut run, &[sample(0.010, turned(to, turn))]);
    for k in 1..=12 {
        tick_with(&mut run, &[]);
        let share = (f64::from(k) / 10.0).min(1.0);
        let proxy = reading(&run).proxy;
        assert!((proxy.translation.vector - from.coords.lerp(&to.coords, share)).norm() < 1e-9, "tick {k}: {proxy}");
        assert!((proxy.rotation.scaled_axis() - turn * share).norm() < 1e-9, "tick {k}: {proxy}");
    }
}

#[test]
fn ring_reaches_back_by_the_delay_and_a_tenth_of_a_second() {
    let mut run = scene(|t| t.sampling = Sampling::Interpolate { delay_s: 0.3 });
    let samples: Vec<PoseSample> =
        (0..2000).map(|k| sample(1.0 + 1e-3 * f64::from(k), along(1e-4 * f64::from(k)))).collect();
    tick_with(&mut run, &samples);
    // All arrive at once: the newest has the least latency, and 0.3 s before it lies sample 1699.
    assert!((x(&run) - 0.1699).abs() < 1e-9, "the tool is at {}", x(&run));
}

/// Two sides of the object, seen at 250 Hz: no sweep between them.
#[test]
fn jump_is_not_swept_when_interpolating() {
    let mut tool = ball(0.01);
    (tool.sampling, tool.max_tool_speed_m_per_s) = (Sampling::Interpolate { delay_s: 0.02 }, 2.0);
    let mut run = Scene::wedge(E, 0.45).tool(tool).run();
    for k in 0..200 {
        let y = if k < 100 { -0.03 } else { 0.09 };
        let seen = [(0, at(Point3::new(0.05, y, 0.015)))];
        run.tick(if k % 4 == 0 { &seen } else { &[] });
    }
    let tool = run.state.tools()[0];
    assert!((tool.proxy.translation.y - 0.09).abs() < 1e-9 && tool.placements == 1, "{tool:?}");
    assert!(run.offsets().iter().all(|o| o.norm() == 0.0), "the object was swept");
}

#[test]
fn source_that_starts_its_clock_again_is_interpolated_again() {
    let delay_s = 0.030;
    let mut run = scene(|t| t.sampling = Sampling::Interpolate { delay_s });
    let mut tracker = Tracker::starting_at(0.0);
    for _ in 0..1000 {
        let samples = tracker.arrived(run.clock_s);
        tick_with(&mut run, &samples);
    }
    for _ in 0..500 {
        tick_with(&mut run, &[]);
    }
    assert!(reading(&run).stale);
    let mut tracker = Tracker::starting_at(run.clock_s);
    let mut worst = 0.0_f64;
    for _ in 0..500 {
        let clock_s = run.clock_s;
        let samples = tracker.arrived(clock_s);
        tick_with(&mut run, &samples);
        let source_s = tracker.played_s(clock_s, delay_s);
        if source_s > Tracker::START_S + 0.05 {
            worst = worst.max((x(&run) - Tracker::position(source_s)).abs());
        }
    }
    assert!(worst <= 0.3 * H + 1e-9, "{worst} m off the delayed device");
}

/// Without a source time the time of arrival is used, for any offset of the caller's clock.
#[test]
fn source_without_a_clock_is_interpolated_by_arrival() {
    let mut run = scene(|t| t.sampling = Sampling::Interpolate { delay_s: 0.030 });
    run.clock_s = 500.0;
    let mut worst = 0.0_f64;
    for k in 0..500 {
        let seen = PoseSample { source_time_ns: None, ..sample(0.0, along(0.3e-3 * f64::from(k))) };
        tick_with(&mut run, if k % 16 == 0 { std::slice::from_ref(&seen) } else { &[] });
        if k > 50 {
            worst = worst.max((x(&run) - 0.3e-3 * f64::from(k - 30)).abs());
        }
    }
    assert!(worst < 1e-9, "{worst} m off the delayed device");
    assert_eq!(reading(&run).placements, 0);
}

#[test]
fn silent_tool_is_held_and_flagged_until_it_speaks_again() {
    let mut run = scene(|t| t.stale_after_s = 0.05);
    tick_with(&mut run, &[sample(0.0, along(0.01))]);
    for k in 1..=100 {
        tick_with(&mut run, &[]);
        let reading = reading(&run);
        assert!((reading.pose_age_s - H * f64::from(k)).abs() < 1e-9, "{}", reading.pose_age_s);
        assert_eq!(reading.stale, reading.pose_age_s > 0.05, "tick {k}");
        assert_eq!(x(&run), 0.01);
    }
    tick_with(&mut run, &[sample(0.101, along(0.012))]);
    assert!(!reading(&run).stale);
}

#[test]
fn frames_compose_from_tracker_to_tool() {
    let world_from_tracker = Isometry3::new(Vector3::new(0.1, 0.2, 0.4), Vector3::new(0.2, -0.4, 1.1));
    let tool_from_marker = Isometry3::new(Vector3::new(0.01, -0.02, 0.15), Vector3::new(-0.7, 0.1, 0.3));
    let tracker_from_marker = Isometry3::new(Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.4, 0.9, -0.2));
    let position_scale = 0.1;
    let mut run = scene(|t| {
        (t.world_from_tracker, t.tool_from_marker, t.position_scale) =
            (world_from_tracker, tool_from_marker, position_scale);
    });
    tick_with(&mut run, &[sample(0.0, tracker_from_marker)]);
    let proxy = reading(&run).proxy;
    // A point of the marker, seen from the tool, is where the scaled tracker puts it in the world.
    for p in [Point3::origin(), Point3::new(0.3, 0.0, 0.0), Point3::new(0.0, -0.2, 0.1)] {
        let tracked = Point3::from(tracker_from_marker.translation.vector * position_scale)
            + tracker_from_marker.rotation * p.coords;
        let (through_tool, through_tracker) = (proxy * (tool_from_marker * p), world_from_tracker * tracked);
        assert!((through_tool - through_tracker).norm() < 1e-12, "{through_tool} {through_tracker}");
    }
}

#[test]
fn newest_pose_is_echoed() {
    let mut run = scene(|_| {});
    let numbered = |sequence, source_time_ns| PoseSample {
        sequence,
        source_time_ns: Some(source_time_ns),
        valid: true,
        pose: along(0.0),
    };
    tick_with(&mut run, &[numbered(41, 7_000_000), numbered(42, 8_000_000)]);
    assert_eq!((reading(&run).pose_sequence, reading(&run).pose_source_time_ns), (42, 8_000_000));
}

#[test]
fn pose_that_is_not_finite_is_refused_and_counted() {
    let mut run = scene(|_| {});
    tick_with(&mut run, &[sample(0.0, along(0.01))]);
    let rotated = |x: f64| {
        let rotation: UnitQuaternion<f64> = Unit::new_unchecked(Quaternion::new(1.0, x, 0.0, 0.0));
        Isometry3::from_parts(Translation3::new(0.0, 0.0, 0.1), rotation)
    };
    let bad = [along(f64::NAN), along(f64::INFINITY), rotated(f64::NAN), rotated(f64::NEG_INFINITY)];
    for (k, pose) in bad.into_iter().enumerate() {
        let before = reading(&run);
        let report = tick_with(&mut run, &[sample(1.0, pose), sample(1.0, pose)]);
        let after = reading(&run);
        assert_eq!(report.poses_refused, 2, "pose {k}");
        assert!((after.pose_age_s - before.pose_age_s - H).abs() < 1e-12 && after.pose_source_time_ns == 0);
        assert_eq!(after.proxy, before.proxy);
        assert!(!report.rolled_back);
    }
    let poses = [ToolPose { tool: 7, sample: sample(0.0, along(0.0)) }];
    let input = TickInput { clock_s: run.clock_s, poses: &poses };
    let report = tick(&run.model, input, &mut run.state, &mut run.workspace, &mut NoProbe);
    assert_eq!(report.poses_refused, 1, "there is no tool 7");
}

#[test]
fn invalid_sample_is_no_news() {
    for sampling in [Sampling::Latest, Sampling::Interpolate { delay_s: 0.0 }] {
        let mut run = scene(|t| (t.sampling, t.stale_after_s) = (sampling, 0.05));
        tick_with(&mut run, &[sample(0.0, along(0.01))]);
        for k in 1..=100 {
            let lost = PoseSample { sequence: 100 + k, valid: false, ..sample(H * k as f64, along(0.5)) };
            let report = tick_with(&mut run, &[lost]);
            assert_eq!((report.poses_refused, reading(&run).pose_sequence, x(&run)), (0, 1, 0.01));
        }
        assert!(reading(&run).stale && reading(&run).placements == 0);
    }
}

/// The formula as published, and the pose of a rigid tool after a tick.
#[test]
fn a_tracked_pose_is_scaled_between_tracker_and_marker() {
    let mut tool = ball(0.01);
    tool.coupling = Coupling::Rigid;
    tool.position_scale = 0.5;
    tool.world_from_tracker = turned(Point3::new(0.1, 0.0, 0.2), Vector3::new(0.0, 0.0, FRAC_PI_2));
    tool.tool_from_marker = at(Point3::new(0.0, 0.0, 0.03));
    let tracked = turned(Point3::new(0.2, 0.4, 0.6), Vector3::new(PI, 0.0, 0.0));
    let pose = world_from_tool(&tool, &tracked);
    // Half of (0.2, 0.4, 0.6), turned about z to (-0.2, 0.1, 0.3), moved; the marker is 30 mm along the tool's z, which points down.
    let expected = Vector3::new(-0.2 + 0.1, 0.1, 0.3 + 0.2 + 0.03);
    assert!((pose.translation.vector - expected).norm() < 1e-12, "{pose:?}");
    let mut run = Scene::block(E, 0.45).tool(tool).run();
    run.tick(&[(0, tracked)]);
    assert_eq!(run.state.tools()[0].proxy, pose);
}
