//! Recorded poses as input of a scene.

use std::path::Path;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use plica_geometry::DisplaySurface;
use plica_sim::{PoseSample, ToolDescription, ToolShape};
use plica_trajectory::{self as trajectory, Fit, Terrain, TrackedPose, TrajectoryError};

use crate::model;
use crate::scene::{Config, MeshConfig};

/// Why recorded poses cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum MotionError {
    /// The file cannot be read.
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
    /// The scene does not have a named tool.
    #[error("{file}: there is no tool `{tool}` in the scene; it has: {known}")]
    UnknownTool {
        /// The pose file.
        file: String,
        /// Name in the file.
        tool: String,
        /// The scene's tools.
        known: String,
    },
    /// The file names no tool, and the scene has several.
    #[error("{file} names no tool, and the scene has {known}; choose one with --tool")]
    WhichTool {
        /// The pose file.
        file: String,
        /// The scene's tools.
        known: String,
    },
}

impl MotionError {
    /// The error for people who may not see the file: its name, the line and the kind of problem, without its words.
    pub fn without_content(&self) -> String {
        let name = |path: &Path| path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        match self {
            Self::Trajectory(TrajectoryError::Line { path, line, .. }) => {
                format!("{}:{line}: this line is no pose of a CSV or TUM file", name(path))
            }
            Self::Trajectory(TrajectoryError::Io { path, .. }) => format!("{}: cannot be read", name(path)),
            Self::Trajectory(TrajectoryError::Empty { path }) => format!("{}: the file has no poses", name(path)),
            Self::UnknownTool { file, known, .. } => {
                format!("{}: names a tool that the scene does not have; it has: {known}", name(Path::new(file)))
            }
            Self::WhichTool { file, known } => {
                format!("{}: names no tool, and the scene has {known}", name(Path::new(file)))
            }
            Self::Trajectory(_) => "the recorded motion cannot be used".to_owned(),
        }
    }
}

/// A pose and its time of arrival.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedPose {
    /// Time \[s\].
    pub time_s: f64,
    /// Index of the tool.
    pub tool: usize,
    /// The pose, numbered from 1 on for each tool.
    pub sample: PoseSample,
}

/// Reads poses for a scene, in order of time; with `fit` also the map of the fit.
pub fn read(
    file: &Path,
    config: &Config,
    default_tool: Option<&str>,
    fit: bool,
) -> Result<(Vec<TimedPose>, Option<Fit>), MotionError> {
    let mut tracked = trajectory::read(file, plica_protocol::pose::gate)?;
    let default_tool = which_tool(file, config, &tracked, default_tool)?;
    let fitted = if fit { Some(fit_onto(config, default_tool, &mut tracked)?) } else { None };
    let mut sequences = vec![0; config.tools().len()];
    let mut poses = Vec::with_capacity(tracked.len());
    for t in &tracked {
        let tool = match &t.tool {
            Some(name) => config.tool_index(name).ok_or_else(|| unknown_tool(file, config, name))?,
            None => default_tool,
        };
        sequences[tool] += 1;
        poses.push(TimedPose { time_s: t.time_s, tool, sample: sample(t, sequences[tool]) });
    }
    Ok((poses, fitted))
}

fn sample(tracked: &TrackedPose, sequence: u64) -> PoseSample {
    let [x, y, z, w] = tracked.orientation_xyzw;
    // The gate has normalised the quaternion; a second normalisation would change bits.
    let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z));
    let source_time_ns = (tracked.time_s.max(0.0) * 1e9).round() as u64;
    PoseSample {
        sequence,
        // As on the bus: 0 is an unknown time.
        source_time_ns: (source_time_ns != 0).then_some(source_time_ns),
        valid: true,
        pose: Isometry3::from_parts(Translation3::from(tracked.position_m), rotation),
    }
}

fn which_tool(
    file: &Path,
    config: &Config,
    tracked: &[TrackedPose],
    asked: Option<&str>,
) -> Result<usize, MotionError> {
    match asked {
        Some(name) => config.tool_index(name).ok_or_else(|| unknown_tool(file, config, name)),
        None if config.tools().len() == 1 || tracked.iter().all(|t| t.tool.is_some()) => Ok(0),
        None => Err(MotionError::WhichTool { file: file.display().to_string(), known: known(config) }),
    }
}

