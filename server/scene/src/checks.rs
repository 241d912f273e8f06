//! Relations between keys, checked with answers that carry file, line, key and advice. Ranges are checked by `ranges`.

use nalgebra::{Point3, Quaternion, UnitQuaternion};

use crate::document::Document;
use crate::error::ConfigError;

/// How far the length of a typed quaternion may be from 1.
const UNIT_TOLERANCE: f64 = 1e-2;

/// Checks of values, with errors at the document's lines.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Check<'a> {
    document: &'a Document,
}

impl<'a> Check<'a> {
    pub(crate) fn new(document: &'a Document) -> Self {
        Self { document }
    }

    pub(crate) fn document(&self) -> &'a Document {
        self.document
    }

    pub(crate) fn error(&self, key: &str, problem: impl Into<String>, advice: impl Into<String>) -> ConfigError {
        self.document.error(key, problem, advice)
    }

    /// A key that its neighbours make necessary.
    pub(crate) fn required<T>(&self, key: &str, value: Option<T>, because: &str) -> Result<T, ConfigError> {
        value.ok_or_else(|| self.error(key, format!("is missing: {because} needs it"), "add the key"))
    }

    /// A key that has no meaning beside its neighbours.
    pub(crate) fn absent<T>(&self, key: &str, value: &Option<T>, because: &str) -> Result<(), ConfigError> {
        match value {
            None => Ok(()),
            Some(_) => Err(self.error(key, format!("has no meaning with {because}"), "remove the key")),
        }
    }

    /// Lower and upper corner of a box with positive extents.
    pub(crate) fn corners(&self, key: &str, min: [f64; 3], max: [f64; 3]) -> Result<[Point3<f64>; 2], ConfigError> {
        if (0..3).all(|i| min[i] <= max[i]) {
            return Ok([min.into(), max.into()]);
        }
        let problem = format!("{max:?} is below min_m {min:?} in some component");
        Err(self.error(&format!("{key}.max_m"), problem, "swap the components so that min_m <= max_m"))
    }

    /// A quaternion of unit length within 1e-2, normalised.
    pub(crate) fn rotation(&self, key: &str, xyzw: [f64; 4]) -> Result<UnitQuaternion<f64>, ConfigError> {
        let q = Quaternion::new(xyzw[3], xyzw[0], xyzw[1], xyzw[2]);
        let norm = q.norm();
        if norm.is_finite() && (norm - 1.0).abs() <= UNIT_TOLERANCE {
            return Ok(UnitQuaternion::from_quaternion(q));
        }
        let problem = format!("the quaternion has length {norm:.4}; the allowed range is 0.99 to 1.01");
        Err(self.error(key, problem, "give x, y, z, w of a unit quaternion; no rotation is [0, 0, 0, 1]"))
    }

    /// A name that can be part of a key on the bus.
    pub(crate) fn name(&self, key: &str, name: &str) -> Result<(), ConfigError> {
        plica_protocol::keys::check_name(name)
            .map_err(|e| self.error(key, e.to_string(), "rename it: it becomes part of a key on the bus"))
    }
}
