//! The job itself: plan, solve in parallel, assemble.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::time::Instant;

use crate::database::{About, Database, DatabaseKind};
use crate::error::{PlanError, TrainingError};
use crate::example::Outcome;
use crate::folder::{TrainingFolder, TrainingJob, TrainingProgress, TrainingStage, from_database};
use crate::interaction::Interaction;
use crate::plan::plan;
use crate::report::{Run, TrainingReport};
use crate::setup::{InteractionSet, Setup};
use crate::tandem::Tandem;

/// Who watches a job.
pub trait Watch: Sync {
    /// After every interaction, and when the stage changes.
    fn progress(&self, progress: &TrainingProgress);
    /// Asked before every Newton step and every few ticks; true ends the job.
    fn cancelled(&self) -> bool;
}

/// Runs the job of `folder` on `n_threads` threads, or goes on with it. The database does not depend on their number, nor on
/// how often the job was ended and begun again.
///
/// # Errors
/// See [`TrainingError`]. Finished examples are kept in any case.
pub fn run(
    setup: &Setup,
    job: &TrainingJob,
    n_threads: usize,
    folder: &TrainingFolder,
    watch: &dyn Watch,
) -> Result<TrainingReport, TrainingError> {
    let begin = Instant::now();
    let (sets, seed) = ask(setup, job);
    let about = About::new(&setup.scene_hash, job.kind, seed);
    let total = sets.iter().map(|set| set.count as u32).sum();
    let start =
        TrainingProgress { stage: TrainingStage::Interactions, done: 0, rejected: 0, total, seconds_left: None };
    tell(folder, watch, &start)?;
    let interactions = plan(setup, &sets, seed)?;
    let tally = Tally::new(folder, watch, interactions.len() as u32, n_threads);
    let fingerprints: Vec<String> = interactions.iter().map(|i| setup.fingerprint(i)).collect();
    let mut open = Vec::new();
    for (index, expected) in fingerprints.iter().enumerate() {
        match folder.finished(&about, index as u32, expected)? {
            Some(outcome) => tally.found(&outcome),
            None => open.push(index),
        }
    }
    tally.report()?;
    let n_resumed = interactions.len() - open.len();
    let n_threads = n_threads.clamp(1, open.len().max(1));
    let work = Work { setup, interactions: &interactions, open: &open, about: &about, kind: job.kind };
    let sizes = work.run(n_threads, folder, watch, &tally)?;
    tell(folder, watch, &TrainingProgress { stage: TrainingStage::Database, seconds_left: Some(0.0), ..tally.now() })?;
    let database = assemble(folder, &about, &fingerprints)?;
    let path = folder.paths().database();
    let nothing = || PlanError::AllRejected { n: database.rejected.len(), first: first_message(&database) };
    if database.examples.is_empty() {
        return Err(nothing().into());
    }
    database.write(&path).map_err(|e| from_database(e, &path))?;
    let run = Run {
        threads: n_threads,
        wall_s: begin.elapsed().as_secs_f64(),
        solved: open.len(),
        resumed: n_resumed,
        ..tally.times()
    };
    let report = TrainingReport::new(setup, &database, interactions.len(), sizes, run);
    folder.set_report(&report)?;
    Ok(report)
}

/// Sets and seed: the scene's, unless the job says otherwise.
fn ask(setup: &Setup, job: &TrainingJob) -> (Vec<InteractionSet>, u64) {
    let (mut sets, seed) = match job.kind {
        DatabaseKind::Training => (vec![setup.training.clone()], setup.training_seed),
        DatabaseKind::Evaluation => (setup.evaluation.clone(), setup.evaluation_seed),
    };
    if let (Some(examples), Some(first)) = (job.examples, sets.first_mut()) {
        first.count = examples as usize;
    }
    (sets, job.seed.unwrap_or(seed))
}

/// What is to be solved.
struct Work<'a> {
    setup: &'a Setup,
    interactions: &'a [Interaction],
    open: &'a [usize],
    about: &'a About,
    kind: DatabaseKind,
}

