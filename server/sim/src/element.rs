//! Hexahedra: rest stiffness (offline, `f64`) and corotated kernels over batches of sixteen (`f32`).

mod batch;
mod stiffness;

pub(crate) use batch::ElementBatches;
pub use stiffness::{lumped_mass, rest_stiffness};
