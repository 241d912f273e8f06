//! A pose of a trajectory.

/// Pose of a tool at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackedPose {
    /// Time since the first pose of the file, in seconds.
    pub time_s: f64,
    /// Name of the tool; `None` if the file names none.
    pub tool: Option<String>,
    /// Position in metres.
    pub position_m: [f64; 3],
    /// Unit quaternion `x y z w`.
    pub orientation_xyzw: [f64; 4],
}
