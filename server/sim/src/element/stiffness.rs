//! Stiffness of one hexahedron at rest.
//!
//! `K = int B^T C B dV`, 2x2x2 Gauss points. The enhanced-strain element adds nine internal modes `alpha` \[SR90\] in the
//! incompatible-mode form that passes the patch test on distorted meshes \[TBW76\]; they are condensed:
//! `K = K_uu - K_ua K_aa^-1 K_au`.

use nalgebra::{Matrix3, Matrix6, Point3, SMatrix, Vector3};
use plica_geometry::isoparametric::{shape_functions, shape_gradients};

use crate::description::{ElementKind, Material};

type Strain24 = SMatrix<f64, 6, 24>;
type Strain9 = SMatrix<f64, 6, 9>;

/// Stiffness of a hexahedron at rest, `[24, 24]` \[N/m\], symmetric; degree of freedom `3 * corner + axis`.
///
/// Corners are in VTK order. Source: \[SR90\], \[TBW76\] for [`ElementKind::EnhancedStrain`].
pub fn rest_stiffness(corners: &[Point3<f64>; 8], material: &Material, kind: ElementKind) -> SMatrix<f64, 24, 24> {
    let elasticity = isotropic_elasticity(material);
    let center = jacobian(corners, [0.0; 3]);
    let center_inverse_transpose = inverse_transpose(&center);
    let mut uu = SMatrix::<f64, 24, 24>::zeros();
    let mut ua = SMatrix::<f64, 24, 9>::zeros();
    let mut aa = SMatrix::<f64, 9, 9>::zeros();
    for xi in gauss_points() {
        let j = jacobian(corners, xi);
        let volume = j.determinant();
        let b = strain_of_displacement(&shape_gradients(xi), &inverse_transpose(&j));
        let g = strain_of_modes(xi, &center_inverse_transpose, center.determinant() / volume);
        uu += b.transpose() * elasticity * b * volume;
        ua += b.transpose() * elasticity * g * volume;
        aa += g.transpose() * elasticity * g * volume;
    }
    let stiffness = match kind {
        ElementKind::FullIntegration => uu,
        ElementKind::EnhancedStrain => match aa.cholesky() {
            Some(factor) => uu - ua * factor.solve(&ua.transpose()),
            None => uu,
        },
    };
    (stiffness + stiffness.transpose()) * 0.5
}

/// Share of a hexahedron's mass at each corner, `int rho N_a dV`, `[8]` \[kg\].
pub fn lumped_mass(corners: &[Point3<f64>; 8], density_kg_per_m3: f64) -> [f64; 8] {
    let mut mass = [0.0; 8];
    for xi in gauss_points() {
        let volume = jacobian(corners, xi).determinant();
        for (m, n) in mass.iter_mut().zip(shape_functions(xi)) {
            *m += density_kg_per_m3 * n * volume;
        }
    }
    mass
}

/// Gradients of the corner functions at the centre, `[8, 3]` \[1/m\]: the deformation gradient there is `sum x_a g_a^T`.
pub(crate) fn center_gradients(corners: &[Point3<f64>; 8]) -> [Vector3<f64>; 8] {
    let inverse_transpose = inverse_transpose(&jacobian(corners, [0.0; 3]));
    shape_gradients([0.0; 3]).map(|g| inverse_transpose * Vector3::from(g))
}

/// The eight Gauss points of weight 1, at `+-1/sqrt(3)`.
fn gauss_points() -> impl Iterator<Item = [f64; 3]> {
    let g = 1.0 / 3.0_f64.sqrt();
    (0..8).map(move |i| [i & 1, (i >> 1) & 1, (i >> 2) & 1].map(|bit| if bit == 0 { -g } else { g }))
}

/// `J = dX / dxi`, columns are the derivatives by one natural coordinate \[m\].
fn jacobian(corners: &[Point3<f64>; 8], xi: [f64; 3]) -> Matrix3<f64> {
    corners.iter().zip(shape_gradients(xi)).map(|(x, g)| x.coords * Vector3::from(g).transpose()).sum()
}

/// `J^-T`; meshes are checked for positive Jacobians when they are built.
fn inverse_transpose(j: &Matrix3<f64>) -> Matrix3<f64> {
    j.try_inverse().unwrap_or_else(Matrix3::zeros).transpose()
}

/// Engineering strain (xx, yy, zz, xy, yz, zx) per degree of freedom.
fn strain_of_displacement(natural_gradients: &[[f64; 3]; 8], inverse_transpose: &Matrix3<f64>) -> Strain24 {
    let mut b = Strain24::zeros();
    for (a, natural) in natural_gradients.iter().enumerate() {
        let columns = strain_columns(&(inverse_transpose * Vector3::from(*natural)));
        b.fixed_columns_mut::<3>(3 * a).copy_from(&columns);
    }
    b
}

/// Strain of the incompatible modes `1 - xi_k^2`, gradients taken with the Jacobian at the centre and scaled by `j_0 / j`,
/// so that their volume integral vanishes \[TBW76\].
fn strain_of_modes(xi: [f64; 3], center_inverse_transpose: &Matrix3<f64>, scale: f64) -> Strain9 {
    let mut g = Strain9::zeros();
    for k in 0..3 {
        let mut natural = Vector3::zeros();
        natural[k] = -2.0 * xi[k];
        let columns = strain_columns(&(center_inverse_transpose * natural * scale));
        g.fixed_columns_mut::<3>(3 * k).copy_from(&columns);
    }
    g
}

/// Strain of the three displacements of a function with gradient `g`.
#[rustfmt::skip]
fn strain_columns(g: &Vector3<f64>) -> SMatrix<f64, 6, 3> {
    SMatrix::<f64, 6, 3>::new(
        g.x, 0.0, 0.0,
        0.0, g.y, 0.0,
        0.0, 0.0, g.z,
        g.y, g.x, 0.0,
        0.0, g.z, g.y,
        g.z, 0.0, g.x,
    )
}

/// `C = lambda 1 1^T + 2 mu I` in engineering notation \[Pa\].
fn isotropic_elasticity(material: &Material) -> Matrix6<f64> {
    let (e, nu) = (material.young_modulus_pa, material.poisson_ratio);
    let lambda = e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu));
    let mu = e / (2.0 * (1.0 + nu));
    let mut c = Matrix6::zeros();
    for i in 0..3 {
        for k in 0..3 {
            c[(i, k)] = lambda;
        }
        c[(i, i)] += 2.0 * mu;
        c[(i + 3, i + 3)] = mu;
    }
    c
}
