//! The kernels of a tick, each alone, on the wedge with a ball pressed 5 mm into it.
//!
//! `cargo bench -p plica-sim --bench kernels`; a whole tick on a scene of one's own: `plicad bench SCENE`.
#![allow(clippy::unwrap_used, reason = "a bench stops at the first surprise")]

#[path = "../tests/common/mod.rs"]
mod common;

use std::sync::Arc;

use common::examples::{RADIUS, examples, presses};
use common::{E, Run, Scene, ball, golden_spiral, tool, top, top_normal};
use divan::Bencher;
use nalgebra::Point3;
use plica_geometry::ConvexPolytope;
use plica_sim::enrichment::{DEFAULT_METHOD, Enricher, EnrichmentOptions, LiveEnrichment};
use plica_sim::{ToolShape, kernels};

fn main() {
    divan::main();
}

/// Where the ball rests 5 mm deep in the top face.
fn pressed_place() -> Point3<f64> {
    Point3::new(0.05, 0.03, top(0.05)) + top_normal() * (RADIUS - 0.005)
}

/// The wedge of 8 x 4 x 4 hexahedra and 6,885 skin vertices, settled below the ball.
fn pressed() -> Run {
    settle(Scene::wedge(E, 0.45).tool(ball(RADIUS)))
}

fn settle(scene: Scene) -> Run {
    let mut run = scene.run();
    run.hold(pressed_place(), 0.3, |_, _| ());
    assert!(run.state.tools()[0].in_contact);
    run
}

/// The rows of a ball, or of the hull of that number of points on it.
#[divan::bench(args = [0, 50, 642, 2562])]
fn contact(bencher: Bencher, hull_points: usize) {
    let tool = if hull_points == 0 { ball(RADIUS) } else { tool("hull", hull_of_a_ball(hull_points)) };
    let Run { model, state, mut workspace, .. } = settle(Scene::wedge(E, 0.45).tool(tool));
    bencher.bench_local(|| kernels::find_contacts(&model, &state, &mut workspace));
}

/// Hull of `n` points on the ball.
fn hull_of_a_ball(n: usize) -> ToolShape {
    let points = golden_spiral(n).map(|p| Point3::from(p * RADIUS)).collect();
    ToolShape::ConvexHull { polytope: ConvexPolytope::hull(points).unwrap() }
}

#[divan::bench]
fn solve(bencher: Bencher) {
    let Run { model, mut state, mut workspace, .. } = pressed();
    kernels::find_contacts(&model, &state, &mut workspace);
    let fresh = workspace.clone();
    bencher.with_inputs(|| fresh.clone()).bench_local_refs(|workspace| kernels::solve(&model, &mut state, workspace));
}

#[divan::bench]
fn embedding(bencher: Bencher) {
    let Run { model, mut state, .. } = pressed();
    bencher.bench_local(|| kernels::embed(&model, &mut state));
}

/// Detail of one frame by methods of the table, with 32 examples on a skin of 1,200 vertices.
#[divan::bench(args = [DEFAULT_METHOD, "kriging-vector", "rescale", "ridge-vector"])]
fn enrichment(bencher: Bencher, method: &str) {
    let examples = examples(&presses(32, 1, [[0.02, 0.012], [0.08, 0.048]]));
    let Run { model, state, .. } = settle(common::examples::scene());
    let options = EnrichmentOptions::named(method, EnrichmentOptions::default().axes).unwrap();
    let enricher = Enricher::new(&model, &examples, options).unwrap();
    let mut live = LiveEnrichment::new(&model, Arc::new(enricher));
    let mut skin = vec![[0.0; 3]; model.n_skin()];
    live.follow(&model, &state);
    live.write_skin(&model, &state, &mut skin);
    assert!(live.least_confidence() > 0.0, "the ball touches, so there is detail to write");
    bencher.bench_local(|| live.write_skin(&model, &state, &mut skin));
}
