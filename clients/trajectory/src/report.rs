//! What a motion file held.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use crate::options::QuaternionOrder;
use crate::time::TimeUnit;

/// Kinds of rows that cannot be played.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum BadRow {
    /// Columns missing, or something that is no number.
    Unreadable,
    /// An empty column.
    Empty,
    /// NaN or infinity.
    NotFinite,
    /// The tracker did not see the tool: a quaternion of zeros, or the origin in the midst of a motion elsewhere.
    Lost,
    /// A quaternion that is not of unit length, a position beyond all bounds.
    Refused,
    /// A second pose of a tool at a time.
    Duplicate,
    /// A time before that of the row above.
    OutOfOrder,
}

impl BadRow {
    fn words(self) -> &'static str {
        match self {
            Self::Unreadable => "unreadable",
            Self::Empty => "with an empty column",
            Self::NotFinite => "not finite",
            Self::Lost => "without sight of the tool",
            Self::Refused => "refused (quaternion or position)",
            Self::Duplicate => "at a time that the tool had already",
            Self::OutOfOrder => "out of order",
        }
    }
}

/// What a motion file held, for summaries.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MotionReport {
    /// Rows, comments and header not counted.
    pub rows: u64,
    /// Poses that are played.
    pub poses: u64,
    /// Unit of the file's times.
    pub time_unit: TimeUnit,
    /// Whether neither an option nor the header said it.
    pub time_unit_recognised: bool,
    /// The time that plays at 0, in the file's unit.
    pub first_time: f64,
    /// From the first pose to the last one \[s\].
    pub duration_s: f64,
    /// Poses of a tool per second, in the median; null for a single pose.
    pub rate_hz: Option<f64>,
    /// Steps of more than ten medians and a tenth of a second, through which the tool is held.
    pub gaps: u64,
    /// The longest step between two poses of a tool \[s\].
    pub longest_step_s: f64,
    /// Order of quaternion components in the file.
    pub quaternion_order: QuaternionOrder,
    /// Whether neither an option nor the header said it.
    pub quaternion_order_assumed: bool,
    /// Rows left out, by kind.
    pub skipped: BTreeMap<BadRow, u64>,
}

impl MotionReport {
    /// Rows left out, of all kinds.
    pub fn n_skipped(&self) -> u64 {
        self.skipped.values().sum()
    }
}

impl fmt::Display for MotionReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} poses over {:.3} s", self.poses, self.duration_s)?;
        if let Some(rate_hz) = self.rate_hz {
            write!(f, ", {rate_hz:.0} Hz")?;
        }
        let unit = self.time_unit.name();
        write!(f, "; times in {unit}{}", if self.time_unit_recognised { " (recognised by their rate)" } else { "" })?;
        if self.first_time != 0.0 {
            write!(f, ", {} {unit} plays at 0", self.first_time)?;
        }
        if self.gaps > 0 {
            write!(f, "; {} gaps in which the tool is held, the longest {:.3} s", self.gaps, self.longest_step_s)?;
        }
        if !self.skipped.is_empty() {
            let kinds: Vec<_> = self.skipped.iter().map(|(kind, n)| format!("{n} {}", kind.words())).collect();
            write!(f, "; left out of {} rows: {}", self.rows, kinds.join(", "))?;
        }
        Ok(())
    }
}
