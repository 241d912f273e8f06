//! Collapsed and inverted elements, and loads far beyond the linear.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::derivatives::{gradient_of, hessian_of, smallest_eigenvalue};
use common::random::Random;
use common::{assert_close, distance, distorted_block, is_on_boundary, material, rest, sides, solve};
use nalgebra::{Matrix3, Vector3};
use plica_accurate::{
    Constraints, Energy, Lame, Material, MaterialModel, Params, Pressure, Projection, Solid, SolveError, Traction,
};
use plica_geometry::shapes::block;

const SIZE: [f64; 3] = [0.02, 0.02, 0.02];

/// Maps of rank 2, 1, 0 and with negative determinant.
fn collapses() -> [Matrix3<f64>; 6] {
    [
        Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0)),
        Matrix3::from_diagonal(&Vector3::new(1.0, 0.0, 0.0)),
        Matrix3::zeros(),
        Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -1.0)),
        -Matrix3::identity(),
        Matrix3::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0),
    ]
}

#[test]
fn stable_neo_hookean_is_finite_everywhere() {
    let mesh = distorted_block(SIZE, [2, 1, 1], 0.2, 8);
    let solid = Solid::uniform(&mesh, material(MaterialModel::StableNeoHookean, 3e4, 0.49)).unwrap();
    for f in collapses() {
        let x = common::affine(&mesh, &f, &Vector3::zeros());
        assert!(solid.value(&x).is_finite() && solid.value(&x) > 0.0);
        assert!(gradient_of(&solid, &x).iter().all(|g| g.is_finite()));
        for projection in [Projection::Exact, Projection::PositiveSemidefinite] {
            let hessian = hessian_of(&solid, &x, projection);
            assert!(hessian.iter().all(|h| h.is_finite()));
            if projection == Projection::PositiveSemidefinite {
                assert!(smallest_eigenvalue(&hessian) >= -1e-10 * hessian.amax(), "{f}");
            }
        }
    }
}

/// Laws with the logarithm of the volume.
const WITH_LOGARITHM: [MaterialModel; 3] =
    [MaterialModel::CompressibleNeoHookean, common::EXPONENTIAL, common::FIBRE_REINFORCED];

#[test]
fn laws_with_a_logarithm_are_infinite_where_they_end_and_large_before() {
    let mesh = block(SIZE, [1, 1, 1]);
    for model in WITH_LOGARITHM {
        let solid = Solid::uniform(&mesh, material(model, 3e4, 0.3)).unwrap();
        for f in collapses().into_iter().filter(|f| f.determinant() <= 1e-12) {
            let value = solid.value(&common::affine(&mesh, &f, &Vector3::zeros()));
            assert_eq!(value, f64::INFINITY, "{model:?} {f}");
        }
        let at = |stretch: f64| {
            let f = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, stretch));
            (solid.value(&common::affine(&mesh, &f, &Vector3::zeros())), energy_density(&solid_material(model), &f))
        };
        let mut before = 0.0;
        for stretch in [1e-1, 1e-3, 1e-6, 1e-12] {
            let (value, density) = at(stretch);
            assert_close(value, density * mesh.volume(), 1e-3, "energy");
            assert!(value.is_finite() && value > before);
            before = value;
        }
    }
}

fn solid_material(model: MaterialModel) -> Material {
    material(model, 3e4, 0.3)
}

/// Energy density of the materials of the test above, straight from their definitions.
fn energy_density(material: &Material, f: &Matrix3<f64>) -> f64 {
    let Lame { lambda_pa, mu_pa } = material.lame();
    let (j, i_c) = (f.determinant(), f.norm_squared());
    let stretching = i_c - 3.0 - 2.0 * j.ln();
    lambda_pa / 4.0 * (j * j - 1.0 - 2.0 * j.ln())
        + match material.model {
            MaterialModel::Exponential { exponent: b } => mu_pa / (2.0 * b) * ((b * stretching).exp() - 1.0),
            MaterialModel::FibreReinforced(fibres) => {
                let matrix_pa = mu_pa * (3.0 * lambda_pa + 2.0 * mu_pa) / (lambda_pa + mu_pa);
                let stretch = (f * fibres.direction.normalize()).norm();
                mu_pa / 2.0 * stretching + (fibres.young_modulus_pa - matrix_pa) / 2.0 * (stretch - 1.0).powi(2)
            }
            _ => mu_pa / 2.0 * stretching,
        }
}

/// An exponential that overflows is an energy without bound, not NaN: the line search turns back from it.
#[test]
fn an_exponential_that_overflows_is_infinite() {
    let stiff = material(MaterialModel::Exponential { exponent: 50.0 }, 3e4, 0.3);
    assert_eq!(stiff.energy_density(&(Matrix3::identity() * 5.0)), f64::INFINITY);
    assert_eq!(stiff.energy_density(&Matrix3::from_diagonal(&Vector3::new(5.0, 5.0, -5.0))), f64::INFINITY);
}

