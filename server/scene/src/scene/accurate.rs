//! Accurate model of a scene and its tie, checked.

use plica_accurate::{Material, MaterialModel, TieOptions};

use super::raw::{RawAccurate, RawMaterialModel, RawTie};
use crate::checks::Check;
use crate::error::ConfigError;

/// Most hexahedra of the accurate model.
const MAX_HEXES: u64 = 1_000_000;
/// Default number of hexahedra of the accurate model per coarse hexahedron and axis.
const REFINEMENT: usize = 3;

/// Mesh of the accurate model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AccurateMesh {
    /// Hexahedra along x, y, z.
    pub divisions: [usize; 3],
    /// Length of the last over that of the first, along each.
    pub grading: [f64; 3],
}

/// Quasi-static model of the examples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AccurateConfig {
    /// Its mesh.
    pub mesh: AccurateMesh,
    /// Material outside of all regions.
    pub material: Material,
}

pub(super) fn check(
    c: &Check<'_>,
    key: &str,
    raw: &RawAccurate,
    coarse_divisions: [usize; 3],
    object: plica_sim::Material,
) -> Result<AccurateConfig, ConfigError> {
    let refined = coarse_divisions.map(|n| REFINEMENT * n);
    let divisions = raw.divisions.map_or(refined, |typed| typed.map(|n| n as usize));
    let n_hexes: u64 = divisions.iter().map(|n| *n as u64).product();
    if n_hexes > MAX_HEXES {
        let problem = format!("{n_hexes} hexahedra; the allowed range is 1 to {MAX_HEXES}");
        return Err(c.error(
            &format!("{key}.divisions"),
            problem,
            "use fewer divisions; with the most allowed, a solve takes minutes",
        ));
    }
    Ok(AccurateConfig {
        mesh: AccurateMesh { divisions, grading: raw.grading.unwrap_or([1.0; 3]) },
        material: Material {
            model: match raw.model {
                RawMaterialModel::StableNeoHookean => MaterialModel::StableNeoHookean,
                RawMaterialModel::CompressibleNeoHookean => MaterialModel::CompressibleNeoHookean,
                RawMaterialModel::Linear => MaterialModel::Linear,
            },
            young_modulus_pa: raw.young_modulus_pa.unwrap_or(object.young_modulus_pa),
            poisson_ratio: raw.poisson_ratio.unwrap_or(object.poisson_ratio),
        },
    })
}

pub(super) fn tie(raw: &RawTie, young_modulus_pa: f64) -> TieOptions {
    TieOptions { young_modulus_pa, compliance_m: raw.compliance_m, band_m: raw.band_m, rim_floor: raw.rim_floor }
}
