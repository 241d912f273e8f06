//! `plicad train`.

mod sensitivity;
mod table;
mod watch;

use std::path::{Path, PathBuf};

use anyhow::Context;
use plica_jobs::by_hand::{self, JobOptions};
use plica_scene::Config;
use plica_scene::setup::{SetupError, setup};
use plica_training::{DatabaseKind, TrainingFolder, TrainingJob, TrainingReport, default_threads, write_atomically};

use crate::cli::{TrainArgs, TrainKind};

use watch::{Ending, ToLog};

pub(super) use watch::OnTerminal;

/// Trains, or reports the sensitivity of the accurate skin.
pub fn run(args: &TrainArgs, json: bool) -> anyhow::Result<()> {
    let n_threads = args.threads.unwrap_or_else(default_threads);
    match (&args.job, &args.scene) {
        (Some(folder), _) => run_job(folder, args.threads, json),
        (None, Some(scene)) => {
            let config = super::scene(scene)?;
            match args.sensitivity {
                Some(n) => sensitivity::run(&config, n as usize, n_threads as usize, json),
                None => run_scene(&config, args, n_threads, json),
            }
        }
        (None, None) => anyhow::bail!("name a scene, or a job's folder with --job"),
    }
}

/// Runs a job from the command line: makes its folder, shows a progress bar, prints a table.
fn run_scene(config: &Config, args: &TrainArgs, n_threads: u32, json: bool) -> anyhow::Result<()> {
    let ending = Ending::listen()?;
    let kind = match args.kind {
        TrainKind::Training => DatabaseKind::Training,
        TrainKind::Evaluation => DatabaseKind::Evaluation,
    };
    let root = args.folder.clone().unwrap_or_else(|| default_folder(config, kind));
    let options = JobOptions { kind, examples: args.examples, seed: args.seed, threads: n_threads };
    let (folder, job) = by_hand::make(&root, config, &options)?;
    let started = by_hand::begin(&root).with_context(|| root.display().to_string())?;
    let watch = OnTerminal::new(Some(ending));
    let result = work(config, &job, &folder, n_threads as usize, &mut |p| watch.observe(&p));
    watch.finish();
    // The result is valid even if its state cannot be written.
    if let Err(error) = by_hand::end(&root, started, &result) {
        tracing::warn!("{}: {error}", root.display());
    }
    let report = result?;
    if let Some(out) = &args.out {
        copy(&folder.paths().database(), out)?;
    }
    let database = args.out.clone().unwrap_or_else(|| folder.paths().database());
    table::print(&report, &database, &folder.paths().report());
    if json {
        println!("{}", summary(&report, &database, &root)?);
    }
    Ok(())
}

/// Runs a job in its folder, as the daemon starts it; progress goes to the log.
fn run_job(root: &Path, threads: Option<u32>, json: bool) -> anyhow::Result<()> {
    let ending = Ending::listen()?;
    anyhow::ensure!(root.is_dir(), "{}: not a job folder, since there is no such folder", root.display());
    let folder = TrainingFolder::open(root)?;
    let job = folder.job()?;
    let config = Config::from_file(&folder.paths().scene())?;
    let n_threads = threads.or(job.threads).unwrap_or_else(default_threads);
    let mut watch = ToLog::new(ending, job.kind.name());
    let result = work(&config, &job, &folder, n_threads as usize, &mut |p| watch.observe(&p));
    let report = result.map_err(without_content)?;
    watch.done(&report);
    if json {
        println!("{}", summary(&report, &folder.paths().database(), root)?);
    }
    Ok(())
}

/// The last line of a job's log goes to clients, who may have named a file that they cannot read: its words stay in the log.
fn without_content(error: anyhow::Error) -> anyhow::Error {
    match error.downcast_ref() {
        Some(SetupError::Motion { object, source }) => {
            eprintln!("plicad: {error}");
            anyhow::anyhow!("objects.{object}.training.recorded: {}", source.without_content())
        }
        _ => error,
    }
}

/// Runs a job; all commands that train call this.
pub(super) fn work(
    config: &Config,
    job: &TrainingJob,
    folder: &TrainingFolder,
    n_threads: usize,
    observer: plica_training::Observer<'_>,
) -> anyhow::Result<TrainingReport> {
    let setup = setup(config)?;
    Ok(plica_training::run(&setup, job, n_threads, folder, observer)?)
}

/// Default folder of a job from the command line.
pub(super) fn default_folder(config: &Config, kind: DatabaseKind) -> PathBuf {
    Path::new("out/train").join(format!("{}-{}", config.name(), kind.name()))
}

fn copy(database: &Path, out: &Path) -> anyhow::Result<()> {
    let name = |path: &Path| path.display().to_string();
    let bytes = std::fs::read(database).with_context(|| name(database))?;
    if let Some(folder) = out.parent() {
        std::fs::create_dir_all(folder).with_context(|| name(folder))?;
    }
    write_atomically(out, &bytes).with_context(|| name(out))
}

fn summary(report: &TrainingReport, database: &Path, folder: &Path) -> Result<String, serde_json::Error> {
    let mut value = serde_json::to_value(report)?;
    value["database"] = database.display().to_string().into();
    value["folder"] = folder.display().to_string().into();
    serde_json::to_string(&value)
}
