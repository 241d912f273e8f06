//! Enrichment: detail that the coarse skin lacks, learned from examples \[SSH12, 5\].
//!
//! For each contact the skin is laid out around the contact point (`layout.rs`), a correlator weighs the examples for
//! the present state, and an interpolator (`field.rs`) adds their detail to the skin. An [`Enricher`] holds the
//! constant tables of one enrichment method. A [`LiveEnrichment`] applies it to the contacts of a running simulation.

mod clearance;
mod correlation;
mod enricher;
mod error;
mod examples;
mod fade;
mod field;
mod groups;
mod kriging;
mod lattice;
mod layout;
mod linear;
mod live;
mod methods;
mod modes;
mod options;
mod rbf;
mod rescale;
mod situation;
mod ssh12;
mod stencil;
mod surface;
mod warp;

pub use enricher::{Enricher, EnricherScratch};
pub use error::EnricherError;
pub use examples::Examples;
pub use field::{FieldOptions, Interpolator};
pub use kriging::KrigingChoice;
pub use layout::Coordinates;
pub use linear::LinearKind;
pub use live::LiveEnrichment;
pub use methods::{DEFAULT_METHOD, FAMILIES, METHODS, NamedMethod};
pub use modes::Precision;
pub use options::{Correlator, EnrichmentOptions};
pub use situation::{Contact, Touch};
pub use ssh12::Ssh12Options;
