//! `plicad chart`: speed against accuracy, one point per configuration.
//!
//! Vertical axis: median error in millimetres against the accurate model's own contact, on one fixed held-out set. Horizontal
//! axis: time of a tick, the median of the simulation in the scene's bench motion plus the median of one evaluation.

mod configuration;
mod measure;
mod picture;
mod points;

use std::path::{Path, PathBuf};

use anyhow::Context;
use plica_scene::Config;
use plica_scene::setup::setup;
use plica_training::evaluation::{DEFAULT_METHOD, EvaluationProgress, Evaluator};
use plica_training::{Database, Setup, fingerprint};
use serde_json::json;

use super::evaluate;
use crate::cli::ChartArgs;

use configuration::{Configuration, configurations};
use measure::Bench;
use points::{Chart, Point};

/// Measures missing points, draws the chart and lists its front.
pub fn run(args: &ChartArgs, json: bool) -> anyhow::Result<()> {
    let config = super::scene(&args.scene)?;
    let setup = setup(&config)?;
    let evaluate::Databases { training, held_out } = evaluate::read(&config, &setup, &args.databases)?;
    let evaluator = Evaluator::new(&setup, &training, &held_out)?;
    let folder = args.out.clone().unwrap_or_else(|| Path::new("out/chart").join(config.name()));
    std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    let file = folder.join("chart.json");
    let identity = identity(&config, &setup, [&training, &held_out], args.ticks);
    let mut chart = Chart::open(&file, config.name(), &identity, args.fresh)?;
    chart.held_out_states = evaluator.n_states()[0];
    chart.timestep_us = 1e6 * config.runtime().timestep_s();
    let all = configurations(&config, &setup, evaluator.n_examples(), args.quick);
    chart.keep_only(&all);
    let bench = Bench { config: &config, setup: &setup, held_out: &held_out, evaluator: &evaluator, ticks: args.ticks };
    measure_missing(&mut chart, &all, &bench, &file)?;
    chart.order_as(&all);
    chart.find_front();
    chart.save(&file)?;
    let svg = folder.join("chart.svg");
    picture::draw(&chart, &svg)?;
    print(&chart, [&file, &svg]);
    if json {
        let mut value = serde_json::to_value(&chart)?;
        value["files"] = json!({ "json": file.display().to_string(), "svg": svg.display().to_string() });
        println!("{}", serde_json::to_string(&value)?);
    }
    Ok(())
}

/// Measures missing points and saves the chart after each.
fn measure_missing(chart: &mut Chart, all: &[Configuration], bench: &Bench<'_>, file: &Path) -> anyhow::Result<()> {
    let bar = evaluate::bar();
    for (done, configuration) in all.iter().enumerate() {
        evaluate::show(&bar, EvaluationProgress { done, all: all.len(), part: &configuration.name });
        if chart.holds(&configuration.name) {
            continue;
        }
        let mut observer = |part: &str| bar.set_message(format!("{}: {part}", configuration.name));
        // A coarse model that cannot be compared does not stop the others.
        match bench.measure(configuration, chart.simulation_us(), &mut observer) {
            Ok(point) => chart.points.push(point),
            Err(error) if configuration.is_other_coarse() => {
                bar.suspend(|| tracing::warn!("{}: {error:#}", configuration.name));
            }
            Err(error) => return Err(error.context(configuration.name.clone())),
        }
        chart.save(file)?;
    }
    bar.finish_and_clear();
    Ok(())
}

/// Digest of everything that all points depend on; points with another digest are measured again.
fn identity(config: &Config, setup: &Setup, databases: [&Database; 2], ticks: u64) -> String {
    let databases = databases.map(|d| json!([d.about.seed, d.examples.len(), d.about.versions]));
    fingerprint(&json!({
        "scene": [setup.scene_hash, config.text()],
        "databases": databases,
        "ticks": ticks,
        "program": env!("CARGO_PKG_VERSION"),
    }))
}

fn print(chart: &Chart, files: [&PathBuf; 2]) {
    println!("{}: {} points, {} held-out states", chart.scene, chart.points.len(), chart.held_out_states);
    println!("{:<36} {:>9} {:>9} {:>9}", "* on the front", "tick us", "indep. mm", "tied mm");
    for p in &chart.points {
        let mark = if p.on_front { "*" } else { "" };
        let tied = p.tied_mm.map_or("-".into(), |mm| format!("{mm:.4}"));
        println!("{:<36} {:>9.1} {:>9.4} {:>9}", format!("{}{mark}", p.name), p.tick_us(), p.independent_mm, tied);
    }
    println!("front, from fast to accurate: {}", chart.front.join("; "));
    if let Some(default) = chart.points.iter().find(|p: &&Point| p.name == DEFAULT_METHOD) {
        println!("default: {:.1} us, {:.4} mm", default.tick_us(), default.independent_mm);
    }
    files.iter().for_each(|file| println!("{}", file.display()));
}
