//! Invariances of both hexahedra, of the corotated kernels, and of the skin's mapping.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::forces::{elastic_forces, instantaneous, node_masses};
use common::{E, Random, Scene, at, ball, distorted_block, material};
use nalgebra::{Matrix3, Point3, Rotation3, SMatrix, SVector, Vector3};
use plica_geometry::isoparametric::{jacobian, volume};
use plica_geometry::shapes::{block, block_skin};
use plica_geometry::{HexMesh, NodeIdx};
use plica_sim::{ElementKind, Material, SolverOptions, lumped_mass, rest_stiffness};
use proptest::prelude::*;

type Corners = [Point3<f64>; 8];
type Vector24 = SVector<f64, 24>;

const KINDS: [ElementKind; 2] = [ElementKind::FullIntegration, ElementKind::EnhancedStrain];
const CELL_M: f64 = 0.01;
const BLOCK_M: [f64; 3] = [0.03; 3];

/// Corners of a cube of 10 mm, each moved by these shares of its edge.
fn corners(shares: [[f64; 3]; 8]) -> Corners {
    let moved = |i: usize| {
        let [x, y, z] = [0b0110_0110 >> i & 1, 0b1100_1100 >> i & 1, 0b1111_0000 >> i & 1].map(f64::from);
        Point3::new(x, y, z) + Vector3::from(shares[i])
    };
    std::array::from_fn(|i| moved(i) * CELL_M)
}

/// Natural coordinates of the Gauss points, weight 1 each.
fn gauss_points() -> impl Iterator<Item = [f64; 3]> {
    let sign = |bit: usize| if bit == 0 { -1.0 } else { 1.0 };
    (0..8).map(move |i| [i & 1, i >> 1 & 1, i >> 2 & 1].map(|bit| sign(bit) / 3.0_f64.sqrt()))
}

/// Regular and distorted hexahedra, convex enough to be meshed with.
fn any_corners() -> impl Strategy<Value = Corners> {
    let shares = prop::array::uniform8(prop::array::uniform3(-0.2..0.2));
    let distorted = shares.prop_map(corners).prop_filter("flat corner", |c| {
        gauss_points().all(|xi| jacobian(c, xi).determinant() > 0.02 * CELL_M.powi(3) / 8.0)
    });
    prop_oneof![1 => Just(corners([[0.0; 3]; 8])), 7 => distorted]
}

fn any_element() -> impl Strategy<Value = (Corners, Material)> {
    (any_corners(), prop_oneof![Just(0.0), Just(0.3), Just(0.45), Just(0.49)]).prop_map(|(c, nu)| (c, material(E, nu)))
}

/// Nodal values of `u = G x + t`, `[24]`.
fn linear(corners: &Corners, gradient: &Matrix3<f64>, shift: &Vector3<f64>) -> Vector24 {
    let at = |a: usize| gradient * corners[a].coords + shift;
    Vector24::from_fn(|i, _| at(i / 3)[i % 3])
}

fn largest(k: &SMatrix<f64, 24, 24>) -> f64 {
    k.iter().fold(0.0, |m, v| m.max(v.abs()))
}

/// Energy of displacements `u` with amplitudes `alpha` of the incompatible modes `1 - xi_k^2`, by the strains' definition:
/// `sum_gauss (lambda / 2 tr(e)^2 + mu e:e) det J`, `e = sym(du/dx + sum_k alpha_k (j_0 / j) J_0^-T grad(1 - xi_k^2))`.
fn energy(corners: &Corners, m: &Material, u: &Vector24, alpha: &SVector<f64, 9>) -> f64 {
    let (e, nu) = (m.young_modulus_pa, m.poisson_ratio);
    let (lambda, mu) = (e * nu / (1.0 + nu) / (1.0 - 2.0 * nu), e / 2.0 / (1.0 + nu));
    let nodal: Corners = std::array::from_fn(|a| Point3::new(u[3 * a], u[3 * a + 1], u[3 * a + 2]));
    let center = jacobian(corners, [0.0; 3]);
    let at_gauss_point = |xi: [f64; 3]| {
        let j = jacobian(corners, xi);
        let mut gradient = jacobian(&nodal, xi) * j.try_inverse().unwrap();
        for k in 0..3 {
            let mode = center.try_inverse().unwrap().row(k) * (-2.0 * xi[k] * center.determinant() / j.determinant());
            gradient += Vector3::new(alpha[3 * k], alpha[3 * k + 1], alpha[3 * k + 2]) * mode;
        }
        let strain = (gradient + gradient.transpose()) / 2.0;
        (lambda / 2.0 * strain.trace().powi(2) + mu * strain.norm_squared()) * j.determinant()
    };
    gauss_points().map(at_gauss_point).sum()
}

