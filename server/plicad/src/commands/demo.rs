//! `plicad demo`.

mod examples;

use std::path::Path;

use plica_scene::Config;
use plica_scene::motion::{self, MotionOptions};

use crate::cli::DemoArgs;
use crate::demo::{self, DemoPath, Summary};

/// Longest motion \[s\].
const LONGEST_S: f64 = 3600.0;

/// Trains on the first run, serves on loopback, drives the tool through a real client, prints a summary, writes pictures and a
/// GLB.
pub fn run(args: &DemoArgs, json: bool) -> anyhow::Result<()> {
    anyhow::ensure!(
        (1.0..=LONGEST_S).contains(&args.seconds),
        "--seconds {} is outside the allowed range 1 to {LONGEST_S}",
        args.seconds
    );
    let mut config = Config::built_in()?;
    let path = match &args.poses {
        Some(file) => recorded(file, args, &config)?,
        None => demo::scripted(&config, args.seconds),
    };
    let trained = examples::examples(&config, &args.out, args.examples)?;
    config.set_database(trained.database.clone());
    let summary = demo::run(&config, &path, trained, &args.out)?;
    print(&summary);
    if json {
        println!("{}", serde_json::to_string(&summary)?);
    }
    Ok(())
}

/// The path of a pose file, and a word about it.
fn recorded(file: &Path, args: &DemoArgs, config: &Config) -> anyhow::Result<DemoPath> {
    let options = MotionOptions { tool: None, fit: args.fit, read: args.reading.options() };
    let motion = motion::read(file, config, options)?;
    motion.remarks.iter().for_each(|remark| tracing::warn!("{}: {remark}", file.display()));
    let (seconds, unit) = (motion.report.duration_s, motion.report.time_unit.name());
    anyhow::ensure!(
        seconds <= LONGEST_S,
        "{}: the motion takes {seconds:.0} s, times taken for {unit}; the demo plays in real time, {LONGEST_S} s at most; are \
         the times in {unit}? --time-unit says it",
        file.display()
    );
    println!("motion           {}", motion.report);
    Ok(demo::from_poses(&motion.poses))
}

fn print(s: &Summary) {
    let scheduling = if s.realtime { "SCHED_FIFO" } else { "ordinary scheduling" };
    let how = match s.trained.seconds {
        0.0 => "trained by an earlier run".to_owned(),
        seconds => format!("trained in {seconds:.0} s"),
    };
    println!("examples         {}, {how}: {}", s.trained.examples, s.trained.database.display());
    println!(
        "ticks            {} of 1 ms, {scheduling}, {} overruns, {} skipped",
        s.ticks, s.overruns, s.skipped_ticks
    );
    println!(
        "tick             p50 {:.0} us, p99 {:.0} us, p99.9 {:.0} us",
        s.tick_us.p50, s.tick_us.p99, s.tick_us.p999
    );
    println!("wake-up late by  p50 {:.0} us, p99 {:.0} us", s.lateness_us.p50, s.lateness_us.p99);
    println!(
        "client           {} skin frames ({} missed, {} with detail), {} wrenches received",
        s.frames_received, s.frames_missed, s.frames_enriched, s.wrenches_received
    );
    println!(
        "poses            {} published, {} used, motion to force {:.0} us",
        s.poses_published, s.poses_accepted, s.motion_to_force_us
    );
    println!("deepest contact  {:.3} mm of penetration", 1e3 * s.max_penetration_m);
    println!("peak force       {:.2} N, peak displacement {:.1} mm", s.peak_force_n, 1e3 * s.peak_displacement_m);
    let [coarse, enriched] = [&s.held_out.coarse, &s.held_out.enriched];
    println!(
        "held-out press   coarse {:.3} mm, enriched {:.3} mm from the accurate skin (RMS), confidence {:.2}",
        1e3 * coarse.rms_m,
        1e3 * enriched.rms_m,
        s.held_out.confidence
    );
    println!("pictures         {}, {}", s.picture.display(), s.live_picture.display());
    println!("mesh             {}", s.glb.display());
}
