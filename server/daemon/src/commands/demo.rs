//! `plicad demo`.

use crate::cli::DemoArgs;
use crate::config::Config;
use crate::demo::{self, Summary};

/// Serves on loopback, drives the tool through a real client, prints a summary, writes a picture and a GLB.
pub fn run(args: &DemoArgs, json: bool) -> anyhow::Result<()> {
    anyhow::ensure!(
        (1.0..=3600.0).contains(&args.seconds),
        "--seconds {} is outside the allowed range 1 to 3600",
        args.seconds
    );
    let config = Config::built_in()?;
    let path = match &args.poses {
        Some(file) => demo::from_file(file, &config, args.fit)?,
        None => demo::scripted(&config, args.seconds),
    };
    let summary = demo::run(&config, &path, &args.out)?;
    print(&summary);
    if json {
        println!("{}", serde_json::to_string(&summary)?);
    }
    Ok(())
}

fn print(s: &Summary) {
    let scheduling = if s.realtime { "SCHED_FIFO" } else { "ordinary scheduling" };
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
        "client           {} skin frames ({} missed), {} wrenches received",
        s.frames_received, s.frames_missed, s.wrenches_received
    );
    println!(
        "poses            {} published, {} used, motion to force {:.0} us",
        s.poses_published, s.poses_accepted, s.motion_to_force_us
    );
    println!("deepest contact  {:.3} mm of penetration", 1e3 * s.max_penetration_m);
    println!("peak force       {:.2} N, peak displacement {:.1} mm", s.peak_force_n, 1e3 * s.peak_displacement_m);
    println!("picture          {}", s.picture.display());
    println!("mesh             {}", s.glb.display());
}
