//! What enrichment is made from: a database's examples as the run-time phase takes them.

use nalgebra::Point3;
use plica_sim::enrichment::{Examples, Touch};

use crate::database::Database;
use crate::example::Example;

impl Database {
    /// The first `n` examples, or all where there are fewer: each `u` with its `d` and its place. A training database is in
    /// farthest-point order, so that any leading part covers the region.
    pub fn leading_examples(&self, n: usize) -> Examples {
        let taken = &self.examples[..n.min(self.examples.len())];
        Examples {
            displacements: taken.iter().map(|e| e.displacements.clone()).collect(),
            details: taken.iter().map(|e| e.detail.clone()).collect(),
            touches: taken.iter().map(Example::touch).collect(),
        }
    }
}

impl Example {
    /// Where its tool touches.
    pub fn touch(&self) -> Touch {
        let [x, y, z, ..] = self.tool_pose;
        Touch { contact_point: self.contact_point.into(), tool_origin: Point3::new(x, y, z) }
    }
}