/// A dead pressure of several moduli: the first Newton step would invert the block.
#[test]
fn line_search_recovers_from_steps_that_would_invert() {
    let mesh = block(SIZE, [2, 2, 2]);
    let mut constraints = Constraints::none(mesh.n_nodes());
    for (node, x) in mesh.nodes().iter().enumerate() {
        for (axis, side) in sides(x, SIZE).into_iter().enumerate() {
            if side[0] || (axis < 2 && side[1]) {
                constraints.give(node, axis, x[axis]);
            }
        }
    }
    let top: Vec<_> = mesh
        .boundary_quads()
        .into_iter()
        .filter(|q| q.iter().all(|n| sides(&mesh.nodes()[n.index()], SIZE)[2][1]))
        .collect();
    let pressure = 2e5;
    let load = Traction::new(&mesh, &top, Vector3::new(0.0, 0.0, -pressure));
    for model in [MaterialModel::CompressibleNeoHookean, MaterialModel::StableNeoHookean, common::EXPONENTIAL] {
        let material = material(model, 3e4, 0.3);
        let solid = Solid::uniform(&mesh, material).unwrap();
        let mut x = rest(&mesh);
        let result = solve(&[&solid, &load], &constraints, &Params::default(), &mut x);
        if model == MaterialModel::StableNeoHookean {
            // This law is too soft: the block settles inverted, visible in its smallest J.
            assert!(result.unwrap().smallest_jacobian.unwrap() < 0.05);
            continue;
        }
        let info = result.unwrap();
        assert!(info.halvings > 0, "the first step was meant to fail: {info:?}");
        let stretch = x.iter().map(|x| x.z).fold(0.0, f64::max) / SIZE[2];
        let stress = material.first_piola_stress(&Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, stretch)));
        assert_close(stress[(2, 2)], -pressure, 1e-8, "stress");
        println!(
            "{model:?} under {pressure} Pa: stretch {stretch:.4}, {} steps, {} halvings",
            info.iterations, info.halvings
        );
    }
}

/// Inner nodes at random positions: the stable material returns to rest.
#[test]
fn stable_neo_hookean_recovers_from_inversion() {
    let mesh = block(SIZE, [4, 4, 4]);
    let solid = Solid::uniform(&mesh, material(MaterialModel::StableNeoHookean, 3e4, 0.45)).unwrap();
    let mut constraints = Constraints::none(mesh.n_nodes());
    for (node, x) in mesh.nodes().iter().enumerate().filter(|(_, x)| is_on_boundary(x, SIZE)) {
        constraints.hold(node, &x.coords);
    }
    let mut random = Random::new(9);
    for start in ["scattered", "collapsed"] {
        let mut x = rest(&mesh);
        for (x, _) in x.iter_mut().zip(mesh.nodes()).filter(|(_, rest)| !is_on_boundary(rest, SIZE)) {
            *x = if start == "collapsed" { Vector3::repeat(0.01) } else { *x + random.vector(0.01) };
        }
        let info = solve(&[&solid], &constraints, &Params::default(), &mut x).unwrap();
        println!(
            "{start}: {} steps, {} indefinite, smallest J {:.3}",
            info.iterations,
            info.indefinite_steps,
            info.smallest_jacobian.unwrap()
        );
        assert!(distance(&x, &rest(&mesh)) <= 1e-9 * SIZE[0], "{start}: {info:?}");
    }
}

#[test]
fn a_start_that_is_not_admissible_is_refused() {
    let mesh = block(SIZE, [1, 1, 1]);
    let solid = Solid::uniform(&mesh, material(MaterialModel::CompressibleNeoHookean, 3e4, 0.3)).unwrap();
    let constraints = Constraints::none(mesh.n_nodes());
    let mut mirrored: Vec<_> = rest(&mesh).iter().map(|x| Vector3::new(x.x, x.y, -x.z)).collect();
    let refused = solve(&[&solid], &constraints, &Params::default(), &mut mirrored);
    assert_eq!(refused, Err(SolveError::NotFinite { iterations: 0 }));
    let mut nan = rest(&mesh);
    nan[3].y = f64::NAN;
    assert_eq!(
        solve(&[&solid], &constraints, &Params::default(), &mut nan),
        Err(SolveError::NotFinite { iterations: 0 })
    );
}

/// A pressure on all sides: every Gauss point has the Cauchy stress `-p`.
#[test]
fn follower_pressure_squeezes_evenly() {
    let mesh = distorted_block(SIZE, [3, 3, 3], 0.2, 10);
    let mut constraints = Constraints::none(mesh.n_nodes());
    for (node, x) in mesh.nodes().iter().enumerate() {
        (0..3).filter(|&axis| sides(x, SIZE)[axis][0]).for_each(|axis| constraints.give(node, axis, x[axis]));
    }
    let load = Pressure::new(mesh.boundary_quads(), 2e4);
    for model in [MaterialModel::CompressibleNeoHookean, MaterialModel::StableNeoHookean, common::EXPONENTIAL] {
        let solid = Solid::uniform(&mesh, material(model, 3e4, 0.3)).unwrap();
        let mut x = rest(&mesh);
        let info = solve(&[&solid, &load], &constraints, &Params::default(), &mut x).unwrap();
        let expected = Matrix3::from_diagonal_element(-2e4);
        for hex in mesh.hex_indices() {
            assert!((solid.cauchy_stress(&x, hex, [0.0; 3]) - expected).norm() <= 1e-5 * 2e4, "{model:?}: {info:?}");
        }
        println!(
            "{model:?} under 20 kPa on all sides: {} steps, volume {:.3}",
            info.iterations,
            solid.volume(&x) / mesh.volume()
        );
    }
}
