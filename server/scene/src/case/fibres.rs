//! Directions of fibres: one for all, circles around an axis, or a cell array of the mesh file.

use nalgebra::{Point3, Unit, Vector3};
use plica_geometry::ElementIdx;
use plica_geometry::import::NamedMesh;

use super::raw::{RawFibreAxis, RawFibres};
use super::support;
use crate::checks::Check;
use crate::document::Document;
use crate::error::ConfigError;

/// Shortest direction, as a share of the mesh's diagonal or of 1: below it is rounding.
const LEAST_LENGTH: f64 = 1e-9;

/// Field of directions; one per element, at its centre.
#[derive(Debug, Clone)]
pub(super) struct FibreField {
    /// Its path in the file.
    key: String,
    kind: Kind,
}

#[derive(Debug, Clone)]
enum Kind {
    Constant(Unit<Vector3<f64>>),
    About { axis: Unit<Vector3<f64>>, through: Point3<f64> },
    Array(String),
}

pub(super) fn check(c: &Check<'_>, key: &str, raw: &RawFibres) -> Result<FibreField, ConfigError> {
    let kind = match (raw.direction, raw.about, &raw.array) {
        (Some(direction), None, None) => Kind::Constant(support::direction(c, &format!("{key}.direction"), direction)?),
        (None, Some(RawFibreAxis { axis, through_m }), None) => {
            Kind::About { axis: support::direction(c, &format!("{key}.about.axis"), axis)?, through: through_m.into() }
        }
        (None, None, Some(name)) => Kind::Array(name.clone()),
        _ => {
            let advice = "give exactly one of direction, about and array";
            return Err(c.error(key, "have no single field of directions", advice));
        }
    };
    Ok(FibreField { key: key.to_owned(), kind })
}

impl FibreField {
    /// Direction in an element, of any length but 0.
    pub(super) fn at(
        &self,
        document: &Document,
        mesh: &NamedMesh,
        element: ElementIdx,
    ) -> Result<Vector3<f64>, ConfigError> {
        let centre = mesh.mesh.centre_of(element);
        match &self.kind {
            Kind::Constant(direction) => Ok(direction.into_inner()),
            Kind::About { axis, through } => {
                let around = axis.cross(&(centre - through));
                let [lower, upper] = mesh.mesh.bounds();
                if around.norm() > LEAST_LENGTH * (upper - lower).norm() {
                    return Ok(around);
                }
                let at: [f64; 3] = centre.coords.into();
                let problem = format!("passes through the element around {at:?} m, which has no circle around it");
                Err(document.error(&format!("{}.about", self.key), problem, "move the axis off the centre of elements"))
            }
            Kind::Array(name) => self.of_array(document, mesh, element, name),
        }
    }

    fn of_array(
        &self,
        document: &Document,
        mesh: &NamedMesh,
        element: ElementIdx,
        name: &str,
    ) -> Result<Vector3<f64>, ConfigError> {
        let key = format!("{}.array", self.key);
        let Some(array) = mesh.vectors.iter().find(|array| array.name == name) else {
            let known: Vec<String> = mesh.vectors.iter().map(|array| format!("`{}`", array.name)).collect();
            let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
            let problem = format!("no cell array `{name}` of three components; the mesh has {known}");
            return Err(document.error(&key, problem, "write the directions as a cell array of a .vtu file"));
        };
        let direction = array.values[element.index()];
        if direction.norm() > LEAST_LENGTH && direction.norm().is_finite() {
            return Ok(direction);
        }
        let at: [f64; 3] = mesh.mesh.centre_of(element).coords.into();
        let problem = format!("`{name}` has no direction in the element around {at:?} m: {:?}", direction.as_slice());
        Err(document.error(&key, problem, "give every element of the material a direction"))
    }
}
