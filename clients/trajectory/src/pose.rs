//! A pose of a trajectory.

/// The header of a CSV trajectory.
pub const CSV_HEADER: [&str; 9] = ["time_s", "tool", "px", "py", "pz", "qx", "qy", "qz", "qw"];

/// Pose of a tool at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackedPose {
    /// Time in seconds.
    pub time_s: f64,
    /// Name of the tool; `None` if the file names none.
    pub tool: Option<String>,
    /// Position in metres.
    pub position_m: [f64; 3],
    /// Unit quaternion `x y z w`.
    pub orientation_xyzw: [f64; 4],
}