fn unknown_tool(file: &Path, config: &Config, tool: &str) -> MotionError {
    MotionError::UnknownTool { file: file.display().to_string(), tool: tool.to_owned(), known: known(config) }
}

fn known(config: &Config) -> String {
    let names: Vec<_> = config.tools().iter().map(|t| t.name.as_str()).collect();
    if names.is_empty() { "no tools".into() } else { names.join(", ") }
}

/// Fits a motion onto the object's skin, as `plica probe --fit` does with the mesh of the daemon.
fn fit_onto(config: &Config, tool: usize, tracked: &mut [TrackedPose]) -> Result<Fit, TrajectoryError> {
    let surface = DisplaySurface::new(&model::skin(config));
    let terrain = Terrain::new(&surface.rest, &surface.triangles).expect("a closed skin has triangles");
    let tip_radius_m = config.tools().get(tool).map_or(0.0, tip_radius_m);
    trajectory::fit_above(tracked, &terrain, tip_radius_m, trajectory::fitted_depth_m(&terrain))
}

/// Height of the object's top above z = 0 at `x` \[m\].
pub fn top_height_m(config: &Config, x: f64) -> f64 {
    match config.object().mesh() {
        MeshConfig::Wedge(wedge) => wedge.height_m(x),
        MeshConfig::Block(size) => size[2],
    }
}

/// Extent of a tool below its origin \[m\].
pub fn tip_radius_m(tool: &ToolDescription) -> f64 {
    let lowest = |points: &mut dyn Iterator<Item = f64>| points.fold(0.0_f64, |low, z| low.max(-z));
    match &tool.shape {
        ToolShape::Ball { radius_m } | ToolShape::Capsule { radius_m, .. } => *radius_m,
        ToolShape::Cuboid { half_extents_m } => half_extents_m[2],
        ToolShape::ConvexHull { polytope } => lowest(&mut polytope.points().iter().map(|p| p.z)),
        ToolShape::Compound { polytopes } => lowest(&mut polytopes.iter().flat_map(|p| p.points()).map(|p| p.z)),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;

    fn write(name: &str, text: &str) -> (tempfile::TempDir, std::path::PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        (folder, path)
    }

    #[test]
    fn a_fitted_motion_presses_as_deep_as_it_should_and_no_deeper() {
        let config = Config::built_in().unwrap();
        let (_folder, path) =
            write("flat.tum", "0 0 0 1 0 0 0 1\n1 4 0 1 0 0 0 1\n2 4 1 1.1 0 0 0 1\n3 0 1 1.2 0 0 0 1\n");
        let (poses, fit) = read(&path, &config, None, true).unwrap();
        assert!(fit.is_some());
        let height =
            |p: &TimedPose| p.sample.pose.translation.z - 0.007 - top_height_m(&config, p.sample.pose.translation.x);
        let lowest = poses.iter().map(height).fold(f64::INFINITY, f64::min);
        let depth = 0.3 * top_height_m(&config, 0.06);
        assert!((lowest + depth).abs() < 1e-6, "{lowest}");
        assert!(poses.iter().all(|p| (0.029999..0.090001).contains(&p.sample.pose.translation.x)));
    }

    #[test]
    fn tools_are_found_by_name_and_poses_are_numbered() {
        let config = Config::built_in().unwrap();
        let header = "time_s,tool,px,py,pz,qx,qy,qz,qw\n";
        let (_folder, path) = write("a.csv", &format!("{header}0,probe,0,0,0.1,0,0,0,1\n0.5,,0,0,0.2,0,0,0,1\n"));
        let (poses, _) = read(&path, &config, None, false).unwrap();
        assert_eq!(poses.iter().map(|p| p.sample.sequence).collect::<Vec<_>>(), [1, 2]);
        assert_eq!(poses[1].sample.source_time_ns, Some(500_000_000));
        let (_folder, path) = write("b.csv", &format!("{header}0,drill,0,0,0.1,0,0,0,1\n"));
        let message = read(&path, &config, None, false).unwrap_err().to_string();
        assert!(message.contains("`drill`") && message.contains("probe"), "{message}");
    }
}
