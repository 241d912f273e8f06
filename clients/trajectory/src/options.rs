//! Options of reading a motion file.

use serde::{Deserialize, Serialize};

use crate::time::TimeUnit;

/// How a motion file is read; what is left out is recognised, or is the format's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ReadOptions {
    /// Unit of the times; None: recognised by a plausible rate.
    pub time_unit: Option<TimeUnit>,
    /// Order of quaternion components; None: `xyzw`, unless a header names the columns in another order.
    pub quaternion_order: Option<QuaternionOrder>,
    /// What becomes of rows that cannot be played.
    pub on_bad_row: OnBadRow,
}

/// Order of the four components of a quaternion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum QuaternionOrder {
    /// `w` last: CSV and TUM files.
    Xyzw,
    /// `w` first: many tracking systems.
    Wxyz,
}

/// What becomes of a row that cannot be played.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnBadRow {
    /// The file is refused, with the line.
    #[default]
    Error,
    /// The row is left out and counted; the tool stays where it was.
    Skip,
}

impl QuaternionOrder {
    /// The components as `xyzw`.
    pub(crate) fn to_xyzw(self, q: [f64; 4]) -> [f64; 4] {
        match self {
            Self::Xyzw => q,
            Self::Wxyz => [q[1], q[2], q[3], q[0]],
        }
    }
}
