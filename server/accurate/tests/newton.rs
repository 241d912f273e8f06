//! Reports, cancellation and failures of a solve.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use std::ops::ControlFlow;

use common::random::Random;
use common::{affine, distance, material, rest, sides, solve};
use nalgebra::{Rotation3, Unit, Vector3};
use plica_accurate::{
    Constraints, Energy, Info, MaterialModel, NodalForces, Params, Pressure, Solid, SolveError, Solver, Traction,
    reactions,
};
use plica_geometry::shapes::block;
use plica_geometry::{HexMesh, NodeIdx};

const SIZE: [f64; 3] = [0.08, 0.02, 0.02];

/// A beam, its mesh and its supports at x = 0.
struct Beam {
    mesh: HexMesh,
    solid: Solid,
    constraints: Constraints,
}

impl Beam {
    fn new() -> Self {
        let mesh = block(SIZE, [8, 2, 2]);
        let solid = Solid::uniform(&mesh, material(MaterialModel::StableNeoHookean, 3e4, 0.45)).unwrap();
        let mut constraints = Constraints::none(mesh.n_nodes());
        for (node, x) in mesh.nodes().iter().enumerate().filter(|(_, x)| sides(x, SIZE)[0][0]) {
            constraints.hold(node, &x.coords);
        }
        Self { mesh, solid, constraints }
    }

    /// Faces of the end at x = length.
    fn end(&self) -> Vec<[NodeIdx; 4]> {
        let is_at_end = |node: &NodeIdx| sides(&self.mesh.nodes()[node.index()], SIZE)[0][1];
        self.mesh.boundary_quads().into_iter().filter(|quad| quad.iter().all(is_at_end)).collect()
    }

    /// A dead traction on the end, sideways or along the beam \[Pa\].
    fn load(&self, x: f64, z: f64) -> Traction {
        Traction::new(&self.mesh, &self.end(), Vector3::new(x, 0.0, z))
    }

    fn solve(&self, load: &dyn Energy, params: &Params) -> (Result<Info, SolveError>, Vec<Vector3<f64>>) {
        let mut x = rest(&self.mesh);
        let result = solve(&[&self.solid, load], &self.constraints, params, &mut x);
        (result, x)
    }
}

#[test]
fn history_is_that_of_newton() {
    let beam = Beam::new();
    let (result, x) = beam.solve(&beam.load(0.0, -150.0), &Params::default());
    let info = result.unwrap();
    println!("bent beam: {:?}", info.residuals);
    assert_eq!(info.residuals.len() as u32, info.iterations + 1);
    assert!(*info.residuals.last().unwrap() <= 1e-9 && info.residuals[0] > 0.1);
    assert!((3..=15).contains(&info.iterations), "{info:?}");
    // The last steps converge quadratically: each residual is about the square of the one before.
    let [.., before, last] = info.residuals[..] else { panic!("{info:?}") };
    assert!(last <= 1e2 * before * before || last <= 1e-12, "{info:?}");
    assert_eq!(info.smallest_jacobian, beam.solid.smallest_jacobian(&x));
    assert!((0.5..1.0).contains(&info.smallest_jacobian.unwrap()));
}

/// Pushed along its axis a slender beam buckles: on the way the exact matrix is not positive definite.
#[test]
fn indefinite_steps_are_counted() {
    let beam = Beam::new();
    let (stretched, _) = beam.solve(&beam.load(300.0, 0.0), &Params::default());
    assert_eq!(stretched.unwrap().indefinite_steps, 0);
    let (pushed, x) = beam.solve(&beam.load(-4e3, 1.0), &Params::default());
    let info = pushed.unwrap();
    println!(
        "buckled beam: {} steps, {} indefinite, {} halvings",
        info.iterations, info.indefinite_steps, info.halvings
    );
    assert!(info.indefinite_steps > 0, "{info:?}");
    let sideways = x.iter().zip(beam.mesh.nodes()).map(|(x, rest)| (x.z - rest.z).abs()).fold(0.0, f64::max);
    assert!(sideways > 0.25 * SIZE[0], "it bends out by {sideways} m");
}

