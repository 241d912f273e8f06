//! A ball on a half-space and on a bonded layer, against Hertz and against the correction for the layer's thickness.
//!
//! A quarter model: symmetry planes x = 0 and y = 0, small cells in the contact region, growing away from it.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod contact;

use std::f64::consts::PI;

use contact::{Body, Tool, YOUNG_MODULUS_PA, at, graded_block, quads};
use plica_accurate::contact::ContactSurface;
use plica_accurate::{Constraints, Material, MaterialModel};

/// Coordinates from 0 to `end_m`: `n_fine` cells of `fine_m`, then `n_growing` that grow by one factor.
fn graded(fine_m: f64, n_fine: usize, n_growing: usize, end_m: f64) -> Vec<f64> {
    let rest = (end_m - fine_m * n_fine as f64) / fine_m;
    let reach = |ratio: f64| (1..=n_growing as i32).map(|k| ratio.powi(k)).sum::<f64>();
    let (mut low, mut high) = (0.1, 10.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if reach(middle) < rest { low = middle } else { high = middle }
    }
    let sizes = (0..n_fine).map(|_| 1.0).chain((1..=n_growing as i32).map(|k| low.powi(k)));
    let ends = sizes.scan(0.0, |end, size| {
        *end += size * fine_m;
        Some(*end)
    });
    std::iter::once(0.0).chain(ends).collect()
}

/// A quarter of a block with its top at z = 0 and its bottom held.
struct Quarter {
    body: Body,
}

impl Quarter {
    fn new(across_m: &[f64], down_m: &[f64], poisson_ratio: f64, model: MaterialModel) -> Self {
        let up: Vec<f64> = down_m.iter().rev().map(|d| -d).collect();
        let mesh = graded_block([across_m, across_m, &up]);
        let mut constraints = Constraints::none(mesh.n_nodes());
        for (node, x) in mesh.nodes().iter().enumerate() {
            (0..2).filter(|axis| x[*axis] == 0.0).for_each(|axis| constraints.give(node, axis, 0.0));
            if x.z == up[0] {
                constraints.hold(node, &x.coords);
            }
        }
        let surface = ContactSurface::new(&mesh, &quads(&mesh, |x| x.z == 0.0));
        let material = Material { model, young_modulus_pa: YOUNG_MODULUS_PA, poisson_ratio };
        Self { body: Body::new(mesh, material, constraints, surface) }
    }

    /// Force \[N\] and contact radius \[m\] of the whole ball at each depth.
    fn press(&mut self, radius_m: f64, depths_m: &[f64]) -> Vec<(f64, f64)> {
        let mut tool = Tool::ball(radius_m, 0.0).exactly();
        tool.params.max_increment_m = 0.1 * radius_m;
        let mut state = self.body.rest(&at(0.0, 0.0, radius_m));
        let mut press = |depth_m: &f64| {
            let info = self.body.go_on(&tool, &[at(0.0, 0.0, radius_m - depth_m)], &mut state).unwrap();
            (4.0 * info.force_n.z, (4.0 * info.area_m2 / PI).sqrt())
        };
        depths_m.iter().map(&mut press).collect()
    }
}

/// `F = 4/3 E* sqrt(R) d^1.5`, `E* = E / (1 - nu^2)` \[Johnson85, eq. 4.23\].
fn hertz_n(radius_m: f64, depth_m: f64, poisson_ratio: f64) -> f64 {
    4.0 / 3.0 * YOUNG_MODULUS_PA / (1.0 - poisson_ratio.powi(2)) * radius_m.sqrt() * depth_m.powf(1.5)
}

/// Force on an incompressible layer bonded to a rigid base over Hertz's, `chi = sqrt(R d) / h`; for `0.1 R <= h <= 12.8 R` and
/// `d <= 0.1 h` [Dimitriadis02].
fn layer_factor(chi: f64) -> f64 {
    1.0 + 1.133 * chi + 1.283 * chi.powi(2) + 0.769 * chi.powi(3) + 0.0975 * chi.powi(4)
}