/// Energy of the element: of the displacements alone, or with the modes at their minimum.
fn element_energy(corners: &Corners, m: &Material, kind: ElementKind, u: &Vector24) -> f64 {
    let zero = SVector::<f64, 9>::zeros();
    if kind == ElementKind::FullIntegration {
        return energy(corners, m, u, &zero);
    }
    // A quadratic function: differences with a finite step are its derivatives.
    let step = 1e-3;
    let unit = |i: usize| SVector::<f64, 9>::from_fn(|k, _| if k == i { step } else { 0.0 });
    let f = |alpha: SVector<f64, 9>| energy(corners, m, u, &alpha);
    let gradient = SVector::<f64, 9>::from_fn(|i, _| (f(unit(i)) - f(-unit(i))) / (2.0 * step));
    let hessian = SMatrix::<f64, 9, 9>::from_fn(|i, k| {
        (f(unit(i) + unit(k)) - f(unit(i)) - f(unit(k)) + f(zero)) / (step * step)
    });
    f(-hessian.lu().solve(&gradient).unwrap())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn stiffness_is_symmetric_and_semi_definite_with_six_zero_modes((c, m) in any_element()) {
        for kind in KINDS {
            let k = rest_stiffness(&c, &m, kind);
            prop_assert_eq!(k, k.transpose());
            let mut modes: Vec<f64> = k.symmetric_eigenvalues().iter().copied().collect();
            modes.sort_by(f64::total_cmp);
            let stiffest = modes[23];
            prop_assert!(modes[..6].iter().all(|v| v.abs() < 1e-12 * stiffest), "{:?}: {:e}", kind, modes[5] / stiffest);
            prop_assert!(modes[6] > 1e-4 * stiffest, "{:?}: {:e}", kind, modes[6] / stiffest);
        }
    }

    #[test]
    fn translations_and_infinitesimal_rotations_meet_no_force((c, m) in any_element(), t in prop::array::uniform3(-1.0..1.0),
        w in prop::array::uniform3(-1.0..1.0)) {
        let rigid = linear(&c, &Vector3::from(w).cross_matrix(), &(Vector3::from(t) * CELL_M));
        for kind in KINDS {
            let k = rest_stiffness(&c, &m, kind);
            let force = k * rigid;
            prop_assert!(force.norm() < 1e-12 * largest(&k) * rigid.norm(), "{:?}: {:e} N", kind, force.norm());
        }
    }

    #[test]
    fn force_is_minus_the_gradient_of_the_energy((c, m) in any_element(), seed in 0_u64..1000) {
        let mut random = Random(seed);
        let u = Vector24::from_fn(|_, _| 1e-3 * random.symmetric());
        for kind in KINDS {
            let force = -rest_stiffness(&c, &m, kind) * u;
            let step = 1e-3;
            let unit = |i: usize| Vector24::from_fn(|k, _| if k == i { step } else { 0.0 });
            let at = |u: Vector24| element_energy(&c, &m, kind, &u);
            let differences = Vector24::from_fn(|i, _| -(at(u + unit(i)) - at(u - unit(i))) / (2.0 * step));
            let error = (force - differences).norm() / force.norm();
            prop_assert!(error < 1e-8, "{:?}: {:e}", kind, error);
        }
    }

    #[test]
    fn modes_only_soften_and_leave_constant_strain_alone((c, m) in any_element(), g in prop::array::uniform9(-1.0..1.0)) {
        let [full, enhanced] = KINDS.map(|kind| rest_stiffness(&c, &m, kind));
        let softening = (full - enhanced).symmetric_eigenvalues();
        prop_assert!(softening.min() > -1e-12 * largest(&full), "{:e}", softening.min());
        let u = linear(&c, &Matrix3::from_row_slice(&g), &Vector3::zeros());
        prop_assert!(((full - enhanced) * u).norm() < 1e-11 * largest(&full) * u.norm());
    }

    #[test]
    fn lumped_masses_are_positive_and_sum_to_the_mass(c in any_corners()) {
        let shares = lumped_mass(&c, 1000.0);
        prop_assert!(shares.iter().all(|&s| s > 0.0), "{:?}", shares);
        prop_assert!((shares.iter().sum::<f64>() / (1000.0 * volume(&c)) - 1.0).abs() < 1e-12);
    }
}

