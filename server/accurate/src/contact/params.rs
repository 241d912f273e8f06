//! Parameters of the contact solver.

/// Parameters of the contact solver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactParams {
    /// Young's modulus of the solid, or its order of magnitude \[Pa\]: the scale of penalties.
    pub young_modulus_pa: f64,
    /// Longest motion of the tool in one increment \[m\].
    pub max_increment_m: f64,
    /// Penalty of pressures over `young_modulus_pa / size of the point's face`.
    pub penalty_ratio: f64,
    /// Penalty of tractions, likewise.
    pub friction_penalty_ratio: f64,
    /// Largest change of pressures and tractions by the last solve, in their continuous part, as a share of the largest
    /// pressure.
    pub pressure_tolerance: f64,
    /// Largest force left at a free coordinate, as a share of the largest nodal force of any single energy.
    pub newton_tolerance: f64,
    /// Largest number of multiplier updates in an increment.
    pub max_updates: u32,
    /// Largest number of Newton steps between two updates.
    pub max_newton_iterations: u32,
    /// Largest number of halvings of a failed increment.
    pub max_halvings: u32,
}

impl ContactParams {
    /// The defaults, for a solid of `young_modulus_pa` and increments of at most `max_increment_m`.
    pub fn new(young_modulus_pa: f64, max_increment_m: f64) -> Self {
        Self {
            young_modulus_pa,
            max_increment_m,
            penalty_ratio: 50.0,
            friction_penalty_ratio: 5.0,
            pressure_tolerance: 0.02,
            newton_tolerance: 1e-5,
            max_updates: 30,
            max_newton_iterations: 30,
            max_halvings: 5,
        }
    }
}
