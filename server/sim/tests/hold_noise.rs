//! A held tool is quiet: no limit cycle of the contact, whatever the stiffness, friction, coupling, depth and place.
#![allow(clippy::unwrap_used, reason = "a test that cannot build its scene should fail")]

mod common;

use common::*;
use nalgebra::{Point3, Vector3};
use plica_sim::*;

/// Standard deviation of the force over its mean while a tool is held.
const NOISE_BOUND: f64 = 5e-4;

/// Places for each stiffness, friction, coupling and tool of the table.
const PLACES: usize = 3;

/// One press that is held.
#[derive(Debug, Clone)]
struct Hold {
    shape: ToolShape,
    young_modulus_pa: f64,
    friction: f64,
    is_coupled: bool,
    depth_m: f64,
    /// Where on the top face \[m\].
    x: f64,
    y: f64,
}

/// How quiet a hold was.
#[derive(Debug, Clone, Copy)]
struct Quiet {
    /// Standard deviation of the force over its mean.
    noise: f64,
    mean_force_n: f64,
    /// Largest distance between two positions of a skin vertex \[m\].
    sway_m: f64,
}

fn rounding(shape: &ToolShape) -> f64 {
    match shape {
        ToolShape::Ball { radius_m } | ToolShape::Capsule { radius_m, .. } => *radius_m,
        _ => 0.0,
    }
}

impl Hold {
    /// How long a press is given to ring down \[s\]: a soft object swings slowly.
    fn settle_s(&self) -> f64 {
        if self.young_modulus_pa < 3e3 { 9.0 } else { 4.0 }
    }

    fn measure(&self) -> Quiet {
        self.measure_after(self.settle_s())
    }

    fn measure_after(&self, settle_s: f64) -> Quiet {
        let mut tool = tool("tool", self.shape.clone());
        tool.friction = self.friction;
        if self.is_coupled {
            tool.coupling = Coupling::Spring(SpringCoupling { max_force_n: 200.0, ..spring() });
        }
        let mut run = Scene::wedge(self.young_modulus_pa, 0.45).tool(tool).run();
        let end = Point3::new(self.x, self.y, top(self.x)) + top_normal() * (rounding(&self.shape) - self.depth_m);
        run.glide(end + top_normal() * (self.depth_m + 1e-3), end, 0.3, |_, _| {});
        run.hold(end, settle_s, |_, _| {});
        let (mut forces, mut low, mut high) = (Vec::new(), run.skin(), run.skin());
        run.hold(end, 0.5, |run, _| {
            forces.push(run.state.tools()[0].force_n);
            if forces.len() % 5 == 0 {
                for (p, (low, high)) in run.skin().iter().zip(low.iter_mut().zip(&mut high)) {
                    (low.coords, high.coords) = (low.coords.inf(&p.coords), high.coords.sup(&p.coords));
                }
            }
        });
        let mean: Vector3<f64> = forces.iter().sum::<Vector3<f64>>() / forces.len() as f64;
        let variance = forces.iter().map(|f| (f - mean).norm_squared()).sum::<f64>() / forces.len() as f64;
        Quiet {
            noise: variance.sqrt() / mean.norm(),
            mean_force_n: mean.norm(),
            sway_m: low.iter().zip(&high).map(|(a, b)| (b - a).norm()).fold(0.0, f64::max),
        }
    }
}

/// Presses at places drawn from a fixed seed: some for each stiffness, friction, coupling and tool.
fn sweep() -> Vec<Hold> {
    let mut random = Random(11);
    let mut between = |low: f64, high: f64| low + (high - low) * 0.5 * (1.0 + random.symmetric());
    let shapes = [
        ToolShape::Ball { radius_m: 0.006 },
        ToolShape::Ball { radius_m: 0.010 },
        ToolShape::Capsule { radius_m: 0.007, length_m: 0.1 },
    ];
    let mut holds = Vec::new();
    for young_modulus_pa in [1e3, 1e4, 3e4, 1e5, 1e6] {
        for friction in [0.0, 0.05, 0.1, 0.2, 0.5, 0.8] {
            for is_coupled in [false, true] {
                for shape in &shapes {
                    for _ in 0..PLACES {
                        let (x, y) = (between(0.025, 0.085), between(0.014, 0.046));
                        let depth_m = top(x) * between(0.08, 0.33);
                        holds.push(Hold {
                            shape: shape.clone(),
                            young_modulus_pa,
                            friction,
                            is_coupled,
                            depth_m,
                            x,
                            y,
                        });
                    }
                }
            }
        }
    }
    holds
}

fn name(shape: &ToolShape) -> &'static str {
    match shape {
        ToolShape::Capsule { .. } => "capsule 7",
        ToolShape::Ball { radius_m } if *radius_m < 0.008 => "ball 6",
        _ => "ball 10",
    }
}

/// The whole table, most of an hour of simulated time: `cargo test --release -p plica-sim --test hold_noise -- --ignored --nocapture`.
#[test]
#[ignore = "minutes"]
fn every_held_tool_is_quiet() {
    let only = std::env::var("HOLD_NOISE_E").ok().map(|e| e.parse::<f64>().unwrap());
    let mut failed = 0;
    for group in sweep().chunks(PLACES) {
        let h = &group[0];
        if only.is_some_and(|e| e != h.young_modulus_pa) {
            continue;
        }
        let found: Vec<Quiet> = group.iter().map(Hold::measure).collect();
        let noises: Vec<String> = found.iter().map(|q| format!("{:8.1e}", q.noise)).collect();
        let sway = found.iter().map(|q| q.sway_m).fold(0.0, f64::max);
        let forces: Vec<String> = found.iter().map(|q| format!("{:7.3}", q.mean_force_n)).collect();
        let coupling = if h.is_coupled { "spring" } else { "rigid" };
        let noisy = if found.iter().any(|q| q.noise >= NOISE_BOUND) { "NOISY" } else { "" };
        failed += found.iter().filter(|q| q.noise >= NOISE_BOUND).count();
        println!(
            "E {:.0e} mu {:.2} {coupling:6} {:9}: noise {}, sway {:.4} mm, force {} N {noisy}",
            h.young_modulus_pa,
            h.friction,
            name(&h.shape),
            noises.join(""),
            1e3 * sway,
            forces.join("")
        );
    }
    assert_eq!(failed, 0, "holds with a noise of {NOISE_BOUND} of the force or more");
}

/// Slices of the table that take seconds.
fn assert_quiet(holds: impl IntoIterator<Item = Hold>) {
    for hold in holds {
        let quiet = hold.measure_after(1.5);
        println!("{hold:?}: {quiet:?}");
        assert!(quiet.noise < NOISE_BOUND, "{hold:?}: {quiet:?}");
    }
}

/// Without friction, and a ball of 6 mm.
fn slippery(young_modulus_pa: f64, is_coupled: bool, [x, y, depth_m]: [f64; 3]) -> Hold {
    let shape = ToolShape::Ball { radius_m: 0.006 };
    Hold { shape, young_modulus_pa, friction: 0.0, is_coupled, depth_m, x, y }
}

#[test]
fn tools_do_not_sway_where_neighbouring_rows_pass_their_load_on() {
    assert_quiet([[0.0370, 0.0432, 9.36e-3], [0.0431, 0.0191, 5.33e-3]].map(|place| slippery(3e4, false, place)));
}

#[test]
fn a_tool_that_rests_where_two_features_of_the_skin_meet_does_not_change_between_them() {
    assert_quiet([slippery(1e5, true, [0.032_960_57, 0.019_122_01, 3.659_356e-3])]);
}
