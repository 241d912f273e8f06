//! Frictional contact between the skin and tools or planes, imposed inside the implicit solve.
//!
//! [`solid`] knows shapes ([`plane_octree`] and [`vertex_graph`] those of many faces), [`detect`] finds skin points near them,
//! [`rows`] turns them into constraint rows that keep their multipliers across ticks, [`friction_law`] is the contact and
//! friction law, [`proxy`] the coupled tools, [`coupling`] the contact operator of the linear solver, [`point`] the contact
//! point on the reference skin.

mod coupling;
mod detect;
mod friction_law;
mod plane_octree;
mod point;
mod proxy;
mod rows;
mod solid;
mod surface;
mod vertex_graph;

pub(crate) use coupling::ContactCoupling;
pub(crate) use detect::{Detector, Search};
pub(crate) use friction_law::{evaluate, predict_secant, settle, stack_forces};
pub(crate) use point::{ContactPoint, contact_point};
pub(crate) use proxy::{Proxy, ProxyMotion, at_arm};
pub(crate) use rows::{Contact, Rows, Selection};
pub(crate) use solid::{Placement, Solid};
pub(crate) use surface::SkinSurface;

/// Run-time 3-vector.
pub(crate) type V3 = nalgebra::Vector3<f32>;
/// Run-time 3x3 matrix.
pub(crate) type M3 = nalgebra::Matrix3<f32>;
