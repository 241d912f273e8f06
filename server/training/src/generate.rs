//! Runs a job: plans, solves in parallel, assembles the database.

use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::time::Instant;

use crate::accurate::AccurateSize;
use crate::database::{About, Database, DatabaseKind};
use crate::error::{PlanError, TrainingError};
use crate::example::Outcome;
use crate::folder::{TrainingFolder, TrainingJob, TrainingProgress, TrainingStage, from_database};
use crate::interaction::Interaction;
use crate::plan::plan;
use crate::report::{Run, TrainingReport};
use crate::setup::{InteractionSet, Setup};
use crate::tandem::Tandem;

/// Observer of a job: called when the stage changes, after every interaction, before every Newton step and every few ticks.
/// `Break` ends the job at its next Newton step or tick; if none is left to solve, the job is finished all the same.
pub type Observer<'a> = &'a mut (dyn FnMut(TrainingProgress) -> ControlFlow<()> + Send);

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
    observer: Observer<'_>,
) -> Result<TrainingReport, TrainingError> {
    let begin = Instant::now();
    let (sets, seed) = sets_and_seed(setup, job);
    let about = About::new(&setup.scene_hash, job.kind, seed);
    let total = sets.iter().map(|set| set.count as u32).sum();
    let mut tally = Tally::new(folder, observer, total, n_threads);
    tally.announce(TrainingStage::Interactions)?;
    let interactions = plan(setup, &sets, seed)?;
    tally.total = interactions.len() as u32;
    let fingerprints: Vec<String> = interactions.iter().map(|i| setup.fingerprint(i)).collect();
    let mut open = Vec::new();
    for (index, expected) in fingerprints.iter().enumerate() {
        match folder.finished(&about, index as u32, expected)? {
            Some(outcome) => tally.found(&outcome),
            None => open.push(index),
        }
    }
    tally.announce(TrainingStage::Examples)?;
    let n_resumed = interactions.len() - open.len();
    let n_threads = n_threads.clamp(1, open.len().max(1));
    let work = Work { setup, interactions: &interactions, open: &open, about: &about, kind: job.kind };
    let size = work.run(n_threads, folder, &tally)?;
    tally.announce(TrainingStage::Database)?;
    let database = assemble(folder, &about, &fingerprints)?;
    let path = folder.paths().database();
    let nothing = || PlanError::AllRejected { n: database.rejected.len(), first: first_message(&database) };
    if database.examples.is_empty() {
        return Err(nothing().into());
    }
    database.write(&path).map_err(from_database)?;
    let run = Run {
        threads: n_threads,
        wall_s: begin.elapsed().as_secs_f64(),
        solved: open.len(),
        resumed: n_resumed,
        ..tally.times()
    };
    let report = TrainingReport::new(setup, &database, interactions.len(), size, run);
    folder.set_report(&report)?;
    Ok(report)
}

/// Sets and seed: the scene's, unless the job says otherwise.
fn sets_and_seed(setup: &Setup, job: &TrainingJob) -> (Vec<InteractionSet>, u64) {
    let (mut sets, seed) = match job.kind {
        DatabaseKind::Training => (vec![setup.training.clone()], setup.training_seed),
        DatabaseKind::Evaluation => (setup.evaluation.clone(), setup.evaluation_seed),
    };
    if let (Some(examples), Some(first)) = (job.examples, sets.first_mut()) {
        first.count = examples as usize;
    }
    (sets, job.seed.unwrap_or(seed))
}

/// Interactions to solve.
struct Work<'a> {
    setup: &'a Setup,
    interactions: &'a [Interaction],
    open: &'a [usize],
    about: &'a About,
    kind: DatabaseKind,
}