/// `K u` over a mesh, `[n_nodes]` [N].
fn stiffness_times(mesh: &HexMesh, m: &Material, kind: ElementKind, u: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut out = vec![Vector3::zeros(); mesh.n_nodes()];
    for hex in mesh.hexes() {
        let local = Vector24::from_fn(|i, _| u[hex[i / 3].index()][i % 3]);
        let force = rest_stiffness(&hex.map(|n| mesh.nodes()[n.index()]), m, kind) * local;
        for (a, n) in hex.iter().enumerate() {
            out[n.index()] += force.fixed_rows::<3>(3 * a);
        }
    }
    out
}

/// Nodal forces of the tractions of a constant stress on the boundary, `int N sigma n dS`, `[n_nodes]` [N].
fn boundary_tractions(mesh: &HexMesh, stress: &Matrix3<f64>) -> Vec<Vector3<f64>> {
    let mut out = vec![Vector3::zeros(); mesh.n_nodes()];
    let g = 1.0 / 3.0_f64.sqrt();
    for quad in mesh.boundary_quads() {
        let x = quad.map(|n| mesh.nodes()[n.index()].coords);
        for (s, t) in [(-g, -g), (g, -g), (g, g), (-g, g)] {
            let shape = [(1.0 - s) * (1.0 - t), (1.0 + s) * (1.0 - t), (1.0 + s) * (1.0 + t), (1.0 - s) * (1.0 + t)];
            let along_s = (x[1] - x[0]) * (1.0 - t) + (x[2] - x[3]) * (1.0 + t);
            let along_t = (x[3] - x[0]) * (1.0 - s) + (x[2] - x[1]) * (1.0 + s);
            let force = stress * along_s.cross(&along_t) / 16.0;
            quad.iter().zip(shape).for_each(|(n, w)| out[n.index()] += force * (w / 4.0));
        }
    }
    out
}

/// Nodes on no boundary face.
fn is_interior(mesh: &HexMesh) -> Vec<bool> {
    let mut interior = vec![true; mesh.n_nodes()];
    mesh.boundary_quads().iter().flatten().for_each(|n: &NodeIdx| interior[n.index()] = false);
    interior
}

fn stress(m: &Material, gradient: &Matrix3<f64>) -> Matrix3<f64> {
    let (e, nu) = (m.young_modulus_pa, m.poisson_ratio);
    let strain = (gradient + gradient.transpose()) / 2.0;
    let lambda = e * nu / (1.0 + nu) / (1.0 - 2.0 * nu);
    Matrix3::identity() * (lambda * strain.trace()) + strain * (e / (1.0 + nu))
}

fn norms(v: &[Vector3<f64>]) -> f64 {
    v.iter().map(|f| f.norm()).fold(0.0, f64::max)
}

/// Every node moved, faces and corners included.
fn crooked_block() -> HexMesh {
    let mut random = Random(5);
    let straight = block(BLOCK_M, [3; 3]);
    let moved = straight.nodes().iter().map(|x| x + random.vector() * (0.2 * CELL_M)).collect();
    HexMesh::new(moved, straight.hexes().to_vec()).unwrap()
}

