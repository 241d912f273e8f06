//! Scenes, cases of the accurate solver and recorded motions: read from files, checked, and converted to descriptions for the
//! simulation, the accurate solver and training.
//!
//! A file is parsed once into a raw type (as typed) and once into a checked type (SI units, every number within its range).
//! The numerical crates check their own inputs again, since they are libraries.

mod checks;
mod document;
mod error;
mod motion_start;
mod ranges;
mod timed_pose;

pub mod case;
pub mod extents;
pub mod hash;
pub mod model;
pub mod motion;
pub mod scene;
pub mod setup;

pub use document::Document;
pub use error::ConfigError;
pub use scene::{BUILT_IN_SCENE, Config};
