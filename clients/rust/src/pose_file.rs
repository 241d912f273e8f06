//! Options of both command lines for reading a pose file.

use clap::{Args, ValueEnum};
use plica_trajectory::{OnBadRow, QuaternionOrder, ReadOptions, TimeUnit};

/// How a pose file is read: docs/poses.md.
#[derive(Debug, Args)]
pub struct PoseFileArgs {
    /// Unit of the file's times [default: recognised by a plausible rate]
    #[arg(long, value_enum, value_name = "UNIT", requires = "poses")]
    pub time_unit: Option<TimeUnitName>,
    /// Order of quaternion components in the file [default: xyzw, or as the header names them]
    #[arg(long, value_enum, value_name = "ORDER", requires = "poses")]
    pub quaternion_order: Option<QuaternionOrderName>,
    /// Rows that cannot be played (NaN, tool out of sight, times that repeat or go back) refuse the file, or are left out and counted.
    #[arg(long, value_enum, default_value_t, value_name = "POLICY")]
    pub on_bad_row: OnBadRowName,
}

/// Units of time by name.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum TimeUnitName {
    /// Seconds.
    S,
    /// Milliseconds.
    Ms,
    /// Microseconds.
    Us,
    /// Nanoseconds.
    Ns,
}

/// Orders of quaternion components by name.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum QuaternionOrderName {
    /// w last.
    Xyzw,
    /// w first.
    Wxyz,
}

/// Policies for rows that cannot be played.
#[derive(Debug, Clone, Copy, Default, ValueEnum)]
pub enum OnBadRowName {
    /// The file is refused, with the line.
    #[default]
    Error,
    /// They are left out and counted; the tool stays where it was.
    Skip,
}

impl PoseFileArgs {
    /// The same as options of the reader.
    pub fn options(&self) -> ReadOptions {
        ReadOptions {
            time_unit: self.time_unit.map(|unit| match unit {
                TimeUnitName::S => TimeUnit::Seconds,
                TimeUnitName::Ms => TimeUnit::Milliseconds,
                TimeUnitName::Us => TimeUnit::Microseconds,
                TimeUnitName::Ns => TimeUnit::Nanoseconds,
            }),
            quaternion_order: self.quaternion_order.map(|order| match order {
                QuaternionOrderName::Xyzw => QuaternionOrder::Xyzw,
                QuaternionOrderName::Wxyz => QuaternionOrder::Wxyz,
            }),
            on_bad_row: match self.on_bad_row {
                OnBadRowName::Error => OnBadRow::Error,
                OnBadRowName::Skip => OnBadRow::Skip,
            },
        }
    }
}
