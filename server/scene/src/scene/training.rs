//! `[objects.<name>.training]`, checked.

use nalgebra::{Point3, Vector3};
use plica_sim::ToolDescription;
use plica_training::{Approach, DriveOptions, FeatureScales, PressRanges};
use plica_trajectory::{OnBadRow, QuaternionOrder, ReadOptions, TimeUnit};

use super::raw::{
    RawAction, RawApproach, RawApproachName, RawBox, RawDrive, RawInteractionSampling, RawOnBadRow, RawOutside,
    RawQuaternionOrder, RawRecorded, RawTimeUnit, RawTraining,
};
use crate::checks::Check;
use crate::error::ConfigError;

/// Least length of a direction.
const SHORTEST_DIRECTION: f64 = 1e-6;

/// Interactions and sampling of `plicad train`.
#[derive(Debug, Clone)]
pub struct TrainingConfig {
    /// Tool that interacts, by index; `None` in a scene without tools.
    pub tool: Option<usize>,
    /// Interactions.
    pub examples: u32,
    /// Seed of the interactions.
    pub seed: u64,
    /// Candidates drawn for each interaction that farthest-point sampling keeps; 1: all candidates are kept.
    pub candidates_per_example: u32,
    /// Scales of the features of farthest-point sampling.
    pub features: FeatureScales,
    /// Ranges of drawn interactions.
    pub ranges: PressRanges,
    /// A recorded motion in place of drawn interactions.
    pub recorded: Option<RecordedConfig>,
    /// Stamp axis, and its replacement.
    pub stamp_axes: [Vector3<f64>; 2],
    /// Drive of the real-time model to a pose.
    pub drive: DriveOptions,
    /// Interactions of an evaluation in the trained region.
    pub evaluation_examples: u32,
    /// Seed of an evaluation.
    pub evaluation_seed: u64,
    /// Sets outside of the trained ranges.
    pub outside: Vec<OutsideConfig>,
}

/// A recorded motion.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordedConfig {
    /// Path as typed, relative to the scene file.
    pub file: String,
    /// Whether it is mapped into the workspace above the object.
    pub fit: bool,
    /// How the file is read.
    pub read: ReadOptions,
}

/// A set of interactions outside of the trained ranges.
#[derive(Debug, Clone)]
pub struct OutsideConfig {
    /// Kind of its examples.
    pub name: String,
    /// Suction instead of a press.
    pub lifts: bool,
    /// Interactions.
    pub examples: u32,
    /// Ranges of the interactions.
    pub ranges: PressRanges,
}

pub(super) fn check(
    c: &Check<'_>,
    key: &str,
    raw: &RawTraining,
    tools: &[ToolDescription],
) -> Result<TrainingConfig, ConfigError> {
    let at = |name: &str| format!("{key}.{name}");
    let ranges = PressRanges {
        region: check_boxes(c, &at("contact_regions"), &raw.contact_regions)?,
        approach: check_approach(c, &at("approach"), &raw.approach)?,
        depth_share: rising(c, &at("depth_share"), raw.depth_share)?,
        drag_m: rising(c, &at("drag_m"), raw.drag_m)?,
        drag_share: raw.drag_share,
    };
    let [contact_m, motion_m] = raw.feature_scales_m;
    let evaluation = &raw.evaluation;
    if evaluation.seed == raw.seed {
        let problem = format!("{} is the seed of training as well", raw.seed);
        return Err(c.error(
            &at("evaluation.seed"),
            problem,
            "choose another one, since interactions that were trained on show no error of unseen ones",
        ));
    }
    let outside = evaluation.outside.iter().enumerate();
    let outside = outside.map(|(i, set)| check_outside(c, &at(&format!("evaluation.outside.{i}")), set, &ranges));
    Ok(TrainingConfig {
        tool: check_tool(c, &at("tool"), raw.tool.as_deref(), tools)?,
        examples: raw.examples,
        seed: raw.seed,
        candidates_per_example: match raw.sampling {
            RawInteractionSampling::Random => 1,
            RawInteractionSampling::FarthestPoint => raw.candidates_per_example,
        },
        features: FeatureScales { contact_m, motion_m },
        recorded: raw.recorded.as_ref().map(recorded),
        stamp_axes: [
            direction(c, &at("stamp_axes"), raw.stamp_axes[0])?,
            direction(c, &at("stamp_axes"), raw.stamp_axes[1])?,
        ],
        drive: drive(&raw.drive),
        evaluation_examples: evaluation.examples,
        evaluation_seed: evaluation.seed,
        outside: outside.collect::<Result<_, _>>()?,
        ranges,
    })
}

