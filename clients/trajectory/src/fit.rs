//! Fits a recorded motion into the workspace of a scene.

use std::collections::HashMap;

use crate::error::TrajectoryError;
use crate::pose::TrackedPose;
use crate::terrain::Terrain;
use crate::workspace::Workspace;

/// Help text of `--fit` in every command that has it.
pub const FIT_HELP: &str =
    "Scales and moves the motion so that its lowest part presses the object; each tool starts upright";

/// Default depth of a fitted motion, at most \[m\].
const DEPTH_M: f64 = 0.008;
/// Default depth at most, as a share of the object's height in its middle.
const DEPTH_SHARE: f64 = 0.3;
/// Upper end of the workspace above first touch \[m\].
const CLEARANCE_M: f64 = 0.03;

/// Map found by [`fit`]: `p' = to_m + scale (p - from_m)`.
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
/// without extent does not count; a trajectory without motion is only moved (s = 1). The tool starts upright (z up) and turns
/// as the hand turned, since the mount of a marker is unrelated to the scene's tool. Times are unchanged.
pub fn fit(poses: &mut [TrackedPose], workspace: Workspace) -> Result<Fit, TrajectoryError> {
    let Workspace { min_m, max_m } = workspace;
    let has_room = (0..3).all(|i| min_m[i] < max_m[i] && (max_m[i] - min_m[i]).is_finite());
    if !has_room {
        return Err(TrajectoryError::Workspace { min_m, max_m });
    }
    let nothing = Workspace { min_m: [0.0; 3], max_m: [0.0; 3] };
    let bounds = Workspace::around(poses.iter().map(|pose| &pose.position_m)).unwrap_or(nothing);
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

/// Fits a motion into the room above an object with [`fit`], then moves it down (or up) until its deepest pose presses
/// `depth_m` into the surface. `tip_radius_m`: extent of the tool below its origin.
///
/// ```text
/// workspace: the middle half of the object, from depth below first touch in its middle to 30 mm above that
/// p'_z = p_z - (h + depth)      h = min over poses of (p_z - tip radius - height of the surface under p)
/// ```
/// Without the second step a wide and flat motion would hover in the middle of the workspace, since it has one scale.
pub fn fit_above(
    poses: &mut [TrackedPose],
    terrain: &Terrain,
    tip_radius_m: f64,
    depth_m: f64,
) -> Result<Fit, TrajectoryError> {
    let mut done = fit(poses, room_above(terrain, tip_radius_m, depth_m))?;
    let clearance = |pose: &TrackedPose| {
        let [x, y, z] = pose.position_m;
        terrain.height_m([x, y]).map(|height| z - tip_radius_m - height)
    };
    if let Some(lowest) = poses.iter().filter_map(clearance).reduce(f64::min) {
        let down = lowest + depth_m;
        poses.iter_mut().for_each(|pose| pose.position_m[2] -= down);
        done.to_m[2] -= down;
    }
    Ok(done)
}

/// Default depth of a motion fitted to an object, in metres: 8 mm, at most 0.3 of its height.
pub fn fitted_depth_m(terrain: &Terrain) -> f64 {
    let height_m = middle_top_m(terrain) - terrain.bounds().min_m[2];
    DEPTH_M.min(DEPTH_SHARE * height_m)
}

/// The middle half of the object, from `depth_m` below first touch to `CLEARANCE_M` above it.
fn room_above(terrain: &Terrain, tip_radius_m: f64, depth_m: f64) -> Workspace {
    let Workspace { min_m, max_m } = terrain.bounds();
    let quarter = |i: usize| 0.25 * (max_m[i] - min_m[i]);
    let touch_m = middle_top_m(terrain) + tip_radius_m;
    Workspace {
        min_m: [min_m[0] + quarter(0), min_m[1] + quarter(1), touch_m - depth_m],
        max_m: [max_m[0] - quarter(0), max_m[1] - quarter(1), touch_m + CLEARANCE_M],
    }
}

/// Height of the object in its middle; its highest point where it has a hole there.
fn middle_top_m(terrain: &Terrain) -> f64 {
    let [x, y, _] = terrain.bounds().centre();
    terrain.height_m([x, y]).unwrap_or(terrain.bounds().max_m[2])
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
