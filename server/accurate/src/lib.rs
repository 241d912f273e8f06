//! The accurate model of Plica: quasi-static equilibria of non-linear solids, found by Newton's method on a sum of energies.
//!
//! [`Energy`] is the one trait: value, gradient and Hessian on a fixed sparsity. [`Solver`] holds the symbolic factorisation
//! and minimises a sum of energies under [`Constraints`]. The caller chooses the energies: a [`Solid`], loads,
//! a [`Tie`] to a coarse imprint, or contact with a tool.
//!
//! Arithmetic is `f64` in SI units. This crate knows no bus, no thread and no clock; a callback receives progress and may
//! cancel. The same input gives the same bits.

mod assembly;
mod constraints;
pub mod contact;
mod energy;
mod factor;
mod hessian;
mod loads;
mod material;
mod newton;
mod ordering;
mod reaction;
mod solid;
mod tie;

pub use constraints::Constraints;
pub use energy::{Energy, Projection};
pub use factor::FactorError;
pub use hessian::Hessian;
pub use loads::{Couple, NodalForces, Pressure, Traction, body_forces, face_area, volume_forces};
pub use material::{Fibres, Lame, Material, MaterialError, MaterialModel};
pub use newton::{ArcState, Info, Loading, Mode, Params, Progress, SolveError, Solver};
pub use reaction::reactions;
pub use solid::{GAUSS_POINTS, Solid, SolidError, TurnGuard};
pub use tie::{TIE_VERSION, Tie, TieOptions, TieTarget};
