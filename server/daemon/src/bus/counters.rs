//! Counters by kind of event, for threads that may lock.

use std::sync::{Mutex, PoisonError};

use plica_protocol::status::Counters;

/// Counters that several threads write.
#[derive(Debug, Default)]
pub(super) struct SharedCounters(Mutex<Counters>);

impl SharedCounters {
    pub(super) fn count(&self, kind: &str) {
        let mut counters = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        count(&mut counters, kind);
    }

    pub(super) fn copy(&self) -> Counters {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Adds one to the counter of `kind`.
pub(super) fn count(counters: &mut Counters, kind: &str) {
    match counters.get_mut(kind) {
        Some(n) => *n += 1,
        None => drop(counters.insert(kind.to_owned(), 1)),
    }
}
