//! Tools of a case: rigid shapes that move as the loads grow.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use plica_accurate::contact::Obstacle;
use plica_geometry::ConvexPolytope;

use super::raw::{RawCaseShape, RawCaseTool};
use super::support;
use crate::checks::Check;
use crate::error::ConfigError;

/// Sides of the prism of a round punch.
const PUNCH_SIDES: usize = 64;

/// A rigid tool.
#[derive(Debug, Clone)]
pub struct Tool {
    /// Name in the case.
    pub name: String,
    pub(super) obstacle: Obstacle,
    start: Isometry3<f64>,
    motion_m: Vector3<f64>,
    pub(super) friction: f64,
}

impl Tool {
    /// `world <- tool` under a share of the loads.
    pub(super) fn pose(&self, share: f64) -> Isometry3<f64> {
        let moved = self.start.translation.vector + self.motion_m * share;
        Isometry3::from_parts(Translation3::from(moved), self.start.rotation)
    }

    /// Length of the way under full loads \[m\].
    pub(super) fn way_m(&self) -> f64 {
        self.motion_m.norm()
    }
}

pub(super) fn check(c: &Check<'_>, raw: &[RawCaseTool]) -> Result<Vec<Tool>, ConfigError> {
    if let Some(i) = raw.iter().position(|tool| tool.friction > 0.0).filter(|_| raw.len() > 1) {
        let problem = "is above 0 while the case has several tools";
        return Err(c.error(&format!("tools.{i}.friction"), problem, "give a single tool friction, or none"));
    }
    let tool = |(i, tool): (usize, &RawCaseTool)| {
        let key = format!("tools.{i}");
        let flat = |e: plica_geometry::HullError| {
            c.error(&format!("{key}.shape"), e.to_string(), "give a shape with a volume")
        };
        let axis = support::direction(c, &format!("{key}.axis"), tool.axis.unwrap_or([0.0, 0.0, 1.0]))?;
        let turn = UnitQuaternion::rotation_between_axis(&Vector3::z_axis(), &axis);
        let half = || UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        Ok(Tool {
            name: tool.name.clone(),
            obstacle: obstacle(tool.shape).map_err(flat)?,
            start: Isometry3::from_parts(tool.position_m.into(), turn.unwrap_or_else(half)),
            motion_m: tool.motion_m.into(),
            friction: tool.friction,
        })
    };
    raw.iter().enumerate().map(tool).collect()
}

fn obstacle(shape: RawCaseShape) -> Result<Obstacle, plica_geometry::HullError> {
    Ok(match shape {
        RawCaseShape::Ball { radius_m } => Obstacle::Ball { radius_m },
        RawCaseShape::Capsule { radius_m, length_m } => Obstacle::Capsule { radius_m, length_m },
        RawCaseShape::Cuboid { size_m } => {
            Obstacle::Polytope(ConvexPolytope::cuboid(size_m.map(|extent| 0.5 * extent))?)
        }
        RawCaseShape::Punch { radius_m, length_m } => {
            Obstacle::Polytope(ConvexPolytope::hull(prism(radius_m, length_m))?)
        }
        RawCaseShape::HalfSpace {} => Obstacle::HalfSpace,
    })
}

/// Corners of a prism with the area of the circle.
fn prism(radius_m: f64, length_m: f64) -> Vec<Point3<f64>> {
    let step = std::f64::consts::TAU / PUNCH_SIDES as f64;
    let radius = radius_m * (step / step.sin()).sqrt();
    let corner = |i: usize, z: f64| Point3::new(radius * (i as f64 * step).cos(), radius * (i as f64 * step).sin(), z);
    (0..PUNCH_SIDES).flat_map(|i| [corner(i, 0.0), corner(i, length_m)]).collect()
}
