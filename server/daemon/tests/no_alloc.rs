//! Between taking poses and handing out frame and wrenches nothing is allocated.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use nalgebra::Isometry3;
use plica_sim::PoseSample;
use plicad::config::Config;
use plicad::realtime::{Command, Loop, LoopOptions, StageTimer, Turn};
use plicad::scene;

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

/// The wedge, pressed and stroked for ten seconds while everybody listens; orders are obeyed on the way.
#[test]
fn ten_thousand_turns_allocate_nothing() {
    let model = Arc::new(scene::build(&Config::built_in().unwrap()).unwrap());
    let options = LoopOptions { publish_hz: 1000.0, wrench_hz: 1000.0, lock_step: false };
    let (mut core, mut ports) = Loop::new(model, options);
    ports.frames.listening.store(true, Relaxed);
    ports.wrenches.iter().for_each(|port| port.listening.store(true, Relaxed));
    let statistics = Arc::clone(core.statistics());
    let mut timer = StageTimer::new();
    let (mut in_contact, mut frames) = (0, 0);
    for k in 0..10_000_u64 {
        let t = k as f64 * 1e-3;
        let pose = Isometry3::translation(0.05 + 0.01 * (2.0 * t).sin(), 0.03, 0.031 + 0.004 * (5.0 * t).cos());
        ports.poses[0].push(PoseSample { sequence: k + 1, source_time_ns: Some(k), valid: true, pose }).unwrap();
        if k % 1000 == 500 {
            ports.commands.orders.push(Command::Snapshot).unwrap();
        }
        let turn = assert_no_alloc(|| {
            let turn = core.turn(&mut timer);
            timer.record(&statistics);
            turn
        });
        let Turn::Ticked(report) = turn else { panic!("it stands still") };
        in_contact += u64::from(report.n_contacts > 0);
        frames += u64::from(ports.frames.frames.update());
        while ports.wrenches[0].wrenches.pop().is_ok() {}
        while ports.commands.replies.pop().is_ok() {}
    }
    assert!(in_contact > 5_000, "{in_contact} ticks in contact");
    assert!(frames > 9_990, "{frames} frames");
}
