//! One tool placement, before either model has seen it.

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// One tool placement. Compared as JSON when a job goes on: the same plan gives the same text.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Interaction {
    /// Name of the set that it was drawn from.
    pub kind: String,
    /// Tool, by index.
    pub tool: u32,
    /// Contact point that was drawn, on the reference skin \[m\].
    pub contact_point_m: [f64; 3],
    /// Outward unit normal of the reference skin there.
    pub normal: [f64; 3],
    /// What the tool does there.
    pub action: Action,
}

/// What a tool does at a contact point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Action {
    /// Moves to first touch along `approach`, on by `depth_m`, then by `drag_m`.
    Press {
        /// Unit vector.
        approach: [f64; 3],
        /// Orientation of the tool.
        orientation_xyzw: [f64; 4],
        /// How far beyond first touch \[m\].
        depth_m: f64,
        /// Along the skin's tangent plane \[m\].
        drag_m: [f64; 3],
    },
    /// Suction raises the contact point along the normal.
    Lift {
        /// How high the coarse skin is raised \[m\].
        height_m: f64,
        /// Radius of the disc that it acts on \[m\].
        radius_m: f64,
    },
    /// Follows recorded poses and holds the last one.
    Follow {
        /// Position \[m\] and quaternion `xyzw` of each.
        poses: Vec<[f64; 7]>,
    },
}

impl Interaction {
    /// Contact point that was drawn, on the reference skin \[m\].
    pub fn contact_point(&self) -> Point3<f64> {
        self.contact_point_m.into()
    }

    /// Outward unit normal of the reference skin there.
    pub fn normal(&self) -> Vector3<f64> {
        self.normal.into()
    }

    /// Depth or height that was drawn \[m\]; 0 for recorded poses.
    pub fn depth_m(&self) -> f64 {
        match self.action {
            Action::Press { depth_m, .. } => depth_m,
            Action::Lift { height_m, .. } => height_m,
            Action::Follow { .. } => 0.0,
        }
    }

    /// Drag that was drawn \[m\]; 0 for lifts and recorded poses.
    pub fn drag(&self) -> Vector3<f64> {
        match self.action {
            Action::Press { drag_m, .. } => drag_m.into(),
            _ => Vector3::zeros(),
        }
    }
}

/// Position and quaternion `xyzw`.
pub(crate) fn to_numbers(pose: &Isometry3<f64>) -> [f64; 7] {
    let (p, q) = (pose.translation.vector, pose.rotation.coords);
    [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
}

/// From position and quaternion `xyzw`.
pub(crate) fn from_numbers(n: &[f64; 7]) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::new(n[0], n[1], n[2]), rotation([n[3], n[4], n[5], n[6]]))
}

pub(crate) fn rotation([x, y, z, w]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}

/// The turn of least angle that puts the tool's z axis against `approach`; about x where it is half a turn.
pub(crate) fn orientation(approach: &Vector3<f64>) -> [f64; 4] {
    let turn = UnitQuaternion::rotation_between(&Vector3::z(), &-approach)
        .unwrap_or_else(|| UnitQuaternion::from_quaternion(Quaternion::new(0.0, 1.0, 0.0, 0.0)));
    turn.coords.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tool_points_its_z_axis_away_from_the_skin() {
        for approach in [-Vector3::z(), Vector3::z(), Vector3::x(), -Vector3::y(), Vector3::new(0.6, 0.0, -0.8)] {
            let turned = rotation(orientation(&approach)) * Vector3::z();
            assert!((turned + approach).norm() < 1e-12, "{approach:?}: {turned:?}");
        }
        assert_eq!(orientation(&-Vector3::z()), [0.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn poses_survive_as_numbers() {
        let pose = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.1, -0.2, 0.3));
        let back = from_numbers(&to_numbers(&pose));
        assert!((back.to_matrix() - pose.to_matrix()).norm() < 1e-15);
    }
}
