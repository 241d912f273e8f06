//! Recorded poses as input of a scene.

use std::path::Path;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use plica_geometry::DisplaySurface;
use plica_sim::{PoseSample, ToolDescription, ToolShape, world_from_tool};
use plica_trajectory::{self as trajectory, Fit, MotionReport, ReadOptions, Terrain, TrackedPose, TrajectoryError};

use crate::model;
use crate::motion_start;
use crate::scene::{Config, MeshConfig};
pub use crate::timed_pose::TimedPose;

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
    /// A tool that starts upside down, and upright with the components of its quaternion in another order.
    #[error(
        "{file}: `{tool}` starts upside down; it starts upright if `w` comes first in the file: say --quaternion-order wxyz \
         if it does, --quaternion-order xyzw if the tool is meant to hang (in a scene: quaternion_order)"
    )]
    WhichQuaternionOrder {
        /// The pose file.
        file: String,
        /// The tool.
        tool: String,
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
            Self::Trajectory(TrajectoryError::TimeUnit { path, .. }) => {
                format!("{}: the unit of its times cannot be told; say it with time_unit", name(path))
            }
            Self::WhichQuaternionOrder { file, tool } => format!(
                "{}: `{tool}` starts upside down, and upright if `w` comes first; say quaternion_order",
                name(Path::new(file))
            ),
            Self::Trajectory(_) => "the recorded motion cannot be used".to_owned(),
        }
    }
}

/// How recorded poses are read.
#[derive(Debug, Clone, Copy, Default)]
pub struct MotionOptions<'a> {
    /// Tool of poses that name none.
    pub tool: Option<&'a str>,
    /// Maps the motion's box into the room above the object.
    pub fit: bool,
    /// How the file is read.
    pub read: ReadOptions,
}

/// Recorded poses for a scene.
#[derive(Debug, Clone)]
pub struct Motion {
    /// In order of time.
    pub poses: Vec<TimedPose>,
    /// What the fit did, if it was asked for.
    pub fit: Option<Fit>,
    /// What the file held.
    pub report: MotionReport,
    /// Sentences on a motion that is likely not meant: far from the object, inside of it, upside down.
    pub remarks: Vec<String>,
}

/// Reads poses for a scene. Bounds of positions hold after the tool's `position_scale`.
pub fn read(file: &Path, config: &Config, options: MotionOptions<'_>) -> Result<Motion, MotionError> {
    let scale = |tool: Option<&str>| {
        let tool = tool.or(options.tool).map_or(Some(0), |name| config.tool_index(name));
        tool.and_then(|tool| config.tools().get(tool)).map_or(1.0, |tool| tool.position_scale)
    };
    let gate = |tool: Option<&str>, position: [f64; 3], orientation_xyzw| {
        plica_protocol::pose::gate(tool, position.map(|c| scale(tool) * c), orientation_xyzw)
    };
    let trajectory::Trajectory { poses: mut tracked, report } = trajectory::read(file, options.read, gate)?;
    let default_tool = which_tool(file, config, &tracked, options.tool)?;
    let fit = if options.fit { Some(fit_onto(file, config, default_tool, &mut tracked)?) } else { None };
    let mut sequences = vec![0; config.tools().len()];
    let mut poses = Vec::with_capacity(tracked.len());
    for t in &tracked {
        let tool = tool_of(file, config, default_tool, t)?;
        sequences[tool] += 1;
        poses.push(TimedPose { time_s: t.time_s, tool, sample: sample(t, sequences[tool]) });
    }
    let may_ask = report.quaternion_order_assumed && fit.is_none();
    if let Some(tool) = motion_start::tool_with_w_first(config, &poses).filter(|_| may_ask) {
        let tool = config.tools()[tool].name.clone();
        return Err(MotionError::WhichQuaternionOrder { file: file.display().to_string(), tool });
    }
    let remarks = motion_start::remarks(config, &poses, fit.is_some());
    Ok(Motion { poses, fit, report, remarks })
}

/// Index of the tool that a pose is for.
fn tool_of(file: &Path, config: &Config, default_tool: usize, pose: &TrackedPose) -> Result<usize, MotionError> {
    let Some(name) = &pose.tool else { return Ok(default_tool) };
    config.tool_index(name).ok_or_else(|| unknown_tool(file, config, name))
}

