//! Conversion between wire types and simulation types, in this file only.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use plica_protocol::pose::Pose;
use plica_protocol::rpc::{
    ANSWER_WITHIN, ActivateReply, ErrorCode, ErrorReply, MAX_SNAPSHOTS, SnapshotReply, StateReply, StepReply,
};
use plica_protocol::skin::{SkinFlags, SkinHeader};
use plica_protocol::status::{Distribution, ObjectStatus, Realtime, Scheduling, SolverStatus, ToolStatus};
use plica_protocol::wrench::{Wrench, WrenchFlags};
use plica_sim::{PoseSample, ToolReading};

use crate::realtime::{EarlyEndCause, Frame, Grants, Outcome, Reading, Refusal, Summary, ToolFrame};

/// A pose that has passed the protocol's gate.
pub fn pose_sample(pose: &Pose) -> PoseSample {
    let [x, y, z, w] = pose.orientation_xyzw;
    // The gate has normalised it; doing so again would change bits.
    let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z));
    let translation = Translation3::from(pose.position_m);
    PoseSample {
        sequence: pose.sequence,
        // 0 on the wire is an unknown time.
        source_time_ns: (pose.source_time_ns != 0).then_some(pose.source_time_ns),
        valid: pose.valid,
        pose: Isometry3::from_parts(translation, rotation),
    }
}

/// Position and quaternion `xyzw` of a pose.
pub fn position_and_xyzw(pose: &Isometry3<f64>) -> ([f64; 3], [f64; 4]) {
    let q = pose.rotation.quaternion();
    (pose.translation.vector.into(), [q.i, q.j, q.k, q.w])
}

/// Header of a skin frame; format, scale and vertex count are filled in where it is encoded.
pub fn skin_header(frame: &Frame, sequence: u64) -> SkinHeader {
    SkinHeader {
        sequence,
        tick: frame.tick,
        sim_time_s: frame.sim_time_s,
        newest_pose_source_time_ns: frame.newest_pose_source_time_ns,
        flags: SkinFlags {
            enriched: frame.confidence > 0.0,
            degraded: frame.degraded,
            sleeping: frame.sleeping,
            ..SkinFlags::default()
        },
        confidence: frame.confidence,
        database_generation: frame.database_generation,
        ..SkinHeader::default()
    }
}

/// Wrench of a tool.
pub fn wrench(frame: &ToolFrame, sequence: u64) -> Wrench {
    let r = &frame.reading;
    let (proxy_position_m, proxy_orientation_xyzw) = position_and_xyzw(&r.proxy);
    Wrench {
        sequence,
        tick: frame.tick,
        sim_time_s: frame.sim_time_s,
        pose_sequence: r.pose_sequence,
        pose_source_time_ns: r.pose_source_time_ns,
        force_n: r.force_n.into(),
        torque_n_m: r.torque_n_m.into(),
        contact_point_m: r.contact_point_m.coords.into(),
        proxy_position_m,
        proxy_orientation_xyzw,
        flags: wrench_flags(r),
        n_contacts: r.n_contacts,
        confidence: frame.confidence,
    }
}

fn wrench_flags(r: &ToolReading) -> WrenchFlags {
    WrenchFlags { in_contact: r.in_contact, sliding: r.sliding, saturated: r.saturated, stale: r.stale }
}

/// Nanoseconds to microseconds.
pub fn distribution(s: &Summary) -> Distribution {
    let us = |ns: u64| ns as f64 * 1e-3;
    Distribution {
        count: s.count,
        min: us(s.min_ns),
        p50: us(s.p50_ns),
        p90: us(s.p90_ns),
        p99: us(s.p99_ns),
        p999: us(s.p999_ns),
        max: us(s.max_ns),
    }
}

/// One tool; the pose counters belong to the bus and are filled in there.
pub fn tool_status(r: &ToolReading) -> ToolStatus {
    ToolStatus {
        pose_sequence: r.pose_sequence,
        pose_age_s: r.present.then_some(r.pose_age_s),
        stale: r.stale,
        in_contact: r.in_contact,
        n_contacts: r.n_contacts,
        force_n: r.force_n.into(),
        saturated: r.saturated,
        placements: r.placements,
        ..ToolStatus::default()
    }
}

