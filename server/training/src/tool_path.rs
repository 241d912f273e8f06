//! Path of a tool: straight lines between poses.

use nalgebra::Isometry3;
use plica_accurate::contact::Obstacle;

use crate::interaction::{Action, Interaction, from_numbers};
use crate::obstacle::first_touch;
use crate::plan::line_of_approach;
use plica_geometry::ReferenceSkin;

/// A turn counts as the path of a point this far from the tool's origin \[m\].
const LEVER_M: f64 = 0.05;
/// Where a press starts, above first touch \[m\].
const CLEARANCE_M: f64 = 1e-3;

/// Poses that a tool visits in straight lines, `world <- tool`.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolPath {
    poses: Vec<Isometry3<f64>>,
    /// Path from the first pose to each \[m\].
    reached: Vec<f64>,
}

impl ToolPath {
    /// From one pose or more.
    ///
    /// # Panics
    /// Without a pose.
    pub fn new(poses: Vec<Isometry3<f64>>) -> Self {
        assert!(!poses.is_empty(), "a tool path has a pose");
        let mut reached = vec![0.0];
        for (k, pair) in poses.windows(2).enumerate() {
            let turn = LEVER_M * pair[0].rotation.angle_to(&pair[1].rotation);
            reached.push(reached[k] + (pair[1].translation.vector - pair[0].translation.vector).norm().max(turn));
        }
        Self { poses, reached }
    }

    /// Path of `interaction`: from a clearance above first touch in by the depth, then along the drag; or as recorded.
    /// `None` for a lift, and for a press that touches nothing.
    pub fn of(interaction: &Interaction, obstacle: &Obstacle, skin: &ReferenceSkin) -> Option<Self> {
        match &interaction.action {
            Action::Lift { .. } => None,
            Action::Follow { poses } => Some(Self::new(poses.iter().map(from_numbers).collect())),
            Action::Press { depth_m, drag_m, .. } => {
                let points = skin.skin().positions();
                let size = extent(skin);
                let (mut pose, direction) = line_of_approach(interaction, 2.0 * size)?;
                let contact = [points, &[interaction.contact_point()]].concat();
                let touch = first_touch(obstacle, &pose, &direction, &contact, 4.0 * size)?;
                pose.translation.vector += direction * (touch - CLEARANCE_M);
                let mut pressed = pose;
                pressed.translation.vector += direction * (CLEARANCE_M + depth_m);
                let mut dragged = pressed;
                dragged.translation.vector += nalgebra::Vector3::from(*drag_m);
                let poses = if dragged == pressed { vec![pose, pressed] } else { vec![pose, pressed, dragged] };
                Some(Self::new(poses))
            }
        }
    }

    /// Without the poses that straight lines between the others pass within `tolerance_m` \[m\] \[DP73\].
    pub fn straightened(&self, tolerance_m: f64) -> Self {
        let mut kept = vec![false; self.poses.len()];
        let mut spans = vec![[0, self.poses.len() - 1]];
        while let Some([first, last]) = spans.pop() {
            (kept[first], kept[last]) = (true, true);
            let misses = (first + 1..last).map(|k| (self.miss(first, last, k), k));
            if let Some((_, farthest)) = misses.filter(|m| m.0 > tolerance_m).max_by(|a, b| a.0.total_cmp(&b.0)) {
                spans.extend([[first, farthest], [farthest, last]]);
            }
        }
        Self::new(self.poses.iter().zip(kept).filter(|(_, kept)| *kept).map(|(pose, _)| *pose).collect())
    }

    /// Distance of pose `k` from the straight line between two others, passed at the same share of the path \[m\].
    fn miss(&self, first: usize, last: usize, k: usize) -> f64 {
        let length = self.reached[last] - self.reached[first];
        let share = if length > 0.0 { (self.reached[k] - self.reached[first]) / length } else { 0.0 };
        let (a, b, pose) = (&self.poses[first], &self.poses[last], &self.poses[k]);
        let passed = a.try_lerp_slerp(b, share, 1e-12).unwrap_or(*b);
        let turn = LEVER_M * passed.rotation.angle_to(&pose.rotation);
        (passed.translation.vector - pose.translation.vector).norm().max(turn)
    }

