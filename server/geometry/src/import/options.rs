//! Unit of a mesh file, and joining of its nodes.

/// How a mesh file is to be read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadOptions {
    /// Length of the file's unit \[m\].
    pub metres_per_unit: f64,
    /// Nodes closer than this become one \[m\]. Without it none do, and parts that touch without sharing nodes are an error; with
    /// 0 none do, and such parts are a remark.
    pub merge_tolerance_m: Option<f64>,
}

impl ReadOptions {
    /// A file in this unit \[m\] whose parts share their nodes.
    pub fn unit(metres_per_unit: f64) -> Self {
        Self { metres_per_unit, merge_tolerance_m: None }
    }
}