fn recorded(raw: &RawRecorded) -> RecordedConfig {
    let time_unit = raw.time_unit.map(|unit| match unit {
        RawTimeUnit::Seconds => TimeUnit::Seconds,
        RawTimeUnit::Milliseconds => TimeUnit::Milliseconds,
        RawTimeUnit::Microseconds => TimeUnit::Microseconds,
        RawTimeUnit::Nanoseconds => TimeUnit::Nanoseconds,
    });
    let quaternion_order = raw.quaternion_order.map(|order| match order {
        RawQuaternionOrder::Xyzw => QuaternionOrder::Xyzw,
        RawQuaternionOrder::Wxyz => QuaternionOrder::Wxyz,
    });
    let on_bad_row = match raw.on_bad_row {
        RawOnBadRow::Error => OnBadRow::Error,
        RawOnBadRow::Skip => OnBadRow::Skip,
    };
    let read = ReadOptions { time_unit, quaternion_order, on_bad_row };
    RecordedConfig { file: raw.file.0.clone(), fit: raw.fit, read }
}

fn check_tool(
    c: &Check<'_>,
    key: &str,
    name: Option<&str>,
    tools: &[ToolDescription],
) -> Result<Option<usize>, ConfigError> {
    let Some(name) = name else { return Ok((!tools.is_empty()).then_some(0)) };
    tools.iter().position(|t| t.name == name).map(Some).ok_or_else(|| {
        let names: Vec<_> = tools.iter().map(|t| t.name.as_str()).collect();
        c.error(key, format!("there is no tool `{name}`"), format!("name one of: {}", names.join(", ")))
    })
}

fn check_outside(
    c: &Check<'_>,
    key: &str,
    raw: &RawOutside,
    training: &PressRanges,
) -> Result<OutsideConfig, ConfigError> {
    let at = |name: &str| format!("{key}.{name}");
    c.name(&at("name"), &raw.name)?;
    let lifts = raw.action == RawAction::Lift;
    if lifts {
        c.absent(&at("drag_m"), &raw.drag_m, "action = \"lift\"")?;
        c.absent(&at("drag_share"), &raw.drag_share, "action = \"lift\"")?;
    }
    let boxes = raw.contact_regions.as_ref().map(|b| check_boxes(c, &at("contact_regions"), b));
    let approach = raw.approach.as_ref().map(|a| check_approach(c, &at("approach"), a));
    let depth = raw.depth_share.map(|d| rising(c, &at("depth_share"), d));
    let drag = raw.drag_m.map(|d| rising(c, &at("drag_m"), d));
    Ok(OutsideConfig {
        name: raw.name.clone(),
        lifts,
        examples: raw.examples,
        ranges: PressRanges {
            region: boxes.transpose()?.unwrap_or_else(|| training.region.clone()),
            approach: approach.transpose()?.unwrap_or(training.approach),
            depth_share: depth.transpose()?.unwrap_or(training.depth_share),
            drag_m: drag.transpose()?.unwrap_or(training.drag_m),
            drag_share: raw.drag_share.unwrap_or(training.drag_share),
        },
    })
}

fn check_boxes(c: &Check<'_>, key: &str, raw: &[RawBox]) -> Result<Vec<[Point3<f64>; 2]>, ConfigError> {
    let boxes = raw.iter().enumerate();
    boxes.map(|(i, b)| c.corners(&format!("{key}.{i}"), b.min_m, b.max_m)).collect()
}

fn check_approach(c: &Check<'_>, key: &str, raw: &RawApproach) -> Result<Approach, ConfigError> {
    Ok(match raw {
        RawApproach::Named(RawApproachName::Normal) => Approach::Normal,
        RawApproach::Named(RawApproachName::Vertical) => Approach::Along(Vector3::new(0.0, 0.0, -1.0)),
        RawApproach::Direction(towards) => Approach::Along(direction(c, key, *towards)?),
    })
}

fn drive(raw: &RawDrive) -> DriveOptions {
    DriveOptions {
        speed_m_per_s: raw.speed_m_per_s,
        mass_damping_per_s: raw.mass_damping_per_s,
        settled_m: raw.settled_m,
        window_s: raw.window_s,
        patience_s: raw.patience_s,
        tolerated_m: raw.tolerated_m,
    }
}

/// Least and largest value, in this order.
fn rising(c: &Check<'_>, key: &str, value: [f64; 2]) -> Result<[f64; 2], ConfigError> {
    if value[0] <= value[1] {
        return Ok(value);
    }
    Err(c.error(key, format!("{value:?} falls"), "give the smaller number first"))
}

fn direction(c: &Check<'_>, key: &str, value: [f64; 3]) -> Result<Vector3<f64>, ConfigError> {
    Vector3::from(value).try_normalize(SHORTEST_DIRECTION).ok_or_else(|| {
        c.error(key, format!("{value:?} has no direction; its length must be 1e-6 or more"), "down is [0, 0, -1]")
    })
}