#[test]
fn reactions_balance_the_load() {
    let beam = Beam::new();
    let load = beam.load(100.0, -150.0);
    let (result, x) = beam.solve(&load, &Params::default());
    result.unwrap();
    let energies: [&dyn Energy; 2] = [&beam.solid, &load];
    let total: Vector3<f64> = reactions(&energies, &x).iter().sum();
    assert!((total + load.total()).norm() <= 1e-8 * load.total().norm(), "{total}");
    let free = reactions(&energies, &x).into_iter().zip(beam.mesh.nodes()).filter(|(_, x)| x.x > 0.0);
    assert!(free.map(|(f, _)| f.norm()).fold(0.0, f64::max) <= 1e-8 * load.total().norm());
}

#[test]
fn nodal_forces_are_a_traction_put_together_by_hand() {
    let beam = Beam::new();
    let load = beam.load(0.0, -150.0);
    let quarter = Vector3::new(0.0, 0.0, -150.0) * SIZE[1] * SIZE[2] / 16.0;
    let forces = beam.end().iter().flatten().map(|&node| (node, quarter)).collect();
    let (_, by_traction) = beam.solve(&load, &Params::default());
    let (_, by_forces) = beam.solve(&NodalForces::new(forces), &Params::default());
    assert!(distance(&by_traction, &by_forces) <= 1e-9 * SIZE[0]);
}

/// A tensile traction that turns with the end: at 3 kPa eight times the buckling force.
#[test]
fn follower_pressure_converges_on_a_bent_beam() {
    let beam = Beam::new();
    let sideways = beam.load(0.0, -150.0);
    for (pull_pa, most_steps) in [(300.0, 15), (3e3, 100)] {
        let pull = Pressure::new(beam.end(), -pull_pa);
        let energies: [&dyn Energy; 3] = [&beam.solid, &sideways, &pull];
        let mut x = rest(&beam.mesh);
        let info = solve(&energies, &beam.constraints, &Params::default(), &mut x).unwrap();
        println!("pulled by {pull_pa} Pa: {} steps, {} halvings", info.iterations, info.halvings);
        assert!(info.iterations <= most_steps);
        let free = reactions(&energies, &x).into_iter().zip(beam.mesh.nodes()).filter(|(_, x)| x.x > 0.0);
        assert!(free.map(|(f, _)| f.norm()).fold(0.0, f64::max) <= 1e-9 * pull_pa * SIZE[1] * SIZE[2]);
    }
}

