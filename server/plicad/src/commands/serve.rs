//! `plicad serve`.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context;
use plica_daemon::bus::{BusOptions, Deaf};
use plica_daemon::server::Server;
use plica_jobs::{DataFolder, DataFolderError, Jobs, Launch, ServedScene, Supervision, default_path};
use plica_scene::Config;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::cli::ServeArgs;
use crate::deafness::Deafness;
use crate::service::Watchdog;

const LOOK_AROUND: Duration = Duration::from_millis(100);

/// Serves a scene until SIGINT or SIGTERM.
pub fn run(args: &ServeArgs, json: bool) -> anyhow::Result<()> {
    // Registered first, so that a signal during the start is not lost.
    let mut signals = Signals::new([SIGINT, SIGTERM]).context("cannot listen for signals")?;
    let config = super::scene_with(&args.scene, &args.database)?;
    let options = BusOptions { databases: args.databases.clone(), ..args.bus.options() };
    let mut server = Server::start_with_jobs(&config, &options, args.lock_step, || open_jobs(args, &config))?;
    for warning in &server.grants().warnings {
        tracing::warn!("{warning}");
    }
    let pace = if args.lock_step { "in lock-step" } else { "in real time" };
    tracing::info!("serving {} {pace} on {} as session `{}`", config.name(), options.place(), options.session);
    let mut watchdog = Watchdog::ready(&format!("serving {} on {}", config.name(), options.place()));
    match wait(&mut server, &mut signals, &mut watchdog) {
        End::Signal => {}
        End::Dead => {
            server.stop();
            anyhow::bail!("the simulation thread has ended by itself; see the message above, and report it");
        }
        End::Deaf(Deaf { silent_ms }) => {
            let deafness = Deafness::note(silent_ms, &server.peers(), data_path(args).ok().as_deref());
            server.abandon();
            return Err(deafness.into());
        }
    }
    watchdog.stopping();
    server.stop();
    tracing::info!("stopped");
    if json {
        println!("{}", serde_json::json!({ "scene": config.name(), "stopped": true }));
    }
    Ok(())
}

/// Jobs in the data folder. With a folder that cannot be used the daemon goes on without jobs, and says so here and in
/// its status; one that another daemon has is an error.
fn open_jobs(args: &ServeArgs, config: &Config) -> Result<(Jobs, Option<Supervision>), DataFolderError> {
    let session = &args.bus.session;
    let path = match data_path(args) {
        Ok(path) => path,
        Err(problem) => return Ok(without_jobs(&problem, problem.clone())),
    };
    let folder = match DataFolder::open(&path, session) {
        Ok(folder) => folder,
        Err(error @ DataFolderError::Locked { .. }) => return Err(error),
        Err(error) => return Ok(without_jobs(&error.to_string(), error.without_place())),
    };
    let scene_folder = args.scene.parent().filter(|_| !super::is_built_in(&args.scene)).map(Path::to_owned);
    let served = ServedScene { name: config.name().to_owned(), folder: scene_folder, text: config.text().to_owned() };
    let launch = Launch::own(args.job_priority.into(), config.runtime().cpu());
    let started = launch.and_then(|launch| Jobs::start(folder, served, launch, args.keep()));
    Ok(started
        .map_or_else(|e| without_jobs(&e.to_string(), e.to_string()), |(jobs, supervision)| (jobs, Some(supervision))))
}

fn data_path(args: &ServeArgs) -> Result<PathBuf, String> {
    args.data.clone().map_or_else(|| default_path(&args.bus.session), Ok)
}

/// `told` goes to clients, `problem` to the log.
fn without_jobs(problem: &str, told: String) -> (Jobs, Option<Supervision>) {
    tracing::warn!("no jobs: {problem}");
    (Jobs::unavailable(told), None)
}

/// Why the daemon ends.
enum End {
    /// SIGINT or SIGTERM.
    Signal,
    /// The simulation thread has panicked.
    Dead,
    /// The bus answers no more.
    Deaf(Deaf),
}

fn wait(server: &mut Server, signals: &mut Signals, watchdog: &mut Watchdog) -> End {
    loop {
        if signals.pending().next().is_some() {
            return End::Signal;
        }
        if !server.is_alive() {
            return End::Dead;
        }
        if let Err(deaf) = server.listen() {
            return End::Deaf(deaf);
        }
        watchdog.feed(server.turns());
        std::thread::sleep(LOOK_AROUND);
    }
}
