//! Errors, confidence and time of one method over all held-out states.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::measure::{Group, Measure};
use super::statistics::{quantile, rank_correlation};
use crate::setup::IN_REGION;

/// Errors, confidence and time of one method over all held-out states.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MethodEvaluation {
    /// Name of the method.
    pub name: String,
    /// Family of the correlation.
    pub correlator: String,
    /// Interpolation.
    pub interpolator: String,
    /// Number of training examples.
    pub examples: usize,
    /// Whole skin, states drawn as training draws.
    pub in_region: Group,
    /// Within three tool radii of the contact point on the reference skin, the same states.
    pub near_contact: Group,
    /// Whole skin, all other states.
    pub outside: Option<Group>,
    /// Whole skin, by kind.
    pub kinds: BTreeMap<String, Group>,
    /// Rank correlation of `1 - confidence` with `E` in the region; absent where either is the same everywhere.
    pub confidence_rank_in_region: Option<f64>,
    /// The same over all states.
    pub confidence_rank: Option<f64>,
    /// Median time of an evaluation on one thread, after one warm-up \[us\].
    pub tick_us: f64,
    /// Least time \[us\].
    pub tick_us_min: f64,
    /// Bytes of the examples' tables.
    pub table_bytes: usize,
}

/// A method, for the head of its evaluation.
pub(super) struct EvaluatedMethod<'a> {
    pub(super) name: &'a str,
    pub(super) correlator: &'a str,
    pub(super) interpolator: &'a str,
    pub(super) n_examples: usize,
    pub(super) table_bytes: usize,
}

/// Errors of a method on one state.
pub(super) struct EvaluatedState<'a> {
    pub(super) kind: &'a str,
    pub(super) whole: Measure,
    pub(super) near: Option<Measure>,
    pub(super) confidence: f64,
    pub(super) time_us: f64,
}

impl MethodEvaluation {
    /// Of all states; `None` where none lies in the region.
    pub(super) fn of(method: &EvaluatedMethod<'_>, states: &[EvaluatedState<'_>]) -> Option<Self> {
        let group = |is_in: &dyn Fn(&str) -> bool| {
            Group::of(&states.iter().filter(|j| is_in(j.kind)).map(|j| j.whole).collect::<Vec<_>>())
        };
        let inside: Vec<&EvaluatedState<'_>> = states.iter().filter(|j| j.kind == IN_REGION).collect();
        let near: Vec<Measure> = inside.iter().filter_map(|j| j.near).collect();
        let kinds = states.iter().map(|j| j.kind.to_owned());
        let kinds = kinds.filter_map(|kind| Some((kind.clone(), group(&|k| k == kind)?))).collect();
        let mut times: Vec<f64> = states.iter().map(|j| j.time_us).collect();
        times.sort_by(f64::total_cmp);
        let ranks = |j: &EvaluatedState<'_>| (1.0 - j.confidence, j.whole.ratio);
        Some(Self {
            name: method.name.to_owned(),
            correlator: method.correlator.to_owned(),
            interpolator: method.interpolator.to_owned(),
            examples: method.n_examples,
            in_region: group(&|k| k == IN_REGION)?,
            near_contact: Group::of(&near)?,
            outside: group(&|k| k != IN_REGION),
            kinds,
            confidence_rank_in_region: rank_correlation(&inside.iter().map(|j| ranks(j)).collect::<Vec<_>>()),
            confidence_rank: rank_correlation(&states.iter().map(ranks).collect::<Vec<_>>()),
            tick_us: quantile(&times, 0.5).unwrap_or(0.0),
            tick_us_min: times.first().copied().unwrap_or(0.0),
            table_bytes: method.table_bytes,
        })
    }
}
