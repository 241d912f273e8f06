//! Device poses, input: `PLPS`, 96 bytes, or the same as JSON.
//!
//! Both forms pass the same gate ([`Pose::checked_for`]): finite numbers, a position within [`MAX_POSITION_M`] after the tool's
//! `position_scale`, an orientation of unit length within [`UNIT_TOLERANCE`], which is then normalised.

use serde::{Deserialize, Serialize};

use crate::bytes::{Layout, finite, open_exact};
use crate::error::DecodeError;
use crate::keys::check_name;
use crate::object::from_object;

/// First bytes of a pose.
pub const MAGIC: [u8; 4] = *b"PLPS";
/// Length of a binary pose in bytes.
pub const BYTES: usize = 96;
/// Largest accepted distance from the origin in metres.
pub const MAX_POSITION_M: f64 = 1e3;
/// Tolerance of an orientation's length around 1.
pub const UNIT_TOLERANCE: f64 = 1e-2;

const FLAG_VALID: u32 = 1;

/// Pose of a tool as its tracker measures it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Rises by one or more with each pose of a source; 0 means that the source does not number its poses.
    pub sequence: u64,
    /// Time of the measurement on the source's own clock, in nanoseconds; 0 means unknown.
    pub source_time_ns: u64,
    /// Random number of a started publisher; sequences are compared within one source.
    pub source_id: u32,
    /// False while the tracker does not see the tool.
    pub valid: bool,
    /// Position in the tracker's frame, in metres after the tool's `position_scale`.
    pub position_m: [f64; 3],
    /// Unit quaternion `x y z w`.
    pub orientation_xyzw: [f64; 4],
    /// One bit per button.
    pub buttons: u32,
    /// Analogue grip, 0 open to 1 closed by convention.
    pub grip: f32,
}

impl Default for Pose {
    fn default() -> Self {
        Self {
            sequence: 0,
            source_time_ns: 0,
            source_id: 0,
            valid: true,
            position_m: [0.0; 3],
            orientation_xyzw: [0.0, 0.0, 0.0, 1.0],
            buttons: 0,
            grip: 0.0,
        }
    }
}

impl Pose {
    /// Encodes 96 bytes, unchecked: the reader applies the gate.
    pub fn encode(&self) -> [u8; BYTES] {
        Layout::new(MAGIC)
            .u64(self.sequence)
            .u64(self.source_time_ns)
            .u32(self.source_id)
            .u32(if self.valid { FLAG_VALID } else { 0 })
            .f64s(self.position_m)
            .f64s(self.orientation_xyzw)
            .u32(self.buttons)
            .f32(self.grip)
            .finish()
    }

    /// [`Self::decode_for`] a tracker that measures in metres.
    pub fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        Self::decode_for(bytes, 1.0)
    }

    /// Decodes 96 bytes and applies the gate. Unknown flag bits are ignored.
    pub fn decode_for(bytes: &[u8], position_scale: f64) -> Result<Self, DecodeError> {
        let mut fields = open_exact(bytes, MAGIC, BYTES)?;
        Self {
            sequence: fields.u64(),
            source_time_ns: fields.u64(),
            source_id: fields.u32(),
            valid: fields.u32() & FLAG_VALID != 0,
            position_m: fields.f64s(),
            orientation_xyzw: fields.f64s(),
            buttons: fields.u32(),
            grip: fields.f32(),
        }
        .checked_for(position_scale)
    }

    /// [`Self::decode_json_for`] a tracker that measures in metres.
    pub fn decode_json(bytes: &[u8]) -> Result<Self, DecodeError> {
        Self::decode_json_for(bytes, 1.0)
    }

    /// Decodes the JSON form and applies the gate.
    pub fn decode_json_for(bytes: &[u8], position_scale: f64) -> Result<Self, DecodeError> {
        let json: JsonPose = from_object(bytes).map_err(|error| DecodeError::Json(error.to_string()))?;
        json.to_pose(position_scale)
    }

    /// Encodes the JSON form with all fields.
    pub fn to_json(&self) -> String {
        serde_json::to_string(&JsonPose::from(self)).expect("numbers always serialise")
    }

    /// [`Self::checked_for`] a tracker that measures in metres.
    pub fn checked(self) -> Result<Self, DecodeError> {
        self.checked_for(1.0)
    }

    /// The gate: the pose with a normalised orientation, or the reason of its refusal.
    ///
    /// ```text
    /// position_scale |p| <= 1e3 m
    /// q <- q / |q|   if | |q| - 1 | <= 1e-2
    /// ```
    /// The position is not scaled. A quaternion of unit length to rounding keeps its bits, so that a second gate changes nothing.
    pub fn checked_for(mut self, position_scale: f64) -> Result<Self, DecodeError> {
        finite("position", &self.position_m)?;
        finite("orientation", &self.orientation_xyzw)?;
        finite("grip", &[f64::from(self.grip)])?;
        let distance_m = position_scale * norm(&self.position_m);
        if distance_m > MAX_POSITION_M {
            return Err(DecodeError::OutOfRange { field: "position", value: distance_m, limit: MAX_POSITION_M });
        }
        self.orientation_xyzw = normalised(self.orientation_xyzw)?;
        Ok(self)
    }
}

