//! Process of one job.
//!
//! It is started through `plicad child`, which lowers its own priority and then executes the job. Nothing runs between fork and
//! exec, since a fork marks every page of the daemon for copying, and the simulation thread would fault on each.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rustix::fs::OFlags;
use rustix::process::{Pid, Signal, kill_process_group};

use crate::folder::JobFolder;
use crate::priority::Priority;

/// Options for starting and ending processes.
#[derive(Debug, Clone)]
pub struct Launch {
    /// Program, run as `PROGRAM train --job DIR`.
    pub program: PathBuf,
    /// plicad with the `child` command that lowers the process; `None` starts the program directly.
    pub launcher: Option<PathBuf>,
    /// Scheduling class.
    pub priority: Priority,
    /// Core of the simulation, which jobs leave free.
    pub avoid_cpu: Option<usize>,
    /// Time between SIGTERM and SIGKILL.
    pub grace: Duration,
}

impl Launch {
    /// Starts the program of this process, lowered.
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
    /// Time of SIGTERM, once it was sent.
    asked: Option<Instant>,
    grace: Duration,
}

impl Process {
    /// Starts the process of a job as the leader of a process group; the error is a sentence.
    pub(crate) fn start(launch: &Launch, folder: &JobFolder) -> Result<Self, String> {
        let log = open_log(&folder.log()).map_err(|e| format!("{} cannot be written: {e}", folder.log().display()))?;
        let for_errors = log.try_clone().map_err(|e| format!("{}: {e}", folder.log().display()))?;
        let mut command = launch.command();
        command.args(["train", "--job"]).arg(folder.path());
        command.stdin(Stdio::null()).stdout(log).stderr(for_errors);
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let child = command.spawn();
        // By its name: clients read it too.
        let program =
            Path::new(command.get_program()).file_name().unwrap_or(command.get_program()).display().to_string();
        let child = child.map_err(|e| format!("{program} cannot be started: {e}"))?;
        Ok(Self { child, asked: None, grace: launch.grace })
    }

    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Whether SIGTERM was sent.
    pub(crate) fn was_asked(&self) -> bool {
        self.asked.is_some()
    }

    /// Exit status, once it has ended.
    pub(crate) fn ended(&mut self) -> io::Result<Option<ExitStatus>> {
        self.child.try_wait()
    }

    /// Sends SIGTERM; SIGKILL if called again after the grace period.
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

    /// Whether it runs on long after SIGKILL: it hangs in the kernel, for instance on a disk.
    pub(crate) fn is_stuck(&self) -> bool {
        self.asked.is_some_and(|asked| asked.elapsed() >= 2 * self.grace)
    }

    /// Signals the process group. The id cannot belong to another process before this one was waited for.
    fn signal(&self, signal: Signal) {
        let group = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw);
        // An error means that the group has ended already.
        let _ = group.map(|group| kill_process_group(group, signal));
    }
}

/// Opens a log without waiting for the reader of a pipe, and refuses everything but a regular file.
fn open_log(path: &Path) -> io::Result<File> {
    let flags = (OFlags::NONBLOCK | OFlags::NOFOLLOW).bits().cast_signed();
    let log = OpenOptions::new().append(true).create(true).custom_flags(flags).open(path)?;
    if log.metadata()?.is_file() { Ok(log) } else { Err(io::Error::other("it is no regular file")) }
}

impl Drop for Process {
    fn drop(&mut self) {
        if matches!(self.child.try_wait(), Ok(None)) {
            self.signal(Signal::KILL);
        }
    }
}
