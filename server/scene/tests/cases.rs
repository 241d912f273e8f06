//! The cases of configs/cases against closed forms. `--nocapture` prints the figures of docs/measured.md.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::f64::consts::{FRAC_PI_2, PI};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use plica_scene::case::{Case, Problem, Solution, SolveOptions, Stability, follow};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/cases")
}

/// A solved case.
struct Solved {
    problem: Problem,
    solution: Solution,
}

/// A case of configs/cases, some of its text replaced and with other options.
fn solve_with(name: &str, changes: &[(&str, &str)], adjust: impl Fn(SolveOptions) -> SolveOptions) -> Solved {
    let file = folder().join(name);
    let text = changes.iter().fold(std::fs::read_to_string(&file).unwrap(), |text, (from, to)| {
        assert!(text.contains(from), "`{from}` is not in {name}");
        text.replace(from, to)
    });
    let case = Case::parse(&file, &text).unwrap();
    let problem = Problem::new(&case).unwrap();
    let begin = std::time::Instant::now();
    let solution = follow(&problem, &adjust(case.solve()), &mut |_| ControlFlow::Continue(())).unwrap();
    println!(
        "{name}: {} elements, {} load steps ({} failed), {} Newton steps, {:.2} s",
        problem.mesh().n_elements(),
        solution.steps.len(),
        solution.n_failed,
        solution.iterations(),
        begin.elapsed().as_secs_f64()
    );
    Solved { problem, solution }
}

fn solve(name: &str) -> Solved {
    solve_with(name, &[], |options| options)
}

impl Solved {
    fn probe(&self, name: &str) -> Vec<f64> {
        let probe = self.problem.probes().iter().find(|probe| probe.name == name).unwrap();
        probe.read(&self.problem, &self.solution).value.components().to_vec()
    }
}

#[track_caller]
fn assert_close(what: &str, found: f64, expected: f64, share: f64) {
    println!("{what}: {found:.6e}, closed form {expected:.6e}, off by {:.3} %", 100.0 * (found / expected - 1.0));
    assert!((found - expected).abs() <= share * expected.abs(), "{what}: {found} is not {expected} within {share}");
}

/// Complete elliptic integrals of the first and second kind, by arithmetic-geometric means.
fn elliptic(k: f64) -> [f64; 2] {
    let (mut a, mut b, mut c, mut sum, mut power) = (1.0, (1.0 - k * k).sqrt(), k, 0.5 * k * k, 1.0);
    while c.abs() > 1e-15 {
        c = 0.5 * (a - b);
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
        sum += power * c * c;
        power *= 2.0;
    }
    let first = FRAC_PI_2 / a;
    [first, first * (1.0 - sum)]
}

/// Tip of an inextensible column under `ratio` times its Euler load, sideways and along over its length: `2 k / K` and
/// `2 E / K - 1`, with `K = pi/2 sqrt(ratio)` \[TG61, 2.7\].
fn elastica(ratio: f64) -> [f64; 2] {
    let (mut low, mut high) = (0.0, 1.0 - 1e-12);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if elliptic(middle)[0] < FRAC_PI_2 * ratio.sqrt() { low = middle } else { high = middle }
    }
    let [first, second] = elliptic(low);
    [2.0 * low / first, 2.0 * second / first - 1.0]
}

#[test]
fn a_column_at_twice_its_euler_load_is_called_unstable_and_followed_to_the_elastica() {
    let straight = solve("column.toml");
    assert_eq!(straight.solution.stability, Stability::Unstable(1));
    assert!(straight.probe("tip")[2].abs() < 1e-9);
    let bent = solve_with("column.toml", &[], |options| SolveOptions { follow_stable: true, ..options });
    assert_eq!(bent.solution.stability, Stability::Stable);
    assert!(bent.solution.n_left > 0);
    let [sideways, along] = elastica(2.0);
    let tip = bent.probe("tip");
    assert_close("column, tip sideways over L", tip[2].abs() / 0.1, sideways, 0.02);
    assert_close("column, tip height over L", 1.0 + tip[0] / 0.1, along, 0.08);
}

#[test]
fn a_bar_stretches_under_its_own_weight() {
    let bar = solve("self-weight.toml");
    assert_close("own weight, end", -bar.probe("end")[2], 1000.0 * 9.81 * 0.01 / 2e5, 1e-9);
    assert_close("own weight, ceiling", bar.probe("ceiling")[2], 1000.0 * 9.81 * 4e-5, 1e-9);
}

#[test]
fn a_square_bar_twists_as_saint_venant_says() {
    let bar = solve("torsion.toml");
    let twist = 0.1_f64.to_radians() / 0.02;
    assert_close("torsion, torque", bar.probe("grip")[0], 0.1406 * 4e5 * 1e-8 * twist, 0.01);
}

#[test]
fn a_moment_rolls_a_strip_up_to_a_full_turn() {
    let strip = solve("roll-up.toml");
    let tip = strip.probe("tip");
    let back = ((tip[0] + 0.2).hypot(tip[2])) / 0.2;
    println!("roll-up: tip {:.4} L from the beginning", back);
    assert!(back < 0.02, "{tip:?}");
    assert_close(
        "roll-up, moment of the wall",
        strip.probe("wall")[1],
        2.0 * PI * 1e6 * (1e-3 * 1.25e-7 / 12.0) / 0.2,
        1e-6,
    );
    assert!(strip.solution.iterations() <= 120, "{}", strip.solution.iterations());
}

