//! Smoothness in time: the tool presses, slides through the trained region, and leaves.
//!
//! The second difference `d[k-1] - 2 d[k] + d[k+1]` between states a small step apart is what an eye sees as jitter. The accurate
//! solution has one of its own, since vertices enter and leave the contact.

use std::ops::ControlFlow;

use nalgebra::{Isometry3, Point3};
use plica_sim::enrichment::Touch;
use serde::{Deserialize, Serialize};

use super::evaluator::{EvaluationError, Evaluator};
use super::methods::Method;
use super::progress::{EvaluationObserver, EvaluationProgress};
use super::statistics::Quantiles;
use crate::coarse::Interrupted;
use crate::error::TrainingError;
use crate::example::{difference, to_f32};
use crate::obstacle::obstacle;
use crate::plan::plan;
use crate::setup::{PressRanges, Setup, Source};
use crate::tandem::Tandem;
use crate::tool_path::ToolPath;
use plica_geometry::ReferenceSkin;

/// Distance between states \[m\].
const STEP_M: f64 = 0.9e-3;
/// Number of presses drawn; the two farthest apart are the ends of the slide.
const CANDIDATES: usize = 64;

/// Detail along a slide.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Slide {
    /// States with contact and an accurate solution.
    pub states: usize,
    /// States with contact whose accurate solution was rejected.
    pub rejected: usize,
    /// Reason of the first rejection.
    pub first_rejection: Option<String>,
    /// Distance between states \[mm\].
    pub step_mm: f64,
    /// Second differences of the accurate solution, `tied`.
    pub accurate: Roughness,
    /// Results of each method.
    pub methods: Vec<SlideMethod>,
}

/// A method along a slide.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SlideMethod {
    /// Its name.
    pub name: String,
    /// Second differences of its detail.
    pub roughness: Roughness,
    /// `E`; absent if no state has detail.
    pub error: Option<Quantiles>,
}

/// Second differences between neighbouring states.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Roughness {
    /// Root of the mean over states and skin of the square \[mm\].
    pub rms_mm: f64,
    /// Largest of a vertex \[mm\].
    pub max_mm: f64,
}

