//! Report of a job, `report.json`: results that are the same on every machine, and times of this run.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use serde::Serialize;

use crate::accurate::AccurateSize;
use crate::database::{Database, DatabaseKind};
use crate::example::{Example, Record, Rejection};
use crate::setup::Setup;
use crate::solve_info::SolveInfo;
use crate::worth::Worth;
use plica_geometry::ReferenceSkin;

/// Report of a job.
#[derive(Debug, Clone, Serialize)]
pub struct TrainingReport {
    /// The scene.
    pub scene_hash: String,
    /// Kind of the database.
    pub kind: DatabaseKind,
    /// Seed of the interactions.
    pub seed: u64,
    /// Results, the same on every machine up to rounding.
    pub result: Summary,
    /// Times of this run on this machine.
    pub run: Run,
}

/// Results, the same on every machine up to rounding.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// Interactions asked for.
    pub interactions: usize,
    /// Examples in the database.
    pub examples: usize,
    /// Examples of each set.
    pub kinds: BTreeMap<String, usize>,
    /// Hexahedra of the accurate model.
    pub accurate_hexes: usize,
    /// Its free unknowns.
    pub accurate_unknowns: usize,
    /// Values of its Cholesky factor.
    pub factor_values: usize,
    /// Solves tied to the coarse imprint.
    pub tied: Option<Solves>,
    /// Solves with contact of their own.
    pub independent: Option<Solves>,
    /// Simulated time until the coarse model counted as settled \[s\].
    pub settle_s: Option<Spread>,
    /// Farthest that a node still moved in the last window \[m\].
    pub residual_motion_m: Option<Spread>,
    /// Tied skin vertices.
    pub n_tied: Option<Spread>,
    /// Area-weighted RMS of `d` over the skin \[m\].
    pub detail_rms_m: Option<Spread>,
    /// Largest `|d|` of an example \[m\].
    pub detail_max_m: Option<Spread>,
    /// The same against the accurate model's own contact \[m\].
    pub independent_rms_m: Option<Spread>,
    /// Size of the tie's force over that of the accurate model's own contact, by set; for lifts the suction stands for the contact.
    pub tied_over_independent_force: BTreeMap<String, Spread>,
    /// Results that needed a guard against elements that turn over.
    pub guarded: Vec<Guarded>,
    /// Interactions without an example, with the reason.
    pub rejected: Vec<Rejection>,
}

/// A result that needed a guard.
#[derive(Debug, Clone, Serialize)]
pub struct Guarded {
    /// Number of the interaction in its plan.
    pub index: u32,
    /// `tied` or `independent`.
    pub reference: &'static str,
    /// What the result without the guard is worth.
    pub unguarded: Worth,
}

/// Newton solves of all examples.
#[derive(Debug, Clone, Serialize)]
pub struct Solves {
    /// Newton steps per example.
    pub iterations: Spread,
    /// Newton steps whose matrix was not positive definite, in all.
    pub indefinite_steps: u64,
    /// Smallest `det F` per example.
    pub smallest_jacobian: Spread,
    /// Largest force left, as a share of the largest nodal force.
    pub residual: Spread,
}

/// Least, median, mean and largest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Least.
    pub min: f64,
    /// Median.
    pub median: f64,
    /// Mean.
    pub mean: f64,
    /// Largest.
    pub max: f64,
}

/// Times of a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Run {
    /// Threads.
    pub threads: usize,
    /// Wall time of this run \[s\].
    pub wall_s: f64,
    /// Interactions solved in this run.
    pub solved: usize,
    /// Interactions that earlier runs had finished.
    pub resumed: usize,
    /// Mean time of an interaction in this run \[s\].
    pub mean_s: Option<f64>,
    /// Longest \[s\].
    pub max_s: Option<f64>,
}

