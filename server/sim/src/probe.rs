//! Stage boundaries of a tick, so that timing never tangles with physics.

/// The stages of a tick, in order. Contact and solve alternate within a tick; a probe adds up their shares.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Stage {
    /// Device poses to target poses.
    Poses,
    /// Contact detection, law and multiplier update.
    Contact,
    /// Element rotations, forces and the linear solve.
    Solve,
    /// Node displacements to skin positions.
    Embedding,
    /// The two non-finite gates and the copy kept for roll-back.
    Gates,
    /// Windows of detail follow contacts, and detail is added to published skins; after the tick, by the caller.
    Enrichment,
}

impl Stage {
    /// All stages in the order in which a tick first enters them.
    pub const ALL: [Stage; 6] =
        [Stage::Poses, Stage::Contact, Stage::Solve, Stage::Embedding, Stage::Gates, Stage::Enrichment];

    /// Name in status messages and benchmark output.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Poses => "poses",
            Stage::Contact => "contact",
            Stage::Solve => "solve",
            Stage::Embedding => "embedding",
            Stage::Gates => "gates",
            Stage::Enrichment => "enrichment",
        }
    }
}

/// Called at every stage boundary. Must not allocate, lock or call the system (reading a clock is the caller's choice).
pub trait Probe {
    /// `stage` begins; the stage before it ends.
    fn enter(&mut self, stage: Stage);
}

/// A probe that costs nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoProbe;

impl Probe for NoProbe {
    #[inline(always)]
    fn enter(&mut self, _stage: Stage) {}
}
