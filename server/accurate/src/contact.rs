//! Unilateral frictional contact of a solid with a rigid tool: the solver's own, independent of any coarse model.
//!
//! [`Obstacle`]s are signed distances; a [`ContactSurface`] holds points on the solid's boundary faces; [`NormalContact`]
//! and [`Friction`] are energies with given multipliers; [`Press::follow`] moves a tool along a path and finds the multipliers.

mod follow;
mod friction;
mod increment;
mod normal;
mod obstacle;
mod params;
mod press;
mod report;
mod result;
mod state;
mod step_size;
mod surface;

pub use friction::{Friction, FrictionRow};
pub use normal::NormalContact;
pub use obstacle::{Gap, Obstacle};
pub use params::ContactParams;
pub use press::Press;
pub use result::{ContactError, ContactInfo, ContactProgress};
pub use state::ContactState;
pub use surface::{ContactPoint, ContactSurface};
