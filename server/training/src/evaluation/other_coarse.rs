//! Another coarse model, driven to the same held-out interactions, without enrichment.

use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

use nalgebra::Vector3;
use plica_geometry::ReferenceSkin;
use plica_sim::{Model, State};
use rayon::prelude::*;

use super::measure::Patch;
use super::progress::{EvaluationObserver, EvaluationProgress};
use super::statistics::Quantiles;
use crate::database::Database;
use crate::error::TrainingError;
use crate::example::{Example, to_f32};
use crate::interaction::Interaction;
use crate::plan::plan;
use crate::setup::{IN_REGION, Setup};
use crate::tandem::{Stop, Tandem};

/// Error of another coarse model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OtherCoarse {
    /// RMS errors of its skin against `independent`, states drawn as training draws \[mm\].
    pub independent_mm: Quantiles,
    /// Number of those states.
    pub states: usize,
    /// States where it did not settle, or lost the tool.
    pub failed: usize,
}

/// Why another coarse model cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum OtherCoarseError {
    /// Interactions, models or threads.
    #[error(transparent)]
    Training(#[from] TrainingError),
    /// The scene draws other interactions than those of the database.
    #[error(
        "held-out example {index} was made at another interaction than the scene draws now; train the held-out set again"
    )]
    OtherPlan {
        /// Its number.
        index: u32,
    },
    /// The skins have different numbers of vertices.
    #[error("the other model has {found} skin vertices, the scene {expected}")]
    OtherSkin {
        /// Of the other model.
        found: usize,
        /// Of the scene.
        expected: usize,
    },
    /// No held-out example can be used.
    #[error(
        "no held-out example in the trained region holds the accurate model's own contact, or the other model settled at none"
    )]
    Nothing,
}

/// One held-out interaction with its accurate skin.
struct Case {
    interaction: Interaction,
    /// Offsets of the accurate skin from rest, `[n_skin]` \[m\].
    accurate: Vec<[f32; 3]>,
}

/// Interactions done, and the observer that all threads call in turn.
struct SharedProgress<'a, 'b> {
    all: usize,
    shared: Mutex<(usize, &'a mut EvaluationObserver<'b>)>,
}

impl SharedProgress<'_, '_> {
    /// Calls the observer after `n_more` more interactions.
    fn observe(&self, n_more: usize) -> ControlFlow<()> {
        let mut shared = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
        let (done, observer) = &mut *shared;
        *done += n_more;
        observer(EvaluationProgress { done: *done, all: self.all, part: "interactions" })
    }
}

/// Drives the coarse model of `other` to the held-out interactions of `setup` in the trained region. The observer is called
/// after each interaction and every few ticks.
///
/// # Errors
/// See [`OtherCoarseError`].
pub fn other_coarse(
    setup: &Setup,
    held_out: &Database,
    other: &Setup,
    n_threads: usize,
    observer: &mut EvaluationObserver<'_>,
) -> Result<OtherCoarse, OtherCoarseError> {
    let expected = setup.coarse.skin.n_vertices();
    let found = other.coarse.skin.n_vertices();
    if found != expected {
        return Err(OtherCoarseError::OtherSkin { found, expected });
    }
    let cases = cases(setup, held_out)?;
    let areas = ReferenceSkin::new(&setup.coarse.skin).vertex_areas().to_vec();
    let whole = Patch::new(&areas, |_| true);
    let progress = SharedProgress { all: cases.len(), shared: Mutex::new((0, observer)) };
    let work = |cases: &[Case]| -> Result<Vec<Option<f64>>, TrainingError> {
        let mut tandem = Tandem::new(other)?;
        let mut errors = Vec::new();
        for case in cases {
            errors.push(match tandem.solve_coarse(&case.interaction, &mut || progress.observe(0)) {
                Ok(half) => {
                    let offsets: Vec<_> = half.state.offsets.iter().map(to_f32).collect();
                    Some(1e3 * whole.rms(&offsets, Some(&case.accurate)))
                }
                Err(Stop::Rejected(..)) => None,
                Err(Stop::Interrupted) => return Err(TrainingError::Interrupted),
            });
            if progress.observe(1).is_break() {
                return Err(TrainingError::Interrupted);
            }
        }
        Ok(errors)
    };
    let failed = |e: rayon::ThreadPoolBuildError| TrainingError::Threads { n_threads, reason: e.to_string() };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().map_err(failed)?;
    let share = cases.len().div_ceil(n_threads.max(1)).max(1);
    let errors: Result<Vec<_>, _> = pool.install(|| cases.par_chunks(share).map(work).collect());
    let errors = errors?.concat();
    let states = errors.iter().flatten().count();
    let independent_mm = Quantiles::of(errors.iter().flatten().copied()).ok_or(OtherCoarseError::Nothing)?;
    Ok(OtherCoarse { independent_mm, states, failed: errors.len() - states })
}

/// The held-out interactions in the trained region, drawn again from the seed of the database, which does not hold them.
fn cases(setup: &Setup, held_out: &Database) -> Result<Vec<Case>, OtherCoarseError> {
    let inside: Vec<&Example> = held_out.examples.iter().filter(|e| e.record.kind == IN_REGION).collect();
    let mut set = setup.evaluation.first().ok_or(OtherCoarseError::Nothing)?.clone();
    set.count = inside.iter().map(|e| e.record.index as usize + 1).max().ok_or(OtherCoarseError::Nothing)?;
    let interactions = plan(setup, &[set], held_out.about.seed).map_err(TrainingError::from)?;
    let model = Model::new(setup.coarse.clone()).map_err(|e| TrainingError::Build(e.into()))?;
    let mut state = State::new(&model);
    let mut cases = Vec::new();
    for example in inside {
        let index = example.record.index;
        let drawn = interactions.get(index as usize);
        let same = drawn.filter(|i| setup.fingerprint(i) == example.record.interaction_sha256);
        let interaction = same.ok_or(OtherCoarseError::OtherPlan { index })?.clone();
        let detail = example.independent_detail.as_ref().ok_or(OtherCoarseError::Nothing)?;
        let nodes: Vec<_> = example.displacements.iter().map(|u| Vector3::from(u.map(f64::from))).collect();
        state.set_node_displacements(&model, &nodes);
        let mut accurate = vec![[0.0; 3]; model.n_skin()];
        state.write_skin_offsets(&model, &mut accurate);
        accurate.iter_mut().zip(detail).for_each(|(o, d)| (0..3).for_each(|k| o[k] += d[k]));
        cases.push(Case { interaction, accurate });
    }
    Ok(cases)
}
