//! Measures one point of the chart.

use std::ops::ControlFlow;

use anyhow::Context;
use plica_scene::Config;
use plica_scene::setup::setup;
use plica_training::evaluation::{EvaluationProgress, Evaluator, MethodEvaluation, other_coarse};
use plica_training::{Database, Setup};
use toml::Value;

use super::configuration::{Change, Configuration, What};
use super::points::Point;
use crate::commands::bench::{WHOLE_MOTION, bench};

/// Called with the name of each step of a measurement.
pub(super) type StepObserver<'a> = &'a mut (dyn FnMut(&str) + Send);

/// Inputs that all points share.
pub(super) struct Bench<'a> {
    pub(super) config: &'a Config,
    pub(super) setup: &'a Setup,
    pub(super) held_out: &'a Database,
    pub(super) evaluator: &'a Evaluator,
    pub(super) ticks: u64,
}

impl Bench<'_> {
    /// Measures one configuration. `simulation_us` is the tick of the scene's own coarse model, once it is known; `observer` is
    /// called at each step of a long measurement.
    pub(super) fn measure(
        &self,
        configuration: &Configuration,
        simulation_us: Option<f64>,
        observer: StepObserver<'_>,
    ) -> anyhow::Result<Point> {
        match &configuration.what {
            What::Coarse => {
                self.of_evaluation(configuration, &self.evaluator.coarse()?, tick_us(self.config, self.ticks)?)
            }
            What::Enriched { method, examples } => {
                let simulation_us = simulation_us.context("the coarse model comes first")?;
                self.of_evaluation(configuration, &self.evaluator.evaluate(method, *examples)?, simulation_us)
            }
            What::OtherCoarse(changes) => self.of_other(configuration, changes, observer),
        }
    }

    fn of_evaluation(&self, of: &Configuration, found: &MethodEvaluation, simulation_us: f64) -> anyhow::Result<Point> {
        let independent = found.in_region.independent_mm;
        let independent =
            independent.context("the held-out set lacks the accurate model's own contact; train it again")?;
        Ok(Point {
            name: of.name.clone(),
            family: of.family.to_owned(),
            correlator: found.correlator.clone(),
            interpolator: found.interpolator.clone(),
            examples: found.examples,
            simulation_us,
            enrichment_us: found.tick_us,
            independent_mm: independent.median,
            independent_p95_mm: independent.p95,
            tied_mm: Some(found.in_region.median_mm),
            states: found.in_region.states,
            failed_states: 0,
            on_front: false,
        })
    }

    fn of_other(&self, of: &Configuration, changes: &[Change], observer: StepObserver<'_>) -> anyhow::Result<Point> {
        let config = changed(self.config, changes)?;
        observer("ticks");
        let simulation_us = tick_us(&config, self.ticks)?;
        let other = setup(&config)?;
        let n_threads = std::thread::available_parallelism().map_or(1, usize::from);
        let mut observe = |p: EvaluationProgress<'_>| {
            observer(&format!("{} of {} {}", p.done, p.all, p.part));
            ControlFlow::Continue(())
        };
        let found = other_coarse(self.setup, self.held_out, &other, n_threads, &mut observe)?;
        Ok(Point {
            name: of.name.clone(),
            family: of.family.to_owned(),
            correlator: "none".to_owned(),
            interpolator: "none".to_owned(),
            examples: 0,
            simulation_us,
            enrichment_us: 0.0,
            independent_mm: found.independent_mm.median,
            independent_p95_mm: found.independent_mm.p95,
            tied_mm: None,
            states: found.states,
            failed_states: found.failed,
            on_front: false,
        })
    }
}

/// Median tick of a scene without enrichment, as `plicad bench` times it \[us\].
fn tick_us(config: &Config, ticks: u64) -> anyhow::Result<f64> {
    let motion = config.bench().with_context(|| {
        format!(
            "{}: has no [bench] table to time ticks with; configs/scenes/wedge.toml has one",
            config.file().display()
        )
    })?;
    Ok(bench(config, motion, ticks, WHOLE_MOTION)?.tick_us.p50)
}

/// The scene with `changes` in the tables of its object.
fn changed(config: &Config, changes: &[Change]) -> anyhow::Result<Config> {
    let mut document: toml::Table = config.text().parse()?;
    for Change { table, key, value } in changes {
        let path = ["objects", config.object().name()].into_iter().chain(table.split('.'));
        let mut at = &mut document;
        for name in path {
            let inner = at.entry(name).or_insert_with(|| Value::Table(toml::Table::new()));
            at = inner.as_table_mut().with_context(|| format!("{name} is no table"))?;
        }
        at.insert((*key).to_owned(), value.clone());
    }
    Ok(Config::parse(config.file(), &toml::to_string(&document)?)?)
}
