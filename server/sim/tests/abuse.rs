//! Extreme use: inverted elements, tools forced through, shaken, pinching, teleporting. The object stays bounded, and
//! recovers after release.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::{Random, Run, Scene, at, ball, top};
use nalgebra::{Point3, Vector3};
use plica_sim::*;

const RADIUS_M: f64 = 0.01;
/// Longest edge of the wedge [m].
const OBJECT_M: f64 = 0.12;
/// Duration of the motion of tools, and of the recovery after it [s].
const DRIVEN_S: f64 = 0.6;
const FREE_S: f64 = 0.8;
/// Position of an absent tool.
const AWAY: Point3<f64> = Point3::new(0.05, 0.03, 0.5);

/// One run of the suite.
#[derive(Debug, Clone, Copy)]
struct Case {
    young_modulus_pa: f64,
    poisson_ratio: f64,
    h: f64,
    coupling: Coupling,
}

/// Result of a run.
#[derive(Debug, Clone, Copy, Default)]
struct Outcome {
    rollbacks: u64,
    /// Whether every frame was finite.
    finite: bool,
    /// Largest displacement of a node at any time, and of a skin vertex at the end [m].
    peak_m: f64,
    left_m: f64,
    /// Share of the ticks with a fall-back.
    fallback_share: f64,
}

fn cases(couplings: &[Coupling]) -> Vec<Case> {
    let mut out = Vec::new();
    for young_modulus_pa in [1e3, 3e4, 1e6] {
        for poisson_ratio in [0.45, 0.49] {
            for h in [1e-3, 5e-3] {
                out.extend(couplings.iter().map(|&coupling| Case { young_modulus_pa, poisson_ratio, h, coupling }));
            }
        }
    }
    out
}

fn both() -> [Coupling; 2] {
    [Coupling::Rigid, Coupling::Spring(SpringCoupling::default())]
}

impl Case {
    fn run(&self, n_tools: usize) -> Run {
        let mut scene = Scene::wedge(self.young_modulus_pa, self.poisson_ratio).timestep(self.h);
        for _ in 0..n_tools {
            let mut tool = ball(RADIUS_M);
            (tool.coupling, tool.friction) = (self.coupling, 0.5);
            scene = scene.tool(tool);
        }
        scene.run()
    }

    /// Drives tools along `path(tool, seconds, tick)`, then takes them away.
    fn drive(&self, n_tools: usize, path: impl Fn(usize, f64, usize) -> Point3<f64>) -> Outcome {
        let mut run = self.run(n_tools);
        let mut outcome = Outcome { finite: true, ..Outcome::default() };
        let ticks = |seconds: f64| (seconds / self.h).round() as usize;
        for k in 0..ticks(DRIVEN_S) {
            let poses: Vec<_> = (0..n_tools).map(|tool| (tool, at(path(tool, k as f64 * self.h, k)))).collect();
            let report = run.tick(&poses);
            outcome.watch(&run, &report);
        }
        let away: Vec<_> = (0..n_tools).map(|tool| (tool, at(AWAY + Vector3::x() * (0.1 * tool as f64)))).collect();
        for _ in 0..ticks(FREE_S) {
            let report = run.tick(&away);
            outcome.watch(&run, &report);
        }
        outcome.fallback_share /= (ticks(DRIVEN_S) + ticks(FREE_S)) as f64;
        outcome
    }
}

impl Outcome {
    fn watch(&mut self, run: &Run, report: &TickReport) {
        // The skin is sampled every few ticks, to save time.
        if run.state.tick().is_multiple_of(10) {
            let offsets = run.offsets();
            self.finite &= offsets.iter().all(|o| o.iter().all(|c| c.is_finite()));
            self.left_m = offsets.iter().map(|o| o.norm()).fold(0.0, f64::max);
        }
        let nodes = run.state.node_displacements(&run.model);
        self.finite &= nodes.iter().all(|u| u.iter().all(|c| c.is_finite()));
        self.peak_m = nodes.iter().map(|u| u.norm()).fold(self.peak_m, f64::max);
        self.rollbacks = run.state.rollbacks();
        self.fallback_share += f64::from(u8::from(report.fallbacks > 0));
    }

    fn blew_up(&self) -> bool {
        !self.finite || self.rollbacks > 0 || self.peak_m > 10.0 * OBJECT_M
    }
}

