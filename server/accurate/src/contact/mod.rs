//! Unilateral frictional contact of a solid with a rigid tool: the solver's own, independent of any coarse model.
//!
//! [`Obstacle`]s are signed distances; a [`ContactSurface`] holds points on the solid's boundary faces; [`NormalContact`]
//! and [`Friction`] are energies with given multipliers; [`Press::follow`] moves a tool along a path and finds the multipliers.

mod friction;
mod increment;
mod leg;
mod normal;
mod obstacle;
mod outcome;
mod params;
mod press;
mod report;
mod state;
mod surface;

pub use friction::{Friction, FrictionRow};
pub use normal::NormalContact;
pub use obstacle::{Gap, Obstacle};
pub use outcome::{ContactError, ContactInfo, ContactProgress};
pub use params::ContactParams;
pub use press::Press;
pub use state::ContactState;
pub use surface::{ContactPoint, ContactSurface};
