//! The accurate model of a scene and its tie, checked.

use plica_accurate::{Material, MaterialModel, TieOptions};

use super::raw::{RawAccurate, RawMaterialModel, RawTie};
use crate::checks::Check;
use crate::error::ConfigError;

/// Most hexahedra of the accurate model.
const MAX_HEXES: u64 = 1_000_000;
/// Hexahedra of the accurate model along an axis for each coarse one, where nothing is said.
const REFINEMENT: usize = 3;

/// Quasi-static model that examples are made with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AccurateConfig {
    /// Hexahedra along x, y, z.
    pub divisions: [usize; 3],
    /// Material of everything that no region claims.
    pub material: Material,
}

pub(super) fn check(
    c: &Check<'_>,
    key: &str,
    raw: &RawAccurate,
    coarse_divisions: [usize; 3],
    object: plica_sim::Material,
) -> Result<AccurateConfig, ConfigError> {
    let number = |name: &str, value: Option<f64>, least: f64, most: f64| {
        value.map(|v| c.number(&format!("{key}.{name}"), v, least, most)).transpose()
    };
    let young_modulus_pa = number("young_modulus_pa", raw.young_modulus_pa, 10.0, 1e9)?;
    let poisson_ratio = number("poisson_ratio", raw.poisson_ratio, 0.0, 0.4999)?;
    let divisions = match raw.divisions {
        None => coarse_divisions.map(|n| REFINEMENT * n),
        Some(divisions) => {
            let key = format!("{key}.divisions");
            divisions.iter().try_for_each(|n| c.count(&key, *n, 1, 1000).map(drop))?;
            divisions.map(|n| n as usize)
        }
    };
    let n_hexes: u64 = divisions.iter().map(|n| *n as u64).product();
    if n_hexes > MAX_HEXES {
        let problem = format!("{n_hexes} hexahedra; the allowed range is 1 to {MAX_HEXES}");
        return Err(c.error(
            &format!("{key}.divisions"),
            problem,
            "use fewer divisions: a solve takes minutes already",
        ));
    }
    Ok(AccurateConfig {
        divisions,
        material: Material {
            model: match raw.model {
                RawMaterialModel::StableNeoHookean => MaterialModel::StableNeoHookean,
                RawMaterialModel::CompressibleNeoHookean => MaterialModel::CompressibleNeoHookean,
                RawMaterialModel::Linear => MaterialModel::Linear,
            },
            young_modulus_pa: young_modulus_pa.unwrap_or(object.young_modulus_pa),
            poisson_ratio: poisson_ratio.unwrap_or(object.poisson_ratio),
        },
    })
}

pub(super) fn check_tie(
    c: &Check<'_>,
    key: &str,
    raw: &RawTie,
    young_modulus_pa: f64,
) -> Result<TieOptions, ConfigError> {
    Ok(TieOptions {
        young_modulus_pa,
        compliance_m: c.number(&format!("{key}.compliance_m"), raw.compliance_m, 1e-8, 0.01)?,
        band_m: c.number(&format!("{key}.band_m"), raw.band_m, 1e-5, 0.05)?,
        rim_floor: c.number(&format!("{key}.rim_floor"), raw.rim_floor, 1e-8, 1.0)?,
    })
}
