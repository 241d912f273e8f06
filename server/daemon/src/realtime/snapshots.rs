//! Stored states, in memory that was allocated before the simulation started.

use plica_sim::State;

/// Number of stored states; the oldest is overwritten.
const N_KEPT: u64 = crate::limits::MAX_SNAPSHOTS;

pub(super) struct Snapshots {
    states: Vec<State>,
    taken: u64,
}

impl Snapshots {
    pub(super) fn new(rest: &State) -> Self {
        Self { states: (0..N_KEPT).map(|_| rest.clone()).collect(), taken: 0 }
    }

    /// Stores a state and returns its number, from 1 on.
    pub(super) fn keep(&mut self, state: &State) -> u64 {
        self.taken += 1;
        self.states[(self.taken % N_KEPT) as usize].copy_from(state);
        self.taken
    }

    pub(super) fn find(&self, id: u64) -> Option<&State> {
        let kept = id >= 1 && id <= self.taken && id + N_KEPT > self.taken;
        kept.then(|| &self.states[(id % N_KEPT) as usize])
    }
}
