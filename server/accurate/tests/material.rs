//! Materials as functions of the deformation gradient.

use nalgebra::{Matrix3, SMatrix, Vector3};
use plica_accurate::{Fibres, Material, MaterialError, MaterialModel, Projection};
use proptest::prelude::*;

const FIBRES: Fibres = Fibres { young_modulus_pa: 1.5e5, direction: Vector3::new(1.0, 2.0, -1.0) };
const MODELS: [MaterialModel; 5] = [
    MaterialModel::Linear,
    MaterialModel::CompressibleNeoHookean,
    MaterialModel::StableNeoHookean,
    MaterialModel::Exponential { exponent: 2.0 },
    MaterialModel::FibreReinforced(FIBRES),
];

/// Whether the law ends at `J = 0`.
fn is_infinite_inside_out(model: MaterialModel) -> bool {
    !matches!(model, MaterialModel::Linear | MaterialModel::StableNeoHookean)
}

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
            if is_infinite_inside_out(model) && f.determinant() < 0.1 {
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
            if is_infinite_inside_out(model) && f.determinant() < 0.1 {
                continue;
            }
            let exact = m.tangent(&f, Projection::Exact);
            let projected = m.tangent(&f, Projection::PositiveSemidefinite);
            prop_assert!((projected - projected.transpose()).norm() <= 1e-13 * exact.norm());
            prop_assert!(projected.symmetric_eigenvalues().min() >= -1e-12 * exact.norm());
        }
    }
}

#[test]
fn parameters_of_a_law_are_checked() {
    let with = |model| material(model).check();
    for exponent in [0.0, -1.0, f64::INFINITY] {
        assert_eq!(with(MaterialModel::Exponential { exponent }), Err(MaterialError::Exponent { exponent }));
    }
    let soft = Fibres { young_modulus_pa: 2.9e4, ..FIBRES };
    let refused = Err(MaterialError::FibreModulus { along_pa: 2.9e4, across_pa: 3e4 });
    assert_eq!(with(MaterialModel::FibreReinforced(soft)), refused);
    let nowhere = Fibres { direction: Vector3::zeros(), ..FIBRES };
    assert_eq!(
        with(MaterialModel::FibreReinforced(nowhere)),
        Err(MaterialError::FibreDirection { direction: [0.0; 3] })
    );
    assert_eq!(with(MaterialModel::FibreReinforced(FIBRES)), Ok(()));
}

/// Fibres no stiffer than what they lie in are not noticed at small strain.
#[test]
fn fibres_of_the_modulus_across_them_leave_the_matrix_isotropic() {
    let fibres = Fibres { young_modulus_pa: 3e4, ..FIBRES };
    let reinforced = material(MaterialModel::FibreReinforced(fibres)).tangent(&Matrix3::identity(), Projection::Exact);
    let plain = material(MaterialModel::CompressibleNeoHookean).tangent(&Matrix3::identity(), Projection::Exact);
    assert!((reinforced - plain).amax() <= 1e-10 * plain.amax());
}
