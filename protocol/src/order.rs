//! Acceptance of poses of a tool: order within a source, and take-over by another source.
//!
//! One [`SourceOrder`] per tool. The caller passes simulated time, so that the same poses at the same ticks are accepted, however
//! fast they arrive.

use crate::pose::Pose;

/// Why a well-formed pose is refused. [`Refusal::kind`] is its counter in the status.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Refusal {
    /// The pose is flagged as invalid: the tracker does not see the tool.
    Invalid,
    /// The source has sent this sequence before.
    Repeated,
    /// The source has sent a later sequence before.
    OutOfOrder,
    /// Another source holds the tool and is not stale.
    Conflict,
}

impl Refusal {
    /// All refusals.
    pub const ALL: [Self; 4] = [Self::Invalid, Self::Repeated, Self::OutOfOrder, Self::Conflict];

    /// Name of the counter in the status.
    pub fn kind(self) -> &'static str {
        match self {
            Self::Invalid => "invalid",
            Self::Repeated => "repeated",
            Self::OutOfOrder => "out_of_order",
            Self::Conflict => "conflict",
        }
    }
}

/// Source that holds a tool, and its last sequence.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SourceOrder {
    holder: Option<Holder>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Holder {
    source_id: u32,
    sequence: u64,
    taken_at_s: f64,
}

impl SourceOrder {
    /// Accepts or refuses a pose that arrives at simulated time `now_s`; a refused pose changes nothing.
    ///
    /// The holder is stale once its last accepted pose is older than `stale_after_s`. Then the next valid pose of any source is
    /// accepted, with any sequence. A pose with sequence 0 is unnumbered: only its source is compared.
    pub fn take(&mut self, pose: &Pose, now_s: f64, stale_after_s: f64) -> Result<(), Refusal> {
        if !pose.valid {
            return Err(Refusal::Invalid);
        }
        // A holder from later than now belongs to a time before a reset.
        let fresh = self.holder.filter(|holder| (0.0..=stale_after_s).contains(&(now_s - holder.taken_at_s)));
        match fresh {
            Some(holder) if holder.source_id != pose.source_id => return Err(Refusal::Conflict),
            Some(holder) => holder.check(pose.sequence)?,
            None => {}
        }
        let Pose { source_id, sequence, .. } = *pose;
        // An unnumbered pose between numbered ones does not forget how far they had come.
        let sequence = fresh.map_or(sequence, |holder| holder.sequence.max(sequence));
        self.holder = Some(Holder { source_id, sequence, taken_at_s: now_s });
        Ok(())
    }

    /// Forgets the holder: the next valid pose of any source is accepted (`rpc/reset`, `rpc/restore`).
    pub fn forget(&mut self) {
        self.holder = None;
    }
}

impl Holder {
    fn check(&self, sequence: u64) -> Result<(), Refusal> {
        match sequence {
            0 => Ok(()),
            same if same == self.sequence => Err(Refusal::Repeated),
            older if older < self.sequence => Err(Refusal::OutOfOrder),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(source_id: u32, sequence: u64) -> Pose {
        Pose { source_id, sequence, ..Pose::default() }
    }

    #[test]
    fn order_within_a_source() {
        let mut order = SourceOrder::default();
        let mut take = |sequence| order.take(&pose(1, sequence), 0.0, 0.1);
        assert_eq!(take(5), Ok(()));
        assert_eq!(take(5), Err(Refusal::Repeated));
        assert_eq!(take(4), Err(Refusal::OutOfOrder));
        assert_eq!(take(0), Ok(()));
        assert_eq!(take(5), Err(Refusal::Repeated));
        assert_eq!(take(9), Ok(()));
    }

    #[test]
    fn another_source_waits_until_the_first_is_stale() {
        let mut order = SourceOrder::default();
        assert_eq!(order.take(&pose(1, 100), 0.0, 0.1), Ok(()));
        assert_eq!(order.take(&pose(2, 1), 0.05, 0.1), Err(Refusal::Conflict));
        assert_eq!(order.take(&pose(2, 2), 0.2, 0.1), Ok(()));
        assert_eq!(order.take(&pose(1, 101), 0.21, 0.1), Err(Refusal::Conflict));
        // The same source may also start anew, for instance a replay that is played again.
        assert_eq!(order.take(&pose(2, 1), 0.5, 0.1), Ok(()));
        order.forget();
        assert_eq!(order.take(&pose(3, 1), 0.5, 0.1), Ok(()));
    }

    #[test]
    fn a_holder_of_a_time_that_was_restored_away_holds_nothing() {
        let mut order = SourceOrder::default();
        assert_eq!(order.take(&pose(1, 100), 5.0, 0.1), Ok(()));
        assert_eq!(order.take(&pose(2, 1), 4.9, 0.1), Ok(()));
    }

    #[test]
    fn poses_marked_invalid_hold_nothing() {
        let mut order = SourceOrder::default();
        let unseen = Pose { valid: false, ..pose(1, 7) };
        assert_eq!(order.take(&unseen, 0.0, 0.1), Err(Refusal::Invalid));
        assert_eq!(order.take(&pose(2, 1), 0.0, 0.1), Ok(()));
        assert_eq!(Refusal::Invalid.kind(), "invalid");
    }
}