    /// Poses between the straight lines.
    pub fn poses(&self) -> &[Isometry3<f64>] {
        &self.poses
    }

    /// Where it ends.
    pub fn end(&self) -> &Isometry3<f64> {
        &self.poses[self.poses.len() - 1]
    }

    /// Length \[m\].
    pub fn length_m(&self) -> f64 {
        self.reached[self.reached.len() - 1]
    }

    /// The pose at a share of the length, 0 to 1.
    pub fn at(&self, share: f64) -> Isometry3<f64> {
        let travelled = share * self.length_m();
        let next = self.reached.partition_point(|r| *r < travelled);
        if next == 0 || next >= self.poses.len() {
            return self.poses[next.min(self.poses.len() - 1)];
        }
        let within = (travelled - self.reached[next - 1]) / (self.reached[next] - self.reached[next - 1]);
        let (a, b) = (&self.poses[next - 1], &self.poses[next]);
        a.try_lerp_slerp(b, within, 1e-12).unwrap_or(*b)
    }

    /// Poses no farther apart than `step_m`, every waypoint among them.
    pub fn steps(&self, step_m: f64) -> Vec<Isometry3<f64>> {
        let mut steps = vec![self.poses[0]];
        for (k, pair) in self.poses.windows(2).enumerate() {
            let n = ((self.reached[k + 1] - self.reached[k]) / step_m).ceil().max(1.0) as usize;
            let between = |i: usize| pair[0].try_lerp_slerp(&pair[1], i as f64 / n as f64, 1e-12);
            steps.extend((1..n).filter_map(between));
            steps.push(pair[1]);
        }
        steps
    }
}

/// Diagonal of the skin's box \[m\].
fn extent(skin: &ReferenceSkin) -> f64 {
    let points = skin.skin().positions();
    let (low, high) = points.iter().fold((points[0], points[0]), |(l, h), p| (l.inf(p), h.sup(p)));
    (high - low).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tool_path_is_followed_at_even_pace_through_its_waypoints() {
        let at = |x: f64, z: f64| Isometry3::translation(x, 0.0, z);
        let path = ToolPath::new(vec![at(0.0, 3.0), at(0.0, 0.0), at(1.0, 0.0)]);
        assert_eq!(path.length_m(), 4.0);
        assert!((path.at(0.25).translation.vector.z - 2.0).abs() < 1e-12);
        assert!((path.at(0.875).translation.vector.x - 0.5).abs() < 1e-12);
        assert_eq!((path.at(0.0), path.at(1.0)), (at(0.0, 3.0), at(1.0, 0.0)));
        let steps = path.steps(2.0);
        assert_eq!(steps.len(), 4);
        assert!(steps.contains(&at(0.0, 0.0)) && steps.contains(&at(0.0, 1.5)));
    }

    #[test]
    fn a_straightened_path_keeps_its_corners_and_ends_only() {
        let at = |x: f64, z: f64| Isometry3::translation(x, 0.0, z);
        let path = ToolPath::new(vec![at(0.0, 2.0), at(0.05, 1.0), at(0.0, 0.0), at(1.0, 0.02), at(2.0, 0.0)]);
        assert_eq!(path.straightened(0.1).poses(), [at(0.0, 2.0), at(0.0, 0.0), at(2.0, 0.0)]);
        assert_eq!(path.straightened(0.01).poses(), path.poses());
    }

    #[test]
    fn a_single_pose_is_a_tool_path() {
        let path = ToolPath::new(vec![Isometry3::identity()]);
        assert_eq!((path.length_m(), path.at(0.5)), (0.0, Isometry3::identity()));
    }
}
