//! The command line of Plica: commands, charts, pictures, and the demo, which is a real client of its own daemon.

pub mod cli;
pub mod commands;
pub mod deafness;
pub mod demo;
pub mod frames_file;
pub mod logging;
pub mod picture;
pub mod roofline;
pub mod run_cost;
pub mod sampling_cost;
mod service;
pub mod work;
