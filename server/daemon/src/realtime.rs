//! The simulation thread. Between taking poses and handing out the frame nothing is allocated, locked or logged.
//!
//! [`Loop`] is the part without a clock: `serve`, lock-step, `simulate`, `bench` and the tests all call its `turn`.
//! [`spawn`] puts it on a thread with absolute deadlines.

mod cadence;
mod command;
mod enrichment;
mod force_steps;
mod frame;
mod histogram;
mod outbox;
mod pacing;
mod ports;
mod privileges;
mod sim_loop;
mod snapshots;
mod stage_timer;
mod statistics;
mod thread;
mod waker;

pub use command::{Command, EarlyEnd, EarlyEndCause, Outcome, Refusal, Reply, Returned};
pub use frame::{Frame, Reading, ToolFrame};
pub use histogram::{AtomicHistogram, Summary};
pub use pacing::{MAX_CATCH_UP, Pacer, Plan};
pub use ports::{CommandPort, FramePort, Ports, WrenchPort};
pub use privileges::{Grants, ThreadOptions};
pub use sim_loop::{Loop, LoopOptions, Turn};
pub use stage_timer::{StageTimer, TurnProbe};
pub use statistics::{SimTime, Statistics};
pub use thread::{Pace, Running, spawn};
pub use waker::Waker;

#[cfg(test)]
mod tests;
