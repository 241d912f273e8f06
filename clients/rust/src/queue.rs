//! Bounded queue between a Zenoh callback and its reader: pushing never blocks and never allocates more.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Message that a full queue drops.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Overflow {
    /// The oldest one: the latest wins.
    DropOldest,
    /// The new one: the messages in the queue have no gaps.
    DropNewest,
}

/// Counters of a subscription.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StreamStats {
    /// Well-formed messages that arrived, dropped ones included.
    pub received: u64,
    /// Messages dropped here, since the reader was slower.
    pub dropped: u64,
    /// Gaps in the sequence: messages dropped by the daemon or the bus.
    pub missed: u64,
    /// Messages that could not be decoded.
    pub malformed: u64,
}

pub(crate) struct Queue<T> {
    state: Mutex<State<T>>,
    filled: Condvar,
    capacity: usize,
    overflow: Overflow,
}

struct State<T> {
    items: VecDeque<T>,
    stats: StreamStats,
    next_sequence: Option<u64>,
}

impl<T> Queue<T> {
    pub(crate) fn new(capacity: usize, overflow: Overflow) -> Self {
        let stats = StreamStats::default();
        let items = VecDeque::with_capacity(capacity.clamp(1, 1024));
        let state = Mutex::new(State { items, stats, next_sequence: None });
        Self { state, filled: Condvar::new(), capacity: capacity.max(1), overflow }
    }

    /// Appends a message; `sequence` is its number in the stream, if the stream is numbered.
    pub(crate) fn push(&self, item: T, sequence: Option<u64>) {
        let mut state = self.lock();
        state.stats.received += 1;
        state.count_missed(sequence);
        if state.items.len() == self.capacity {
            state.stats.dropped += 1;
            match self.overflow {
                Overflow::DropNewest => return,
                Overflow::DropOldest => state.items.pop_front(),
            };
        }
        state.items.push_back(item);
        self.filled.notify_one();
    }

    pub(crate) fn count_malformed(&self) {
        self.lock().stats.malformed += 1;
    }

    /// The oldest message, waiting at most `timeout` for one.
    pub(crate) fn pop(&self, timeout: Duration) -> Option<T> {
        let (mut state, _) = self
            .filled
            .wait_timeout_while(self.lock(), timeout, |state| state.items.is_empty())
            .unwrap_or_else(PoisonError::into_inner);
        state.items.pop_front()
    }

    pub(crate) fn stats(&self) -> StreamStats {
        self.lock().stats
    }

    fn lock(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T> State<T> {
    /// A falling sequence means that the daemon was restarted: nothing is missing.
    fn count_missed(&mut self, sequence: Option<u64>) {
        let Some(sequence) = sequence else { return };
        if let Some(next) = self.next_sequence {
            self.stats.missed += sequence.saturating_sub(next);
        }
        self.next_sequence = Some(sequence.saturating_add(1));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NO_WAIT: Duration = Duration::ZERO;

    fn filled(overflow: Overflow) -> Queue<u64> {
        let queue = Queue::new(2, overflow);
        [10, 11, 12].into_iter().for_each(|n| queue.push(n, Some(n)));
        queue
    }

    #[test]
    fn latest_wins_or_first_come() {
        let (oldest, newest) = (filled(Overflow::DropOldest), filled(Overflow::DropNewest));
        assert_eq!([oldest.pop(NO_WAIT), oldest.pop(NO_WAIT), oldest.pop(NO_WAIT)], [Some(11), Some(12), None]);
        assert_eq!([newest.pop(NO_WAIT), newest.pop(NO_WAIT), newest.pop(NO_WAIT)], [Some(10), Some(11), None]);
        assert_eq!((oldest.stats().received, oldest.stats().dropped), (3, 1));
    }

    #[test]
    fn holes_in_the_sequence_are_counted() {
        let queue = Queue::new(8, Overflow::DropNewest);
        [5, 6, 9, 1, 2].into_iter().for_each(|n| queue.push(n, Some(n)));
        assert_eq!(queue.stats().missed, 2);
    }
}
