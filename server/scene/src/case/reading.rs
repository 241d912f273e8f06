//! Readings of probes.

use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use super::probe::{Probe, Sensor, Source};
use super::problem::Problem;
use super::solution::Solution;
use super::tool_contact::ToolLoad;

/// Reading of a probe.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reading {
    /// Quantity.
    pub quantity: &'static str,
    /// Unit of the value.
    pub unit: &'static str,
    /// A number, three components, or the six of a symmetric tensor: xx, yy, zz, xy, yz, xz.
    pub value: Value,
}

/// One number or several.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// One number.
    Scalar(f64),
    /// Components.
    Components(Vec<f64>),
}

impl Probe {
    /// Reads the sensor in a solution.
    pub fn read(&self, problem: &Problem, solution: &Solution) -> Reading {
        let x = solution.positions();
        match &self.sensor {
            Sensor::Displacement(weights) => {
                let rest = problem.mesh().nodes();
                let moved = weights.iter().map(|&(n, w)| (x[n.index()] - rest[n.index()].coords) * w);
                Reading::vector("displacement", "m", &moved.sum())
            }
            Sensor::Force(source) => Reading::vector("force", "N", &wrench(problem, solution, *source).force),
            Sensor::Moment(source, about) => {
                let wrench = wrench(problem, solution, *source);
                Reading::vector("moment", "N m", &(wrench.moment - about.coords.cross(&wrench.force)))
            }
            Sensor::Volume => {
                let value = Value::Scalar(problem.solid().volume(x));
                Reading { quantity: "volume", unit: "m3", value }
            }
            Sensor::Stress(point) => Reading::tensor(&problem.solid().recovered_stress(x, point.element, point.xi)),
        }
    }
}

/// Force and moment about the origin that a support or a tool exerts on the body.
fn wrench(problem: &Problem, solution: &Solution, source: Source) -> ToolLoad {
    let support = match source {
        Source::Tool(tool) => return solution.tool_loads[tool],
        Source::Support(support) => support,
    };
    let x = solution.positions();
    let holding = problem.holding_forces(x, solution.share, &solution.contact_forces);
    let mut sum = ToolLoad::default();
    let rows = &problem.supports()[support].rows;
    for ((node, _), force) in rows.iter().zip(problem.support_forces(support, &holding)) {
        sum.force += force;
        sum.moment += x[node.index()].cross(&force);
    }
    sum
}

impl Reading {
    fn vector(quantity: &'static str, unit: &'static str, v: &Vector3<f64>) -> Self {
        Self { quantity, unit, value: Value::Components(vec![v.x, v.y, v.z]) }
    }

    fn tensor(t: &Matrix3<f64>) -> Self {
        let components = vec![t[(0, 0)], t[(1, 1)], t[(2, 2)], t[(0, 1)], t[(1, 2)], t[(0, 2)]];
        Self { quantity: "stress", unit: "Pa", value: Value::Components(components) }
    }
}

impl Value {
    /// All numbers of the value.
    pub fn components(&self) -> &[f64] {
        match self {
            Self::Scalar(number) => std::slice::from_ref(number),
            Self::Components(numbers) => numbers,
        }
    }
}
