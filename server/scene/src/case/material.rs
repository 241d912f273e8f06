//! Materials and regions of a case.

use nalgebra::Vector3;
use plica_accurate::{Fibres, Lame, Material, MaterialModel};
use plica_geometry::ElementIdx;
use plica_geometry::import::NamedMesh;
use plica_geometry::select::Selector;

use super::fibres::{self, FibreField};
use super::raw::{RawMaterial, RawModel, RawRegion};
use super::select;
use crate::checks::Check;
use crate::document::Document;
use crate::error::ConfigError;

/// Range of `lambda_pa` over `mu_pa`: Poisson's ratios from -0.5 to 0.499999.
const LAMBDA_OVER_MU: [f64; 2] = [-0.5, 5e5];

/// Checked material; its fibres have no direction before the mesh is known.
#[derive(Debug, Clone)]
pub(super) struct MaterialSpec {
    /// The material, with fibres along x.
    pub(super) material: Material,
    fibres: Option<FibreField>,
}

/// Region of another material.
#[derive(Debug, Clone)]
pub(super) struct Region {
    pub(super) selector: Selector,
    pub(super) material: MaterialSpec,
    /// Its own density [kg/m3], if it has one.
    pub(super) density_kg_per_m3: Option<f64>,
}

impl MaterialSpec {
    /// The material of an element of the mesh.
    pub(super) fn at(
        &self,
        document: &Document,
        mesh: &NamedMesh,
        element: ElementIdx,
    ) -> Result<Material, ConfigError> {
        match (&self.fibres, self.material.model) {
            (Some(field), MaterialModel::FibreReinforced(fibres)) => {
                let direction = field.at(document, mesh, element)?;
                Ok(Material { model: MaterialModel::FibreReinforced(Fibres { direction, ..fibres }), ..self.material })
            }
            _ => Ok(self.material),
        }
    }
}

pub(super) fn check(c: &Check<'_>, raw: &RawMaterial) -> Result<MaterialSpec, ConfigError> {
    own(c, "material", raw)
}

/// Regions; constants that they leave out are those of the base material.
pub(super) fn check_regions(
    c: &Check<'_>,
    raw: &[RawRegion],
    base: &RawMaterial,
    material: &MaterialSpec,
) -> Result<Vec<Region>, ConfigError> {
    let region = |(i, r): (usize, &RawRegion)| {
        let key = format!("regions.{i}");
        let model = r.model.unwrap_or(base.model);
        // What a law has besides its constants comes from the base material where that has the same law.
        let inherits = model == base.model;
        let keeps_constants = [r.young_modulus_pa, r.poisson_ratio, r.mu_pa, r.lambda_pa] == [None; 4];
        let constants = if keeps_constants {
            [base.young_modulus_pa, base.poisson_ratio, base.mu_pa, base.lambda_pa]
        } else {
            [r.young_modulus_pa, r.poisson_ratio, r.mu_pa, r.lambda_pa]
        };
        let [young_modulus_pa, poisson_ratio, mu_pa, lambda_pa] = constants;
        let raw = RawMaterial {
            model,
            young_modulus_pa,
            poisson_ratio,
            mu_pa,
            lambda_pa,
            exponent: r.exponent.or(base.exponent.filter(|_| inherits)),
            fibres: r.fibres.clone().or(base.fibres.clone().filter(|_| inherits)),
            density_kg_per_m3: r.density_kg_per_m3,
        };
        let is_base = inherits && keeps_constants && r.exponent.is_none() && r.fibres.is_none();
        Ok(Region {
            selector: select::check(c, &format!("{key}.select"), &r.select)?,
            material: if is_base { material.clone() } else { own(c, &key, &raw)? },
            density_kg_per_m3: r.density_kg_per_m3,
        })
    };
    raw.iter().enumerate().map(region).collect()
}

fn own(c: &Check<'_>, key: &str, raw: &RawMaterial) -> Result<MaterialSpec, ConfigError> {
    let (exponent_key, fibres_key) = (format!("{key}.exponent"), format!("{key}.fibres"));
    if raw.model != RawModel::Exponential {
        c.absent(&exponent_key, &raw.exponent, "another model than \"exponential\"")?;
    }
    if raw.model != RawModel::FibreReinforced {
        c.absent(&fibres_key, &raw.fibres, "another model than \"fibre_reinforced\"")?;
    }
    let model = match raw.model {
        RawModel::Linear => MaterialModel::Linear,
        RawModel::CompressibleNeoHookean => MaterialModel::CompressibleNeoHookean,
        RawModel::StableNeoHookean => MaterialModel::StableNeoHookean,
        RawModel::Exponential => {
            MaterialModel::Exponential { exponent: c.required(&exponent_key, raw.exponent, "model = \"exponential\"")? }
        }
        RawModel::FibreReinforced => return reinforced(c, key, raw),
    };
    Ok(MaterialSpec { material: constants(c, key, raw, model)?, fibres: None })
}

fn reinforced(c: &Check<'_>, key: &str, raw: &RawMaterial) -> Result<MaterialSpec, ConfigError> {
    let because = "model = \"fibre_reinforced\"";
    let fibres_key = format!("{key}.fibres");
    let fibres = c.required(&fibres_key, raw.fibres.as_ref(), because)?;
    c.absent(&format!("{key}.mu_pa"), &raw.mu_pa, because)?;
    c.absent(&format!("{key}.lambda_pa"), &raw.lambda_pa, because)?;
    let along = Fibres { young_modulus_pa: fibres.fibre_modulus_pa, direction: Vector3::x() };
    let material = constants(c, key, raw, MaterialModel::FibreReinforced(along))?;
    if fibres.fibre_modulus_pa < material.young_modulus_pa {
        let across = material.young_modulus_pa;
        let problem =
            format!("{} is below young_modulus_pa = {across}, the modulus across the fibres", fibres.fibre_modulus_pa);
        let advice = "fibres stiffen: give the larger modulus along them";
        return Err(c.error(&format!("{fibres_key}.fibre_modulus_pa"), problem, advice));
    }
    Ok(MaterialSpec { material, fibres: Some(fibres::check(c, &fibres_key, fibres)?) })
}

fn constants(c: &Check<'_>, key: &str, raw: &RawMaterial, model: MaterialModel) -> Result<Material, ConfigError> {
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
