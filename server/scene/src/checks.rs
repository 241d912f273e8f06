//! Range checks that answer with file, line, key, allowed range and advice.

use nalgebra::{Point3, Quaternion, UnitQuaternion, Vector3};

use crate::document::Document;
use crate::error::ConfigError;

/// How far the length of a typed quaternion may be from 1.
const UNIT_TOLERANCE: f64 = 1e-2;
/// Largest coordinate of anything in a scene \[m\].
const LARGEST_M: f64 = 1e3;

/// Checks values against a document's lines.
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

    /// `value` if it lies in `[least, most]`.
    pub(crate) fn number(&self, key: &str, value: f64, least: f64, most: f64) -> Result<f64, ConfigError> {
        if value.is_finite() && (least..=most).contains(&value) {
            return Ok(value);
        }
        let problem = format!("{value} is outside the allowed range {least} to {most}");
        Err(self.error(key, problem, format!("choose a value from {least} to {most}")))
    }

    /// A whole number in `[least, most]`.
    pub(crate) fn count(&self, key: &str, value: u32, least: u32, most: u32) -> Result<u32, ConfigError> {
        self.number(key, value.into(), least.into(), most.into()).map(|_| value)
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

    /// Components within 1 km of the origin.
    pub(crate) fn vector(&self, key: &str, value: [f64; 3]) -> Result<Vector3<f64>, ConfigError> {
        for component in value {
            self.number(key, component, -LARGEST_M, LARGEST_M)?;
        }
        Ok(value.into())
    }

    /// A point within 1 km of the origin.
    pub(crate) fn point(&self, key: &str, value: [f64; 3]) -> Result<Point3<f64>, ConfigError> {
        self.vector(key, value).map(Point3::from)
    }

    /// Lower and upper corner of a box with positive extents.
    pub(crate) fn corners(&self, key: &str, min: [f64; 3], max: [f64; 3]) -> Result<[Point3<f64>; 2], ConfigError> {
        let corners = [self.point(&format!("{key}.min_m"), min)?, self.point(&format!("{key}.max_m"), max)?];
        if (0..3).all(|i| min[i] <= max[i]) {
            return Ok(corners);
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