/// Runs all cases, prints their results, and asserts that all stay bounded and all but the softest recover.
fn survive(what: &str, couplings: &[Coupling], run: impl Fn(&Case) -> Outcome) {
    let results: Vec<(Case, Outcome)> = cases(couplings).iter().map(|case| (*case, run(case))).collect();
    println!("{what}: {} blow-ups in {} runs", results.iter().filter(|r| r.1.blew_up()).count(), results.len());
    for (case, o) in &results {
        let coupling = if case.coupling == Coupling::Rigid { "rigid" } else { "spring" };
        println!(
            "  E {:.0e} Pa, nu {}, h {:.0} ms, {coupling}: peak {:.1} mm, at the end {:.4} mm, fall-backs in {:.0} % of ticks, {} roll-backs",
            case.young_modulus_pa,
            case.poisson_ratio,
            case.h * 1e3,
            o.peak_m * 1e3,
            o.left_m * 1e3,
            o.fallback_share * 100.0,
            o.rollbacks
        );
    }
    for (case, o) in &results {
        assert!(!o.blew_up(), "{what}, {case:?}: {o:?}");
        // At 1 kPa the ring-down takes seconds.
        let rest_m = if case.young_modulus_pa < 1e4 { 0.02 } else { 5e-5 };
        assert!(o.left_m < rest_m, "{what}, {case:?}: not back after {FREE_S} s: {o:?}");
    }
}

/// Nodes at random, elements inverted.
fn scramble(case: &Case, amplitude_m: f64) -> Outcome {
    let mut run = case.run(0);
    let mut random = Random(17);
    let u: Vec<_> = (0..run.model.n_nodes()).map(|_| random.vector() * amplitude_m).collect();
    run.state.set_node_displacements(&run.model, &u);
    let mut outcome = Outcome { finite: true, ..Outcome::default() };
    let n_ticks = (1.5 / case.h).round() as usize;
    for _ in 0..n_ticks {
        let report = run.tick(&[]);
        outcome.watch(&run, &report);
    }
    outcome.fallback_share /= n_ticks as f64;
    outcome
}

#[test]
fn scrambled_by_20_mm() {
    survive("scramble 20 mm", &[Coupling::Rigid], |case| scramble(case, 0.02));
}

#[test]
fn scrambled_by_60_mm() {
    survive("scramble 60 mm", &[Coupling::Rigid], |case| scramble(case, 0.06));
}

/// Press by `depth` within 0.25 s, hold, release.
fn push(x: f64, depth: f64, seconds: f64) -> Point3<f64> {
    let share = (seconds / 0.25).min(1.0) - ((seconds - 0.45) / 0.15).clamp(0.0, 1.0);
    Point3::new(x, 0.03, top(x) + RADIUS_M + 1e-3 - (depth + 1e-3) * share)
}

#[test]
fn pushed_to_half_depth() {
    survive("half depth", &both(), |case| case.drive(1, |_, t, _| push(0.05, 0.5 * top(0.05), t)));
}

#[test]
fn pushed_through() {
    survive("60 mm through", &both(), |case| case.drive(1, |_, t, _| push(0.02, 0.06, t)));
}

#[test]
fn shaken_at_half_the_tick_rate() {
    survive("jitter +-2 mm", &both(), |case| {
        case.drive(1, |_, t, k| {
            let jitter = if k % 2 == 0 { 0.002 } else { -0.002 };
            push(0.05, 0.003, t) + Vector3::new(jitter, -jitter, jitter)
        })
    });
}

/// Two balls from both sides, 14 mm deep each, lift by 20 mm.
#[test]
fn pinched_and_lifted() {
    survive("pinch", &both(), |case| {
        case.drive(2, |tool, t, _| {
            let side = if tool == 0 { -1.0 } else { 1.0 };
            let (depth, lift) = (0.014 * (t / 0.2).min(1.0), 0.02 * ((t - 0.25) / 0.2).clamp(0.0, 1.0));
            Point3::new(0.05, 0.03 + side * (0.03 + RADIUS_M - depth), 0.6 * top(0.05) + lift)
        })
    });
}

/// 8 or 22 mm deep at once, and out again, every 50 ms; at 22 mm the ball is all inside.
#[test]
fn teleported_in_and_out() {
    survive("teleport", &both(), |case| {
        let depths = [-0.02, 0.008, -0.02, 0.022];
        case.drive(1, |_, t, _| push(0.05, depths[(t / 0.05) as usize % 4], 0.3))
    });
}
