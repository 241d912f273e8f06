//! Between taking poses and handing out frame and wrenches nothing is allocated and nothing is freed, enriched or not.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use nalgebra::{Isometry3, Point3, Vector3};
use plica_daemon::realtime::{Command, Loop, LoopOptions, Returned, StageTimer, Turn};
use plica_scene::Config;
use plica_scene::model;
use plica_sim::enrichment::{Enricher, Examples, LiveEnrichment, Touch};
use plica_sim::{Model, PoseSample};

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

/// Dents at a few places, and a detail that deepens them. What it looks like does not matter here.
fn examples(model: &Model) -> Examples {
    let description = model.description();
    let mut examples = Examples::default();
    for k in 0..6 {
        let contact_point = Point3::new(0.035 + 0.006 * f64::from(k), 0.026 + 0.002 * f64::from(k % 3), 0.028);
        let depth = 0.003 + 0.0005 * f64::from(k);
        let dent = |p: &Point3<f64>| {
            let share = (-(p - contact_point).norm_squared() / 4e-4).exp() * p.z / 0.04;
            [0.0, 0.0, -(depth * share) as f32]
        };
        examples.displacements.push(description.mesh.nodes().iter().map(dent).collect());
        examples.details.push(description.skin.positions().iter().map(|p| dent(p).map(|x| 0.3 * x)).collect());
        let tool_origin = contact_point + Vector3::new(0.0, 0.0, 0.007 - depth);
        examples.touches.push(Touch { contact_point, tool_origin });
    }
    examples
}

/// The wedge, pressed and stroked for ten seconds while everybody listens; orders are obeyed on the way. From the second
/// second on it is enriched, and from then on what enriches it is replaced each second.
#[test]
fn ten_thousand_turns_allocate_and_free_nothing() {
    let config = Config::built_in().unwrap();
    let model = Arc::new(model::build(&config).unwrap());
    let enricher = Arc::new(Enricher::new(&model, &examples(&model), config.enrichment().options).unwrap());
    let options = LoopOptions { publish_hz: 1000.0, wrench_hz: 1000.0, lock_step: false };
    let (mut core, mut ports) = Loop::new(Arc::clone(&model), options);
    ports.frames.listening.store(true, Relaxed);
    ports.wrenches.iter().for_each(|port| port.listening.store(true, Relaxed));
    let statistics = Arc::clone(core.statistics());
    let mut timer = StageTimer::new();
    let (mut in_contact, mut frames, mut trusted, mut retired) = (0, 0, 0, 0);
    for k in 0..10_000_u64 {
        let t = k as f64 * 1e-3;
        let pose = Isometry3::translation(0.05 + 0.01 * (2.0 * t).sin(), 0.03, 0.031 + 0.004 * (5.0 * t).cos());
        ports.poses[0].push(PoseSample { sequence: k + 1, source_time_ns: Some(k), valid: true, pose }).unwrap();
        if k % 1000 == 500 {
            ports.commands.orders.push(Command::Snapshot).unwrap();
        }
        if k > 0 && k % 1000 == 0 {
            let live = Box::new(LiveEnrichment::new(&model, Arc::clone(&enricher)));
            ports.commands.orders.push(Command::Activate(live)).unwrap();
        }
        let turn = assert_no_alloc(|| {
            let turn = core.turn(&mut timer);
            timer.record(&statistics);
            turn
        });
        let Turn::Ticked(report) = turn else { panic!("it stands still") };
        in_contact += u64::from(report.n_contacts > 0);
        if ports.frames.frames.update() {
            let frame = ports.frames.frames.output_buffer();
            assert_eq!(u64::from(frame.database_generation), k / 1000, "tick {k}");
            frames += 1;
            trusted += u64::from(frame.confidence > 0.0);
        }
        while ports.wrenches[0].wrenches.pop().is_ok() {}
        while let Ok(reply) = ports.commands.replies.pop() {
            retired += u64::from(matches!(reply.returned, Returned::Enrichment(Some(_))));
        }
    }
    assert!(in_contact > 5_000, "{in_contact} ticks in contact");
    assert_eq!(frames, 10_000);
    assert_eq!(retired, 8, "all but the first replace one");
    assert!(trusted > 1_000, "{trusted} frames with detail");
}
