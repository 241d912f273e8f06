//! `plicad train`.

mod sensitivity;
mod table;
mod watch;

use std::path::{Path, PathBuf};

use anyhow::Context;
use plica_jobs::by_hand::{self, JobRequest};
use plica_scene::Config;
use plica_scene::setup::setup;
use plica_training::{Folder, Job, JobKind, Report, write_atomically};

use crate::cli::{TrainArgs, TrainKind};

use watch::{Ending, ToLog};

pub(super) use watch::OnTerminal;

/// Trains, or says how firm the accurate skin is.
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

/// All cores but one: somebody may be simulating.
fn default_threads() -> u32 {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    u32::try_from(cores.saturating_sub(1)).unwrap_or(1).max(1)
}

/// A job by hand: makes its folder, shows a bar, prints a table.
fn run_scene(config: &Config, args: &TrainArgs, n_threads: u32, json: bool) -> anyhow::Result<()> {
    let ending = Ending::listen()?;
    let kind = match args.kind {
        TrainKind::Training => JobKind::Training,
        TrainKind::Evaluation => JobKind::Evaluation,
    };
    let root = args.folder.clone().unwrap_or_else(|| default_folder(config, kind));
    let request = JobRequest { kind, examples: args.examples, seed: args.seed, threads: n_threads };
    let (folder, job) = by_hand::make(&root, config, &request)?;
    let begun = by_hand::begin(&root).with_context(|| root.display().to_string())?;
    let watch = OnTerminal::new(Some(ending));
    let result = work(config, &job, &folder, n_threads as usize, &watch);
    watch.finish();
    // The result counts, even if the note about it cannot be written.
    if let Err(error) = by_hand::end(&root, begun, &result) {
        tracing::warn!("{}: {error}", root.display());
    }
    let report = result?;
    if let Some(out) = &args.out {
        copy(&folder.database(), out)?;
    }
    table::print(&report, args.out.as_deref().unwrap_or(&folder.database()), &folder.report());
    if json {
        println!("{}", summary(&report, args.out.as_deref().unwrap_or(&folder.database()), &root)?);
    }
    Ok(())
}

/// A job in its folder, as the daemon starts it: says what happens in lines of a log.
fn run_job(root: &Path, threads: Option<u32>, json: bool) -> anyhow::Result<()> {
    let ending = Ending::listen()?;
    anyhow::ensure!(root.is_dir(), "{}: is no job folder: there is no such folder", root.display());
    let folder = Folder::open(root)?;
    let job = folder.job()?;
    let config = Config::from_file(&root.join("scene.toml"))?;
    let n_threads = threads.or(job.threads).unwrap_or_else(default_threads);
    let watch = ToLog::new(ending, job.kind.name());
    let report = work(&config, &job, &folder, n_threads as usize, &watch)?;
    watch.done(&report);
    if json {
        println!("{}", summary(&report, &folder.database(), root)?);
    }
    Ok(())
}

/// The one code path of all.
pub(super) fn work(
    config: &Config,
    job: &Job,
    folder: &Folder,
    n_threads: usize,
    watch: &dyn plica_training::Watch,
) -> anyhow::Result<Report> {
    let setup = setup(config)?;
    Ok(plica_training::run(&setup, job, n_threads, folder, watch)?)
}

fn default_folder(config: &Config, kind: JobKind) -> PathBuf {
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

fn summary(report: &Report, database: &Path, folder: &Path) -> Result<String, serde_json::Error> {
    let mut value = serde_json::to_value(report)?;
    value["database"] = database.display().to_string().into();
    value["folder"] = folder.display().to_string().into();
    serde_json::to_string(&value)
}