/// Why there is no slide.
#[derive(Debug, thiserror::Error)]
pub enum SlideError {
    /// Interactions or models.
    #[error(transparent)]
    Training(#[from] TrainingError),
    /// A method.
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
    /// Recorded interactions have no region to slide through.
    #[error("a slide is drawn where training draws presses; this scene trains on recorded poses")]
    NotDrawn,
    /// Too few states with contact and an accepted accurate solution.
    #[error("along the slide there are not three neighbouring states with contact and an accurate solution")]
    TooShort,
}

/// A state along the slide.
struct Station {
    displacements: Vec<[f32; 3]>,
    touch: Touch,
    tied: Vec<[f32; 3]>,
}

/// Slides from one end of the trained region to the other and compares `methods`, trained on the first `n_examples` examples.
///
/// # Errors
/// See [`SlideError`].
pub fn slide(
    setup: &Setup,
    evaluator: &Evaluator,
    methods: &[Method],
    n_examples: usize,
    observer: &mut EvaluationObserver<'_>,
) -> Result<Slide, SlideError> {
    let (tool, poses) = poses(setup)?;
    let mut stations: Vec<Option<Station>> = Vec::new();
    let (mut rejected, mut first_rejection) = (0, None);
    let mut tandem = Tandem::new(setup).map_err(TrainingError::from)?;
    let interrupted = |_| SlideError::Training(TrainingError::Interrupted);
    let walked = tandem.walk(
        tool,
        &poses,
        |tandem, half| {
            if observer(EvaluationProgress { done: stations.len(), all: poses.len(), part: "slide" }).is_break() {
                return Err(Interrupted);
            }
            let tied = half.as_ref().map(|half| tandem.solve_tied(half, &mut || ControlFlow::Continue(())));
            if let Some(Err(stop)) = &tied {
                rejected += 1;
                first_rejection.get_or_insert_with(|| stop.to_string());
            }
            stations.push(half.zip(tied.and_then(Result::ok)).map(|(half, tied)| Station {
                touch: Touch {
                    contact_point: half.contact.position,
                    tool_origin: Point3::from(half.pose.translation.vector),
                },
                tied: difference(&tied.offsets, &half.state.offsets),
                displacements: half.state.displacements.iter().map(to_f32).collect(),
            }));
            Ok(())
        },
        &mut || ControlFlow::Continue(()),
    );
    walked.map_err(interrupted)?;
    let accurate: Vec<_> = stations.iter().map(|s| s.as_ref().map(|s| s.tied.clone())).collect();
    let mut found = Slide {
        states: accurate.iter().flatten().count(),
        rejected,
        first_rejection,
        step_mm: 1e3 * STEP_M,
        accurate: roughness(evaluator, &accurate).ok_or(SlideError::TooShort)?,
        methods: Vec::new(),
    };
    for (done, method) in methods.iter().enumerate() {
        let part = format!("{} along the slide", method.name);
        if observer(EvaluationProgress { done, all: methods.len(), part: &part }).is_break() {
            return Err(interrupted(Interrupted));
        }
        let mut prepared = evaluator.prepare(method, &evaluator.examples(n_examples))?;
        let mut detail = |s: &Station| prepared.evaluate(&s.displacements, 1.0, &s.touch).0.to_vec();
        let details: Vec<_> = stations.iter().map(|s| s.as_ref().map(&mut detail)).collect();
        let errors = stations.iter().flatten().zip(details.iter().flatten());
        let errors = errors.filter_map(|(s, d)| evaluator.ratio(d, &s.tied));
        found.methods.push(SlideMethod {
            name: method.name.clone(),
            error: Quantiles::of(errors),
            roughness: roughness(evaluator, &details).ok_or(SlideError::TooShort)?,
        });
    }
    Ok(found)
}

/// The tool, and its poses from first touch at one end of the region to where it leaves at the other.
fn poses(setup: &Setup) -> Result<(usize, Vec<Isometry3<f64>>), SlideError> {
    let Source::Press(ranges) = &setup.training.source else { return Err(SlideError::NotDrawn) };
    // As shallow as training presses: a long drag adds to the depth.
    let ranges = PressRanges { depth_share: [ranges.depth_share[0]; 2], drag_share: 0.0, ..ranges.clone() };
    let mut set = setup.training.clone();
    (set.source, set.count, set.candidates_per_example) = (Source::Press(ranges), CANDIDATES, 1);
    let tool = set.tool;
    let presses = plan(setup, &[set], setup.evaluation_seed).map_err(TrainingError::from)?;
    let skin = ReferenceSkin::new(&setup.coarse.skin);
    let shape = obstacle(&setup.coarse.tools[tool].shape).map_err(|_| SlideError::TooShort)?;
    let paths: Vec<ToolPath> = presses.iter().filter_map(|press| ToolPath::of(press, &shape, &skin)).collect();
    let apart = |(a, b): &(&ToolPath, &ToolPath)| (a.end().translation.vector - b.end().translation.vector).norm();
    let pairs = paths.iter().flat_map(|a| paths.iter().map(move |b| (a, b)));
    let farthest = pairs.max_by(|a, b| apart(a).total_cmp(&apart(b)));
    let (first, last) = farthest.ok_or(SlideError::TooShort)?;
    let back = last.poses().iter().rev();
    let corners = first.poses().iter().chain(back).copied().collect();
    Ok((tool, ToolPath::new(corners).steps(STEP_M)))
}

/// `None` without three neighbours.
fn roughness(evaluator: &Evaluator, details: &[Option<Vec<[f32; 3]>>]) -> Option<Roughness> {
    let (mut squares, mut max, mut n) = (0.0, 0.0_f64, 0);
    for triple in details.windows(3) {
        let [Some(a), Some(b), Some(c)] = triple else { continue };
        let second = |v: usize| std::array::from_fn(|k| a[v][k] - 2.0 * b[v][k] + c[v][k]);
        let field: Vec<[f32; 3]> = (0..b.len()).map(second).collect();
        squares += evaluator.rms(&field).powi(2);
        max = max.max(evaluator.largest(&field));
        n += 1;
    }
    (n > 0).then(|| Roughness { rms_mm: 1e3 * (squares / f64::from(n)).sqrt(), max_mm: 1e3 * max })
}
