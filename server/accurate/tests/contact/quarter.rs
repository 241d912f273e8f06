//! A quarter of a block under a ball: symmetry planes x = 0 and y = 0, small cells in the contact region.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use std::f64::consts::PI;

use plica_accurate::contact::ContactSurface;
use plica_accurate::{Constraints, Material};

use super::{Body, Tool, at, graded_block, quads};

/// Coordinates from 0 to `end_m`: `n_fine` cells of `fine_m`, then `n_growing` that grow by one factor.
pub fn graded(fine_m: f64, n_fine: usize, n_growing: usize, end_m: f64) -> Vec<f64> {
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
pub struct Quarter {
    pub body: Body,
}

impl Quarter {
    pub fn new(across_m: &[f64], down_m: &[f64], material: Material) -> Self {
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
        Self { body: Body::new(mesh, material, constraints, surface) }
    }

    /// Force \[N\] and contact radius \[m\] of the whole ball at each depth.
    pub fn press(&mut self, radius_m: f64, depths_m: &[f64]) -> Vec<(f64, f64)> {
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