/// The object; sizes and frame counters are filled in by the bus.
pub fn object_status(reading: &Reading) -> ObjectStatus {
    ObjectStatus {
        sleeping: reading.report.sleeping,
        rollbacks: reading.rollbacks,
        enriched: reading.confidence.is_some(),
        database_generation: reading.database_generation,
        confidence: reading.confidence.map(f64::from),
        max_penetration_m: reading.max_penetration_m.into(),
        dropped_contacts: reading.dropped_contacts,
        solver: SolverStatus { iterations: reading.report.iterations.into(), fallbacks: reading.fallbacks },
        ..ObjectStatus::default()
    }
}

/// Privileges that the operating system granted.
pub fn realtime(grants: &Grants) -> Realtime {
    Realtime {
        scheduling: if grants.fifo { Scheduling::Fifo } else { Scheduling::Normal },
        memory_locked: grants.memory_locked,
        timer_slack_ns: grants.timer_slack_ns,
        warnings: grants.warnings.clone(),
    }
}

/// Reply of `reset`, `pause`, `resume`, `restore`, `interrupt`.
pub fn state_reply(outcome: &Outcome) -> StateReply {
    StateReply { tick: outcome.tick, sim_time_s: outcome.sim_time_s, paused: outcome.paused }
}

/// Reply of a `step` of `ticks` ticks, or the error of one that stopped early.
pub fn step_reply(outcome: &Outcome, ticks: u32) -> Result<StepReply, ErrorReply> {
    let Some(early) = outcome.early else {
        return Ok(StepReply { tick: outcome.tick, sim_time_s: outcome.sim_time_s });
    };
    let (tick, ticks_done) = (outcome.tick, ticks - early.ticks_left);
    let reached =
        format!("after {ticks_done} of {ticks} ticks, at tick {tick}; step again for the rest, without the poses");
    let error = match early.cause {
        EarlyEndCause::Interrupted => {
            ErrorReply::new(ErrorCode::Interrupted, format!("rpc/interrupt ended the step {reached}"))
        }
        EarlyEndCause::Deadline => {
            let limit_s = ANSWER_WITHIN.as_secs();
            ErrorReply::new(ErrorCode::TimedOut, format!("the step reached its limit of {limit_s} s {reached}"))
        }
    };
    Err(error.stopped_at(tick, ticks_done))
}

/// Error reply of a step that expects another tick.
pub fn wrong_tick(present: &Outcome, from_tick: u64) -> ErrorReply {
    let message = format!(
        "the simulation is at tick {}, and from_tick is {from_tick}; nothing was done. If this repeats a step whose answer got \
         lost, that step was carried out",
        present.tick
    );
    ErrorReply { tick: Some(present.tick), ..ErrorReply::new(ErrorCode::WrongTick, message) }
}

/// Reply of `snapshot`.
pub fn snapshot_reply(outcome: &Outcome) -> SnapshotReply {
    SnapshotReply { id: outcome.snapshot.unwrap_or_default().to_string() }
}

/// Reply of `activate`.
pub fn activate_reply(outcome: &Outcome, n_examples: usize) -> ActivateReply {
    ActivateReply {
        tick: outcome.tick,
        database_generation: outcome.database_generation,
        examples: u32::try_from(n_examples).unwrap_or(u32::MAX),
    }
}

/// Error reply of a refused command.
pub fn refusal(refusal: Refusal) -> ErrorReply {
    let (code, message) = match refusal {
        Refusal::NotPaused => (ErrorCode::NotPaused, "step needs a paused simulation; call rpc/pause first".to_owned()),
        Refusal::LockStep => (
            ErrorCode::RpcMalformed,
            "this daemon runs in lock-step and moves by rpc/step only; start it without --lock-step".to_owned(),
        ),
        Refusal::UnknownSnapshot => {
            (ErrorCode::UnknownSnapshot, format!("no snapshot of that id; the last {MAX_SNAPSHOTS} are kept"))
        }
        Refusal::Busy => (ErrorCode::Busy, "steps of an earlier request are still running".to_owned()),
    };
    ErrorReply::new(code, message)
}
