//! The result as a VTU file.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use plica_geometry::export::{ExportError, Field, write_volume_vtu};

use super::problem::Problem;
use super::solution::Solution;

/// Writes displacement, Cauchy stress (at the centre of each element), von Mises stress, smallest `det F` of each element,
/// and regions.
///
/// # Errors
/// [`ExportError`]: the file cannot be written.
pub fn write_result(path: &Path, problem: &Problem, solution: &Solution) -> Result<(), ExportError> {
    let (mesh, solid, x) = (problem.mesh(), problem.solid(), solution.positions());
    let displacement: Vec<Vector3<f64>> = mesh.nodes().iter().zip(x).map(|(rest, x)| x - rest.coords).collect();
    let stress = solid.centre_stresses(x);
    let von_mises: Vec<f64> = stress.iter().map(von_mises).collect();
    let jacobian = solid.smallest_jacobians(x);
    let region: Vec<f64> = problem.region_of_element().iter().map(|&region| region as f64).collect();
    let cell_fields = [
        Field::Scalars("von_mises_pa", &von_mises),
        Field::Scalars("jacobian", &jacobian),
        Field::Scalars("region", &region),
        Field::Tensors("cauchy_stress_pa", &stress),
    ];
    write_volume_vtu(path, mesh, &[Field::Vectors("displacement_m", &displacement)], &cell_fields)
}

/// `sqrt(3/2 s : s)`, `s` the stress less its mean pressure.
fn von_mises(stress: &Matrix3<f64>) -> f64 {
    let deviator = stress - Matrix3::from_diagonal_element(stress.trace() / 3.0);
    (1.5 * deviator.norm_squared()).sqrt()
}
