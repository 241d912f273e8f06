//! Degenerate inputs: far from every example, yet possible in a simulation.

use plica_sim::enrichment::Examples;
use serde::{Deserialize, Serialize};

use super::evaluator::{EvaluationError, Evaluator};
use super::measure::Group;
use super::methods::Method;
use super::statistics::Quantiles;

/// A method on degenerate inputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Degenerate {
    /// RMS of the detail over that of `d[i]` for `u = 0` at the training contact points; it should be 0.
    pub at_rest: Quantiles,
    /// For `u = -u[i]`: it should not be 1.
    pub reversed: Quantiles,
    /// For `u = 2 u[i]`: it should be bounded.
    pub doubled: Quantiles,
    /// For `u = 4 u[i]`.
    pub quadrupled: Quantiles,
    /// States in the region, trained on the training set taken twice; it should be the same as with the set taken once.
    pub duplicated: Group,
}

impl Evaluator {
    /// Evaluates `method`, trained on the first `n_examples` examples, on degenerate inputs.
    ///
    /// # Errors
    /// [`EvaluationError::Method`].
    pub fn degenerate(&self, method: &Method, n_examples: usize) -> Result<Degenerate, EvaluationError> {
        let examples = self.examples(n_examples);
        let mut prepared = self.prepare(method, &examples)?;
        let nothing = || EvaluationError::NothingInRegion { n: examples.touches.len() };
        let mut over_own = |factor: f64| {
            let mut ratios = Vec::new();
            for (u, (d, touch)) in examples.displacements.iter().zip(examples.details.iter().zip(&examples.touches)) {
                let own = self.rms(d);
                let (detail, _) = prepared.evaluate(u, factor, touch);
                if own > 0.0 {
                    ratios.push(self.rms(detail) / own);
                }
            }
            Quantiles::of(ratios).ok_or_else(nothing)
        };
        Ok(Degenerate {
            at_rest: over_own(0.0)?,
            reversed: over_own(-1.0)?,
            doubled: over_own(2.0)?,
            quadrupled: over_own(4.0)?,
            duplicated: self.evaluate_with(method, &twice(&examples))?.in_region,
        })
    }
}

fn twice(examples: &Examples) -> Examples {
    Examples {
        displacements: [&examples.displacements[..], &examples.displacements[..]].concat(),
        details: [&examples.details[..], &examples.details[..]].concat(),
        touches: [&examples.touches[..], &examples.touches[..]].concat(),
    }
}
