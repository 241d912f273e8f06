//! Materials of an object and of its regions, each for both models, checked and resolved.

use nalgebra::Point3;
use plica_accurate::Material as AccurateMaterial;
use plica_sim::Material;

use super::raw::{RawMaterial, RawRegion};
use crate::checks::Check;
use crate::error::ConfigError;

/// Box of another material, for both models.
#[derive(Debug, Clone)]
pub struct Region {
    /// Name, for messages.
    pub name: String,
    /// Lower and upper corner \[m\].
    pub corners: [Point3<f64>; 2],
    /// Material of coarse hexahedra whose centre lies inside.
    pub coarse: Material,
    /// Material of accurate hexahedra whose centre lies inside.
    pub accurate: AccurateMaterial,
}

pub(super) fn coarse(raw: &RawMaterial) -> Material {
    Material {
        young_modulus_pa: raw.young_modulus_pa,
        poisson_ratio: raw.poisson_ratio,
        density_kg_per_m3: raw.density_kg_per_m3,
    }
}

/// Regions in the order of the file. Constants that a region leaves out are those of the model around it.
pub(super) fn check_regions(
    c: &Check<'_>,
    key: &str,
    raw: &[RawRegion],
    coarse: Material,
    accurate: AccurateMaterial,
) -> Result<Vec<Region>, ConfigError> {
    let region = |(i, r): (usize, &RawRegion)| {
        let key = format!("{key}.{i}");
        Ok(Region {
            name: r.name.clone(),
            corners: c.corners(&key, r.min_m, r.max_m)?,
            coarse: Material {
                young_modulus_pa: r.young_modulus_pa.unwrap_or(coarse.young_modulus_pa),
                poisson_ratio: r.poisson_ratio.unwrap_or(coarse.poisson_ratio),
                density_kg_per_m3: r.density_kg_per_m3.unwrap_or(coarse.density_kg_per_m3),
            },
            accurate: AccurateMaterial {
                model: accurate.model,
                young_modulus_pa: r.young_modulus_pa.unwrap_or(accurate.young_modulus_pa),
                poisson_ratio: r.poisson_ratio.unwrap_or(accurate.poisson_ratio),
            },
        })
    };
    raw.iter().enumerate().map(region).collect()
}