/// The gate of [`Pose::checked`] for a pose that did not arrive over the bus: returns the normalised orientation `xyzw`.
///
/// # Errors
/// A sentence: the tool's name is not a name, or the pose is refused.
pub fn gate(tool: Option<&str>, position_m: [f64; 3], orientation_xyzw: [f64; 4]) -> Result<[f64; 4], String> {
    tool.map_or(Ok(()), check_name).map_err(|error| error.to_string())?;
    let pose = Pose { position_m, orientation_xyzw, ..Pose::default() }.checked();
    pose.map(|pose| pose.orientation_xyzw).map_err(|error| error.to_string())
}

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum::<f64>().sqrt()
}

fn normalised(q: [f64; 4]) -> Result<[f64; 4], DecodeError> {
    let norm = norm(&q);
    if (norm - 1.0).abs() > UNIT_TOLERANCE {
        return Err(DecodeError::NotUnit { norm });
    }
    let unit_to_rounding = (norm - 1.0).abs() <= 4.0 * f64::EPSILON;
    Ok(if unit_to_rounding { q } else { q.map(|component| component / norm) })
}

/// The JSON form of a pose; only `position` and `orientation` are required.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JsonPose {
    /// See [`Pose::sequence`].
    #[serde(default)]
    pub sequence: u64,
    /// See [`Pose::source_time_ns`].
    #[serde(default)]
    pub source_time_ns: u64,
    /// See [`Pose::source_id`].
    #[serde(default)]
    pub source_id: u32,
    /// See [`Pose::valid`]; true if left out.
    #[serde(default = "yes")]
    pub valid: bool,
    /// See [`Pose::position_m`].
    pub position: [f64; 3],
    /// Quaternion `x y z w`.
    pub orientation: [f64; 4],
    /// See [`Pose::buttons`].
    #[serde(default)]
    pub buttons: u32,
    /// See [`Pose::grip`].
    #[serde(default)]
    pub grip: f32,
}

pub(crate) fn yes() -> bool {
    true
}

impl JsonPose {
    /// Applies the gate.
    pub fn to_pose(&self, position_scale: f64) -> Result<Pose, DecodeError> {
        Pose {
            sequence: self.sequence,
            source_time_ns: self.source_time_ns,
            source_id: self.source_id,
            valid: self.valid,
            position_m: self.position,
            orientation_xyzw: self.orientation,
            buttons: self.buttons,
            grip: self.grip,
        }
        .checked_for(position_scale)
    }
}

impl From<&Pose> for JsonPose {
    fn from(pose: &Pose) -> Self {
        Self {
            sequence: pose.sequence,
            source_time_ns: pose.source_time_ns,
            source_id: pose.source_id,
            valid: pose.valid,
            position: pose.position_m,
            orientation: pose.orientation_xyzw,
            buttons: pose.buttons,
            grip: pose.grip,
        }
    }
}
