//! Contact history: pressures, tractions and anchors between increments of a tool's motion.

use nalgebra::{Isometry3, Point3, Vector3};

use super::obstacle::Obstacle;
use super::surface::ContactSurface;

/// Bisections of the interval in which a point meets the obstacle.
const TOUCH_HALVINGS: u32 = 40;

/// Pressures, tractions and anchors of all contact points, at one pose of the tool.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactState {
    pub(super) pose: Isometry3<f64>,
    pub(super) pressures_pa: Vec<f64>,
    pub(super) tractions_pa: Vec<Vector3<f64>>,
    /// Anchor of each point, in the tool's frame; without contact the position of the point \[m\].
    pub(super) anchors: Vec<Point3<f64>>,
}

impl ContactState {
    /// State without contact: tool at `pose`, nodes at `x: [n_nodes]` \[m\].
    pub fn untouched(surface: &ContactSurface, pose: &Isometry3<f64>, x: &[Vector3<f64>]) -> Self {
        let points = surface.points();
        Self {
            pose: *pose,
            pressures_pa: vec![0.0; points.len()],
            tractions_pa: vec![Vector3::zeros(); points.len()],
            anchors: points.iter().map(|point| pose.inverse_transform_point(&point.position(x))).collect(),
        }
    }

    /// `world <- tool`.
    pub fn pose(&self) -> &Isometry3<f64> {
        &self.pose
    }

    /// Normal pressure per reference area, `[n_points]` \[Pa\]; 0 without contact.
    pub fn pressures_pa(&self) -> &[f64] {
        &self.pressures_pa
    }

    /// Tangential traction on the tool per reference area, `[n_points]` \[Pa\].
    pub fn tractions_pa(&self) -> &[Vector3<f64>] {
        &self.tractions_pa
    }

    /// Anchors when the tool is at `pose`, in world coordinates \[m\].
    ///
    /// A point in contact keeps its anchor. A point that the moving tool meets, the point being at rest, is anchored
    /// where they meet; every other point at its position.
    pub(super) fn anchors_at(&self, pose: &Isometry3<f64>, obstacle: &Obstacle) -> Vec<Point3<f64>> {
        let anchor = |(anchor, pressure): (&Point3<f64>, &f64)| {
            let met = if *pressure > 0.0 { *anchor } else { self.meet(anchor, pose, obstacle) };
            pose * met
        };
        self.anchors.iter().zip(&self.pressures_pa).map(anchor).collect()
    }

    /// Position at which the tool, moving to `pose`, meets a point at rest; in the tool's frame.
    fn meet(&self, start: &Point3<f64>, pose: &Isometry3<f64>, obstacle: &Obstacle) -> Point3<f64> {
        let end = pose.inverse_transform_point(&(self.pose * start));
        let distance = |p: &Point3<f64>| obstacle.distance(&Isometry3::identity(), p);
        if distance(&end) >= 0.0 || distance(start) <= 0.0 {
            return if distance(start) <= 0.0 { *start } else { end };
        }
        let (mut free, mut inside) = (*start, end);
        for _ in 0..TOUCH_HALVINGS {
            let middle = nalgebra::center(&free, &inside);
            if distance(&middle) >= 0.0 { free = middle } else { inside = middle }
        }
        free
    }
}