impl Work<'_> {
    /// One sequential solve per thread, in the order of the plan. Sizes of the accurate model: unknowns, factor values.
    fn run(
        &self,
        n_threads: usize,
        folder: &TrainingFolder,
        watch: &dyn Watch,
        tally: &Tally<'_>,
    ) -> Result<(usize, usize), TrainingError> {
        let threads = |e: rayon::ThreadPoolBuildError| TrainingError::Threads { n_threads, reason: e.to_string() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().map_err(threads)?;
        let (next, failed) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let cancelled = || watch.cancelled() || failed.load(Relaxed) > 0;
        let worker = |_: rayon::BroadcastContext<'_>| {
            let mut tandem = Tandem::new(self.setup)?;
            while let Some(&index) = self.open.get(next.fetch_add(1, Relaxed)) {
                let begin = Instant::now();
                let two = self.kind == DatabaseKind::Evaluation;
                let outcome = tandem.solve(index as u32, &self.interactions[index], two, &cancelled);
                let outcome = outcome.map_err(|_| TrainingError::Interrupted)?;
                folder.store(self.about, &outcome)?;
                tally.solved(&outcome, begin.elapsed().as_secs_f64())?;
            }
            Ok(tandem.accurate().size())
        };
        // A thread that fails ends the others at their next Newton step; its error counts, not that they were interrupted.
        let guarded = |context: rayon::BroadcastContext<'_>| {
            let result = worker(context);
            if result.is_err() {
                failed.fetch_add(1, Relaxed);
            }
            result
        };
        let mut results = pool.broadcast(guarded);
        results.sort_by_key(|r| !matches!(r, Err(e) if !matches!(e, TrainingError::Interrupted)));
        results.into_iter().collect::<Result<Vec<_>, _>>().map(|sizes| sizes[0])
    }
}

/// Examples in the order of the plan, from the disk: those of earlier runs and of this one alike.
fn assemble(folder: &TrainingFolder, about: &About, fingerprints: &[String]) -> Result<Database, TrainingError> {
    let mut database = Database { about: about.clone(), examples: Vec::new(), rejected: Vec::new() };
    for (index, expected) in fingerprints.iter().enumerate() {
        match folder.finished(about, index as u32, expected)? {
            Some(Outcome::Accepted(example)) => database.examples.push(*example),
            Some(Outcome::Rejected(rejection)) => database.rejected.push(rejection),
            None => {
                let problem = format!("interaction {index} was finished and is gone or damaged; run the job again");
                return Err(TrainingError::File { path: folder.paths().root().to_owned(), problem });
            }
        }
    }
    Ok(database)
}

fn first_message(database: &Database) -> String {
    database.rejected.first().map_or_else(String::new, |r| r.message.clone())
}

fn tell(folder: &TrainingFolder, watch: &dyn Watch, progress: &TrainingProgress) -> Result<(), TrainingError> {
    folder.set_progress(progress)?;
    watch.progress(progress);
    Ok(())
}

/// Counts what is finished, and how long it took.
struct Tally<'a> {
    folder: &'a TrainingFolder,
    watch: &'a dyn Watch,
    total: u32,
    n_threads: usize,
    counts: Mutex<Counts>,
}

#[derive(Debug, Clone, Default)]
struct Counts {
    done: u32,
    rejected: u32,
    seconds: Vec<f64>,
}

impl<'a> Tally<'a> {
    fn new(folder: &'a TrainingFolder, watch: &'a dyn Watch, total: u32, n_threads: usize) -> Self {
        Self { folder, watch, total, n_threads, counts: Mutex::new(Counts::default()) }
    }

    fn counts(&self) -> std::sync::MutexGuard<'_, Counts> {
        self.counts.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    fn found(&self, outcome: &Outcome) {
        self.counts().count(outcome);
    }

    fn solved(&self, outcome: &Outcome, seconds: f64) -> Result<(), TrainingError> {
        let mut counts = self.counts();
        counts.count(outcome);
        counts.seconds.push(seconds);
        // Told under the lock, so that progress never runs backwards.
        tell(self.folder, self.watch, &self.progress(&counts))
    }

    fn report(&self) -> Result<(), TrainingError> {
        tell(self.folder, self.watch, &self.now())
    }

    fn now(&self) -> TrainingProgress {
        self.progress(&self.counts())
    }

    fn progress(&self, counts: &Counts) -> TrainingProgress {
        let left = self.total.saturating_sub(counts.done + counts.rejected);
        let mean = |seconds: &[f64]| seconds.iter().sum::<f64>() / seconds.len() as f64;
        let seconds_left = (!counts.seconds.is_empty())
            .then(|| mean(&counts.seconds) * f64::from(left) / self.n_threads.max(1) as f64);
        let (done, rejected, total) = (counts.done, counts.rejected, self.total);
        TrainingProgress { stage: TrainingStage::Examples, done, rejected, total, seconds_left }
    }

    fn times(&self) -> Run {
        let seconds = &self.counts().seconds;
        Run {
            mean_s: (!seconds.is_empty()).then(|| seconds.iter().sum::<f64>() / seconds.len() as f64),
            max_s: seconds.iter().copied().reduce(f64::max),
            ..Run::default()
        }
    }
}

impl Counts {
    fn count(&mut self, outcome: &Outcome) {
        match outcome {
            Outcome::Accepted(_) => self.done += 1,
            Outcome::Rejected(_) => self.rejected += 1,
        }
    }
}
