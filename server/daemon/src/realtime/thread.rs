//! The thread that turns the loop: absolute deadlines, or on demand in lock-step.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::sync_channel;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::pacing::{Pacer, Plan};
use super::privileges::{Grants, ThreadOptions, acquire};
use super::sim_loop::{Loop, Turn};
use super::stage_timer::StageTimer;
use super::statistics::Statistics;
use super::waker::Waker;

/// Time before a deadline in which a real-time thread spins instead of sleeping. Without `SCHED_FIFO` it never spins, since the
/// scheduler would penalise it.
const SPIN: Duration = Duration::from_micros(100);
/// Longest sleep of a thread in lock-step.
const LOCK_STEP_NAP: Duration = Duration::from_millis(100);

/// Pacing of ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pace {
    /// One per time step.
    RealTime,
    /// On command.
    LockStep,
}

/// A running simulation thread. Stops on request, or on drop.
#[derive(Debug)]
pub struct Running {
    stop: Arc<AtomicBool>,
    waker: Arc<Waker>,
    grants: Grants,
    thread: Option<JoinHandle<Loop>>,
}

/// Starts the thread; returns once it is set up and has touched all its memory.
pub fn spawn(core: Loop, options: ThreadOptions) -> std::io::Result<Running> {
    let stop = Arc::new(AtomicBool::new(false));
    let waker = Arc::clone(core.waker());
    let (ready, started) = sync_channel(1);
    let thread_stop = Arc::clone(&stop);
    let thread = std::thread::Builder::new().name("plica-sim".into()).spawn(move || {
        let mut core = core;
        core.waker().register_current();
        let pace = if core.is_lock_step() { Pace::LockStep } else { Pace::RealTime };
        let options = if pace == Pace::LockStep { ThreadOptions::default() } else { options };
        let grants = acquire(&options);
        core.warm_up(&mut StageTimer::new());
        let fifo = grants.fifo;
        let _ = ready.send(grants);
        match pace {
            Pace::RealTime => run_in_real_time(&mut core, fifo, &thread_stop),
            Pace::LockStep => run_in_lock_step(&mut core, &thread_stop),
        }
        core
    })?;
    let grants =
        started.recv().map_err(|_| std::io::Error::other("the simulation thread ended while it was set up"))?;
    Ok(Running { stop, waker, grants, thread: Some(thread) })
}

impl Running {
    /// Privileges that the operating system granted.
    pub fn grants(&self) -> &Grants {
        &self.grants
    }

    /// Whether the thread still runs.
    pub fn is_alive(&self) -> bool {
        self.thread.as_ref().is_some_and(|t| !t.is_finished())
    }

    /// Ends the thread and gives the loop back; `None` if it panicked.
    pub fn stop(mut self) -> Option<Loop> {
        self.end()
    }

    fn end(&mut self) -> Option<Loop> {
        self.stop.store(true, Relaxed);
        self.waker.wake();
        self.thread.take().and_then(|t| t.join().ok())
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.end();
    }
}

fn run_in_real_time(core: &mut Loop, fifo: bool, stop: &AtomicBool) {
    let start = Instant::now();
    let now_ns = || start.elapsed().as_nanos() as u64;
    let statistics = Arc::clone(core.statistics());
    let mut timer = StageTimer::new();
    let mut pacer = Pacer::new(now_ns(), (core.model().timestep_s() * 1e9) as u64);
    let mut waited = false;
    while !stop.load(Relaxed) {
        match pacer.plan(now_ns()) {
            Plan::Wait { until_ns } => {
                wait_until(start, until_ns, fifo && !core.state().sleeping());
                waited = true;
            }
            Plan::Run { lateness_ns } => {
                if waited {
                    statistics.lateness.record(lateness_ns);
                }
                waited = false;
                timed_turn(core, &mut timer, &statistics);
                if core.is_stepping() {
                    run_steps(core, &mut timer, &statistics, stop);
                    pacer.restart(now_ns());
                }
                pacer.finish(now_ns());
                statistics.overruns.store(pacer.overruns(), Relaxed);
                statistics.skipped.store(pacer.skipped(), Relaxed);
            }
        }
    }
}

/// Ticks of a command run on without waiting.
fn run_steps(core: &mut Loop, timer: &mut StageTimer, statistics: &Statistics, stop: &AtomicBool) {
    while core.is_stepping() && !stop.load(Relaxed) {
        timed_turn(core, timer, statistics);
    }
}

fn run_in_lock_step(core: &mut Loop, stop: &AtomicBool) {
    let statistics = Arc::clone(core.statistics());
    let mut timer = StageTimer::new();
    while !stop.load(Relaxed) {
        timed_turn(core, &mut timer, &statistics);
        if !core.is_stepping() {
            std::thread::park_timeout(LOCK_STEP_NAP);
        }
    }
}

fn timed_turn(core: &mut Loop, timer: &mut StageTimer, statistics: &Statistics) {
    statistics.turns.fetch_add(1, Relaxed);
    let begin = Instant::now();
    core.end_late_step(begin);
    if let Turn::Ticked(_) = core.turn(timer) {
        statistics.tick.record(begin.elapsed().as_nanos() as u64);
        timer.record(statistics);
    }
}

/// Sleeps until `start + until_ns`; with `spin`, the last [`SPIN`] of it awake.
fn wait_until(start: Instant, until_ns: u64, spin: bool) {
    let deadline = start + Duration::from_nanos(until_ns);
    let early = if spin { SPIN } else { Duration::ZERO };
    let left = deadline.saturating_duration_since(Instant::now());
    if left > early {
        sleep(left - early);
    }
    while spin && Instant::now() < deadline {
        std::hint::spin_loop();
    }
}

/// Sleeps to an absolute time, so that being preempted on the way in does not make it longer.
#[cfg(target_os = "linux")]
fn sleep(duration: Duration) {
    use rustix::thread::{ClockId, Timespec, clock_nanosleep_absolute};
    let now = rustix::time::clock_gettime(ClockId::Monotonic);
    let until_ns = i128::from(now.tv_sec) * 1_000_000_000 + i128::from(now.tv_nsec) + duration.as_nanos() as i128;
    let until = Timespec { tv_sec: (until_ns / 1_000_000_000) as i64, tv_nsec: (until_ns % 1_000_000_000) as _ };
    // An interrupted sleep is taken up again by the loop, which looks at the clock first.
    let _ = clock_nanosleep_absolute(ClockId::Monotonic, &until);
}

#[cfg(not(target_os = "linux"))]
fn sleep(duration: Duration) {
    std::thread::sleep(duration);
}
