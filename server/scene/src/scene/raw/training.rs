//! Accurate model and training of a scene, as typed.

#![allow(rustdoc::broken_intra_doc_links, reason = "units in brackets; the schema shows this text as it is")]

use plica_training::{DriveOptions, FeatureScales};
use schemars::JsonSchema;
use serde::Deserialize;

use super::{LARGEST_M, RawBox, RawFile};

/// Most interactions of a set.
const MAX_EXAMPLES: u32 = 100_000;

/// Quasi-static model of the examples. Supports and regions are the object's.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawAccurate {
    /// Hexahedra along x, y, z; three times the coarse ones where left out.
    #[schemars(inner(range(min = 1, max = 1000)))]
    pub divisions: Option<[u32; 3]>,
    /// Length of the last hexahedron over that of the first, along x, y, z; 1 where left out.
    #[schemars(inner(range(min = 1e-3, max = 1e3)))]
    pub grading: Option<[f64; 3]>,
    /// Material law.
    pub model: RawMaterialModel,
    /// Young's modulus in place of the object's [Pa].
    #[schemars(range(min = 10.0, max = 1e9))]
    pub young_modulus_pa: Option<f64>,
    /// Poisson's ratio in place of the object's [-].
    #[schemars(range(min = 0.0, max = 0.4999))]
    pub poisson_ratio: Option<f64>,
}

/// Material laws of the accurate model, each with mean dilatation.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawMaterialModel {
    /// Finite everywhere, inverted elements included.
    #[default]
    StableNeoHookean,
    /// Infinite where volume vanishes.
    CompressibleNeoHookean,
    /// Small strains; not invariant under rotations.
    Linear,
}

/// Tie of the accurate skin to the imprint of the tool on the coarse skin.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawTie {
    /// Stretch of the tie under a pressure as large as Young's modulus [m].
    #[schemars(range(min = 1e-8, max = 0.01))]
    pub compliance_m: f64,
    /// Distance to the tool below which skin vertices are tied [m].
    #[schemars(range(min = 1e-5, max = 0.05))]
    pub band_m: f64,
    /// Share of the stiffness left at the end of the band, with exponential decay up to there [-].
    #[schemars(range(min = 1e-8, max = 1.0))]
    pub rim_floor: f64,
}

/// Interactions and sampling of `plicad train`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawTraining {
    /// Tool that interacts; the first one by name where left out.
    pub tool: Option<String>,
    /// Interactions.
    #[schemars(range(min = 1, max = MAX_EXAMPLES))]
    pub examples: u32,
    /// Seed of the interactions.
    pub seed: u64,
    /// Sampling of the interactions.
    pub sampling: RawInteractionSampling,
    /// Farthest-point sampling: candidates drawn for each example kept.
    #[schemars(range(min = 2, max = 1000))]
    pub candidates_per_example: u32,
    /// Farthest-point sampling: length scales of contact points, and of presses and drags [m].
    #[schemars(inner(range(min = 1e-6, max = 10.0)))]
    pub feature_scales_m: [f64; 2],
    /// Boxes around the contact points on the resting skin; none: wherever the skin faces the tool.
    pub contact_regions: Vec<RawBox>,
    /// Direction of the press: "vertical" (down), "normal" (against the skin), or x, y, z. The tool's z axis points the other way.
    pub approach: RawApproach,
    /// Least and largest depth beyond first touch, as a share of the thickness there along the approach.
    #[schemars(inner(range(min = 1e-3, max = 0.95)))]
    pub depth_share: [f64; 2],
    /// Least and largest length of the drag along the skin's tangent plane [m].
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub drag_m: [f64; 2],
    /// Share of the interactions that drag.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub drag_share: f64,
    /// States picked from a recorded motion, in place of drawn ones.
    pub recorded: Option<RawRecorded>,
    /// First axis of stamps, projected to the tangent plane, and its replacement where it is normal to the skin.
    #[schemars(inner(inner(range(min = -LARGEST_M, max = LARGEST_M))))]
    pub stamp_axes: [[f64; 3]; 2],
    /// Drive of the real-time model to a pose.
    pub drive: RawDrive,
    /// Interactions kept apart from training.
    pub evaluation: RawEvaluation,
}

/// Sampling of interactions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawInteractionSampling {
    /// Farthest-point sampling among the candidates.
    FarthestPoint,
    /// All candidates, as drawn.
    Random,
}

/// Direction of a press.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "approach is \"vertical\", \"normal\", or a direction [x, y, z]")]
pub enum RawApproach {
    /// By name.
    Named(RawApproachName),
    /// Towards x, y, z; need not be of unit length.
    Direction(#[schemars(inner(range(min = -LARGEST_M, max = LARGEST_M)))] [f64; 3]),
}

/// Directions with a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawApproachName {
    /// Along -z.
    Vertical,
    /// Against the skin's normal.
    Normal,
}

