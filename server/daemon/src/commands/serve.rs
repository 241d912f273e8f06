//! `plicad serve`.

use std::time::Duration;

use anyhow::Context;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::cli::ServeArgs;
use crate::config::Config;
use crate::server::Server;

const LOOK_AROUND: Duration = Duration::from_millis(100);

/// Serves a scene until SIGINT or SIGTERM.
pub fn run(args: &ServeArgs, json: bool) -> anyhow::Result<()> {
    // Registered first, so that a signal during the start is not lost.
    let mut signals = Signals::new([SIGINT, SIGTERM]).context("cannot listen for signals")?;
    let config = args.scene.as_deref().map_or_else(Config::built_in, Config::from_file)?;
    let options = args.bus.options();
    let server = Server::start(&config, &options, args.lock_step)?;
    for warning in &server.grants().warnings {
        tracing::warn!("{warning}");
    }
    let pace = if args.lock_step { "in lock-step" } else { "in real time" };
    tracing::info!("serving {} {pace} on {} as session `{}`", config.name(), options.place(), options.session);
    let outcome = wait(&server, &mut signals);
    server.stop();
    tracing::info!("stopped");
    outcome?;
    if json {
        println!("{}", serde_json::json!({ "scene": config.name(), "stopped": true }));
    }
    Ok(())
}

fn wait(server: &Server, signals: &mut Signals) -> anyhow::Result<()> {
    loop {
        if signals.pending().next().is_some() {
            return Ok(());
        }
        anyhow::ensure!(
            server.is_alive(),
            "the simulation thread has ended by itself; see the message above, and report it"
        );
        std::thread::sleep(LOOK_AROUND);
    }
}
