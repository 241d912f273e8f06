//! Materials as functions of the deformation gradient.

use nalgebra::{Matrix3, SMatrix};
use plica_accurate::{Material, MaterialModel, Projection};
use proptest::prelude::*;

const MODELS: [MaterialModel; 3] =
    [MaterialModel::Linear, MaterialModel::CompressibleNeoHookean, MaterialModel::StableNeoHookean];

fn material(model: MaterialModel) -> Material {
    Material { model, young_modulus_pa: 3e4, poisson_ratio: 0.4 }
}

fn any_gradient() -> impl Strategy<Value = Matrix3<f64>> {
    prop::array::uniform9(-0.6..0.6_f64).prop_map(|g| Matrix3::identity() + Matrix3::from_row_slice(&g))
}

proptest! {
    #[test]
    fn stress_and_tangent_are_derivatives(f in any_gradient(), direction in prop::array::uniform9(-1.0..1.0_f64)) {
        let d = Matrix3::from_row_slice(&direction);
        for model in MODELS {
            let m = material(model);
            if model == MaterialModel::CompressibleNeoHookean && f.determinant() < 0.1 {
                continue;
            }
            let h = 1e-5;
            let (plus, minus) = (f + d * h, f - d * h);
            let by_value = (m.energy_density(&plus) - m.energy_density(&minus)) / (2.0 * h);
            let p = m.first_piola_stress(&f);
            prop_assert!((by_value - p.dot(&d)).abs() <= 1e-6 * (1.0 + p.norm()), "{model:?} {by_value} {}", p.dot(&d));
            let by_stress = (m.first_piola_stress(&plus) - m.first_piola_stress(&minus)) / (2.0 * h);
            let tangent = m.tangent(&f, Projection::Exact);
            let by_tangent = tangent * SMatrix::<f64, 9, 1>::from_column_slice(d.as_slice());
            let miss = (by_tangent - SMatrix::<f64, 9, 1>::from_column_slice(by_stress.as_slice())).norm();
            prop_assert!(miss <= 1e-6 * tangent.norm(), "{model:?} {miss}");
        }
    }

    #[test]
    fn projected_tangent_lifts_negative_eigenvalues_to_zero(f in any_gradient()) {
        for model in MODELS {
            let m = material(model);
            if model == MaterialModel::CompressibleNeoHookean && f.determinant() < 0.1 {
                continue;
            }
            let exact = m.tangent(&f, Projection::Exact);
            let projected = m.tangent(&f, Projection::PositiveSemidefinite);
            prop_assert!((projected - projected.transpose()).norm() <= 1e-13 * exact.norm());
            prop_assert!(projected.symmetric_eigenvalues().min() >= -1e-12 * exact.norm());
        }
    }
}