/// A recorded motion.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawRecorded {
    /// Poses, as `plicad simulate` reads them: CSV or a TUM trajectory. Path relative to the scene file.
    pub file: RawFile,
    /// Whether the trajectory's box is mapped into the workspace above the object.
    #[serde(default)]
    pub fit: bool,
    /// Unit of the file's times; recognised by a plausible rate where left out.
    pub time_unit: Option<RawTimeUnit>,
    /// Order of quaternion components in the file; xyzw where left out.
    pub quaternion_order: Option<RawQuaternionOrder>,
    /// What becomes of rows that cannot be played.
    #[serde(default)]
    pub on_bad_row: RawOnBadRow,
}

/// Unit of a motion file's times.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
pub enum RawTimeUnit {
    /// Seconds.
    #[serde(rename = "s")]
    Seconds,
    /// Milliseconds.
    #[serde(rename = "ms")]
    Milliseconds,
    /// Microseconds.
    #[serde(rename = "us")]
    Microseconds,
    /// Nanoseconds.
    #[serde(rename = "ns")]
    Nanoseconds,
}

/// Order of quaternion components in a motion file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawQuaternionOrder {
    /// `w` last.
    Xyzw,
    /// `w` first.
    Wxyz,
}

/// What becomes of rows of a motion file that cannot be played.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawOnBadRow {
    /// The file is refused.
    #[default]
    Error,
    /// They are left out.
    Skip,
}

/// Drive of the real-time model to a pose, and criterion of settling.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawDrive {
    /// Speed of the tool [m/s].
    #[schemars(range(min = 1e-3, max = 1.0))]
    pub speed_m_per_s: f64,
    /// Least damping proportional to mass while training [1/s]; states at rest do not depend on it.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub mass_damping_per_s: f64,
    /// Largest displacement within `window_s` of an object that counts as settled [m].
    #[schemars(range(min = 1e-8, max = 0.01))]
    pub settled_m: f64,
    /// Time within which displacements are compared with `settled_m` [s].
    #[schemars(range(min = 1e-3, max = 10.0))]
    pub window_s: f64,
    /// Longest wait until the object has settled [s].
    #[schemars(range(min = 0.01, max = 600.0))]
    pub patience_s: f64,
    /// Largest displacement within `window_s` of an accepted interaction after `patience_s` [m].
    #[schemars(range(min = 1e-8, max = 0.01))]
    pub tolerated_m: f64,
}

/// Interactions kept apart from training.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawEvaluation {
    /// Interactions drawn at random, as in training.
    #[schemars(range(min = 1, max = MAX_EXAMPLES))]
    pub examples: u32,
    /// Seed; another one than that of training.
    pub seed: u64,
    /// Sets outside of the trained ranges.
    pub outside: Vec<RawOutside>,
}

/// A set of interactions outside of the trained ranges. Keys left out are those of training.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawOutside {
    /// Kind of its examples in the database; several sets may share it.
    pub name: String,
    /// Action at the contact point.
    #[serde(default)]
    pub action: RawAction,
    /// Interactions.
    #[schemars(range(min = 1, max = MAX_EXAMPLES))]
    pub examples: u32,
    /// Boxes around the contact points on the resting skin.
    pub contact_regions: Option<Vec<RawBox>>,
    /// Direction of the press.
    pub approach: Option<RawApproach>,
    /// Least and largest depth, or height of a lift, as a share of the local thickness.
    #[schemars(inner(range(min = 1e-3, max = 0.95)))]
    pub depth_share: Option<[f64; 2]>,
    /// Least and largest length of the drag [m].
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub drag_m: Option<[f64; 2]>,
    /// Share of the interactions that drag.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub drag_share: Option<f64>,
}

/// Action at a contact point.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawAction {
    /// The tool presses and drags.
    #[default]
    Press,
    /// Suction on a disc of the tool's radius lifts the skin.
    Lift,
}

impl Default for RawTie {
    fn default() -> Self {
        let d = plica_accurate::TieOptions::for_modulus(1.0);
        Self { compliance_m: d.compliance_m, band_m: d.band_m, rim_floor: d.rim_floor }
    }
}

impl Default for RawTraining {
    fn default() -> Self {
        let scales = FeatureScales::default();
        Self {
            tool: None,
            examples: 128,
            seed: 1,
            sampling: RawInteractionSampling::FarthestPoint,
            candidates_per_example: 2,
            feature_scales_m: [scales.contact_m, scales.motion_m],
            contact_regions: Vec::new(),
            approach: RawApproach::Named(RawApproachName::Vertical),
            depth_share: [0.1, 0.35],
            drag_m: [0.0, 0.005],
            drag_share: 2.0 / 3.0,
            recorded: None,
            stamp_axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            drive: RawDrive::default(),
            evaluation: RawEvaluation::default(),
        }
    }
}

impl Default for RawDrive {
    fn default() -> Self {
        let d = DriveOptions::default();
        Self {
            speed_m_per_s: d.speed_m_per_s,
            mass_damping_per_s: d.mass_damping_per_s,
            settled_m: d.settled_m,
            window_s: d.window_s,
            patience_s: d.patience_s,
            tolerated_m: d.tolerated_m,
        }
    }
}

impl Default for RawEvaluation {
    fn default() -> Self {
        Self { examples: 120, seed: 2, outside: Vec::new() }
    }
}