/// Slope of a least-squares line through the points' logarithms.
fn log_log_slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let logs: Vec<_> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let mean = logs.iter().fold((0.0, 0.0), |sum, (x, y)| (sum.0 + x / n, sum.1 + y / n));
    let over = logs.iter().map(|(x, y)| (x - mean.0) * (y - mean.1)).sum::<f64>();
    over / logs.iter().map(|(x, _)| (x - mean.0).powi(2)).sum::<f64>()
}

fn hertz(n_fine: usize, n_growing: usize) {
    let (radius_m, poisson_ratio) = (0.01_f64, 0.3);
    let depths_m = [0.025e-3, 0.05e-3, 0.1e-3, 0.2e-3];
    let contact_m = (radius_m * depths_m[3]).sqrt();
    let coordinates = graded(1.25 * contact_m / n_fine as f64, n_fine, n_growing, 100.0 * contact_m);
    let mut quarter = Quarter::new(&coordinates, &coordinates, poisson_ratio, MaterialModel::Linear);
    let results = quarter.press(radius_m, &depths_m);
    println!("ball of 10 mm on a block of 100 contact radii, nu 0.3, {} hexahedra", quarter.body.mesh.n_hexes());
    for (depth_m, (force_n, contact_m)) in depths_m.iter().zip(&results) {
        println!(
            "depth {:.3} mm: {:.3e} N, {:.4} of Hertz; contact radius {:.3} of Hertz",
            depth_m * 1e3,
            force_n,
            force_n / hertz_n(radius_m, *depth_m, poisson_ratio),
            contact_m / (radius_m * depth_m).sqrt()
        );
    }
    let points: Vec<_> = depths_m.iter().zip(&results).map(|(d, (f, _))| (*d, *f)).collect();
    let slope = log_log_slope(&points);
    println!("log-log slope {slope:.4}, 1.5 expected");
    assert!((slope - 1.5).abs() < 0.03 * 1.5, "{slope}");
    let worst = points.iter().map(|(d, f)| (f / hertz_n(radius_m, *d, poisson_ratio) - 1.0).abs()).fold(0.0, f64::max);
    assert!(worst < 0.08, "{worst}");
}

#[test]
fn small_depths_follow_hertz() {
    hertz(8, 11);
}

#[test]
#[ignore = "minutes: finer"]
fn small_depths_follow_hertz_finer() {
    hertz(16, 14);
}

/// Ratios of the force to the corrected one.
fn bonded_layer(n_fine: usize, n_growing: usize, n_down: usize) -> Vec<f64> {
    let (height_m, poisson_ratio) = (0.01, 0.499);
    let mut ratios = Vec::new();
    for (radius_m, depth_m) in [(0.01_f64, 0.25e-3), (0.01, 1e-3), (0.03, 0.25e-3), (0.03, 1e-3)] {
        let contact_m = (radius_m * depth_m).sqrt();
        let fine_m = 1.25 * contact_m / n_fine as f64;
        let across = graded(fine_m, n_fine, n_growing, 8.0 * height_m);
        let down = graded(fine_m, 4, n_down - 4, height_m);
        let mut quarter = Quarter::new(&across, &down, poisson_ratio, MaterialModel::Linear);
        let (force_n, _) = quarter.press(radius_m, &[depth_m])[0];
        let chi = contact_m / height_m;
        let over_hertz = force_n / hertz_n(radius_m, depth_m, poisson_ratio);
        println!(
            "layer of 10 mm, nu 0.499, ball of {:.0} mm, depth {:.2} mm, chi {chi:.3}: {over_hertz:.3} of Hertz, \
             correction {:.3}, ratio {:.4} ({} hexahedra)",
            radius_m * 1e3,
            depth_m * 1e3,
            layer_factor(chi),
            over_hertz / layer_factor(chi),
            quarter.body.mesh.n_hexes()
        );
        ratios.push(over_hertz / layer_factor(chi));
    }
    ratios
}

/// From a sixth to half of the thickness, where Hertz alone is short by up to a half.
#[test]
fn layers_follow_the_thickness_correction() {
    for ratio in bonded_layer(7, 9, 8) {
        assert!((ratio - 1.0).abs() < 0.06, "{ratio}");
    }
}

#[test]
#[ignore = "minutes: finer"]
fn layers_follow_the_thickness_correction_finer() {
    for ratio in bonded_layer(14, 14, 14) {
        assert!((ratio - 1.0).abs() < 0.06, "{ratio}");
    }
}
