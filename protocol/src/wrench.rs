//! Forces on a tool, output: `PLWR`, 192 bytes.

use crate::bytes::{Layout, finite, open_exact};
use crate::error::DecodeError;

/// First bytes of a wrench.
pub const MAGIC: [u8; 4] = *b"PLWR";
/// Length of a wrench in bytes.
pub const BYTES: usize = 192;

/// Force and torque on one tool at one tick. World frame, SI units.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wrench {
    /// Rises by one with each wrench published for this tool.
    pub sequence: u64,
    /// Simulation tick.
    pub tick: u64,
    /// Simulated time in seconds.
    pub sim_time_s: f64,
    /// Sequence of the pose of this tick.
    pub pose_sequence: u64,
    /// Source time of that pose, echoed so that a client measures motion-to-force on its own clock.
    pub pose_source_time_ns: u64,
    /// Force on the tool in newtons.
    pub force_n: [f64; 3],
    /// Torque on the tool about the proxy's origin in newton metres.
    pub torque_n_m: [f64; 3],
    /// Contact point in metres; the last one after release, zero before the first contact.
    pub contact_point_m: [f64; 3],
    /// Position of the proxy, the simulated tool, in metres.
    pub proxy_position_m: [f64; 3],
    /// Orientation of the proxy, `x y z w`.
    pub proxy_orientation_xyzw: [f64; 4],
    /// State of the tool.
    pub flags: WrenchFlags,
    /// Number of active contacts.
    pub n_contacts: u32,
    /// Confidence of the enrichment at this tool, 0 to 1.
    pub confidence: f32,
}

/// State of a tool in a [`Wrench`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct WrenchFlags {
    /// Bit 1: the tool is in contact.
    pub in_contact: bool,
    /// Bit 2: at least one contact slides.
    pub sliding: bool,
    /// Bit 4: the coupling is at its force or torque limit.
    pub saturated: bool,
    /// Bit 8: no pose for `stale_after_ms`; the tool is held.
    pub stale: bool,
}

impl WrenchFlags {
    /// Encodes the `u32`.
    pub fn bits(self) -> u32 {
        u32::from(self.in_contact)
            | u32::from(self.sliding) << 1
            | u32::from(self.saturated) << 2
            | u32::from(self.stale) << 3
    }

    /// Decodes the `u32`; unknown bits are ignored.
    pub fn from_bits(bits: u32) -> Self {
        Self { in_contact: bits & 1 != 0, sliding: bits & 2 != 0, saturated: bits & 4 != 0, stale: bits & 8 != 0 }
    }
}

impl Wrench {
    /// Encodes 192 bytes.
    pub fn encode(&self) -> [u8; BYTES] {
        Layout::new(MAGIC)
            .u64(self.sequence)
            .u64(self.tick)
            .f64(self.sim_time_s)
            .u64(self.pose_sequence)
            .u64(self.pose_source_time_ns)
            .f64s(self.force_n)
            .f64s(self.torque_n_m)
            .f64s(self.contact_point_m)
            .f64s(self.proxy_position_m)
            .f64s(self.proxy_orientation_xyzw)
            .u32(self.flags.bits())
            .u32(self.n_contacts)
            .f32(self.confidence)
            .u32(0)
            .finish()
    }

    /// Decodes 192 bytes; refuses non-finite numbers.
    pub fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let mut fields = open_exact(bytes, MAGIC, BYTES)?;
        Self {
            sequence: fields.u64(),
            tick: fields.u64(),
            sim_time_s: fields.f64(),
            pose_sequence: fields.u64(),
            pose_source_time_ns: fields.u64(),
            force_n: fields.f64s(),
            torque_n_m: fields.f64s(),
            contact_point_m: fields.f64s(),
            proxy_position_m: fields.f64s(),
            proxy_orientation_xyzw: fields.f64s(),
            flags: WrenchFlags::from_bits(fields.u32()),
            n_contacts: fields.u32(),
            confidence: fields.f32(),
        }
        .checked()
    }

    fn checked(self) -> Result<Self, DecodeError> {
        finite("sim_time_s", &[self.sim_time_s])?;
        finite("force", &self.force_n)?;
        finite("torque", &self.torque_n_m)?;
        finite("contact_point", &self.contact_point_m)?;
        finite("proxy_position", &self.proxy_position_m)?;
        finite("proxy_orientation", &self.proxy_orientation_xyzw)?;
        finite("confidence", &[f64::from(self.confidence)])?;
        Ok(self)
    }
}
