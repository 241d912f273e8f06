//! The daemon of Plica: bus, real-time loop, server.
//!
//! It holds no finite-element arithmetic and reads no scene file: wire types become simulation types in [`wire`], and
//! everything else moves bytes and time.

pub mod bus;
pub mod database_loader;
pub mod limits;
pub mod realtime;
pub mod replay;
pub mod server;
pub mod wire;
