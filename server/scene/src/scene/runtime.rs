//! `[runtime]` and `[contact]` in the simulation's types.

use nalgebra::Vector3;
use plica_sim::{ContactOptions, SleepOptions};

use super::raw::{RawContact, RawRuntime};
/// Time step, gravity, real-time thread.
#[derive(Debug, Clone)]
pub struct RuntimeConfig {
    timestep_s: f64,
    gravity_m_per_s2: Vector3<f64>,
    realtime_priority: Option<u32>,
    cpu: Option<usize>,
    lock_memory: bool,
    sleep: SleepOptions,
}

impl RuntimeConfig {
    /// Length of a tick \[s\].
    pub fn timestep_s(&self) -> f64 {
        self.timestep_s
    }
    /// Acceleration of free fall, along -z \[m/s2\].
    pub fn gravity_m_per_s2(&self) -> Vector3<f64> {
        self.gravity_m_per_s2
    }
    /// Requested `SCHED_FIFO` priority, if any.
    pub fn realtime_priority(&self) -> Option<u32> {
        self.realtime_priority
    }
    /// Core that the simulation thread is pinned to, if any.
    pub fn cpu(&self) -> Option<usize> {
        self.cpu
    }
    /// Whether memory is locked.
    pub fn lock_memory(&self) -> bool {
        self.lock_memory
    }
    /// Sleep of an object at rest.
    pub fn sleep(&self) -> &SleepOptions {
        &self.sleep
    }
}

pub(super) fn runtime(raw: &RawRuntime) -> RuntimeConfig {
    RuntimeConfig {
        timestep_s: raw.timestep_s,
        gravity_m_per_s2: Vector3::new(0.0, 0.0, -raw.gravity_m_per_s2),
        realtime_priority: (raw.realtime_priority > 0).then_some(raw.realtime_priority),
        cpu: raw.cpu.map(|cpu| cpu as usize),
        lock_memory: raw.lock_memory,
        sleep: SleepOptions {
            enabled: raw.sleep.enabled,
            speed_m_per_s: raw.sleep.speed_m_per_s,
            after_s: raw.sleep.after_s,
        },
    }
}

pub(super) fn contact(raw: &RawContact) -> ContactOptions {
    ContactOptions {
        stiffness_ratio: raw.stiffness_ratio,
        multiplier_relaxation: raw.multiplier_relaxation,
        activation_gap_m: raw.activation_gap_m,
        recovery_time_s: raw.recovery_time_s,
        max_contacts: raw.max_contacts as usize,
        max_support_contacts: raw.max_support_contacts as usize,
        plane_friction: raw.plane_friction,
    }
}
