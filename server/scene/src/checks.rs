//! Checks of relations between keys, with errors that carry file, line, key and advice. Ranges are checked by `ranges`.

use nalgebra::{Point3, Quaternion, UnitQuaternion};

use crate::document::Document;
use crate::error::ConfigError;

/// Tolerance of a typed quaternion's length around 1.
const UNIT_TOLERANCE: f64 = 1e-2;

/// Checks of a document, with errors at its lines.
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

    /// Value of a key that another key requires.
    pub(crate) fn required<T>(&self, key: &str, value: Option<T>, because: &str) -> Result<T, ConfigError> {
        value.ok_or_else(|| self.error(key, format!("is missing: {because} needs it"), "add the key"))
    }

    /// Refuses a key that has no meaning with another one.
    pub(crate) fn absent<T>(&self, key: &str, value: &Option<T>, because: &str) -> Result<(), ConfigError> {
        match value {
            None => Ok(()),
            Some(_) => Err(self.error(key, format!("has no meaning with {because}"), "remove the key")),
        }
    }

    /// Lower and upper corner of a box; refuses negative extents.
    pub(crate) fn corners(&self, key: &str, min: [f64; 3], max: [f64; 3]) -> Result<[Point3<f64>; 2], ConfigError> {
        if (0..3).all(|i| min[i] <= max[i]) {
            return Ok([min.into(), max.into()]);
        }
        let problem = format!("{max:?} is below min_m {min:?} in some component");
        Err(self.error(&format!("{key}.max_m"), problem, "swap the components so that min_m <= max_m"))
    }

    /// Normalises a quaternion; refuses a length more than 1e-2 from 1.
    pub(crate) fn rotation(&self, key: &str, xyzw: [f64; 4]) -> Result<UnitQuaternion<f64>, ConfigError> {
        let q = Quaternion::new(xyzw[3], xyzw[0], xyzw[1], xyzw[2]);
        let norm = q.norm();
        if norm.is_finite() && (norm - 1.0).abs() <= UNIT_TOLERANCE {
            return Ok(UnitQuaternion::from_quaternion(q));
        }
        let problem = format!("the quaternion has length {norm:.4}; the allowed range is 0.99 to 1.01");
        Err(self.error(key, problem, "give x, y, z, w of a unit quaternion; no rotation is [0, 0, 0, 1]"))
    }

    /// Refuses a name that cannot be part of a key on the bus.
    pub(crate) fn name(&self, key: &str, name: &str) -> Result<(), ConfigError> {
        plica_protocol::keys::check_name(name)
            .map_err(|e| self.error(key, e.to_string(), "rename it, since it becomes part of a key on the bus"))
    }
}
