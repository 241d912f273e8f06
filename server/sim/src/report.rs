//! Reports of a tick.

use nalgebra::{Isometry3, Point3, Vector3};

/// Statistics of one tick.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TickReport {
    /// Iterations of the linear solver, over all passes and sub-steps.
    pub iterations: u32,
    /// Active-set passes, over all sub-steps.
    pub passes: u32,
    /// Solves repeated with block Jacobi.
    pub fallbacks: u32,
    /// Contact rows that carry load.
    pub n_contacts: u32,
    /// Contact rows that were found and left out because a tool or plane had its `max_contacts`.
    pub dropped_contacts: u32,
    /// Deepest skin point below a tool or plane surface at the end of the tick, among contact rows \[m\].
    pub max_penetration_m: f32,
    /// Poses refused at the input gate because a component was not finite.
    pub poses_refused: u32,
    /// Whether the result was not finite or beyond recovery, and the last good state was restored.
    pub rolled_back: bool,
    /// Whether the object sleeps: nothing was solved.
    pub sleeping: bool,
}

/// Reading of one tool after a tick. World frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToolReading {
    /// Whether a pose was ever received; an absent tool has no contacts.
    pub present: bool,
    /// Force on the tool \[N\]. With a spring coupling: the bounded force that the device should
    /// display, which is zero without contact.
    pub force_n: Vector3<f64>,
    /// Torque on the tool about the proxy's origin \[N m\].
    pub torque_n_m: Vector3<f64>,
    /// Sum of the contact forces on the tool \[N\].
    pub contact_force_n: Vector3<f64>,
    /// Contact point on the deformed skin; the last one is held after release \[m\].
    pub contact_point_m: Point3<f64>,
    /// The same point pulled back to the reference skin \[m\].
    pub reference_contact_point_m: Point3<f64>,
    /// Whether both points are of this tick.
    pub contact_point_is_new: bool,
    /// Pose of the proxy.
    pub proxy: Isometry3<f64>,
    /// Sequence number of the newest pose.
    pub pose_sequence: u64,
    /// Source time of the newest pose \[ns\].
    pub pose_source_time_ns: u64,
    /// Age of the newest pose \[s\].
    pub pose_age_s: f64,
    /// Contacts that carry load.
    pub n_contacts: u32,
    /// Whether any contact carries load.
    pub in_contact: bool,
    /// Whether a loaded contact slides.
    pub sliding: bool,
    /// Whether the coupling is at its largest force or torque.
    pub saturated: bool,
    /// Whether the newest pose is too old.
    pub stale: bool,
    /// Jumps that re-placed the tool without sweep, since the state was made.
    pub placements: u64,
}

/// One contact row after a tick, for tests and tools. World frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactReading {
    /// Tool index, or `n_tools + plane index`.
    pub body: usize,
    /// The skin point, deformed \[m\].
    pub point_m: Point3<f64>,
    /// Unit normal from the tool to the skin.
    pub normal: Vector3<f64>,
    /// Gap at the end of the tick \[m\].
    pub gap_m: f64,
    /// Normal force on the skin, never negative \[N\].
    pub normal_force_n: f64,
    /// Tangential force on the skin \[N\].
    pub tangential_force_n: Vector3<f64>,
}