impl TrainingReport {
    /// Report of a finished job with `interactions` planned interactions.
    pub(crate) fn new(setup: &Setup, database: &Database, interactions: usize, size: AccurateSize, run: Run) -> Self {
        let examples = &database.examples;
        let records = || examples.iter().map(|e| &e.record);
        let mut kinds = BTreeMap::new();
        records().for_each(|r| *kinds.entry(r.kind.clone()).or_insert(0) += 1);
        let areas = ReferenceSkin::new(&setup.coarse.skin).vertex_areas().to_vec();
        let details = || examples.iter().map(|e| &e.detail);
        let own = || examples.iter().filter_map(|e| e.independent_detail.as_ref());
        let result = Summary {
            interactions,
            examples: examples.len(),
            kinds,
            accurate_hexes: setup.accurate.mesh.n_hexes(),
            accurate_unknowns: size.n_unknowns,
            factor_values: size.n_factor_values,
            tied: Solves::of(records().map(|r| r.tied)),
            independent: Solves::of(records().filter_map(|r| r.independent)),
            settle_s: Spread::of(records().map(|r: &Record| r.settling.time_s)),
            residual_motion_m: Spread::of(records().map(|r| r.settling.motion_m)),
            n_tied: Spread::of(records().map(|r| f64::from(r.n_tied))),
            detail_rms_m: Spread::of(details().map(|d| rms(d, &areas))),
            detail_max_m: Spread::of(details().map(|d| largest(d))),
            independent_rms_m: Spread::of(own().map(|d| rms(d, &areas))),
            tied_over_independent_force: force_ratios(examples),
            guarded: records().flat_map(Guarded::of).collect(),
            rejected: database.rejected.clone(),
        };
        let about = &database.about;
        Self { scene_hash: about.scene_hash.clone(), kind: about.kind, seed: about.seed, result, run }
    }
}

fn force_ratios(examples: &[Example]) -> BTreeMap<String, Spread> {
    let size = |f: &[f64; 3]| Vector3::from(*f).norm();
    let mut ratios: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for example in examples {
        if let Some(own) = example.independent_force.as_ref().map(size).filter(|n| *n > 0.0) {
            ratios.entry(example.record.kind.clone()).or_default().push(size(&example.tied_force) / own);
        }
    }
    ratios.into_iter().filter_map(|(kind, all)| Some((kind, Spread::of(all.into_iter())?))).collect()
}

impl Guarded {
    fn of(record: &Record) -> impl Iterator<Item = Self> + use<> {
        let index = record.index;
        let both = [("tied", record.tied_unguarded), ("independent", record.independent_unguarded)];
        both.into_iter().filter_map(move |(reference, worth)| Some(Self { index, reference, unguarded: worth? }))
    }
}

impl Solves {
    fn of(solves: impl Iterator<Item = SolveInfo>) -> Option<Self> {
        let solves: Vec<_> = solves.collect();
        Some(Self {
            iterations: Spread::of(solves.iter().map(|s| f64::from(s.iterations)))?,
            indefinite_steps: solves.iter().map(|s| u64::from(s.indefinite_steps)).sum(),
            smallest_jacobian: Spread::of(solves.iter().map(|s| s.smallest_jacobian))?,
            residual: Spread::of(solves.iter().map(|s| s.residual))?,
        })
    }
}

impl Spread {
    /// `None` without a value.
    pub fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = values.collect();
        sorted.sort_by(f64::total_cmp);
        let (min, max) = (*sorted.first()?, *sorted.last()?);
        let n = sorted.len();
        let median = 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]);
        Some(Self { min, median, mean: sorted.iter().sum::<f64>() / n as f64, max })
    }
}

/// Root of the area-weighted mean of `|v|^2` over the skin; `field` and `areas` `[n_skin]`, in the field's unit.
pub fn rms(field: &[[f32; 3]], areas: &[f64]) -> f64 {
    let squared = |v: &[f32; 3]| v.iter().map(|c| f64::from(*c).powi(2)).sum::<f64>();
    let sum: f64 = field.iter().zip(areas).map(|(v, area)| area * squared(v)).sum();
    (sum / areas.iter().sum::<f64>()).sqrt()
}

/// Largest `|v|` of a field `[n_skin]`.
pub fn largest(field: &[[f32; 3]]) -> f64 {
    let squared = |v: &[f32; 3]| v.iter().map(|c| f64::from(*c).powi(2)).sum::<f64>();
    field.iter().map(squared).fold(0.0, f64::max).sqrt()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;

    #[test]
    fn a_spread_is_that_of_its_values() {
        let spread = Spread::of([3.0, 1.0, 2.0, 10.0].into_iter()).unwrap();
        assert_eq!((spread.min, spread.median, spread.mean, spread.max), (1.0, 2.5, 4.0, 10.0));
        assert!(Spread::of(std::iter::empty()).is_none());
    }

    #[test]
    fn rms_is_weighted_by_area() {
        assert!((rms(&[[3.0, 0.0, 4.0], [0.0; 3]], &[1.0, 3.0]) - 2.5).abs() < 1e-12);
        assert_eq!(largest(&[[3.0, 0.0, 4.0], [0.0; 3]]), 5.0);
    }
}