impl Work<'_> {
    /// One sequential solve per thread, in the order of the plan.
    fn run(&self, n_threads: usize, folder: &TrainingFolder, tally: &Tally<'_>) -> Result<AccurateSize, TrainingError> {
        let threads = |e: rayon::ThreadPoolBuildError| TrainingError::Threads { n_threads, reason: e.to_string() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().map_err(threads)?;
        let (next, failed) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let worker = |_: rayon::BroadcastContext<'_>| {
            let mut tandem = Tandem::new(self.setup)?;
            let mut observe = || match tally.observe() {
                ControlFlow::Continue(()) if failed.load(Relaxed) == 0 => ControlFlow::Continue(()),
                _ => ControlFlow::Break(()),
            };
            while let Some(&index) = self.open.get(next.fetch_add(1, Relaxed)) {
                let begin = Instant::now();
                let two = self.kind == DatabaseKind::Evaluation;
                let outcome = tandem.solve(index as u32, &self.interactions[index], two, &mut observe);
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

/// Counts and times finished interactions, and reports progress to the folder and the observer.
struct Tally<'a> {
    folder: &'a TrainingFolder,
    total: u32,
    n_threads: usize,
    shared: Mutex<Shared<'a>>,
}

/// State that threads change in turn, so that progress never runs backwards.
struct Shared<'a> {
    counts: Counts,
    observer: Observer<'a>,
    is_cancelled: bool,
}

#[derive(Debug, Clone, Default)]
struct Counts {
    done: u32,
    rejected: u32,
    seconds: Vec<f64>,
}

impl<'a> Tally<'a> {
    fn new(folder: &'a TrainingFolder, observer: Observer<'a>, total: u32, n_threads: usize) -> Self {
        let shared = Shared { counts: Counts::default(), observer, is_cancelled: false };
        Self { folder, total, n_threads, shared: Mutex::new(shared) }
    }

    fn shared(&self) -> std::sync::MutexGuard<'_, Shared<'a>> {
        self.shared.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    fn found(&self, outcome: &Outcome) {
        self.shared().counts.count(outcome);
    }

    fn solved(&self, outcome: &Outcome, seconds: f64) -> Result<(), TrainingError> {
        let mut shared = self.shared();
        shared.counts.count(outcome);
        shared.counts.seconds.push(seconds);
        self.report(&mut shared, TrainingStage::Examples)
    }

    fn announce(&self, stage: TrainingStage) -> Result<(), TrainingError> {
        self.report(&mut self.shared(), stage)
    }

    fn report(&self, shared: &mut Shared<'_>, stage: TrainingStage) -> Result<(), TrainingError> {
        let progress = self.progress(&shared.counts, stage);
        self.folder.set_progress(&progress)?;
        shared.observe(progress);
        Ok(())
    }

    /// `Break` once the observer has ended the job.
    fn observe(&self) -> ControlFlow<()> {
        let mut shared = self.shared();
        let progress = self.progress(&shared.counts, TrainingStage::Examples);
        shared.observe(progress);
        if shared.is_cancelled { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    fn progress(&self, counts: &Counts, stage: TrainingStage) -> TrainingProgress {
        let left = self.total.saturating_sub(counts.done + counts.rejected);
        let mean = |seconds: &[f64]| seconds.iter().sum::<f64>() / seconds.len() as f64;
        let seconds_left = match stage {
            TrainingStage::Database => Some(0.0),
            _ => (!counts.seconds.is_empty())
                .then(|| mean(&counts.seconds) * f64::from(left) / self.n_threads.max(1) as f64),
        };
        let (done, rejected, total) = (counts.done, counts.rejected, self.total);
        TrainingProgress { stage, done, rejected, total, seconds_left }
    }

    fn times(&self) -> Run {
        let seconds = &self.shared().counts.seconds;
        Run {
            mean_s: (!seconds.is_empty()).then(|| seconds.iter().sum::<f64>() / seconds.len() as f64),
            max_s: seconds.iter().copied().reduce(f64::max),
            ..Run::default()
        }
    }
}

impl Shared<'_> {
    fn observe(&mut self, progress: TrainingProgress) {
        self.is_cancelled |= (self.observer)(progress).is_break();
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
