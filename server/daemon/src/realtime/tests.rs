#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use nalgebra::Isometry3;
use plica_scene::Config;
use plica_scene::model;
use plica_sim::enrichment::{Enricher, EnrichmentOptions, Examples, LiveEnrichment, Touch};
use plica_sim::{NoProbe, PoseSample, ToolPose};

use super::*;

const SCENE: &str = r#"
[objects.block]
mesh = { generator = "block", size_m = [0.04, 0.04, 0.02] }
material = { young_modulus_pa = 3e4, poisson_ratio = 0.4, density_kg_per_m3 = 1000.0 }
supports = { fixed = { faces = ["z_min"] } }
coarse = { divisions = [2, 2, 2] }
skin = { spacing_m = 0.005 }
[tools.ball]
shape = { ball = { radius_m = 0.006 } }
coupling = "rigid"
"#;

fn start(lock_step: bool) -> (Loop, Ports) {
    serve(SCENE, lock_step)
}

fn serve(scene: &str, lock_step: bool) -> (Loop, Ports) {
    let config = Config::parse(Path::new("block.toml"), scene).unwrap();
    let model = Arc::new(model::build(&config).unwrap());
    Loop::new(model, LoopOptions { publish_hz: 90.0, wrench_hz: 500.0, lock_step })
}

fn sample(sequence: u64, z: f64) -> PoseSample {
    PoseSample {
        sequence,
        source_time_ns: Some(1000 * sequence),
        valid: true,
        pose: Isometry3::translation(0.02, 0.02, z),
    }
}

fn step(ticks: u32, poses: Vec<ToolPose>) -> Command {
    Command::Step { ticks, poses, deadline: Instant::now() + Duration::from_secs(3600) }
}

fn order(core: &mut Loop, ports: &mut Ports, command: Command) -> Result<Outcome, Refusal> {
    ports.commands.orders.push(command).unwrap();
    core.turn(&mut NoProbe);
    while core.is_stepping() {
        core.turn(&mut NoProbe);
    }
    ports.commands.replies.pop().unwrap().outcome
}

fn positions(core: &mut Loop, ports: &mut Ports) -> Vec<[f32; 3]> {
    let question = ports.frames.ask();
    core.turn(&mut NoProbe);
    assert!(ports.frames.frames.update());
    let frame = ports.frames.frames.output_buffer();
    assert_eq!(frame.answers, question);
    frame.positions.clone()
}

#[test]
fn a_turn_is_one_tick_of_simulated_time() {
    let (mut core, _ports) = start(false);
    for k in 1..=5 {
        assert!(matches!(core.turn(&mut NoProbe), Turn::Ticked(_)));
        assert_eq!(core.state().tick(), k);
    }
    assert!((core.state().sim_time_s() - 5e-3).abs() < 1e-12);
}

#[test]
fn poses_arrive_and_wrenches_leave_at_their_rate() {
    let (mut core, mut ports) = start(false);
    ports.wrenches[0].listening.store(true, Relaxed);
    ports.poses[0].push(sample(7, 0.1)).unwrap();
    for _ in 0..10 {
        core.turn(&mut NoProbe);
    }
    let first = ports.wrenches[0].wrenches.pop().unwrap();
    assert_eq!((first.tick, first.reading.pose_sequence, first.reading.pose_source_time_ns), (1, 7, 7000));
    assert_eq!(1 + ports.wrenches[0].wrenches.slots(), 5);
}

#[test]
fn nobody_listening_costs_no_frame_and_no_wrench() {
    let (mut core, mut ports) = start(false);
    ports.poses[0].push(sample(1, 0.1)).unwrap();
    for _ in 0..100 {
        core.turn(&mut NoProbe);
    }
    assert!(!ports.frames.frames.update());
    assert!(ports.wrenches[0].wrenches.is_empty());
}

#[test]
fn frames_come_at_the_publishing_rate() {
    let (mut core, mut ports) = start(false);
    ports.frames.listening.store(true, Relaxed);
    let mut due = 0;
    for _ in 0..200 {
        core.turn(&mut NoProbe);
        if ports.frames.frames.update() {
            due += 1;
            assert_eq!(ports.frames.frames.output_buffer().due, due);
        }
    }
    assert!((18..=19).contains(&due), "90 Hz for 0.2 s: {due}");
}

