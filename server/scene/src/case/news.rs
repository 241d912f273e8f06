//! Progress of a solve.

/// Progress of a solve, reported before every Newton step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct News {
    /// Share of the loads already carried.
    pub reached: f64,
    /// Share of the loads at the end of this load step.
    pub target: f64,
    /// Newton steps done in this load step.
    pub iteration: u32,
    /// Largest force left, as a share of the largest nodal force.
    pub residual: f64,
}