#[test]
fn patch_of_distorted_elements_carries_constant_stress() {
    let gradient = Matrix3::new(0.02, -0.01, 0.03, 0.015, -0.03, 0.005, -0.02, 0.01, 0.025);
    for mesh in [block(BLOCK_M, [3; 3]), crooked_block()] {
        let u: Vec<_> = mesh.nodes().iter().map(|x| gradient * x.coords).collect();
        for kind in KINDS {
            let m = material(E, 0.45);
            let forces = stiffness_times(&mesh, &m, kind, &u);
            let expected = boundary_tractions(&mesh, &stress(&m, &gradient));
            let errors: Vec<_> = forces.iter().zip(&expected).map(|(f, e)| f - e).collect();
            assert!(norms(&errors) < 1e-12 * norms(&expected), "{kind:?}: {:e} N", norms(&errors));
            let interior = is_interior(&mesh);
            assert_eq!(interior.iter().filter(|&&i| i).count(), 8);
        }
    }
}

/// A free block on the run-time kernels.
fn free_block(mesh: HexMesh, kind: ElementKind) -> Scene {
    let skin = block_skin(BLOCK_M, 5e-3);
    Scene::on(mesh, skin, E, 0.45).with(|d| {
        d.element = kind;
        d.fixed.fill(false);
    })
}

/// Rotations of up to 2.5 rad around any axis.
fn rotations() -> Vec<Rotation3<f64>> {
    let mut random = Random(11);
    [0.2, 0.9, 1.6, 2.5].map(|angle| Rotation3::new(random.vector().normalize() * angle)).to_vec()
}

#[test]
fn patch_passes_the_kernels_in_any_rotation() {
    let stretch = Matrix3::new(1.05, 0.02, 0.0, 0.02, 0.93, -0.03, 0.0, -0.03, 1.1);
    for kind in KINDS {
        let mesh = distorted_block(BLOCK_M, [3; 3], 0.2);
        let interior = is_interior(&mesh);
        let expected = boundary_tractions(&mesh, &stress(&material(E, 0.45), &(stretch - Matrix3::identity())));
        let model = instantaneous(free_block(mesh, kind));
        for rotation in rotations() {
            let gradient = rotation.matrix() * stretch - Matrix3::identity();
            let u: Vec<_> = model.description().mesh.nodes().iter().map(|x| gradient * x.coords).collect();
            let forces = elastic_forces(&model, &u);
            let inside: Vec<_> = forces.iter().zip(&interior).filter(|(_, i)| **i).map(|(f, _)| *f).collect();
            assert!(norms(&inside) < 2e-5 * norms(&forces), "{kind:?}: {:e} of {:e} N", norms(&inside), norms(&forces));
            // Elements pull against the tractions that hold this strain: f = -R (tractions).
            let errors: Vec<_> = forces.iter().zip(&expected).map(|(f, t)| f + rotation * t).collect();
            assert!(norms(&errors) < 2e-5 * norms(&forces), "{kind:?}: {:e} of {:e} N", norms(&errors), norms(&forces));
        }
    }
}

#[test]
fn rest_is_rest() {
    for kind in KINDS {
        let mut run = free_block(distorted_block(BLOCK_M, [3; 3], 0.2), kind).run();
        for _ in 0..20 {
            run.tick(&[]);
        }
        assert_eq!(norms(&run.state.node_velocities(&run.model)), 0.0);
        assert_eq!(norms(&run.state.node_displacements(&run.model)), 0.0);
    }
}

#[test]
fn rigid_motion_of_a_free_block_meets_no_force() {
    for kind in KINDS {
        for mesh in [block(BLOCK_M, [3; 3]), distorted_block(BLOCK_M, [3; 3], 0.2)] {
            let model = instantaneous(free_block(mesh, kind));
            // Forces of a strain of 1, the scale against which zero is measured.
            let unit: Vec<_> = model.description().mesh.nodes().iter().map(|x| x.coords * 1e-3).collect();
            let scale = norms(&elastic_forces(&model, &unit)) / 1e-3;
            for rotation in rotations() {
                let shift = Vector3::new(0.01, -0.02, 0.005);
                let moved = |x: &Point3<f64>| rotation * x.coords - x.coords + shift;
                let u: Vec<_> = model.description().mesh.nodes().iter().map(moved).collect();
                let force = norms(&elastic_forces(&model, &u));
                assert!(force < 3e-6 * scale, "{kind:?}, {:.1} rad: {force:e} of {scale:e} N", rotation.angle());
            }
        }
    }
}

