//! No tick allocates or frees, in any situation.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use std::sync::Arc;

use assert_no_alloc::{AllocDisabler, assert_no_alloc, violation_count};
use common::{E, Run, Scene, at, ball, tool, top, top_normal, turned};
use nalgebra::{Isometry3, Point3, Vector3};
use plica_geometry::ConvexPolytope;
use plica_sim::enrichment::{Enricher, EnrichmentOptions, Examples, LiveEnrichment, Touch};
use plica_sim::*;

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

/// Allocations and frees of this thread while `f` runs.
fn allocations(f: impl FnOnce()) -> u32 {
    let before = violation_count();
    assert_no_alloc(f);
    violation_count() - before
}

#[test]
fn harness_sees_allocations_and_frees() {
    assert_eq!(allocations(|| ()), 0);
    assert_eq!(allocations(|| drop(std::hint::black_box(Vec::<u8>::with_capacity(16)))), 2);
    let kept = std::hint::black_box(vec![1_u8; 16]);
    assert_eq!(allocations(|| drop(kept)), 1);
    let mut full = vec![1_u8; 16];
    assert!(allocations(|| full.push(std::hint::black_box(1))) > 0);
}

/// Every kind of tool on the wedge, whose upper edge a plane presses down.
fn crowded(sleep: bool) -> Run {
    let spring = Coupling::Spring(SpringCoupling::default());
    let with = |mut tool: ToolDescription, friction: f64, coupling: Coupling, sampling: Sampling| {
        (tool.friction, tool.coupling, tool.sampling) = (friction, coupling, sampling);
        tool
    };
    let hull = [(0.0, 0.0), (0.008, 0.0), (0.0, 0.008), (-0.006, -0.006)];
    let points_m: Vec<Point3<f64>> =
        hull.iter().flat_map(|&(x, y)| [0.0, 0.02].map(|z| Point3::new(x, y, z))).collect();
    let capsule = ToolShape::Capsule { radius_m: 0.007, length_m: 0.1 };
    let cuboid = ToolShape::Cuboid { half_extents_m: [0.01, 0.005, 0.004] };
    let late = Sampling::Interpolate { delay_s: 0.02 };
    Scene::wedge(E, 0.45)
        .tool(with(ball(0.008), 0.5, spring, Sampling::Latest))
        .tool(with(tool("capsule", capsule), 0.8, spring, late))
        .tool(with(tool("cuboid", cuboid), 0.3, Coupling::Rigid, Sampling::Latest))
        .tool(with(
            tool("hull", ToolShape::ConvexHull { polytope: ConvexPolytope::hull(points_m).unwrap() }),
            0.0,
            Coupling::Rigid,
            late,
        ))
        .with(|d| {
            d.planes.push(Plane { point_m: Point3::new(0.0, 0.0, 0.0385), normal: Vector3::new(1.0, 0.0, -3.0) });
            d.gravity_m_per_s2 = Vector3::new(0.0, 0.0, -1.0);
            d.sleep = SleepOptions { enabled: sleep, after_s: 0.2, speed_m_per_s: 1e-3 };
        })
        .run()
}

/// Pose of tool `k` at tick `n`: sliding, pressing in and out; every 2000 ticks all are away for 700; now and then one jumps.
fn pose(k: usize, n: usize) -> Isometry3<f64> {
    if n % 2000 >= 1300 {
        return at(Point3::new(0.05, 0.03, 0.2));
    }
    let t = n as f64 * 1e-3;
    let jump = if n.is_multiple_of(777) { 0.02 } else { 0.0 };
    let x = 0.025 + 0.022 * k as f64 + 0.006 * (3.0 * t + k as f64).sin() + jump;
    let depth = 0.002 + 0.003 * (5.0 * t).sin();
    let reach = [0.008, 0.007, 0.004, 0.0][k];
    let p = Point3::new(x, 0.03 + 0.01 * (2.0 * t).cos(), top(x)) + top_normal() * (reach - depth);
    turned(p, Vector3::new(0.1 * t.sin(), 0.2, 0.0))
}