fn sample(tracked: &TrackedPose, sequence: u64) -> PoseSample {
    let source_time_ns = (tracked.time_s.max(0.0) * 1e9).round() as u64;
    PoseSample {
        sequence,
        // As on the bus: 0 is an unknown time.
        source_time_ns: (source_time_ns != 0).then_some(source_time_ns),
        valid: true,
        pose: isometry(tracked),
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

/// Fits a motion onto the object's skin, as `plica probe --fit` does with the mesh that it is given. The tool is what is
/// fitted, wherever its marker and its tracker are.
fn fit_onto(
    file: &Path,
    config: &Config,
    default_tool: usize,
    tracked: &mut [TrackedPose],
) -> Result<Fit, MotionError> {
    let surface = DisplaySurface::new(&model::skin(config));
    let terrain = Terrain::new(&surface.rest, &surface.triangles).expect("a closed skin has triangles");
    let tip_radius_m = config.tools().get(default_tool).map_or(0.0, tip_radius_m);
    let tools = tracked.iter().map(|t| tool_of(file, config, default_tool, t)).collect::<Result<Vec<_>, _>>()?;
    let each = |tracked: &mut [TrackedPose], map: &dyn Fn(&ToolDescription, &Isometry3<f64>) -> Isometry3<f64>| {
        for (pose, tool) in tracked.iter_mut().zip(&tools) {
            if let Some(tool) = config.tools().get(*tool).filter(|tool| !is_in_world(tool)) {
                set_pose(pose, &map(tool, &isometry(pose)));
            }
        }
    };
    each(tracked, &world_from_tool);
    let fit = trajectory::fit_above(tracked, &terrain, tip_radius_m, trajectory::fitted_depth_m(&terrain))?;
    each(tracked, &tracker_from_marker);
    Ok(fit)
}

/// Whether a tool is tracked at its own origin, in the world and in metres.
fn is_in_world(tool: &ToolDescription) -> bool {
    let identity = Isometry3::identity();
    tool.world_from_tracker == identity && tool.tool_from_marker == identity && tool.position_scale == 1.0
}

/// The tracked pose that puts a tool at a pose in the world: [`world_from_tool`] undone.
fn tracker_from_marker(tool: &ToolDescription, world_from_tool: &Isometry3<f64>) -> Isometry3<f64> {
    let mut pose = tool.world_from_tracker.inverse() * world_from_tool * tool.tool_from_marker;
    pose.translation.vector /= tool.position_scale;
    pose
}

fn isometry(tracked: &TrackedPose) -> Isometry3<f64> {
    let [x, y, z, w] = tracked.orientation_xyzw;
    // The gate has normalised the quaternion; a second normalisation would change bits.
    let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z));
    Isometry3::from_parts(Translation3::from(tracked.position_m), rotation)
}

fn set_pose(tracked: &mut TrackedPose, pose: &Isometry3<f64>) {
    let q = pose.rotation.quaternion();
    (tracked.position_m, tracked.orientation_xyzw) = (pose.translation.vector.into(), [q.i, q.j, q.k, q.w]);
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

    const FIT: MotionOptions<'_> = MotionOptions {
        tool: None,
        fit: true,
        read: ReadOptions { time_unit: None, quaternion_order: None, on_bad_row: trajectory::OnBadRow::Error },
    };

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
        let Motion { poses, fit, .. } = read(&path, &config, FIT).unwrap();
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
        let poses = read(&path, &config, MotionOptions::default()).unwrap().poses;
        assert_eq!(poses.iter().map(|p| p.sample.sequence).collect::<Vec<_>>(), [1, 2]);
        assert_eq!(poses[1].sample.source_time_ns, Some(500_000_000));
        let (_folder, path) = write("b.csv", &format!("{header}0,drill,0,0,0.1,0,0,0,1\n"));
        let message = read(&path, &config, MotionOptions::default()).unwrap_err().to_string();
        assert!(message.contains("`drill`") && message.contains("probe"), "{message}");
    }

    /// The wedge with its probe tracked otherwise.
    fn tracked_by(keys: &str) -> Config {
        let plain = "position_scale = 1.0           # 1e-4 to 1e4: factor on tracked positions";
        let scene = crate::BUILT_IN_SCENE.replace("world_from_tracker = {", "# world_from_tracker = {");
        assert!(scene.contains(plain));
        Config::parse(std::path::Path::new("wedge.toml"), &scene.replace(plain, keys)).unwrap()
    }

    #[test]
    fn positions_in_millimetres_are_in_bounds_after_position_scale() {
        let far = "0 1500 30 40 0 0 0 1\n0.01 1500 30 40 0 0 0 1\n";
        let (_folder, path) = write("mm.tum", far);
        let scaled = tracked_by("position_scale = 0.001");
        assert_eq!(read(&path, &scaled, MotionOptions::default()).unwrap().poses.len(), 2);
        let message = read(&path, &Config::built_in().unwrap(), MotionOptions::default()).unwrap_err().to_string();
        assert!(message.contains("`position` is 150") && message.contains("at most 1000"), "{message}");
    }

    #[test]
    fn a_fit_puts_the_tool_above_the_object_wherever_its_tracker_is() {
        let text = "0 0 0 1 0 0 0 1\n1 4 0 1 0 0 0 1\n2 4 1 1.1 0 0 0 1\n3 0 1 1.2 0 0.6 0 0.8\n";
        let (_folder, path) = write("flat.tum", text);
        let world = |config: &Config| -> Vec<Isometry3<f64>> {
            let poses = read(&path, config, FIT).unwrap().poses;
            poses.iter().map(|p| world_from_tool(&config.tools()[0], &p.sample.pose)).collect()
        };
        let plain = world(&Config::built_in().unwrap());
        let scaled = world(&tracked_by("position_scale = 0.001"));
        let moved =
            world(&tracked_by("world_from_tracker = { translation_m = [0.1, -0.2, 0.3] }\nposition_scale = 0.5"));
        for (plain, other) in plain.iter().zip(scaled.iter().zip(&moved)).flat_map(|(p, (a, b))| [(p, a), (p, b)]) {
            assert!((plain.translation.vector - other.translation.vector).norm() < 1e-9, "{plain} {other}");
            assert!(plain.rotation.angle_to(&other.rotation) < 1e-7);
        }
    }
}
