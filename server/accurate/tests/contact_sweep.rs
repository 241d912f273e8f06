//! Dependence of results on increments and mesh, and cost of presses. The sweeps over the wedge take minutes:
//! `cargo test --release -p plica-accurate --test contact_sweep -- --ignored --nocapture`.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;
mod contact;

use std::f64::consts::TAU;

use common::random::Random;
use contact::{BLOCK_M, Body, Tool, YOUNG_MODULUS_PA, at, soft_block, stable};
use nalgebra::{Isometry3, Vector3};
use plica_accurate::contact::{ContactInfo, ContactParams};
use plica_geometry::shapes::{Wedge, wedge};

const RADIUS_M: f64 = 7e-3;

/// Force under a ball 4 mm deep on meshes of `n x n x n/2` cells.
fn forces(ns: &[usize]) -> Vec<f64> {
    let force = |&n: &usize| {
        let mut body = soft_block([n, n, n / 2]);
        let (x, y) = (0.5 * BLOCK_M[0], 0.5 * BLOCK_M[1]);
        let path = [BLOCK_M[2] + RADIUS_M, BLOCK_M[2] + RADIUS_M - 4e-3].map(|z| at(x, y, z));
        let (info, _) = body.press(&Tool::ball(RADIUS_M, 0.0).exactly(), &path);
        print_row(&format!("ball 4 mm deep, faces of {:.2} mm", BLOCK_M[0] / n as f64 * 1e3), &info);
        info.force_n.z
    };
    ns.iter().map(force).collect()
}

/// The contact radius is about 4 mm.
#[test]
fn forces_settle_with_the_mesh() {
    let forces = forces(&[6, 12, 24]);
    let changes = [(forces[1] - forces[0]).abs() / forces[2], (forces[2] - forces[1]).abs() / forces[2]];
    println!("changes of the force: {changes:.4?}");
    assert!(changes[1] < 0.5 * changes[0], "{changes:?}");
}

#[test]
#[ignore = "minutes"]
fn forces_settle_with_finer_meshes() {
    let forces = forces(&[12, 16, 18, 20, 24, 30, 36]);
    assert!((forces[6] - forces[5]).abs() < 0.02 * forces[6], "{forces:?}");
}

/// The wedge of the scenes, `scale` times 32 x 16 x 8 hexahedra.
fn scene(divisions: [usize; 3]) -> Body {
    Body::held_below(wedge(&Wedge::default(), divisions), stable(0.48))
}

fn tool(friction: f64, max_increment_m: f64) -> Tool {
    Tool { params: ContactParams::new(YOUNG_MODULUS_PA, max_increment_m), ..Tool::capsule(friction) }
}

/// From first contact, `share` of the local height down, then `drag` sideways.
fn path(x: f64, y: f64, share: f64, drag: Vector3<f64>) -> Vec<Isometry3<f64>> {
    let height_m = Wedge::default().height_m(x);
    let touch = at(x, y, height_m + RADIUS_M);
    let deep = at(0.0, 0.0, -share * height_m) * touch;
    let mut path = vec![touch, deep];
    if drag != Vector3::zeros() {
        path.push(at(drag.x, drag.y, 0.0) * deep);
    }
    path
}

fn print_row(what: &str, info: &ContactInfo) {
    println!(
        "{what}: force {:.4} {:.4} {:.4} N, penetration {:.3} mm, mean gap {:.3} mm, excess of friction {:.1e}, {} points, J {:.3}; \
         {} increments ({} failed), {} updates, {} Newton steps, {} indefinite",
        info.force_n.x,
        info.force_n.y,
        info.force_n.z,
        info.max_penetration_m * 1e3,
        info.mean_gap_m * 1e3,
        info.friction_excess,
        info.n_touching,
        info.smallest_jacobian.unwrap(),
        info.increments,
        info.failed_increments,
        info.outer_iterations,
        info.newton_iterations,
        info.indefinite_steps
    );
}

fn rms_mm(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum();
    (sum / a.len() as f64).sqrt() * 1e3
}

/// Twenty-four states of the wedge, drawn like its examples: all are solved, in fewer than 40 factorisations a state.
#[test]
#[ignore = "minutes"]
fn states_of_the_wedge() {
    let mut body = scene([32, 16, 8]);
    let mut random = Random::new(1);
    let mut uniform = |low: f64, high: f64| low + 0.5 * (high - low) * (1.0 + random.within(1.0));
    let mut factorisations = Vec::new();
    for state in 0..24 {
        let (x, y, share) = (uniform(0.02, 0.08), uniform(0.012, 0.048), uniform(0.1, 0.35));
        let (length, angle) = (uniform(0.0, 5e-3), uniform(0.0, TAU));
        let drag = if state % 3 == 0 { 0.0 } else { length } * Vector3::new(angle.cos(), angle.sin(), 0.0);
        let (info, _) = body.press(&tool(0.8, 0.5 * RADIUS_M), &path(x, y, share, drag));
        let depth_mm = share * Wedge::default().height_m(x) * 1e3;
        print_row(&format!("{depth_mm:4.1} mm deep, dragged {:.1} mm", drag.norm() * 1e3), &info);
        factorisations.push(info.newton_iterations + info.indefinite_steps);
    }
    factorisations.sort_unstable();
    let mean = f64::from(factorisations.iter().sum::<u32>()) / 24.0;
    println!("factorisations per state: mean {mean:.1}, median {}, most {}", factorisations[12], factorisations[23]);
    assert!(mean < 40.0, "{mean}");
}

/// One deep press with a long drag, in shorter and shorter increments.
#[test]
#[ignore = "minutes"]
fn increments_on_the_wedge() {
    let mut body = scene([32, 16, 8]);
    for friction in [0.0, 0.8] {
        let mut finest: Option<Vec<Vector3<f64>>> = None;
        for max_increment_m in [0.25e-3, 0.5e-3, 1e-3, 2e-3, 3.5e-3, 5e-3] {
            let (info, _) =
                body.press(&tool(friction, max_increment_m), &path(0.05, 0.03, 0.35, Vector3::new(5e-3, 0.0, 0.0)));
            print_row(&format!("friction {friction}, increments of {:.2} mm", max_increment_m * 1e3), &info);
            let finest = finest.get_or_insert_with(|| body.x.clone());
            println!("    {:.4} mm RMS from the shortest increments", rms_mm(&body.x, finest));
        }
    }
}

/// The same press on finer and finer meshes; nodes that all meshes have are compared with those of the finest.
#[test]
#[ignore = "many minutes, 3 GB"]
fn meshes_of_the_wedge() {
    let divisions = [[64, 32, 16], [32, 16, 8], [16, 8, 4]];
    for friction in [0.0, 0.8] {
        let mut finest: Option<Vec<Vector3<f64>>> = None;
        for [n, m, l] in divisions {
            let mut body = scene([n, m, l]);
            let (info, _) = body.press(&tool(friction, 2e-3), &path(0.05, 0.03, 0.35, Vector3::new(5e-3, 0.0, 0.0)));
            print_row(&format!("friction {friction}, {n} x {m} x {l}"), &info);
            let step = n / 16;
            let node = |i: usize, j: usize, k: usize| step * i + (n + 1) * (step * j + (m + 1) * step * k);
            let common: Vec<_> = (0..17 * 9 * 5).map(|c| body.x[node(c % 17, c / 17 % 9, c / 153)]).collect();
            let finest = finest.get_or_insert_with(|| common.clone());
            println!("    {:.4} mm RMS from the finest mesh, at the nodes of the coarsest", rms_mm(&common, finest));
        }
    }
}
