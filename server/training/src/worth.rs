//! The worth of a result that is not accepted, or that needed a guard against elements that turn over.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::solve_info::SolveInfo;

/// The last state of a solve without a guard.
#[derive(Debug, Clone, Default)]
pub struct Unguarded {
    /// How the solve went.
    pub solve: SolveInfo,
    /// Centre at rest of the hexahedron with the smallest `det F` \[m\].
    pub worst_m: [f64; 3],
    /// Skin offsets from rest, `[n_skin]` \[m\].
    pub offsets: Vec<Vector3<f64>>,
    /// Those of the accepted result at the same pose, with a guard; none without such a result.
    pub accepted: Option<Vec<Vector3<f64>>>,
}

/// Worth of a result.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Worth {
    /// Newton steps.
    pub iterations: u32,
    /// Largest force left at a free coordinate, as a share of the largest nodal force.
    pub residual: f64,
    /// Smallest `det F`.
    pub smallest_jacobian: f64,
    /// Centre at rest of the hexahedron that has it \[m\].
    pub worst_m: [f64; 3],
    /// Distance of its skin from that of the nearest accepted result, the one with a guard; none without such a result.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_accepted: Option<SkinDistance>,
}

/// Distance of two skins.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SkinDistance {
    /// Area-weighted RMS \[m\].
    pub rms_m: f64,
    /// At the worst vertex \[m\].
    pub worst_m: f64,
}

impl Unguarded {
    /// Worth of this state; `areas: [n_skin]` \[m^2\].
    pub fn worth(&self, areas: &[f64]) -> Worth {
        let SolveInfo { iterations, residual, smallest_jacobian, .. } = self.solve;
        let to_accepted = self.accepted.as_ref().map(|accepted| SkinDistance::between(&self.offsets, accepted, areas));
        // JSON has no NaN.
        let residual = if residual.is_finite() { residual } else { f64::MAX };
        Worth { iterations, residual, smallest_jacobian, worst_m: self.worst_m, to_accepted }
    }
}

impl SkinDistance {
    /// Between two skins, `[n_skin]` \[m\], weighted by `areas: [n_skin]`.
    pub fn between(a: &[Vector3<f64>], b: &[Vector3<f64>], areas: &[f64]) -> Self {
        let squared = || a.iter().zip(b).map(|(a, b)| (a - b).norm_squared());
        let sum: f64 = squared().zip(areas).map(|(d, area)| d * area).sum();
        Self { rms_m: (sum / areas.iter().sum::<f64>()).sqrt(), worst_m: squared().fold(0.0, f64::max).sqrt() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn worth_tells_how_far_the_skin_is_from_the_accepted_one() {
        let accepted = Some(vec![Vector3::new(0.0, 3.0, 4.0), Vector3::zeros()]);
        let nothing = Unguarded { offsets: vec![Vector3::zeros(); 2], ..Unguarded::default() };
        let unguarded = Unguarded { accepted, ..nothing.clone() };
        let found = unguarded.worth(&[1.0, 3.0]).to_accepted.expect("there is an accepted skin");
        assert!((found.rms_m - 2.5).abs() < 1e-12 && (found.worst_m - 5.0).abs() < 1e-12, "{found:?}");
        assert!(nothing.worth(&[1.0, 3.0]).to_accepted.is_none());
    }
}