#[test]
fn a_publisher_that_never_reads_delays_nothing_and_is_counted() {
    let (mut core, ports) = start(false);
    let mut ports = ports;
    ports.frames.listening.store(true, Relaxed);
    ports.wrenches[0].listening.store(true, Relaxed);
    ports.poses[0].push(sample(1, 0.1)).unwrap();
    for _ in 0..1000 {
        core.turn(&mut NoProbe);
    }
    assert_eq!(core.state().tick(), 1000);
    assert_eq!(ports.statistics.wrench_drops.load(Relaxed), 500 - 256);
}

#[test]
fn contacts_left_out_are_summed_until_a_reset() {
    // Cells of 5 mm, so that several rows fit below the ball.
    let scene = SCENE.replace("divisions = [2, 2, 2]", "divisions = [8, 8, 4]");
    let (mut core, mut ports) = serve(&format!("{scene}[contact]\nmax_contacts = 1\n"), false);
    let mut dropped = 0;
    for k in 0..100_u32 {
        ports.poses[0].push(sample(1 + u64::from(k), 0.026 - 4e-5 * f64::from(k))).unwrap();
        if let Turn::Ticked(report) = core.turn(&mut NoProbe) {
            dropped += u64::from(report.dropped_contacts);
        }
    }
    let reading = ports.readings.read();
    assert!(dropped > 0, "a ball 4 mm deep touches more than one point");
    assert_eq!(crate::wire::object_status(reading).dropped_contacts, dropped);
    order(&mut core, &mut ports, Command::Reset).unwrap();
    assert_eq!(ports.readings.read().dropped_contacts, 0);
}

#[test]
fn lock_step_ticks_when_told_to() {
    let (mut core, mut ports) = start(true);
    assert_eq!(core.turn(&mut NoProbe), Turn::Still);
    let poses = vec![ToolPose { tool: 0, sample: sample(3, 0.1) }];
    let outcome = order(&mut core, &mut ports, step(4, poses)).unwrap();
    assert_eq!((outcome.tick, outcome.paused), (4, true));
    assert_eq!(core.state().tools()[0].pose_sequence, 3);
    assert_eq!(order(&mut core, &mut ports, Command::Resume), Err(Refusal::LockStep));
    assert_eq!(order(&mut core, &mut ports, step(0, Vec::new())).unwrap().tick, 4);
}

#[test]
fn an_interrupted_step_has_used_its_poses_and_tells_its_tick() {
    let (mut core, mut ports) = start(true);
    let poses = vec![ToolPose { tool: 0, sample: sample(3, 0.1) }];
    ports.commands.orders.push(step(1000, poses)).unwrap();
    ports.commands.orders.push(Command::Interrupt).unwrap();
    core.turn(&mut NoProbe);
    assert!(!core.is_stepping());
    let stepped = ports.commands.replies.pop().unwrap().outcome.unwrap();
    let early = EarlyEnd { ticks_left: 999, cause: EarlyEndCause::Interrupted };
    assert_eq!((stepped.tick, stepped.early), (1, Some(early)));
    assert_eq!(core.state().tools()[0].pose_sequence, 3);
    let interrupted = ports.commands.replies.pop().unwrap().outcome.unwrap();
    assert_eq!((interrupted.tick, interrupted.early), (1, None));
    // Nothing to interrupt, and nothing left over for the next step.
    assert_eq!(order(&mut core, &mut ports, Command::Interrupt).unwrap().tick, 1);
    let whole = order(&mut core, &mut ports, step(3, Vec::new())).unwrap();
    assert_eq!((whole.tick, whole.early), (4, None));
}

#[test]
fn a_step_past_its_deadline_ends_after_one_more_tick() {
    let (mut core, mut ports) = start(true);
    let deadline = Instant::now();
    ports.commands.orders.push(Command::Step { ticks: 500, poses: Vec::new(), deadline }).unwrap();
    for _ in 0..5 {
        core.end_late_step(deadline - Duration::from_nanos(1));
        core.turn(&mut NoProbe);
    }
    core.end_late_step(deadline);
    core.turn(&mut NoProbe);
    let stepped = ports.commands.replies.pop().unwrap().outcome.unwrap();
    let early = EarlyEnd { ticks_left: 494, cause: EarlyEndCause::Deadline };
    assert_eq!((stepped.tick, stepped.early), (6, Some(early)));
}

