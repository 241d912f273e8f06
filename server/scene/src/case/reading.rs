//! Readings of probes.

use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use super::probe::{Probe, Sensor};
use super::problem::Problem;
use super::solution::Solution;

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
            Sensor::Force(support) => Reading::vector("force", "N", &problem.support_force(*support, x)),
            Sensor::Volume => {
                let value = Value::Scalar(problem.solid().volume(x));
                Reading { quantity: "volume", unit: "m3", value }
            }
            Sensor::Stress(hex, xi) => Reading::tensor(&problem.solid().cauchy_stress(x, *hex, *xi)),
        }
    }
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
