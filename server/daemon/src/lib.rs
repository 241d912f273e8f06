//! The daemon of Plica: configuration, the real-time loop, the bus and the command line.
//!
//! It holds no finite-element arithmetic: scenes become [`plica_sim::ModelDescription`]s in [`scene`], wire types
//! become simulation types in [`wire`], and everything else moves bytes and time.

pub mod bus;
pub mod case;
pub mod cli;
pub mod commands;
pub mod config;
pub mod demo;
pub mod enrichment;
pub mod frames_file;
pub mod jobs;
pub mod limits;
pub mod logging;
pub mod motion;
pub mod picture;
pub mod realtime;
pub mod replay;
pub mod roofline;
pub mod scene;
pub mod server;
pub mod surface;
pub mod training;
pub mod wire;