#[test]
fn steps_need_a_pause_and_resume_goes_on() {
    let (mut core, mut ports) = start(false);
    let refused = order(&mut core, &mut ports, step(1, Vec::new()));
    assert_eq!(refused, Err(Refusal::NotPaused));
    assert!(order(&mut core, &mut ports, Command::Pause).unwrap().paused);
    let tick = core.state().tick();
    assert_eq!(core.turn(&mut NoProbe), Turn::Still);
    assert_eq!(core.state().tick(), tick);
    assert!(!order(&mut core, &mut ports, Command::Resume).unwrap().paused);
    assert!(core.state().tick() > tick);
}

#[test]
fn snapshot_and_restore_repeat_the_same_bytes() {
    let (mut core, mut ports) = start(true);
    let press = |sequence, z| vec![ToolPose { tool: 0, sample: sample(sequence, z) }];
    order(&mut core, &mut ports, step(20, press(1, 0.024))).unwrap();
    let id = order(&mut core, &mut ports, Command::Snapshot).unwrap().snapshot.unwrap();
    let run = |core: &mut Loop, ports: &mut Ports| {
        order(core, ports, step(30, press(2, 0.023))).unwrap();
        positions(core, ports)
    };
    let once = run(&mut core, &mut ports);
    assert_eq!(order(&mut core, &mut ports, Command::Restore { id }).unwrap().tick, 20);
    assert_eq!(run(&mut core, &mut ports), once);
    assert_eq!(order(&mut core, &mut ports, Command::Restore { id: 99 }), Err(Refusal::UnknownSnapshot));
}

#[test]
fn old_snapshots_are_overwritten() {
    let (mut core, mut ports) = start(true);
    for expected in 1..=9 {
        let outcome = order(&mut core, &mut ports, Command::Snapshot).unwrap();
        assert_eq!(outcome.snapshot, Some(expected));
    }
    assert_eq!(order(&mut core, &mut ports, Command::Restore { id: 1 }), Err(Refusal::UnknownSnapshot));
    assert!(order(&mut core, &mut ports, Command::Restore { id: 2 }).is_ok());
}

#[test]
fn reset_returns_to_rest_and_forgets_waiting_poses() {
    let (mut core, mut ports) = start(true);
    let rest = positions(&mut core, &mut ports);
    let poses = vec![ToolPose { tool: 0, sample: sample(1, 0.022) }];
    order(&mut core, &mut ports, step(50, poses)).unwrap();
    ports.poses[0].push(sample(9, 0.022)).unwrap();
    assert_eq!(order(&mut core, &mut ports, Command::Reset).unwrap().tick, 0);
    assert_eq!(positions(&mut core, &mut ports), rest);
    order(&mut core, &mut ports, step(1, Vec::new())).unwrap();
    assert!(!core.state().tools()[0].present);
}

/// A detail of 1 mm downwards wherever the ball presses the middle.
fn live(model: &Arc<plica_sim::Model>) -> Box<LiveEnrichment> {
    live_scaled(model, 0.5)
}

/// The same with a detail of `scale` times the dent.
fn live_scaled(model: &Arc<plica_sim::Model>, scale: f32) -> Box<LiveEnrichment> {
    let description = model.description();
    let touch = |depth: f64| Touch {
        contact_point: nalgebra::Point3::new(0.02, 0.02, 0.02),
        tool_origin: nalgebra::Point3::new(0.02, 0.02, 0.026 - depth),
    };
    let pressed = |depth: f64| {
        let dent = move |p: &nalgebra::Point3<f64>| {
            let off_squared = (p.x - 0.02).powi(2) + (p.y - 0.02).powi(2);
            [0.0, 0.0, -(depth * (-off_squared / 1e-4).exp() * p.z / 0.02) as f32]
        };
        let nodes = description.mesh.nodes().iter().map(dent).collect();
        let detail = description.skin.positions().iter().map(|p| dent(p).map(|x| scale * x)).collect();
        (nodes, detail)
    };
    let depths = [0.001, 0.002, 0.003];
    let (displacements, details) = depths.iter().map(|d| pressed(*d)).unzip();
    let examples = Examples { displacements, details, touches: depths.map(touch).to_vec() };
    let options = EnrichmentOptions { fade: false, ..EnrichmentOptions::default() };
    Box::new(LiveEnrichment::new(model, Arc::new(Enricher::new(model, &examples, options).unwrap())))
}

