//! `[runtime]` and `[contact]`, checked.

use nalgebra::Vector3;
use plica_sim::{ContactOptions, SleepOptions};

use super::raw::{RawContact, RawRuntime};
use crate::checks::Check;
use crate::error::ConfigError;

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
    /// `SCHED_FIFO` priority to ask for, if any.
    pub fn realtime_priority(&self) -> Option<u32> {
        self.realtime_priority
    }
    /// Core that the simulation thread is pinned to, if any.
    pub fn cpu(&self) -> Option<usize> {
        self.cpu
    }
    /// Whether to lock memory.
    pub fn lock_memory(&self) -> bool {
        self.lock_memory
    }
    /// When an object at rest stops being solved.
    pub fn sleep(&self) -> &SleepOptions {
        &self.sleep
    }
}

pub(super) fn check(c: &Check<'_>, raw: &RawRuntime) -> Result<RuntimeConfig, ConfigError> {
    let gravity = c.number("runtime.gravity_m_per_s2", raw.gravity_m_per_s2, 0.0, 100.0)?;
    let priority = c.count("runtime.realtime_priority", raw.realtime_priority, 0, 99)?;
    let cpu = raw.cpu.map(|cpu| c.count("runtime.cpu", cpu, 0, 1023)).transpose()?;
    Ok(RuntimeConfig {
        timestep_s: c.number("runtime.timestep_s", raw.timestep_s, 1e-4, 0.02)?,
        gravity_m_per_s2: Vector3::new(0.0, 0.0, -gravity),
        realtime_priority: (priority > 0).then_some(priority),
        cpu: cpu.map(|cpu| cpu as usize),
        lock_memory: raw.lock_memory,
        sleep: SleepOptions {
            enabled: raw.sleep.enabled,
            speed_m_per_s: c.number("runtime.sleep.speed_m_per_s", raw.sleep.speed_m_per_s, 1e-8, 0.1)?,
            after_s: c.number("runtime.sleep.after_s", raw.sleep.after_s, 0.0, 60.0)?,
        },
    })
}

pub(super) fn check_contact(c: &Check<'_>, raw: &RawContact) -> Result<ContactOptions, ConfigError> {
    Ok(ContactOptions {
        stiffness_ratio: c.number("contact.stiffness_ratio", raw.stiffness_ratio, 1.0, 100.0)?,
        multiplier_relaxation: c.number("contact.multiplier_relaxation", raw.multiplier_relaxation, 1e-3, 1.0)?,
        activation_gap_m: c.number("contact.activation_gap_m", raw.activation_gap_m, 0.0, 0.01)?,
        recovery_time_s: c.number("contact.recovery_time_s", raw.recovery_time_s, 1e-4, 1.0)?,
        max_contacts: c.count("contact.max_contacts", raw.max_contacts, 1, 256)? as usize,
        max_support_contacts: c.count("contact.max_support_contacts", raw.max_support_contacts, 1, 1024)? as usize,
        plane_friction: c.number("contact.plane_friction", raw.plane_friction, 0.0, 2.0)?,
    })
}
