//! Keeps panics inside callbacks.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use plica_protocol::rpc::ErrorCode;

use super::counters::SharedCounters;

/// A callback that never unwinds into Zenoh, where a panic would end reception from that client for good. A caught
/// panic is counted as `internal`.
pub(super) fn guarded<T>(
    counters: &Arc<SharedCounters>,
    callback: impl Fn(T) + Send + Sync + 'static,
) -> impl Fn(T) + Send + Sync + 'static {
    let counters = Arc::clone(counters);
    move |value| {
        if catch_unwind(AssertUnwindSafe(|| callback(value))).is_err() {
            counters.count(ErrorCode::Internal.name());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_counted_and_goes_no_further() {
        let counters = Arc::new(SharedCounters::default());
        let callback = guarded(&counters, |number: i32| assert_ne!(number, 0, "on purpose"));
        callback(0);
        callback(1);
        assert_eq!(counters.copy()["internal"], 1);
    }
}
