//! Interactions from a recorded motion: states picked from it, each with its tool path.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::error::PlanError;
use crate::interaction::{Action, Interaction, from_numbers, to_numbers};
use crate::obstacle::{clearance, obstacle};
use crate::random::Draws;
use crate::setup::{InteractionSet, RecordedPose, Setup};
use plica_geometry::ReferenceSkin;

/// A pose that overlaps the object at rest by less than this is no press \[m\].
const LEAST_PRESS_M: f64 = 0.5e-3;
/// Poses of a path that are closer than this are left out \[m\]; a turn counts as the path of a point at 50 mm.
const LEAST_STEP_M: f64 = 0.2e-3;
const LEVER_M: f64 = 0.05;

/// Candidates: poses that press the object at rest and come after one that is clear of it, `count * candidates_per_example` of them at most, drawn without
/// replacement; each follows the motion from the last pose that was clear of the object.
pub(crate) fn candidates(
    setup: &Setup,
    skin: &ReferenceSkin,
    set: &InteractionSet,
    poses: &[RecordedPose],
    seed: u64,
) -> Result<Vec<Interaction>, PlanError> {
    let own: Vec<Isometry3<f64>> = poses.iter().filter(|p| p.tool == set.tool).map(|p| p.pose).collect();
    let nothing = || PlanError::NothingTouched { set: set.name.clone(), n_poses: own.len() };
    let shape = obstacle(&setup.coarse.tools[set.tool].shape).map_err(|_| nothing())?;
    let gaps: Vec<f64> = own.iter().map(|pose| clearance(&shape, pose, skin.skin().positions())).collect();
    let first_clear = gaps.iter().position(|gap| *gap > 0.0).unwrap_or(own.len());
    let pressing: Vec<usize> = (first_clear..own.len()).filter(|&i| gaps[i] < -LEAST_PRESS_M).collect();
    if pressing.is_empty() {
        return Err(nothing());
    }
    let chosen = shuffled(pressing, seed);
    let n_candidates = set.count * set.candidates_per_example.max(1);
    let follow = |index: usize| {
        let begin = (0..index).rev().find(|&i| gaps[i] > 0.0).unwrap_or(0);
        let touch = (begin..=index).find(|&i| gaps[i] <= 0.0).unwrap_or(index);
        let deepest = |pose: &Isometry3<f64>| -> Point3<f64> {
            let points = skin.skin().positions().iter().map(|p| (shape.distance(pose, p), *p));
            points.reduce(|a, b| if b.0 < a.0 { b } else { a }).map_or(Point3::origin(), |best| best.1)
        };
        let contact = skin.nearest(&deepest(&own[touch]));
        Interaction {
            kind: set.name.clone(),
            tool: set.tool as u32,
            contact_point_m: contact.position.coords.into(),
            normal: skin.normal(&contact).into(),
            action: Action::Follow { poses: thinned(&own[begin..=index]) },
        }
    };
    Ok(chosen.into_iter().take(n_candidates).map(follow).collect())
}

/// From the first pose to the last \[m\].
pub(crate) fn travel(poses: &[[f64; 7]]) -> Vector3<f64> {
    match (poses.first(), poses.last()) {
        (Some(first), Some(last)) => from_numbers(last).translation.vector - from_numbers(first).translation.vector,
        _ => Vector3::zeros(),
    }
}

/// In random order (Fisher and Yates); stream 2^32 - 1 of the seed.
fn shuffled(mut items: Vec<usize>, seed: u64) -> Vec<usize> {
    let mut draws = Draws::new(seed, u32::MAX, 0);
    for last in (1..items.len()).rev() {
        let other = (draws.unit() * (last + 1) as f64) as usize;
        items.swap(last, other.min(last));
    }
    items
}

/// First pose, last pose, and poses between them at least a step apart.
fn thinned(poses: &[Isometry3<f64>]) -> Vec<[f64; 7]> {
    let path = |a: &Isometry3<f64>, b: &Isometry3<f64>| {
        (a.translation.vector - b.translation.vector).norm().max(LEVER_M * a.rotation.angle_to(&b.rotation))
    };
    let mut kept: Vec<Isometry3<f64>> = Vec::new();
    for (i, pose) in poses.iter().enumerate() {
        let is_last = i + 1 == poses.len();
        if is_last || kept.last().is_none_or(|last| path(last, pose) >= LEAST_STEP_M) {
            kept.push(*pose);
        }
    }
    kept.iter().map(to_numbers).collect()
}