#[test]
fn an_incline_and_a_wall_carry_a_block() {
    let block = solve("incline.toml");
    let (incline, wall) = (block.probe("incline"), block.probe("wall"));
    assert_close("incline, across", incline[0].hypot(incline[2]), 0.1 / 30_f64.to_radians().cos(), 1e-7);
    assert_close("incline, wall", wall[0], 0.1 * 30_f64.to_radians().tan(), 1e-7);
    assert!(incline[0] < 0.0 && wall[1].abs() < 1e-12, "{incline:?} {wall:?}");
}

#[test]
fn a_ball_presses_as_hertz_says() {
    let ball = solve("ball.toml");
    let force = ball.probe("ball")[2];
    assert_close("ball, force", -force, 31.372e-3, 0.05);
    assert_close("ball, bottom", ball.probe("bottom")[2], -force, 1e-5);
}

#[test]
fn a_flat_punch_presses_as_sneddon_says() {
    let punch = solve("punch.toml");
    assert_close("punch, force", -punch.probe("punch")[2], 17.857e-3, 0.08);
}

#[test]
fn a_nearly_incompressible_block_takes_few_newton_steps() {
    let block = solve("block.toml");
    println!("{:?}", block.solution.steps.iter().map(|s| s.iterations).collect::<Vec<_>>());
    assert!(block.solution.iterations() <= 45, "{}", block.solution.iterations());
}

/// Pressure of an incompressible Neo-Hookean sphere of radii 0.1 and 0.11 m at the stretch `a` of the inner one \[Ogd84, 5.3\].
fn sphere_pressure(mu_pa: f64, a: f64) -> f64 {
    let f = |s: f64| 2.0 / s + 0.5 / s.powi(4);
    let outer = (1.0 + (a.powi(3) - 1.0) / 1.1_f64.powi(3)).cbrt();
    mu_pa * (f(outer) - f(a))
}

#[test]
fn a_balloon_passes_its_largest_pressure() {
    let balloon = solve("balloon.toml");
    let largest = (0..10_000).map(|i| sphere_pressure(1e5, 1.0 + 1e-4 * f64::from(i))).fold(0.0, f64::max);
    let [limit] = balloon.solution.limit_loads[..] else { panic!("{:?}", balloon.solution.limit_loads) };
    assert_close("balloon, largest pressure", 15e3 * limit, largest, 0.01);
    let stretch = 1.0 + balloon.probe("inside")[2] / 0.1;
    assert!(stretch > 2.0 && balloon.solution.share < 0.9 * limit, "{stretch}");
    assert_close("balloon, pressure at the end", 15e3 * balloon.solution.share, sphere_pressure(1e5, stretch), 0.01);
}

/// Largest and least force on half of an arch of straight legs, clamped at its feet: `P = E I v_xxx + N b` of a leg of slope `b`
/// under the thrust `N`, by beam-column theory \[Wil64\]. The crown sinks by `w`: `2 b w - w^2 J = 2 N L / (E A)`,
/// `w^2 J = int v_x^2`.
fn arch_limits() -> [f64; 2] {
    let (length, slope, area, inertia): (f64, f64, f64, f64) = (0.1, 0.06, 5e-6, 2e-3 * 2.5e-3_f64.powi(3) / 12.0);
    let (stiffness, bending) = (1e6 * area, 1e6 * inertia);
    let mut path = Vec::new();
    for i in 1..4000 {
        let thrust = bending * (2.0 * PI / length).powi(2) * 0.98 * f64::from(i) / 4000.0;
        let k = (thrust / bending).sqrt();
        let (half, size) = ((0.5 * k * length).tan(), 2.0 * (0.5 * k * length).tan() - k * length);
        let rise = |x: f64| k / size * (1.0 - (k * x).cos() - half * (k * x).sin());
        let n = 400;
        let simpson = |j: i32| if j == 0 || j == n { 1.0 } else { f64::from(2 + 2 * (j % 2)) };
        let sum: f64 = (0..=n).map(|j| simpson(j) * rise(length * f64::from(j) / f64::from(n)).powi(2)).sum();
        let bowing = sum * length / f64::from(3 * n);
        let root = slope * slope - 2.0 * bowing * thrust * length / stiffness;
        for sign in [-1.0, 1.0] {
            let sunk = (slope + sign * root.sqrt()) / bowing;
            if root >= 0.0 && (k * length - PI).abs() > 1e-3 {
                path.push([sunk, bending * k.powi(3) * sunk / size + thrust * slope]);
            }
        }
    }
    let largest = path.iter().filter(|p| p[0] < 6e-3).map(|p| p[1]).fold(0.0, f64::max);
    let least = path.iter().filter(|p| p[0] > 6e-3).map(|p| p[1]).fold(f64::INFINITY, f64::min);
    [largest, least]
}

#[test]
fn an_arch_snaps_through_and_bears_all_of_its_load() {
    let arch = solve("arch.toml");
    let [largest, least] = arch_limits();
    let [first, second] = arch.solution.limit_loads[..] else { panic!("{:?}", arch.solution.limit_loads) };
    assert_close("arch, largest force", 0.3e-3 * first, largest, 0.02);
    assert_close("arch, least force after it", 0.3e-3 * second, least, 0.04);
    assert_eq!(arch.solution.share, 1.0);
    assert!(arch.probe("crown")[2] < -8e-3, "{:?}", arch.probe("crown"));
    assert_eq!(arch.solution.stability, Stability::Stable);
}
