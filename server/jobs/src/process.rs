//! The process of one job.
//!
//! It is started through `plicad child`, which lowers itself and then becomes the process that does the work. Nothing
//! is done between fork and exec: a fork would mark every page of the daemon for copying, and the simulation would
//! pay for it, page by page.

use std::fs::OpenOptions;
use std::io;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process_group};

use crate::folder::JobFolder;
use crate::priority::Priority;

/// How processes are started and ended.
#[derive(Debug, Clone)]
pub struct Launch {
    /// What runs as `PROGRAM train --job DIR`.
    pub program: PathBuf,
    /// The plicad whose `child` command lowers the process; `None` runs the program as it is.
    pub launcher: Option<PathBuf>,
    /// How low.
    pub priority: Priority,
    /// Core that belongs to the simulation.
    pub avoid_cpu: Option<usize>,
    /// How long a process that was asked to stop may take.
    pub grace: Duration,
}

impl Launch {
    /// This very program, lowered.
    pub fn own(priority: Priority, avoid_cpu: Option<usize>) -> io::Result<Self> {
        let program = std::env::current_exe()?;
        Ok(Self { launcher: Some(program.clone()), program, priority, avoid_cpu, grace: Duration::from_secs(2) })
    }

    fn command(&self) -> Command {
        let Some(launcher) = &self.launcher else { return Command::new(&self.program) };
        let mut command = Command::new(launcher);
        command.args(["child", "--parent", &std::process::id().to_string(), "--priority", self.priority.name()]);
        if let Some(cpu) = self.avoid_cpu {
            command.args(["--avoid-cpu", &cpu.to_string()]);
        }
        command.arg("--").arg(&self.program);
        command
    }
}

/// A running process.
#[derive(Debug)]
pub(crate) struct Process {
    child: Child,
    /// When it was asked to stop.
    asked: Option<Instant>,
    grace: Duration,
}

impl Process {
    /// Starts the process of a job, the leader of a process group; the error is a sentence.
    pub(crate) fn start(launch: &Launch, folder: &JobFolder) -> Result<Self, String> {
        let log = OpenOptions::new().append(true).create(true).open(folder.log());
        let log = log.map_err(|e| format!("{} cannot be written: {e}", folder.log().display()))?;
        let for_errors = log.try_clone().map_err(|e| format!("{}: {e}", folder.log().display()))?;
        let mut command = launch.command();
        command.args(["train", "--job"]).arg(folder.path());
        command.stdin(Stdio::null()).stdout(log).stderr(for_errors);
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let child = command.spawn();
        let child = child.map_err(|e| format!("{} cannot be started: {e}", command.get_program().display()))?;
        Ok(Self { child, asked: None, grace: launch.grace })
    }

    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Whether this daemon has asked it to stop.
    pub(crate) fn was_asked(&self) -> bool {
        self.asked.is_some()
    }

    /// How it ended, once it has.
    pub(crate) fn ended(&mut self) -> io::Result<Option<ExitStatus>> {
        self.child.try_wait()
    }

    /// Asks it to stop; called again after the grace, ends it.
    pub(crate) fn stop(&mut self) {
        match self.asked {
            None => {
                self.signal(Signal::TERM);
                self.asked = Some(Instant::now());
            }
            Some(asked) if asked.elapsed() >= self.grace => self.signal(Signal::KILL),
            Some(_) => {}
        }
    }

    /// True if it is still there long after it was ended: it hangs in the kernel, on a disk for instance.
    pub(crate) fn is_stuck(&self) -> bool {
        self.asked.is_some_and(|asked| asked.elapsed() >= 2 * self.grace)
    }

    /// A process that has not been waited for keeps its number, so this cannot reach another one.
    fn signal(&self, signal: Signal) {
        let group = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw);
        // An error means that it has ended already.
        let _ = group.map(|group| kill_process_group(group, signal));
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        if matches!(self.child.try_wait(), Ok(None)) {
            self.signal(Signal::KILL);
        }
    }
}
