//! Mapping a recorded motion into the room that a scene has.

use std::collections::HashMap;

use super::{TrackedPose, TrajectoryError};

/// A box in the world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Workspace {
    /// Lower corner in metres.
    pub min_m: [f64; 3],
    /// Upper corner in metres.
    pub max_m: [f64; 3],
}

/// What [`fit`] did: `p' = to_m + scale (p - from_m)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// Uniform scale.
    pub scale: f64,
    /// Centre of the trajectory's box.
    pub from_m: [f64; 3],
    /// Centre of the workspace.
    pub to_m: [f64; 3],
}

/// Maps the bounding box of all positions into the workspace, and each tool's first pose to upright, in place.
///
/// ```text
/// p' = c_w + s (p - c_t)        s = min over axes of (workspace extent / trajectory extent)
/// q' = q q_0^-1                 q_0: the tool's first orientation
/// ```
/// One scale for all axes keeps the motion's shape; the tightest axis fills its extent, and s may be above 1. An axis
/// without extent does not count; a trajectory that stands still is only moved (s = 1). How a marker happened to sit on
/// the hand says nothing about a scene's tool: it starts upright (z up) and turns as the hand turned. Times stay.
pub fn fit(poses: &mut [TrackedPose], workspace: Workspace) -> Result<Fit, TrajectoryError> {
    let Workspace { min_m, max_m } = workspace;
    let has_room = (0..3).all(|i| min_m[i] < max_m[i] && (max_m[i] - min_m[i]).is_finite());
    if !has_room {
        return Err(TrajectoryError::Workspace { min_m, max_m });
    }
    let bounds = bounds(poses);
    let scale = (0..3)
        .filter(|&i| bounds.max_m[i] > bounds.min_m[i])
        .map(|i| (max_m[i] - min_m[i]) / (bounds.max_m[i] - bounds.min_m[i]))
        .reduce(f64::min)
        .unwrap_or(1.0);
    let (from_m, to_m) = (bounds.centre(), workspace.centre());
    for pose in &mut *poses {
        pose.position_m = std::array::from_fn(|i| to_m[i] + scale * (pose.position_m[i] - from_m[i]));
    }
    turn_upright(poses);
    Ok(Fit { scale, from_m, to_m })
}

impl Workspace {
    fn centre(&self) -> [f64; 3] {
        std::array::from_fn(|i| 0.5 * (self.min_m[i] + self.max_m[i]))
    }
}

fn turn_upright(poses: &mut [TrackedPose]) {
    let mut first: HashMap<Option<String>, [f64; 4]> = HashMap::new();
    for pose in poses {
        let q0 = *first.entry(pose.tool.clone()).or_insert(pose.orientation_xyzw);
        pose.orientation_xyzw = relative(pose.orientation_xyzw, q0);
    }
}

/// `a b^-1` of unit quaternions `x y z w`, normalised.
fn relative(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    let ([ax, ay, az, aw], [bx, by, bz, bw]) = (a, [-b[0], -b[1], -b[2], b[3]]);
    let product = [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ];
    let norm = product.iter().map(|c| c * c).sum::<f64>().sqrt();
    product.map(|c| c / norm)
}

fn bounds(poses: &[TrackedPose]) -> Workspace {
    let Some(first) = poses.first() else {
        return Workspace { min_m: [0.0; 3], max_m: [0.0; 3] };
    };
    let start = Workspace { min_m: first.position_m, max_m: first.position_m };
    poses.iter().fold(start, |b, pose| Workspace {
        min_m: std::array::from_fn(|i| b.min_m[i].min(pose.position_m[i])),
        max_m: std::array::from_fn(|i| b.max_m[i].max(pose.position_m[i])),
    })
}
