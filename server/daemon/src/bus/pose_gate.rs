//! Gate of one tool's poses: accepts or refuses them, and counts both. No bus; the only clock is simulated time.

use plica_protocol::DecodeError;
use plica_protocol::order::{Refusal, SourceOrder};
use plica_protocol::pose::Pose;
use plica_protocol::status::Counters;

use super::counters::count;

/// The gate of one tool.
#[derive(Debug, Clone, Default)]
pub(super) struct PoseGate {
    order: SourceOrder,
    stale_after_s: f64,
    accepted: u64,
    rejected: Counters,
}

impl PoseGate {
    pub(super) fn new(stale_after_s: f64) -> Self {
        Self { stale_after_s, ..Self::default() }
    }

    /// Accepts a pose, or counts its refusal by kind.
    pub(super) fn admit(&mut self, arrived: Result<Pose, DecodeError>, now_s: f64) -> Option<Pose> {
        let pose = match arrived {
            Ok(pose) => pose,
            Err(error) => {
                self.reject(error.kind());
                return None;
            }
        };
        match self.order.take(&pose, now_s, self.stale_after_s) {
            Ok(()) => {
                self.accepted += 1;
                Some(pose)
            }
            Err(refusal) => {
                self.reject(refusal.kind());
                None
            }
        }
    }

    /// Checks poses in this order on a copy of the gate, which replaces the gate if all of them are accepted.
    pub(super) fn try_take(&mut self, pose: &Pose, now_s: f64) -> Result<(), Refusal> {
        self.order.take(pose, now_s, self.stale_after_s)?;
        self.accepted += 1;
        Ok(())
    }

    fn reject(&mut self, kind: &str) {
        count(&mut self.rejected, kind);
    }

    /// Undoes the count of an accepted pose that is not used.
    pub(super) fn turn_back(&mut self, kind: &str) {
        self.accepted -= 1;
        self.reject(kind);
    }

    /// Forgets the source: the next valid pose of any source is accepted.
    pub(super) fn forget(&mut self) {
        self.order.forget();
    }

    pub(super) fn accepted(&self) -> u64 {
        self.accepted
    }

    pub(super) fn rejected(&self) -> &Counters {
        &self.rejected
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(source_id: u32, sequence: u64) -> Pose {
        Pose { source_id, sequence, ..Pose::default() }
    }

    fn rejected(gate: &PoseGate) -> Vec<(&str, u64)> {
        gate.rejected().iter().map(|(kind, n)| (kind.as_str(), *n)).collect()
    }

    #[test]
    fn repeated_and_late_poses_are_counted_and_not_used() {
        let mut gate = PoseGate::new(0.2);
        let used: Vec<bool> = [1, 2, 2, 1, 3].iter().map(|s| gate.admit(Ok(pose(7, *s)), 0.0).is_some()).collect();
        assert_eq!(used, [true, true, false, false, true]);
        assert_eq!(rejected(&gate), [("out_of_order", 1), ("repeated", 1)]);
        assert_eq!(gate.accepted(), 3);
    }

    #[test]
    fn a_second_publisher_is_a_conflict_until_the_first_is_stale() {
        let mut gate = PoseGate::new(0.2);
        assert!(gate.admit(Ok(pose(1, 50)), 0.0).is_some());
        assert!(gate.admit(Ok(pose(2, 1)), 0.1).is_none());
        assert!(gate.admit(Ok(pose(2, 2)), 0.21).is_some(), "takes over");
        assert!(gate.admit(Ok(pose(1, 51)), 0.22).is_none(), "the first one is the second now");
        assert_eq!(rejected(&gate), [("conflict", 2)]);
    }

    #[test]
    fn what_cannot_be_read_is_counted_by_kind() {
        let mut gate = PoseGate::new(0.2);
        assert!(gate.admit(Pose::decode(b"PLPS"), 0.0).is_none());
        assert!(gate.admit(Pose::decode_json(b"{"), 0.0).is_none());
        assert!(gate.admit(Pose { position_m: [f64::NAN; 3], ..pose(1, 1) }.checked(), 0.0).is_none());
        assert_eq!(rejected(&gate), [("bad_json", 1), ("non_finite", 1), ("too_short", 1)]);
    }

    #[test]
    fn a_pose_without_room_is_rejected_and_not_accepted() {
        let mut gate = PoseGate::new(0.2);
        assert!(gate.admit(Ok(pose(1, 1)), 0.0).is_some());
        gate.turn_back("queue_full");
        assert_eq!((gate.accepted(), rejected(&gate)), (0, vec![("queue_full", 1)]));
    }

    #[test]
    fn a_reset_forgets_who_held_the_tool() {
        let mut gate = PoseGate::new(10.0);
        assert!(gate.admit(Ok(pose(1, 9)), 0.0).is_some());
        gate.forget();
        assert!(gate.admit(Ok(pose(2, 1)), 0.0).is_some());
    }
}
