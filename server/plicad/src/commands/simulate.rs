//! `plicad simulate`.

use std::sync::Arc;

use anyhow::Context;
use indicatif::{ProgressBar, ProgressStyle};
use plica_daemon::database_loader;
use plica_daemon::replay::Replay;
use plica_scene::Config;
use plica_scene::model;
use plica_scene::motion::{self, Motion, MotionOptions};
use plica_sim::NoProbe;

use crate::cli::SimulateArgs;
use crate::frames_file::{FramesFile, Shape};
use crate::run_cost::RunCost;

/// Runs a scene along recorded poses and writes what came of it.
pub fn run(args: &SimulateArgs, json: bool) -> anyhow::Result<()> {
    let config = super::scene_with(&args.scene, &args.database)?;
    let options = MotionOptions { tool: args.tool.as_deref(), fit: args.fit, read: args.reading.options() };
    let motion = motion::read(&args.poses, &config, options)?;
    if let Some(fit) = motion.fit {
        tracing::info!("fitted by scale {:.4}, {:?} m to {:?} m", fit.scale, fit.from_m, fit.to_m);
    }
    motion.remarks.iter().for_each(|remark| tracing::warn!("{}: {remark}", args.poses.display()));
    let summary = simulate(&config, &motion, args)?;
    if json {
        println!("{summary}");
    } else {
        let (frames, ticks) = (&summary["n_frames"], &summary["n_ticks"]);
        println!("{}: {}", args.poses.display(), motion.report);
        println!("{}: {frames} frames of {ticks} ticks", args.out.display());
        let (contact, peak) = (&summary["ticks_in_contact"], summary["peak_force_n"].as_f64().unwrap_or(0.0));
        println!("{contact} ticks in contact, peak force {peak:.3} N");
        let (rollbacks, placements) = (count(&summary["rollbacks"]), count(&summary["placements"]));
        if rollbacks > 0 {
            println!(
                "{rollbacks} rollbacks: the last good state was restored, and forces there mean nothing; try a shorter runtime.timestep_s"
            );
        }
        if placements > 0 {
            println!(
                "{placements} times a tool was placed anew, without a sweep: a pose was too far from the one before it"
            );
        }
        if contact == 0 && !args.fit {
            println!("nothing was touched: is the motion where the object is? --fit moves it there");
        }
    }
    Ok(())
}

fn count(value: &serde_json::Value) -> u64 {
    value.as_u64().unwrap_or(0)
}

fn simulate(config: &Config, motion: &Motion, args: &SimulateArgs) -> anyhow::Result<serde_json::Value> {
    let model = Arc::new(model::build(config)?);
    let n_ticks = ticks_to(motion.report.duration_s, model.timestep_s());
    let n_frames = n_ticks / args.every;
    anyhow::ensure!(n_frames > 0, "--every {} leaves no frame of {n_ticks} ticks; choose a smaller one", args.every);
    let shape = Shape { n_frames: n_frames as usize, n_skin: model.n_skin(), n_tools: model.n_tools() };
    let cost = RunCost::of(&model, n_ticks, n_frames);
    match cost.objection(&args.out, &motion.report) {
        Some(objection) if args.no_limits => tracing::warn!("{objection}"),
        Some(objection) => anyhow::bail!("{}: {objection}; --no-limits goes on all the same", args.poses.display()),
        None => {}
    }
    let enrichment = database_loader::at_start(config, &model)?;
    let mut file = FramesFile::create(&args.out, shape).with_context(|| args.out.display().to_string())?;
    let mut replay = Replay::new(model, motion.poses.clone());
    if let Some((enrichment, ready)) = &enrichment {
        replay.enrich(enrichment.live(ready));
    }
    let progress = bar(n_ticks)?;
    let (mut ticks_in_contact, mut peak_force_n, mut dropped_contacts) = (0, 0.0_f64, 0_u64);
    for tick in 1..=n_ticks {
        let wanted = tick % args.every == 0;
        if wanted {
            replay.want_frame();
        }
        dropped_contacts += u64::from(replay.tick(&mut NoProbe).dropped_contacts);
        let tools = replay.core().state().tools();
        ticks_in_contact += u64::from(tools.iter().any(|t| t.in_contact));
        peak_force_n = tools.iter().map(|t| t.force_n.norm()).fold(peak_force_n, f64::max);
        if wanted {
            let tools = replay.core().state().tools().to_vec();
            file.write(replay.frame(), &tools).with_context(|| args.out.display().to_string())?;
        }
        progress.inc(1);
    }
    progress.finish_and_clear();
    let placements: u64 = replay.core().state().tools().iter().map(|tool| tool.placements).sum();
    file.finish().with_context(|| args.out.display().to_string())?;
    Ok(serde_json::json!({
        "scene": config.name(), "out": args.out, "n_ticks": n_ticks, "n_frames": n_frames,
        "n_skin": shape.n_skin, "n_tools": shape.n_tools, "rollbacks": replay.core().state().rollbacks(),
        "placements": placements,
        "ticks_in_contact": ticks_in_contact, "peak_force_n": peak_force_n, "dropped_contacts": dropped_contacts,
        "motion": motion.report, "remarks": motion.remarks,
    }))
}

/// Ticks until the last pose has been used once.
fn ticks_to(last_s: f64, timestep_s: f64) -> u64 {
    1 + (last_s / timestep_s - 1e-6).ceil().max(0.0) as u64
}

fn bar(n_ticks: u64) -> anyhow::Result<ProgressBar> {
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} ticks, {eta} left")?;
    Ok(ProgressBar::new(n_ticks).with_style(style))
}
