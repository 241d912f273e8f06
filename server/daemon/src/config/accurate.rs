//! The accurate model of a scene and its tie, checked.

use plica_accurate::{Material, MaterialModel, TieOptions};

use super::ConfigError;
use super::checks::Check;
use super::object::Region;
use super::raw::{RawAccurate, RawMaterialModel, RawTie};

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
    /// Whether the material's Young's modulus is the scene's own for this model, not the object's.
    overrides: [bool; 2],
}

impl AccurateConfig {
    /// Material inside a region: what the region says, else what this model says, else what the object says.
    pub fn material_in(&self, region: &Region) -> Material {
        let stiffness = (region.gives_young_modulus || !self.overrides[0]).then_some(region.material.young_modulus_pa);
        let ratio = (region.gives_poisson_ratio || !self.overrides[1]).then_some(region.material.poisson_ratio);
        Material {
            model: self.material.model,
            young_modulus_pa: stiffness.unwrap_or(self.material.young_modulus_pa),
            poisson_ratio: ratio.unwrap_or(self.material.poisson_ratio),
        }
    }
}

pub(super) fn check(
    c: &Check<'_>,
    key: &str,
    raw: &RawAccurate,
    (coarse, object): ([usize; 3], plica_sim::Material),
) -> Result<AccurateConfig, ConfigError> {
    let number = |name: &str, value: Option<f64>, least: f64, most: f64| {
        value.map(|v| c.number(&format!("{key}.{name}"), v, least, most)).transpose()
    };
    let young_modulus_pa = number("young_modulus_pa", raw.young_modulus_pa, 10.0, 1e9)?;
    let poisson_ratio = number("poisson_ratio", raw.poisson_ratio, 0.0, 0.4999)?;
    let divisions = match raw.divisions {
        None => coarse.map(|n| REFINEMENT * n),
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
        overrides: [young_modulus_pa.is_some(), poisson_ratio.is_some()],
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
