//! Measured points, saved so that an interrupted run can continue.

use std::path::Path;

use anyhow::Context;
use plica_training::evaluation::{COARSE, DEFAULT_METHOD, pareto_front};
use plica_training::write_atomically;
use serde::{Deserialize, Serialize};

use super::configuration::Configuration;

/// `chart.json`
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Chart {
    /// Name of the scene.
    pub(super) scene: String,
    /// Digest of everything that all points depend on.
    pub(super) identity: String,
    /// Length of a tick in simulated time \[us\].
    pub(super) timestep_us: f64,
    /// Number of states that errors are taken over.
    pub(super) held_out_states: usize,
    /// Name of the default method.
    pub(super) default: String,
    /// Names of the points on the front, by rising time: no other point is both faster and more accurate.
    pub(super) front: Vec<String>,
    /// In the order of the list of configurations.
    pub(super) points: Vec<Point>,
}

/// One configuration, measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Point {
    pub(super) name: String,
    /// Parameter that is varied.
    pub(super) family: String,
    pub(super) correlator: String,
    pub(super) interpolator: String,
    pub(super) examples: usize,
    /// Median tick without enrichment \[us\].
    pub(super) simulation_us: f64,
    /// Median evaluation of the method \[us\].
    pub(super) enrichment_us: f64,
    /// Median RMS error against `independent` \[mm\].
    pub(super) independent_mm: f64,
    /// Its 95th percentile \[mm\].
    pub(super) independent_p95_mm: f64,
    /// Median RMS error against `tied` \[mm\]; another coarse model has another tie.
    pub(super) tied_mm: Option<f64>,
    /// Number of states in the median.
    pub(super) states: usize,
    /// States where another coarse model did not come to rest.
    pub(super) failed_states: usize,
    /// No other point is both faster and more accurate.
    pub(super) on_front: bool,
}

impl Point {
    /// The whole tick \[us\].
    pub(super) fn tick_us(&self) -> f64 {
        self.simulation_us + self.enrichment_us
    }
}

impl Chart {
    /// Opens the points of `file`; empty with `fresh`, without a file, or where their `identity` is another one.
    pub(super) fn open(file: &Path, scene: &str, identity: &str, fresh: bool) -> anyhow::Result<Self> {
        let new = Self {
            scene: scene.to_owned(),
            identity: identity.to_owned(),
            timestep_us: 0.0,
            held_out_states: 0,
            default: DEFAULT_METHOD.to_owned(),
            front: Vec::new(),
            points: Vec::new(),
        };
        if fresh || !file.exists() {
            return Ok(new);
        }
        let name = || file.display().to_string();
        let bytes = std::fs::read(file).with_context(name)?;
        let old: Self = serde_json::from_slice(&bytes)
            .with_context(|| format!("{}: is not a chart; remove it, or measure again with --fresh", name()))?;
        if old.identity == identity {
            return Ok(old);
        }
        tracing::warn!("{}: scene, databases or ticks have changed; all points are measured again", name());
        Ok(new)
    }

    pub(super) fn holds(&self, name: &str) -> bool {
        self.points.iter().any(|p| p.name == name)
    }

    /// Tick of the scene's own coarse model \[us\].
    pub(super) fn simulation_us(&self) -> Option<f64> {
        self.points.iter().find(|p| p.name == COARSE).map(|p| p.simulation_us)
    }

    /// Drops points without a configuration.
    pub(super) fn keep_only(&mut self, all: &[Configuration]) {
        self.points.retain(|p| all.iter().any(|c| c.name == p.name));
    }

    pub(super) fn order_as(&mut self, all: &[Configuration]) {
        self.points.sort_by_key(|p| all.iter().position(|c| c.name == p.name));
    }

    pub(super) fn find_front(&mut self) {
        let places: Vec<[f64; 2]> = self.points.iter().map(|p| [p.tick_us(), p.independent_mm]).collect();
        let front = pareto_front(&places);
        self.front = front.iter().map(|i| self.points[*i].name.clone()).collect();
        self.points.iter_mut().enumerate().for_each(|(i, p)| p.on_front = front.contains(&i));
    }

    pub(super) fn save(&self, file: &Path) -> anyhow::Result<()> {
        let text = serde_json::to_string_pretty(self)? + "\n";
        write_atomically(file, text.as_bytes()).with_context(|| file.display().to_string())
    }
}
