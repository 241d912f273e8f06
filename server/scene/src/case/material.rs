//! Materials and regions of a case.

use plica_accurate::{Lame, Material, MaterialModel};
use plica_geometry::select::Selector;

use super::raw::{RawMaterial, RawModel, RawRegion};
use super::select;
use crate::checks::Check;
use crate::error::ConfigError;

/// Range of `lambda_pa` over `mu_pa`: Poisson's ratios from -0.5 to 0.499999.
const LAMBDA_OVER_MU: [f64; 2] = [-0.5, 5e5];

/// Region of another material.
#[derive(Debug, Clone)]
pub(super) struct Region {
    pub(super) selector: Selector,
    pub(super) material: Material,
    /// Its own density [kg/m3], if it has one.
    pub(super) density_kg_per_m3: Option<f64>,
}

pub(super) fn check(c: &Check<'_>, raw: &RawMaterial) -> Result<Material, ConfigError> {
    constants(c, "material", raw)
}

/// Regions; constants that they leave out are those of the base material.
pub(super) fn check_regions(
    c: &Check<'_>,
    raw: &[RawRegion],
    base: &RawMaterial,
    material: Material,
) -> Result<Vec<Region>, ConfigError> {
    let region = |(i, r): (usize, &RawRegion)| {
        let key = format!("regions.{i}");
        let own = RawMaterial {
            model: r.model.unwrap_or(base.model),
            young_modulus_pa: r.young_modulus_pa,
            poisson_ratio: r.poisson_ratio,
            mu_pa: r.mu_pa,
            lambda_pa: r.lambda_pa,
            density_kg_per_m3: r.density_kg_per_m3,
        };
        let keeps_constants = [r.young_modulus_pa, r.poisson_ratio, r.mu_pa, r.lambda_pa] == [None; 4];
        let material = match keeps_constants {
            true => Material { model: model(own.model), ..material },
            false => constants(c, &key, &own)?,
        };
        Ok(Region {
            selector: select::check(c, &format!("{key}.select"), &r.select)?,
            material,
            density_kg_per_m3: r.density_kg_per_m3,
        })
    };
    raw.iter().enumerate().map(region).collect()
}

fn constants(c: &Check<'_>, key: &str, raw: &RawMaterial) -> Result<Material, ConfigError> {
    let model = model(raw.model);
    match (raw.young_modulus_pa, raw.poisson_ratio, raw.mu_pa, raw.lambda_pa) {
        (Some(young), Some(poisson), None, None) => {
            Ok(Material { model, young_modulus_pa: young, poisson_ratio: poisson })
        }
        (None, None, Some(mu_pa), Some(lambda_pa)) => {
            let [least, most] = LAMBDA_OVER_MU.map(|ratio| ratio * mu_pa);
            if !(least..=most).contains(&lambda_pa) {
                let problem = format!("{lambda_pa} is outside the allowed range {least} to {most} for mu_pa = {mu_pa}");
                return Err(c.error(&format!("{key}.lambda_pa"), problem, "lambda_pa / mu_pa is 2 nu / (1 - 2 nu)"));
            }
            Ok(Material::from_lame(model, Lame { lambda_pa, mu_pa }))
        }
        _ => {
            let advice = "give young_modulus_pa and poisson_ratio, or mu_pa and lambda_pa";
            Err(c.error(key, "an isotropic material has two constants that belong together", advice))
        }
    }
}

fn model(raw: RawModel) -> MaterialModel {
    match raw {
        RawModel::Linear => MaterialModel::Linear,
        RawModel::CompressibleNeoHookean => MaterialModel::CompressibleNeoHookean,
        RawModel::StableNeoHookean => MaterialModel::StableNeoHookean,
    }
}
