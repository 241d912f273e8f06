//! Error of preparing an enrichment method.

/// Error of preparing an enricher.
#[derive(Debug, thiserror::Error)]
pub enum EnricherError {
    /// An array of the examples has another length than the model or the other arrays.
    #[error("example {example} has {found} {what}, {expected} are needed")]
    Length {
        /// The example.
        example: usize,
        /// The array.
        what: &'static str,
        /// Its length.
        found: usize,
        /// Length needed.
        expected: usize,
    },
    /// Fewer examples than the method needs.
    #[error("{found} examples, at least {needed} are needed")]
    TooFew {
        /// Examples.
        found: usize,
        /// Needed.
        needed: usize,
    },
    /// The method's matrix is singular.
    #[error("the examples do not determine the weights: are they all the same?")]
    Singular,
}
