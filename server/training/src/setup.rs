//! Set-up of training as plain data, from a configuration that the caller has read and checked.

use nalgebra::{Isometry3, Point3, Vector3};
use plica_accurate::{Material, TieOptions};
use plica_geometry::HexMesh;
use plica_sim::ModelDescription;
use serde::Serialize;

use crate::canonical::fingerprint;
use crate::interaction::Interaction;

/// A scene and its interactions. SI units.
#[derive(Debug, Clone)]
pub struct Setup {
    /// Names the scene that examples belong to: SHA-256 in hexadecimal digits, made by the caller.
    pub scene_hash: String,
    /// The real-time model as it runs. Training replaces couplings by rigid ones and never lets the object sleep.
    pub coarse: ModelDescription,
    /// The accurate model.
    pub accurate: AccurateDescription,
    /// Tie of the accurate skin to the coarse imprint.
    pub tie: TieOptions,
    /// Direction whose tangential part is the first axis of every contact frame, and the one that stands in where the first
    /// is normal to the skin.
    pub stamp_axes: [Vector3<f64>; 2],
    /// Drive of the coarse model.
    pub drive: DriveOptions,
    /// Scales of the features of farthest-point sampling.
    pub features: FeatureScales,
    /// Interactions to train on.
    pub training: InteractionSet,
    /// Seed of the training interactions.
    pub training_seed: u64,
    /// Interactions to evaluate on: the first set is drawn as training is, the others lie outside.
    pub evaluation: Vec<InteractionSet>,
    /// Seed of the evaluation interactions.
    pub evaluation_seed: u64,
}

impl Setup {
    /// Digest of an interaction with drive and stamp axes, which the scene hash leaves out; 64 hexadecimal digits.
    pub fn fingerprint(&self, interaction: &Interaction) -> String {
        let axes = self.stamp_axes.map(<[f64; 3]>::from);
        fingerprint(&(interaction, self.drive, axes))
    }
}

/// The accurate model.
#[derive(Debug, Clone)]
pub struct AccurateDescription {
    /// Solid hexahedra.
    pub mesh: HexMesh,
    /// Material of each hexahedron, `[n_hexes]`.
    pub materials: Vec<Material>,
    /// Density of each hexahedron, for its weight, `[n_hexes]` \[kg/m3\].
    pub densities_kg_per_m3: Vec<f64>,
    /// Nodes held at their rest position, `[n_nodes]`.
    pub fixed: Vec<bool>,
}

/// Drive of the coarse model to a pose, and criterion of settling.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DriveOptions {
    /// Speed of the tool \[m/s\].
    pub speed_m_per_s: f64,
    /// Least damping proportional to mass \[1/s\]. What is at rest does not depend on it; with little of it the object sways
    /// for seconds around the single point that a round tip touches.
    pub mass_damping_per_s: f64,
    /// Settled if no node has moved farther than this \[m\] ...
    pub settled_m: f64,
    /// ... within this time \[s\].
    pub window_s: f64,
    /// Longest wait for that \[s\].
    pub patience_s: f64,
    /// What is not settled by then is rejected if a node still moves farther than this within the window \[m\].
    pub tolerated_m: f64,
}

impl Default for DriveOptions {
    fn default() -> Self {
        Self {
            speed_m_per_s: 0.05,
            mass_damping_per_s: 50.0,
            settled_m: 2e-6,
            window_s: 0.1,
            patience_s: 4.0,
            tolerated_m: 2e-5,
        }
    }
}

/// Scales of the features of farthest-point sampling.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeatureScales {
    /// Contact points \[m\].
    pub contact_m: f64,
    /// Presses and drags \[m\].
    pub motion_m: f64,
}

impl Default for FeatureScales {
    fn default() -> Self {
        Self { contact_m: 12e-3, motion_m: 4e-3 }
    }
}

/// Name of the set in the trained region, and kind of its examples.
pub const IN_REGION: &str = "in_region";

/// Interactions drawn from the same source.
#[derive(Debug, Clone)]
pub struct InteractionSet {
    /// Kind of its examples, as the database names it.
    pub name: String,
    /// Tool, by index.
    pub tool: usize,
    /// How many.
    pub count: usize,
    /// Candidates drawn for each interaction that farthest-point sampling keeps; 1 keeps all candidates.
    pub candidates_per_example: usize,
    /// Source of the interactions.
    pub source: Source,
}

/// Source of interactions.
#[derive(Debug, Clone)]
pub enum Source {
    /// Drawn at random: the tool presses and drags.
    Press(PressRanges),
    /// Drawn at random: suction lifts the skin. Depth is height.
    Lift(PressRanges),
    /// Picked from recorded poses.
    Recorded(Vec<RecordedPose>),
}

/// Ranges of drawn interactions.
#[derive(Debug, Clone, PartialEq)]
pub struct PressRanges {
    /// Contact points lie in one of these boxes (lower and upper corner), where the skin faces the tool; none: everywhere \[m\].
    pub region: Vec<[Point3<f64>; 2]>,
    /// Direction of the press.
    pub approach: Approach,
    /// Depth as a share of the local thickness along the approach.
    pub depth_share: [f64; 2],
    /// Length of the tangential drag \[m\].
    pub drag_m: [f64; 2],
    /// Share of the interactions that drag at all.
    pub drag_share: f64,
}

/// Direction in which the tool presses. Its z axis points the other way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Approach {
    /// Always this unit vector.
    Along(Vector3<f64>),
    /// Against the skin's normal.
    Normal,
}

/// A pose of a recorded motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordedPose {
    /// Time \[s\].
    pub time_s: f64,
    /// Tool, by index.
    pub tool: usize,
    /// `world <- tool`.
    pub pose: Isometry3<f64>,
}
