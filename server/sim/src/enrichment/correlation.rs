//! Correlation of the present state with the examples, by any of the correlators.

use nalgebra::DMatrix;
use plica_geometry::ReferenceSkin;

use super::error::EnricherError;
use super::fade::Trust;
use super::kriging::{Kriging, KrigingChoice};
use super::linear::Linear;
use super::options::Correlator;
use super::rbf::Rbf;
use super::situation::Situation;
use super::ssh12::Ssh12;
use super::stencil::Stencil;
use crate::model::Model;

/// Pitch and width of the stencil, in coarse cells.
const STENCIL_CELLS: [f64; 2] = [2.0 / 3.0, 1.0];

/// A correlator with its tables.
#[derive(Debug, Clone)]
pub(crate) enum Correlation {
    None,
    Ssh12(Ssh12),
    Linear(Linear),
    Rbf(Rbf),
    Kriging(Box<Kriging>, KrigingChoice),
}

impl Correlation {
    /// `products` are inner products of the fields to predict, `[n][n]`.
    pub(crate) fn new(
        model: &Model,
        skin: &ReferenceSkin,
        correlator: Correlator,
        situations: &[Situation<'_>],
        products: &DMatrix<f64>,
    ) -> Result<Self, EnricherError> {
        let singular = || EnricherError::Singular;
        let cell = f64::from(model.cell_size);
        Ok(match correlator {
            Correlator::Rescale => Self::None,
            Correlator::Ssh12(options) => Self::Ssh12(Ssh12::new(situations, options)),
            Correlator::Linear(kind) => {
                let mesh = &model.description().mesh;
                Self::Linear(Linear::new(kind, situations, products, mesh, &model.order).ok_or_else(singular)?)
            }
            Correlator::Rbf { width_cells } => {
                Self::Rbf(Rbf::new(situations, products, width_cells * cell).ok_or_else(singular)?)
            }
            Correlator::Kriging => {
                let [pitch, width] = STENCIL_CELLS.map(|cells| cells * cell);
                let stencil = Stencil::new(skin, pitch, width);
                let (kriging, choice) = Kriging::new(stencil, situations, products, cell).ok_or_else(singular)?;
                Self::Kriging(Box::new(kriging), choice)
            }
        })
    }

    /// Writes the weights `[n]`.
    pub(crate) fn weigh(&self, situation: &Situation<'_>, kernel: &mut [f32], weights: &mut [f32]) -> Trust {
        match self {
            Self::None => Trust::FULL,
            Self::Ssh12(ssh12) => ssh12.weigh(situation, weights),
            Self::Linear(linear) => linear.weigh(situation, weights),
            Self::Rbf(rbf) => rbf.weigh(situation, kernel, weights),
            Self::Kriging(kriging, _) => kriging.weigh(situation, kernel, weights),
        }
    }

    pub(crate) fn kriging_choice(&self) -> Option<KrigingChoice> {
        match self {
            Self::Kriging(_, choice) => Some(*choice),
            _ => None,
        }
    }
}
