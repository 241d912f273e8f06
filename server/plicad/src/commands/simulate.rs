//! `plicad simulate`.

use std::sync::Arc;

use anyhow::Context;
use indicatif::{ProgressBar, ProgressStyle};
use plica_daemon::database_loader;
use plica_daemon::replay::Replay;
use plica_scene::Config;
use plica_scene::model;
use plica_scene::motion::{self, TimedPose};
use plica_sim::NoProbe;

use crate::cli::SimulateArgs;
use crate::frames_file::{FramesFile, Shape};

/// No simulation is meant to write more.
const MAX_OUTPUT_BYTES: f64 = 1e12;

/// Runs a scene along recorded poses and writes what came of it.
pub fn run(args: &SimulateArgs, json: bool) -> anyhow::Result<()> {
    let config = super::scene_with(&args.scene, &args.database)?;
    let (poses, fit) = motion::read(&args.poses, &config, args.tool.as_deref(), args.fit)?;
    if let Some(fit) = fit {
        tracing::info!("fitted by scale {:.4}, {:?} m to {:?} m", fit.scale, fit.from_m, fit.to_m);
    }
    let summary = simulate(&config, poses, args)?;
    if json {
        println!("{summary}");
    } else {
        let (frames, ticks) = (&summary["n_frames"], &summary["n_ticks"]);
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

fn simulate(config: &Config, poses: Vec<TimedPose>, args: &SimulateArgs) -> anyhow::Result<serde_json::Value> {
    let model = Arc::new(model::build(config)?);
    let n_ticks = ticks_to(poses.last().map_or(0.0, |p| p.time_s), model.timestep_s());
    let n_frames = n_ticks / args.every;
    anyhow::ensure!(n_frames > 0, "--every {} leaves no frame of {n_ticks} ticks; choose a smaller one", args.every);
    let shape = Shape { n_frames: n_frames as usize, n_skin: model.n_skin(), n_tools: model.n_tools() };
    let bytes = 12.0 * n_frames as f64 * shape.n_skin as f64;
    anyhow::ensure!(
        bytes <= MAX_OUTPUT_BYTES,
        "{} ticks ({:.0} s) would take {:.0} GB; are the times of {} in seconds? --every N writes fewer frames",
        n_ticks,
        n_ticks as f64 * model.timestep_s(),
        bytes / 1e9,
        args.poses.display()
    );
    let enrichment = database_loader::at_start(config, &model)?;
    let mut file = FramesFile::create(&args.out, shape).with_context(|| args.out.display().to_string())?;
    let mut replay = Replay::new(model, poses);
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