#[test]
fn activating_changes_the_skin_and_nothing_else() {
    let (mut core, mut ports) = start(true);
    let press = |sequence, z| vec![ToolPose { tool: 0, sample: sample(sequence, z) }];
    order(&mut core, &mut ports, step(100, press(1, 0.024))).unwrap();
    let coarse = positions(&mut core, &mut ports);
    assert_eq!(ports.frames.frames.output_buffer().database_generation, 0);
    let own = order(&mut core, &mut ports, step(0, Vec::new())).unwrap();
    let activated = live(core.model());
    let outcome = order(&mut core, &mut ports, Command::Activate(activated)).unwrap();
    assert_eq!(outcome, Outcome { database_generation: 1, ..own });
    // Standing still, and after the next tick.
    let enriched = positions(&mut core, &mut ports);
    let frame = ports.frames.frames.output_buffer();
    assert!(frame.database_generation == 1 && frame.confidence > 0.0, "{} confident", frame.confidence);
    let moved = enriched.iter().zip(&coarse).map(|(a, b)| (a[2] - b[2]).abs()).fold(0.0, f32::max);
    assert!(moved > 1e-5, "detail of {moved} m");
    assert_eq!(core.state().tick(), 100);
    ports.wrenches[0].listening.store(true, Relaxed);
    order(&mut core, &mut ports, step(2, press(2, 0.024))).unwrap();
    assert!(ports.wrenches[0].wrenches.pop().unwrap().confidence > 0.0);
    assert!(ports.readings.read().confidence.unwrap() > 0.0);
}

#[test]
fn detail_that_is_not_finite_is_left_out_of_a_degraded_frame() {
    let (mut core, mut ports) = start(true);
    let press = |sequence, z| vec![ToolPose { tool: 0, sample: sample(sequence, z) }];
    order(&mut core, &mut ports, Command::Step { ticks: 100, poses: press(1, 0.024) }).unwrap();
    let coarse = positions(&mut core, &mut ports);
    let own = live_scaled(core.model(), f32::INFINITY);
    order(&mut core, &mut ports, Command::Activate(own)).unwrap();
    assert_eq!(positions(&mut core, &mut ports), coarse);
    let frame = ports.frames.frames.output_buffer();
    assert!(frame.degraded && frame.confidence == 0.0 && frame.database_generation == 1);
    // Other examples end it.
    let other = live(core.model());
    order(&mut core, &mut ports, Command::Activate(other)).unwrap();
    assert_ne!(positions(&mut core, &mut ports), coarse);
    assert!(!ports.frames.frames.output_buffer().degraded);
}

#[test]
fn what_was_active_comes_back_to_the_asker() {
    let (mut core, mut ports) = start(true);
    let mut activate = || {
        let live = live(core.model());
        ports.commands.orders.push(Command::Activate(live)).unwrap();
        core.turn(&mut NoProbe);
        ports.commands.replies.pop().unwrap()
    };
    assert!(matches!(activate().returned, Returned::Enrichment(None)));
    let second = activate();
    assert_eq!(second.outcome.unwrap().database_generation, 2);
    assert!(matches!(second.returned, Returned::Enrichment(Some(_))));
}

#[test]
fn a_restored_state_is_enriched_as_it_was_and_a_reset_one_is_at_rest() {
    let (mut core, mut ports) = start(true);
    let rest = positions(&mut core, &mut ports);
    let activated = live(core.model());
    order(&mut core, &mut ports, Command::Activate(activated)).unwrap();
    let press = |sequence, z| vec![ToolPose { tool: 0, sample: sample(sequence, z) }];
    order(&mut core, &mut ports, step(100, press(1, 0.024))).unwrap();
    let id = order(&mut core, &mut ports, Command::Snapshot).unwrap().snapshot.unwrap();
    let kept = positions(&mut core, &mut ports);
    order(&mut core, &mut ports, step(50, press(2, 0.05))).unwrap();
    assert_ne!(positions(&mut core, &mut ports), kept);
    order(&mut core, &mut ports, Command::Restore { id }).unwrap();
    assert_eq!(positions(&mut core, &mut ports), kept);
    assert_eq!(order(&mut core, &mut ports, Command::Reset).unwrap().database_generation, 1);
    assert_eq!(positions(&mut core, &mut ports), rest);
    assert_eq!(ports.frames.frames.output_buffer().confidence, 0.0);
}

#[test]
fn the_thread_runs_and_gives_the_loop_back() {
    let (core, _ports) = start(false);
    let running = spawn(core, ThreadOptions::default()).unwrap();
    std::thread::sleep(Duration::from_millis(50));
    assert!(running.is_alive());
    let core = running.stop().unwrap();
    assert!(core.state().tick() > 0);
    assert_eq!(core.statistics().tick.summary().count, core.state().tick());
}
