//! Client of a Plica daemon: publishes poses, receives skins and wrenches, calls methods.
//!
//! ```no_run
//! use std::time::Duration;
//! use plica_client::{Client, ClientOptions, PoseSource};
//!
//! let client = Client::connect(&ClientOptions::default())?;
//! let wrenches = client.subscribe_wrenches("probe", 1000)?;
//! let mut source = PoseSource::new();
//! client.publish_pose("probe", &source.pose([0.05, 0.03, 0.05], [0.0, 0.0, 0.0, 1.0]))?;
//! if let Some(message) = wrenches.next(Duration::from_secs(1)) {
//!     println!("{:?} N", message.wrench.force_n);
//! }
//! # Ok::<(), plica_client::ClientError>(())
//! ```
//!
//! All calls block, at most for the time-out of [`ClientOptions`]. They work from plain threads and from tokio's
//! multi-threaded runtime; Zenoh refuses tokio's single-threaded one.
//! [`pattern`] and [`recording`] work without a bus.

mod client;
mod error;
mod jobs;
pub mod mesh;
mod options;
pub mod pattern;
pub mod pose_file;
mod publish;
mod query;
mod queue;
mod reach;
pub mod recording;
mod subscribe;

pub use client::Client;
pub use error::ClientError;
pub use jobs::FetchError;
pub use options::ClientOptions;
pub use plica_protocol as protocol;
pub use publish::{PosePublisher, PoseSource, SourceClock};
pub use queue::StreamStats;
pub use subscribe::{RawMessage, SkinMessage, Subscription, WrenchMessage};
