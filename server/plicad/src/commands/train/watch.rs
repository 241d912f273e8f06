//! Observers of a job: a bar on the terminal, or lines of a log. Both stop it at SIGTERM and Ctrl-C.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressStyle};
use plica_training::{TrainingProgress, TrainingReport, TrainingStage};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

/// Least time between two lines of a log.
const LOG_INTERVAL: Duration = Duration::from_secs(30);

/// Set once a signal has asked the process to end.
#[derive(Debug, Clone)]
pub(in crate::commands) struct Ending(Arc<AtomicBool>);

impl Ending {
    pub(super) fn listen() -> std::io::Result<Self> {
        let asked = Arc::new(AtomicBool::new(false));
        for signal in [SIGTERM, SIGINT, SIGHUP] {
            signal_hook::flag::register(signal, Arc::clone(&asked))?;
        }
        Ok(Self(asked))
    }

    /// `Break` once the process is asked to end.
    pub(super) fn flow(&self) -> ControlFlow<()> {
        if self.0.load(Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// A progress bar.
#[derive(Debug)]
pub(in crate::commands) struct OnTerminal {
    /// `None` leaves the default action of signals.
    ending: Option<Ending>,
    bar: ProgressBar,
}

impl OnTerminal {
    pub(in crate::commands) fn new(ending: Option<Ending>) -> Self {
        let style = ProgressStyle::with_template("{bar:40} {pos}/{len} {msg}").expect("the template is fixed");
        let bar = ProgressBar::new(1).with_style(style).with_message("builds the models");
        bar.enable_steady_tick(Duration::from_millis(500));
        Self { ending, bar }
    }

    pub(in crate::commands) fn finish(&self) {
        self.bar.finish_and_clear();
    }

    pub(in crate::commands) fn observe(&self, p: &TrainingProgress) -> ControlFlow<()> {
        self.bar.set_length(p.total.into());
        self.bar.set_position((p.done + p.rejected).into());
        self.bar.set_message(line(p));
        self.ending.as_ref().map_or(ControlFlow::Continue(()), Ending::flow)
    }
}

/// Lines on standard error, which the daemon keeps as the job's log.
#[derive(Debug)]
pub(super) struct ToLog {
    ending: Ending,
    kind: &'static str,
    newest: Option<TrainingProgress>,
    /// Time and content of the last line.
    last: Option<(Instant, TrainingProgress)>,
}

impl ToLog {
    pub(super) fn new(ending: Ending, kind: &'static str) -> Self {
        Self { ending, kind, newest: None, last: None }
    }

    pub(super) fn done(&self, report: &TrainingReport) {
        let (examples, rejected) = (report.result.examples, report.result.rejected.len());
        eprintln!("{}: {examples} examples, {rejected} rejected, in {:.0} s", self.kind, report.run.wall_s);
    }

    pub(super) fn observe(&mut self, p: &TrainingProgress) -> ControlFlow<()> {
        if self.newest.replace(*p) != Some(*p) && self.is_news(p) {
            eprintln!("{}: {} of {}, {}", self.kind, p.done + p.rejected, p.total, line(p));
            self.last = Some((Instant::now(), *p));
        }
        self.ending.flow()
    }

    fn is_news(&self, p: &TrainingProgress) -> bool {
        self.last.is_none_or(|(at, last)| {
            at.elapsed() >= LOG_INTERVAL || last.stage != p.stage || last.rejected != p.rejected
        })
    }
}

fn line(p: &TrainingProgress) -> String {
    match (p.stage, p.seconds_left) {
        (TrainingStage::Interactions, _) => "draws interactions".to_owned(),
        (TrainingStage::Database, _) => "writes the database".to_owned(),
        (TrainingStage::Examples, None) => format!("{} rejected", p.rejected),
        (TrainingStage::Examples, Some(seconds)) => {
            let left = HumanDuration(Duration::from_secs_f64(seconds.clamp(0.0, 1e9)));
            format!("{} rejected, {left} left", p.rejected)
        }
    }
}
