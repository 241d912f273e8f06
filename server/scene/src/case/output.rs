//! The result as a VTU file.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use plica_accurate::GAUSS_POINTS;
use plica_geometry::export::{ExportError, Field, write_vtu};

use super::problem::Problem;
use super::solution::Solution;

/// Writes displacement, Cauchy stress (at the centre of each hexahedron), von Mises stress, smallest `det F` of each
/// hexahedron, and regions.
///
/// # Errors
/// [`ExportError`]: the file cannot be written.
pub fn write_result(path: &Path, problem: &Problem, solution: &Solution) -> Result<(), ExportError> {
    let (mesh, solid, x) = (problem.mesh(), problem.solid(), solution.positions());
    let displacement: Vec<Vector3<f64>> = mesh.nodes().iter().zip(x).map(|(rest, x)| x - rest.coords).collect();
    let stress: Vec<_> = mesh.hex_indices().map(|hex| solid.cauchy_stress(x, hex, [0.0; 3])).collect();
    let von_mises: Vec<f64> = stress.iter().map(von_mises).collect();
    let smallest_jacobian = |hex| {
        let at = GAUSS_POINTS.iter().map(|&xi| solid.deformation_gradient(x, hex, xi).determinant());
        at.fold(f64::INFINITY, f64::min)
    };
    let jacobian: Vec<f64> = mesh.hex_indices().map(smallest_jacobian).collect();
    let region: Vec<f64> = problem.region_of_hex().iter().map(|&region| region as f64).collect();
    let cell_fields = [
        Field::Scalars("von_mises_pa", &von_mises),
        Field::Scalars("jacobian", &jacobian),
        Field::Scalars("region", &region),
        Field::Tensors("cauchy_stress_pa", &stress),
    ];
    write_vtu(path, mesh, &[Field::Vectors("displacement_m", &displacement)], &cell_fields)
}

/// `sqrt(3/2 s : s)`, `s` the stress less its mean pressure.
fn von_mises(stress: &Matrix3<f64>) -> f64 {
    let deviator = stress - Matrix3::from_diagonal_element(stress.trace() / 3.0);
    (1.5 * deviator.norm_squared()).sqrt()
}
