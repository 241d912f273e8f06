//! A ball on a half-space and on a bonded layer, against Hertz and against the correction for the layer's thickness.
//!
//! A quarter model: symmetry planes x = 0 and y = 0, small cells in the contact region, growing away from it.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod contact;

use contact::YOUNG_MODULUS_PA;
use contact::quarter::{Quarter, graded};
use plica_accurate::{Material, MaterialModel};

fn linear(poisson_ratio: f64) -> Material {
    Material { model: MaterialModel::Linear, young_modulus_pa: YOUNG_MODULUS_PA, poisson_ratio }
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
    let mut quarter = Quarter::new(&coordinates, &coordinates, linear(poisson_ratio));
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
        let mut quarter = Quarter::new(&across, &down, linear(poisson_ratio));
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
