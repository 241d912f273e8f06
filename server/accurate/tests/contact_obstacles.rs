//! Obstacles: distances, normals and curvatures of every shape.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::random::Random;
use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};
use plica_accurate::contact::Obstacle;
use plica_geometry::ConvexPolytope;

const STEP_M: f64 = 1e-7;

fn shapes() -> Vec<(&'static str, Obstacle)> {
    let ball = Obstacle::Ball { radius_m: 7e-3 };
    let capsule = Obstacle::Capsule { radius_m: 3e-3, length_m: 0.02 };
    let cuboid = Obstacle::Polytope(ConvexPolytope::cuboid([4e-3, 5e-3, 6e-3]).unwrap());
    let hull = Obstacle::Polytope(ConvexPolytope::hull(tetrahedron().to_vec()).unwrap());
    let union = Obstacle::Union(vec![Obstacle::Ball { radius_m: 2e-3 }, capsule.clone(), cuboid.clone()]);
    vec![
        ("ball", ball),
        ("capsule", capsule),
        ("half-space", Obstacle::HalfSpace),
        ("cuboid", cuboid),
        ("hull", hull),
        ("union", union),
    ]
}

fn tetrahedron() -> [Point3<f64>; 5] {
    let corner = |x, y, z| Point3::new(x, y, z) * 1e-3;
    // The last point lies inside.
    [corner(0.0, 0.0, 0.0), corner(9.0, 0.0, 0.0), corner(1.0, 8.0, 0.0), corner(2.0, 1.0, 7.0), corner(2.0, 1.0, 1.0)]
}

fn pose() -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.4, -1.1, 0.7));
    Isometry3::from_parts(Translation3::new(0.02, -0.01, 0.03), rotation)
}

#[test]
fn normals_and_curvatures_are_derivatives() {
    let mut random = Random::new(5);
    for (name, obstacle) in shapes() {
        for _ in 0..200 {
            let point = pose() * Point3::from(random.vector(0.02));
            let gap = obstacle.gap(&pose(), &point);
            let at = |axis: usize, steps: f64| obstacle.gap(&pose(), &(point + Vector3::ith(axis, steps * STEP_M)));
            let central = |axis: usize| (at(axis, 1.0), at(axis, -1.0));
            let slopes = |axis: usize| (central(axis).0.distance_m - central(axis).1.distance_m) / (2.0 * STEP_M);
            let turns = |axis: usize| (central(axis).0.normal - central(axis).1.normal) / (2.0 * STEP_M);
            // No derivative where the nearest face or part changes within the step.
            let changes = (0..3).any(|axis| (turns(axis) * STEP_M).norm() > 1e-3);
            if changes {
                continue;
            }
            let normal = Vector3::from_fn(|axis, _| slopes(axis));
            let curvature = Matrix3::from_columns(&[turns(0), turns(1), turns(2)]);
            assert!((gap.normal - normal).norm() < 1e-6, "{name} at {point}: {} {normal}", gap.normal);
            let scale = 1.0 + gap.curvature.amax();
            assert!((gap.curvature - curvature).amax() < 1e-4 * scale, "{name}: {} {curvature}", gap.curvature);
            assert!((gap.normal.norm() - 1.0).abs() < 1e-12, "{name}");
            assert!((obstacle.distance(&pose(), &point) - gap.distance_m).abs() < 1e-15, "{name}");
        }
    }
}

#[test]
fn shapes_lie_as_those_of_the_simulation() {
    let origin = Isometry3::identity();
    let distance = |obstacle: &Obstacle, x: f64, y: f64, z: f64| obstacle.distance(&origin, &Point3::new(x, y, z));
    let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-15, "{found} {expected}");
    let capsule = Obstacle::Capsule { radius_m: 1.0, length_m: 5.0 };
    near(distance(&capsule, 0.0, 0.0, -3.0), 2.0);
    near(distance(&capsule, 3.0, 0.0, 2.0), 2.0);
    near(distance(&capsule, 0.0, 0.0, 7.0), 1.0);
    near(distance(&Obstacle::HalfSpace, 4.0, 5.0, 2.0), 2.0);
    let cuboid = Obstacle::Polytope(ConvexPolytope::cuboid([1.0, 2.0, 3.0]).unwrap());
    near(distance(&cuboid, 0.0, 0.0, -4.0), 1.0);
    near(distance(&cuboid, 0.0, 1.5, 0.0), -0.5);
    near(distance(&Obstacle::Union(vec![capsule, cuboid]), 0.0, 1.9, 0.0), -0.1);
    assert_eq!(distance(&Obstacle::Union(Vec::new()), 0.0, 0.0, 0.0), f64::INFINITY);
}

/// On a centre or an axis the normal is any unit vector.
#[test]
fn centres_have_a_normal() {
    for (name, obstacle) in shapes() {
        let gap = obstacle.gap(&pose(), &(pose() * Point3::origin()));
        assert!((gap.normal.norm() - 1.0).abs() < 1e-12 && gap.curvature.iter().all(|c| c.is_finite()), "{name}");
    }
    let axis =
        Obstacle::Capsule { radius_m: 1.0, length_m: 5.0 }.gap(&Isometry3::identity(), &Point3::new(0.0, 0.0, 2.0));
    assert_eq!((axis.distance_m, axis.normal.z), (-1.0, 0.0));
}
