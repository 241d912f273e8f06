//! plicad: the daemon.
pub mod config;