#[test]
fn the_observer_sees_every_step_and_may_cancel() {
    let beam = Beam::new();
    let load = beam.load(0.0, -150.0);
    let energies: [&dyn Energy; 2] = [&beam.solid, &load];
    let mut solver = Solver::new(&beam.constraints, &energies).unwrap();
    let mut seen = Vec::new();
    let mut x = rest(&beam.mesh);
    let info = solver
        .minimise(&energies, &beam.constraints, &Params::default(), &mut x, &mut |progress| {
            seen.push(progress);
            ControlFlow::Continue(())
        })
        .unwrap();
    assert_eq!(seen.iter().map(|p| p.residual).collect::<Vec<_>>(), info.residuals);
    assert_eq!(seen.iter().map(|p| p.iteration).collect::<Vec<_>>(), (0..=info.iterations).collect::<Vec<_>>());

    let mut x = rest(&beam.mesh);
    let cancelled = solver.minimise(&energies, &beam.constraints, &Params::default(), &mut x, &mut |progress| {
        if progress.iteration == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert_eq!(cancelled, Err(SolveError::Cancelled { iterations: 2 }));
    assert!(distance(&x, &rest(&beam.mesh)) > 0.0, "x is where the solve was");
}

#[test]
fn too_few_steps_are_an_error_with_numbers() {
    let beam = Beam::new();
    let params = Params { max_iterations: 2, ..Params::default() };
    match beam.solve(&beam.load(0.0, -150.0), &params).0 {
        Err(SolveError::NotConverged { iterations: 2, residual, tolerance: 1e-9 }) => assert!(residual > 1e-9),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_body_that_nothing_holds_is_an_error() {
    let beam = Beam::new();
    let load = beam.load(10.0, 0.0);
    let mut x = rest(&beam.mesh);
    let params = Params { max_iterations: 20, ..Params::default() };
    let result = solve(&[&beam.solid, &load], &Constraints::none(x.len()), &params, &mut x);
    assert!(result.is_err(), "{result:?}");
}

/// Supports that move as a rigid body move the solid without force, up to rounding.
#[test]
fn rigid_motion_of_the_supports_is_no_load() {
    let beam = Beam::new();
    let axis = Unit::new_normalize(Vector3::new(1.0, 1.0, 3.0));
    let expected = affine(&beam.mesh, Rotation3::from_axis_angle(&axis, 0.7).matrix(), &Vector3::new(0.3, 0.1, -0.2));
    let mut constraints = Constraints::none(beam.mesh.n_nodes());
    for (node, _) in beam.mesh.nodes().iter().enumerate().filter(|(_, x)| sides(x, SIZE)[0][0]) {
        constraints.hold(node, &expected[node]);
    }
    let mut x = rest(&beam.mesh);
    let info = solve(&[&beam.solid], &constraints, &Params::default(), &mut x).unwrap();
    println!("rigid motion: {:?}", info.residuals);
    assert!(distance(&x, &expected) <= 1e-9, "{}", distance(&x, &expected));
}

/// Given coordinates arrive in one step of a linear solid, to the last bit, and the free ones with them.
#[test]
fn prescribed_displacements_arrive_exactly() {
    let beam = Beam::new();
    let solid = Solid::uniform(&beam.mesh, material(MaterialModel::Linear, 3e4, 0.3)).unwrap();
    for seed in 0..30 {
        let mut random = Random::new(seed);
        let mut constraints = beam.constraints.clone();
        let mut targets = Vec::new();
        for (node, _) in beam.mesh.nodes().iter().enumerate().filter(|(_, x)| sides(x, SIZE)[0][1]) {
            let target = random.vector(7e-2);
            constraints.hold(node, &target);
            targets.push((node, target));
        }
        let mut x = rest(&beam.mesh);
        let info = solve(&[&solid], &constraints, &Params::default(), &mut x).unwrap();
        assert_eq!(info.iterations, 1, "{info:?}");
        assert!(targets.iter().all(|&(node, target)| x[node] == target));
    }
}

/// The top of a cube sinks by 70 % while it turns by 100 degrees. A single step would invert elements, at infinite
/// energy in the compressible material: the solve stops on the way and continues from there.
#[test]
fn given_coordinates_stop_where_the_energy_would_be_infinite() {
    let size = [0.02; 3];
    let mesh = block(size, [4, 4, 4]);
    let middle = Vector3::new(0.01, 0.01, 0.0);
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 100_f64.to_radians());
    let mut constraints = Constraints::none(mesh.n_nodes());
    let mut top = Vec::new();
    for (node, x) in mesh.nodes().iter().enumerate() {
        let [is_low, is_high] = sides(x, size)[2];
        if is_low {
            constraints.hold(node, &x.coords);
        } else if is_high {
            top.push((node, (middle + turn * (x.coords - middle)).component_mul(&Vector3::new(1.0, 1.0, 0.3))));
        }
    }
    top.iter().for_each(|(node, target)| constraints.hold(*node, target));
    let solid = Solid::uniform(&mesh, material(MaterialModel::CompressibleNeoHookean, 3e4, 0.45)).unwrap();
    let mut x = rest(&mesh);
    let info = solve(&[&solid], &constraints, &Params::default(), &mut x).unwrap();
    println!("turned and sunk: {} steps, {} halvings, J {:?}", info.iterations, info.halvings, info.smallest_jacobian);
    assert!(info.halvings > 0 && info.smallest_jacobian.unwrap() > 0.0);
    assert!(top.iter().all(|&(node, target)| x[node] == target));
}

#[test]
fn a_solver_serves_one_load_after_another_with_the_same_bits() {
    let beam = Beam::new();
    let loads = [beam.load(0.0, -150.0), beam.load(-4e3, 1.0), beam.load(0.0, -150.0)];
    let mut solver = Solver::new(&beam.constraints, &[&beam.solid]).unwrap();
    let results = loads.each_ref().map(|load| {
        let mut x = rest(&beam.mesh);
        let energies: [&dyn Energy; 2] = [&beam.solid, load];
        let go = &mut |_| ControlFlow::Continue(());
        let info = solver.minimise(&energies, &beam.constraints, &Params::default(), &mut x, go).unwrap();
        (x, info)
    });
    assert_eq!(results[0], results[2]);
    assert_ne!(results[0].0, results[1].0);
    assert_eq!(results[0].0, beam.solve(&loads[0], &Params::default()).1, "as by a fresh solver");
}

/// For problems in parallel, solvers move to threads and share the solid.
#[test]
fn solvers_may_move_between_threads() {
    fn is_send<T: Send>() {}
    fn is_shared<T: Sync>() {}
    is_send::<Solver>();
    is_shared::<Solid>();
    is_shared::<Constraints>();
}
