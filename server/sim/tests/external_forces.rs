//! Constant forces at nodes, as training uses them to lift the skin.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::{E, Run, Scene, at, ball, relative, top};
use nalgebra::{Point3, Vector3};
use plica_sim::lumped_mass;

/// Lumped mass of each node [kg].
fn node_masses(run: &Run) -> Vec<f64> {
    let d = run.model.description();
    let mut mass = vec![0.0; d.mesh.n_nodes()];
    for (hex, material) in d.mesh.hexes().iter().zip(&d.materials) {
        let corners = hex.map(|n| d.mesh.nodes()[n.index()]);
        for (node, share) in hex.iter().zip(lumped_mass(&corners, material.density_kg_per_m3)) {
            mass[node.index()] += share;
        }
    }
    mass
}

fn settled(mut run: Run) -> Vec<Vector3<f64>> {
    run.hold(Point3::new(0.0, 0.0, 1.0), 2.0, |_, _| {});
    run.state.node_displacements(&run.model)
}

#[test]
fn weight_given_as_forces_sags_as_gravity_does() {
    let gravity = Vector3::new(1.0, 0.0, -20.0);
    let scene = Scene::wedge(E, 0.45).tool(ball(0.005));
    let fallen = settled(scene.clone().with(|d| d.gravity_m_per_s2 = gravity).run());
    let mut run = scene.run();
    let forces: Vec<_> = node_masses(&run).iter().map(|m| gravity * *m).collect();
    run.state.set_external_forces(&run.model, &forces);
    let error = relative(&settled(run), &fallen);
    println!("forces against gravity: {error:.1e}");
    assert!(fallen.iter().map(|u| u.norm()).fold(0.0, f64::max) > 1e-4);
    assert!(error < 1e-4, "{error:e}");
}

#[test]
fn forces_that_were_taken_away_leave_no_trace() {
    let run = |touched: bool| {
        let mut run = Scene::wedge(E, 0.45).tool(ball(0.005)).run();
        if touched {
            let n_nodes = run.model.n_nodes();
            run.state.set_external_forces(&run.model, &vec![Vector3::z(); n_nodes]);
            run.state.set_external_forces(&run.model, &[]);
        }
        let above = |height: f64| Point3::new(0.05, 0.03, top(0.05) + height);
        run.glide(above(0.006), above(0.002), 0.1, |_, _| {});
        run.tick(&[(0, at(above(0.002)))]);
        run.state.node_displacements(&run.model)
    };
    assert_eq!(run(true), run(false));
}

#[test]
fn a_snapshot_holds_the_forces() {
    let mut run = Scene::wedge(E, 0.45).run();
    let n_nodes = run.model.n_nodes();
    run.state.set_external_forces(&run.model, &vec![Vector3::z() * 1e-3; n_nodes]);
    let mut copy = run.state.clone();
    copy.copy_from(&run.state);
    run.tick(&[]);
    let moved = run.state.node_displacements(&run.model);
    run.state = copy;
    run.tick(&[]);
    assert_eq!(run.state.node_displacements(&run.model), moved);
    assert!(moved.iter().any(|u| u.z > 0.0));
}
