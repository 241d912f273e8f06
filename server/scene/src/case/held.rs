//! Check that supports leave no rigid motion.

use nalgebra::{Matrix6, Point3, SymmetricEigen, Vector3, Vector6};
use plica_geometry::VolumeMesh;

use super::support::Support;
use crate::document::Document;
use crate::error::ConfigError;

/// Least motion of the held coordinates, as a share of the body's motion.
const LEAST_HOLD: f64 = 1e-6;

/// Refuses a case in which a body can move without deformation.
///
/// A small rigid motion `u(x) = t + w x (x - c)` moves a node along a held direction `d` by `d . u`. The sum of these squares over
/// held directions is a quadratic form in `(t, size w)`: where its least eigenvalue is 0, that motion is free.
pub(super) fn check(document: &Document, mesh: &VolumeMesh, supports: &[Support]) -> Result<(), ConfigError> {
    let (body_of_node, n_bodies) = mesh.bodies();
    for body in 0..n_bodies {
        let nodes: Vec<_> = (0..mesh.n_nodes()).filter(|&n| body_of_node[n] == body).map(|n| mesh.nodes()[n]).collect();
        let (centre, size) = extent(&nodes);
        let mut form = Matrix6::zeros();
        for (node, direction) in supports.iter().flat_map(|s| &s.rows) {
            if body_of_node[node.index()] == body {
                let arm = (mesh.nodes()[node.index()] - centre) / size;
                let row = moved(direction, &arm);
                form += row * row.transpose();
            }
        }
        if let Some(motion) = free_motion(&form) {
            return Err(refuse(document, n_bodies, centre, &motion));
        }
    }
    Ok(())
}

fn extent(nodes: &[Point3<f64>]) -> (Point3<f64>, f64) {
    let sum: Vector3<f64> = nodes.iter().map(|x| x.coords).sum();
    let centre = Point3::from(sum / nodes.len() as f64);
    (centre, nodes.iter().map(|x| (x - centre).norm()).fold(0.0, f64::max))
}

/// Displacement of a node along `d`, as a row over `(t, size w)`: `d . (t + w x arm)`.
fn moved(d: &Vector3<f64>, arm: &Vector3<f64>) -> Vector6<f64> {
    let by_rotation = arm.cross(d);
    Vector6::new(d.x, d.y, d.z, by_rotation.x, by_rotation.y, by_rotation.z)
}

fn free_motion(form: &Matrix6<f64>) -> Option<Vector6<f64>> {
    let eigen = SymmetricEigen::new(*form);
    let least = eigen.eigenvalues.imin();
    let is_free = eigen.eigenvalues[least] <= LEAST_HOLD * LEAST_HOLD * eigen.eigenvalues.max().max(f64::MIN_POSITIVE);
    is_free.then(|| eigen.eigenvectors.column(least).into_owned())
}

fn refuse(document: &Document, n_bodies: usize, centre: Point3<f64>, motion: &Vector6<f64>) -> ConfigError {
    let (shift, turn) = (motion.fixed_rows::<3>(0), motion.fixed_rows::<3>(3));
    let largest = |v: Vector3<f64>| ["x", "y", "z"][v.iamax()];
    let how = if turn.norm() > 1e-3 {
        format!("turn about {}", largest(turn.into_owned()))
    } else {
        format!("slide along {}", largest(shift.into_owned()))
    };
    let which = if n_bodies == 1 {
        "the body".to_owned()
    } else {
        let c: [f64; 3] = centre.coords.into();
        format!("one of {n_bodies} bodies that share no node, the one around {c:?} m,")
    };
    let problem = format!("{which} is free to {how} without deforming");
    document.error("supports", problem, "hold more nodes or axes; a body needs six held coordinates at least")
}
