//! Wakes a thread that may not have been started yet, without a lock.

use std::sync::OnceLock;
use std::thread::Thread;

/// A thread to wake; without one, waking has no effect.
#[derive(Debug, Default)]
pub struct Waker(OnceLock<Thread>);

impl Waker {
    /// The calling thread is the one to wake from now on. Later calls change nothing.
    pub fn register_current(&self) {
        let _ = self.0.set(std::thread::current());
    }

    /// Ends the thread's present or next `park`.
    pub fn wake(&self) {
        if let Some(thread) = self.0.get() {
            thread.unpark();
        }
    }
}