/// Half of the coarse offset removed, in a dozen states with many tools.
fn enrichment(run: &Run) -> LiveEnrichment {
    let mut trained = crowded(false);
    let mut examples = Examples::default();
    for n in 0..600 {
        trained.tick(&[0, 1, 2, 3].map(|k| (k, pose(k, n))));
        let reading = trained.state.tools()[0];
        if n % 50 == 49 && reading.in_contact {
            let to_f32 = |v: &Vector3<f64>, share: f64| (v * share).cast::<f32>().into();
            let u = trained.state.node_displacements(&trained.model);
            examples.displacements.push(u.iter().map(|u| to_f32(u, 1.0)).collect());
            examples.details.push(trained.offsets().iter().map(|o| to_f32(o, -0.5)).collect());
            let tool_origin = reading.proxy.translation.vector.into();
            examples.touches.push(Touch { contact_point: reading.reference_contact_point_m, tool_origin });
        }
    }
    let enricher = Enricher::new(&run.model, &examples, EnrichmentOptions::default()).unwrap();
    LiveEnrichment::new(&run.model, Arc::new(enricher))
}

#[test]
fn ten_thousand_ticks_with_contact_allocate_nothing() {
    let mut run = crowded(true);
    let mut live = enrichment(&run);
    let mut skin = vec![[0.0; 3]; run.model.n_skin()];
    let (mut enriched, mut touching, mut sleeping, mut fallbacks, mut refused, mut dropped) = (0, 0, 0, 0, 0, 0);
    let mut count = 0;
    for n in 0..10_000_u64 {
        let jumble = if n.is_multiple_of(1500) { f64::NAN } else { 0.0 };
        let mut poses = [0, 1, 2, 3].map(|k| ToolPose {
            tool: k,
            sample: PoseSample {
                sequence: n,
                source_time_ns: Some(n * 1_000_000),
                valid: !n.is_multiple_of(97),
                pose: pose(k, n as usize),
            },
        });
        poses[0].sample.pose.translation.x += jumble;
        let input = TickInput { clock_s: run.clock_s, poses: &poses };
        let mut report = TickReport::default();
        count += allocations(|| {
            report = tick(&run.model, input, &mut run.state, &mut run.workspace, &mut NoProbe);
            live.follow(&run.model, &run.state);
            if n.is_multiple_of(11) {
                live.write_skin(&run.model, &run.state, &mut skin);
            }
        });
        run.clock_s += 1e-3;
        enriched += u32::from(live.confidence(0) > 0.0);
        touching += u32::from(run.state.tools().iter().any(|t| t.in_contact));
        sleeping += u32::from(report.sleeping);
        (fallbacks, refused) = (fallbacks + report.fallbacks, refused + report.poses_refused);
        dropped += report.dropped_contacts;
        assert_eq!(count, 0, "tick {n} allocated: {report:?}");
    }
    println!(
        "{touching} ticks in contact, {sleeping} asleep, {fallbacks} fall-backs, {dropped} rows left out, {refused} poses refused, \
         {enriched} with detail"
    );
    assert!(touching > 5000 && sleeping > 100 && refused > 0 && enriched > 100);
}

#[test]
fn roll_back_frame_and_snapshot_allocate_nothing() {
    let mut run = crowded(false);
    for n in 0..50 {
        run.tick(&[0, 1, 2, 3].map(|k| (k, pose(k, 200 + n))));
    }
    let mut kept = run.state.clone();
    let mut spoilt = run.state.node_displacements(&run.model);
    spoilt.iter_mut().for_each(|u| u.z = f64::NAN);
    let mut skin = vec![[0.0; 3]; run.model.n_skin()];
    let input = TickInput { clock_s: run.clock_s, poses: &[] };
    let mut report = TickReport::default();
    let mut load = 0.0;
    let count = allocations(|| {
        kept.copy_from(&run.state);
        run.state.set_node_displacements(&run.model, &spoilt);
        report = tick(&run.model, input, &mut run.state, &mut run.workspace, &mut NoProbe);
        run.state.write_skin(&run.model, &mut skin);
        run.state.write_skin_offsets(&run.model, &mut skin);
        run.state.copy_from(&kept);
        load = run.state.contacts().map(|c| c.normal_force_n).sum();
    });
    assert!(report.rolled_back && load > 0.0, "{report:?}, {load} N");
    assert_eq!(count, 0);
}
