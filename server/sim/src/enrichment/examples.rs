//! Examples from training, and prepared as at run time.

use nalgebra::Vector3;

use super::error::EnricherError;
use super::layout::{Charts, FAR};
use super::situation::{Contact, Offsets, Situation, Touch};
use super::surface::{FramedPoint, Surface};
use crate::lanes::{F, Node};
use crate::model::Model;
use crate::state::State;

/// Examples whose displacements differ by less than this share are duplicates.
const DUPLICATE: f64 = 5e-3;

/// Examples of coarse and accurate skins, from training.
#[derive(Debug, Clone, Default)]
pub struct Examples {
    /// Coarse displacements in the order of the mesh's nodes, `[n][n_nodes]` \[m\].
    pub displacements: Vec<Vec<[f32; 3]>>,
    /// `s_a - s_c`, `[n][n_skin]` \[m\].
    pub details: Vec<Vec<[f32; 3]>>,
    /// Contact point and tool of each example, `[n]`.
    pub touches: Vec<Touch>,
}

/// Examples with offsets, layouts and frames as at run time.
pub(crate) struct PreparedExamples {
    displacements: Vec<Vec<Node>>,
    offsets: Vec<Vec<Node>>,
    layouts: Vec<Vec<[F; 2]>>,
    framed_points: Vec<FramedPoint>,
    touches: Vec<Touch>,
}

impl PreparedExamples {
    pub(crate) fn new(model: &Model, surface: &Surface, charts: &Charts, examples: &Examples) -> Self {
        let mut prepared = Self {
            displacements: Vec::new(),
            offsets: Vec::new(),
            layouts: Vec::new(),
            framed_points: Vec::new(),
            touches: examples.touches.clone(),
        };
        let mut state = State::new(model);
        for (displacements, touch) in examples.displacements.iter().zip(&examples.touches) {
            let nodes: Vec<_> = displacements.iter().map(|d| Vector3::from(d.map(f64::from))).collect();
            state.set_node_displacements(model, &nodes);
            let mut offsets = vec![[0.0; 4]; model.n_skin()];
            state.write_padded_offsets(model, &mut offsets);
            let framed = surface.framed_point(&touch.contact_point);
            let mut layout = vec![[F::splat(FAR); 2]; surface.groups().n()];
            if let Some(chart) = charts.at(&framed) {
                charts.lay_out(&chart, surface, &mut layout);
            }
            prepared.displacements.push(state.u[..model.n_free].to_vec());
            prepared.offsets.push(offsets);
            prepared.layouts.push(layout);
            prepared.framed_points.push(framed);
        }
        prepared
    }

    pub(crate) fn situations(&self) -> Vec<Situation<'_>> {
        let of_example = |i: usize| {
            let (displacements, touch) = (&self.displacements[i][..], &self.touches[i]);
            let contact = Contact { displacements, offsets: Offsets::Padded(&self.offsets[i]), touch };
            contact.at(&self.framed_points[i], &self.layouts[i])
        };
        (0..self.framed_points.len()).map(of_example).collect()
    }
}

/// Checks the lengths of all arrays.
pub(crate) fn check(model: &Model, examples: &Examples) -> Result<(), EnricherError> {
    let found = examples.touches.len();
    if found < 2 {
        return Err(EnricherError::TooFew { found, needed: 2 });
    }
    let lengths = examples.displacements.iter().zip(&examples.details).enumerate();
    for (example, (displacements, details)) in lengths {
        for (what, found, expected) in
            [("nodes", displacements.len(), model.n_nodes()), ("skin vertices", details.len(), model.n_skin())]
        {
            if found != expected {
                return Err(EnricherError::Length { example, what, found, expected });
            }
        }
    }
    let arrays = [("displacements", examples.displacements.len()), ("details", examples.details.len())];
    match arrays.into_iter().find(|(_, n)| *n != found) {
        Some((what, n)) => Err(EnricherError::Length { example: 0, what, found: n, expected: found }),
        None => Ok(()),
    }
}

/// Examples without near duplicates: the first of each is kept.
pub(crate) fn without_duplicates(examples: &Examples) -> Examples {
    let squared = |a: &[[f32; 3]], b: &[[f32; 3]]| -> f64 {
        a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| f64::from(a - b).powi(2)).sum()
    };
    let mut kept: Vec<usize> = Vec::new();
    for (i, u) in examples.displacements.iter().enumerate() {
        let nothing = vec![[0.0; 3]; u.len()];
        let nearest = squared(u, &nothing) * DUPLICATE * DUPLICATE;
        if kept.iter().all(|k| squared(u, &examples.displacements[*k]) > nearest) {
            kept.push(i);
        }
    }
    Examples {
        displacements: kept.iter().map(|i| examples.displacements[*i].clone()).collect(),
        details: kept.iter().map(|i| examples.details[*i].clone()).collect(),
        touches: kept.iter().map(|i| examples.touches[*i]).collect(),
    }
}
