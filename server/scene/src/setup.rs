//! Set-up of training from a checked scene.

use std::path::Path;

use plica_sim::world_from_tool;
use plica_training::{IN_REGION, InteractionSet, RecordedPose, Setup, Source};

use crate::hash::{HashError, scene_hash};
use crate::model::{self, SceneModelError};
use crate::motion::{self, MotionError, MotionOptions};
use crate::scene::{Config, TrainingConfig};

/// Why a scene cannot be trained.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// The scene has no model.
    #[error(transparent)]
    Scene(#[from] SceneModelError),
    /// A file that the scene names cannot be read.
    #[error(transparent)]
    Hash(#[from] HashError),
    /// The recorded motion cannot be used.
    #[error("objects.{object}.training.recorded: {cause}")]
    Motion {
        /// The object.
        object: String,
        /// Why.
        cause: MotionError,
    },
    /// The scene has no tool.
    #[error("{file}: the scene has no tool to train with; add a table [tools.<name>]")]
    NoTool {
        /// The scene.
        file: String,
    },
}

/// Set-up of training on a scene.
///
/// # Errors
/// See [`SetupError`].
pub fn setup(config: &Config) -> Result<Setup, SetupError> {
    let training = config.training();
    let no_tool = || SetupError::NoTool { file: config.file().display().to_string() };
    let tool = training.tool.ok_or_else(no_tool)?;
    Ok(Setup {
        scene_hash: scene_hash(config)?,
        coarse: model::describe(config)?,
        accurate: model::describe_accurate(config, None)?,
        tie: config.object().tie(),
        stamp_axes: training.stamp_axes,
        drive: training.drive,
        features: training.features,
        training: trained_set(config, training, tool)?,
        training_seed: training.seed,
        evaluation: evaluation_sets(config, training, tool)?,
        evaluation_seed: training.evaluation_seed,
    })
}

fn trained_set(config: &Config, training: &TrainingConfig, tool: usize) -> Result<InteractionSet, SetupError> {
    Ok(InteractionSet {
        name: IN_REGION.to_owned(),
        tool,
        count: training.examples as usize,
        candidates_per_example: training.candidates_per_example as usize,
        source: source(config, training, tool)?,
    })
}

fn evaluation_sets(config: &Config, training: &TrainingConfig, tool: usize) -> Result<Vec<InteractionSet>, SetupError> {
    let in_region = InteractionSet {
        count: training.evaluation_examples as usize,
        candidates_per_example: 1,
        ..trained_set(config, training, tool)?
    };
    let outside = training.outside.iter().map(|set| InteractionSet {
        name: set.name.clone(),
        tool,
        count: set.examples as usize,
        candidates_per_example: 1,
        source: if set.lifts { Source::Lift(set.ranges.clone()) } else { Source::Press(set.ranges.clone()) },
    });
    Ok(std::iter::once(in_region).chain(outside).collect())
}

fn source(config: &Config, training: &TrainingConfig, tool: usize) -> Result<Source, SetupError> {
    let Some(recorded) = &training.recorded else { return Ok(Source::Press(training.ranges.clone())) };
    let path = config.file().parent().unwrap_or(Path::new("")).join(&recorded.file);
    let name = config.tools()[tool].name.clone();
    let options = MotionOptions { tool: Some(&name), fit: recorded.fit, read: recorded.read };
    let poses = motion::read(&path, config, options)
        .map_err(|cause| SetupError::Motion { object: config.object().name().to_owned(), cause })?;
    let pose = |timed: &motion::TimedPose| RecordedPose {
        time_s: timed.time_s,
        tool: timed.tool,
        pose: world_from_tool(&config.tools()[timed.tool], &timed.sample.pose),
    };
    Ok(Source::Recorded(poses.poses.iter().map(pose).collect()))
}
