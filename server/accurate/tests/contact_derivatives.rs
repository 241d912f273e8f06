//! The energies of contact pass the harness that every energy passes.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::derivatives::{check_derivatives, gradient_of};
use common::random::Random;
use common::{distorted_block, rest};
use nalgebra::{Isometry3, Point3, Vector3};
use plica_accurate::Energy;
use plica_accurate::contact::{ContactSurface, Friction, FrictionRow, NormalContact, Obstacle};
use plica_geometry::ConvexPolytope;

const CELL: f64 = 0.01;
const PENALTY: f64 = 1e8;

struct Scene {
    surface: ContactSurface,
    x: Vec<Vector3<f64>>,
    random: Random,
}

/// The boundary of two hexahedra, moved by a tenth of a cell: 40 points.
fn scene(seed: u64) -> Scene {
    let mesh = distorted_block([0.02, 0.01, 0.01], [2, 1, 1], 0.0, 0);
    let mut random = Random::new(seed);
    let x = random.scatter(&rest(&mesh), 0.1 * CELL);
    Scene { surface: ContactSurface::new(&mesh, &mesh.boundary_quads()), x, random }
}

#[test]
fn pressures() {
    let obstacles = [
        Obstacle::Ball { radius_m: 9e-3 },
        Obstacle::Capsule { radius_m: 8e-3, length_m: 0.03 },
        Obstacle::HalfSpace,
        Obstacle::Polytope(ConvexPolytope::cuboid([0.012, 0.01, 0.005]).unwrap()),
    ];
    for (n, obstacle) in obstacles.iter().enumerate() {
        let mut scene = scene(n as u64);
        let pose = Isometry3::new(Vector3::new(0.008, 0.003, 4e-3), scene.random.vector(0.5));
        let n_points = scene.surface.points().len();
        // Some push across a gap, some are inside without pushing.
        let multipliers: Vec<f64> = (0..n_points).map(|_| scene.random.within(2e5)).collect();
        let penalties = vec![PENALTY; n_points];
        let contact = NormalContact {
            surface: &scene.surface,
            obstacle,
            pose: &pose,
            multipliers_pa: &multipliers,
            penalties_pa_per_m: &penalties,
        };
        let pushing = (0..n_points).filter(|q| contact.pressure(*q, &scene.x).0 > 0.0).count();
        assert!(pushing > 5 && pushing < n_points - 5, "{obstacle:?}: {pushing} of {n_points}");
        check_derivatives(&format!("{obstacle:?}"), &contact, &scene.x, CELL);
    }
}

#[test]
fn tractions() {
    let mut scene = scene(9);
    let points = scene.surface.points();
    let penalties = vec![PENALTY; points.len()];
    let rows: Vec<_> = (0..points.len())
        .map(|q| {
            let normal = scene.random.vector(1.0).normalize();
            let multiplier = scene.random.vector(3e4);
            FrictionRow {
                anchor: points[q].position(&scene.x) + scene.random.vector(5e-4),
                normal,
                multiplier_pa: multiplier - normal * normal.dot(&multiplier),
                bound_pa: if q % 5 == 0 { 0.0 } else { 4e4 + scene.random.within(4e4) },
            }
        })
        .collect();
    let slides = |q: &usize| {
        let (held, trial) = rows[*q].traction(PENALTY, &points[*q].position(&scene.x));
        trial.norm() > held.norm()
    };
    let sliding = (0..points.len()).filter(slides).count();
    assert!(sliding > 10 && sliding < points.len() - 5, "{sliding} of {} slide", points.len());
    let friction = Friction { surface: &scene.surface, rows: &rows, penalties_pa_per_m: &penalties };
    check_derivatives("friction", &friction, &scene.x, CELL);
}

/// Sliding, the traction is the bound, against the slip; sticking, it is proportional to the slip.
#[test]
fn tractions_are_bounded() {
    let row = FrictionRow {
        anchor: Point3::origin(),
        normal: Vector3::z(),
        multiplier_pa: Vector3::zeros(),
        bound_pa: 300.0,
    };
    let traction = |x: f64, z: f64| row.traction(1e6, &Point3::new(x, 0.0, z)).0;
    assert!((traction(1e-4, 0.5) - Vector3::new(100.0, 0.0, 0.0)).norm() < 1e-9);
    assert!((traction(1e-2, 0.5) - Vector3::new(300.0, 0.0, 0.0)).norm() < 1e-9);
    assert!((traction(-1e-2, 0.0) - Vector3::new(-300.0, 0.0, 0.0)).norm() < 1e-9);
}

/// The sum of nodal forces is the sum of pressures over the area: points carry their faces' whole area.
#[test]
fn points_carry_the_area() {
    let mesh = distorted_block([0.02, 0.01, 0.01], [4, 3, 2], 0.0, 0);
    let mut quads = mesh.boundary_quads();
    quads.retain(|quad| quad.iter().all(|node| mesh.nodes()[node.index()].z > 0.0099));
    let surface = ContactSurface::new(&mesh, &quads);
    let n_points = surface.points().len();
    assert_eq!(n_points, 4 * 12);
    let (multipliers, penalties) = (vec![500.0; n_points], vec![PENALTY; n_points]);
    let pose = Isometry3::new(Vector3::new(0.0, 0.0, 0.01), Vector3::x() * std::f64::consts::PI);
    let contact = NormalContact {
        surface: &surface,
        obstacle: &Obstacle::HalfSpace,
        pose: &pose,
        multipliers_pa: &multipliers,
        penalties_pa_per_m: &penalties,
    };
    let x = rest(&mesh);
    let sum: f64 = gradient_of(&contact, &x).as_slice().chunks(3).map(|force| force[2]).sum();
    assert!((sum - 500.0 * 0.02 * 0.01).abs() < 1e-12, "{sum}");
    assert!(contact.value(&x).abs() < 1e-12, "no gap, no energy beyond the multipliers' own");
}