/// Weights may be stored in 16 bits, which is a part in 3e4 of a displacement; rows keep their sum.
#[test]
fn skin_follows_the_rows_of_the_embedding() {
    let model = instantaneous(Scene::wedge(E, 0.45).with(|d| d.fixed.fill(false)));
    let mut run = common::Run::new(model);
    let mut random = Random(3);
    let scattered: Vec<_> = (0..run.model.n_nodes()).map(|_| random.vector() * 5e-3).collect();
    let shifted = vec![Vector3::new(0.02, -0.01, 0.03); run.model.n_nodes()];
    for u in [scattered, shifted] {
        run.state.set_node_displacements(&run.model, &u);
        let d = run.model.description();
        let expected = d.embedding.apply(&u);
        let offset_error = run.offsets().iter().zip(&expected).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        let positions = d.skin.positions().iter().zip(&expected).map(|(p, o)| p + o);
        let error = run.skin().iter().zip(positions).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        println!("offsets {offset_error:.1e} m, positions {error:.1e} m off");
        assert!(offset_error < 2e-6 && error < 2e-6, "{offset_error:e} m, {error:e} m");
    }
}

/// Rows push nodes with the transpose of the skin's mapping: the free block gains the momentum and angular momentum
/// that the tool loses.
#[test]
fn push_of_a_tool_changes_momentum_by_force_times_time() {
    let h = 1e-4;
    let mut tool = ball(0.008);
    tool.friction = 0.4;
    let mesh = distorted_block(BLOCK_M, [3; 3], 0.2);
    let scene = free_block(mesh, ElementKind::EnhancedStrain).timestep(h).with(|d| {
        d.mass_damping_per_s = 0.0;
        d.solver = SolverOptions { tolerance: 1e-5, max_iterations: 100, ..d.solver };
    });
    let mut run = scene.tool(tool).run();
    let masses = node_masses(run.model.description());
    let (mut impulse, mut turn) = (Vector3::zeros(), Vector3::zeros());
    let (mut worst, mut worst_turn) = (0.0_f64, 0.0_f64);
    for k in 0..300 {
        let tool_at = Point3::new(0.012, 0.016, 0.0382) + Vector3::new(0.1, -0.05, -0.2) * (h * f64::from(k));
        run.tick(&[(0, at(tool_at))]);
        for contact in run.state.contacts() {
            let force = contact.normal * contact.normal_force_n + contact.tangential_force_n;
            impulse += force * h;
            turn += contact.point_m.coords.cross(&force) * h;
        }
        let u = run.state.node_displacements(&run.model);
        let positions = run.model.description().mesh.nodes().iter().zip(&u).map(|(x, u)| x.coords + u);
        let velocities = run.state.node_velocities(&run.model);
        let momenta: Vec<Vector3<f64>> = velocities.iter().zip(&masses).map(|(v, m)| v * *m).collect();
        let moment: Vector3<f64> = positions.zip(&momenta).map(|(x, p)| x.cross(p)).sum();
        worst = worst.max((momenta.iter().sum::<Vector3<f64>>() - impulse).norm());
        worst_turn = worst_turn.max((moment - turn).norm());
    }
    println!(
        "momentum {worst:.1e} of {:.1e} N s, moment {worst_turn:.1e} of {:.1e} N m s",
        impulse.norm(),
        turn.norm()
    );
    assert!(impulse.norm() > 1e-3, "{impulse:?}");
    assert!(worst < 1e-3 * impulse.norm() && worst_turn < 1e-2 * turn.norm());
}
