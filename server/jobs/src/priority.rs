//! Lowers the priority of a job's process, in the process itself before it starts its work.

/// Scheduling class of jobs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Priority {
    /// Runs on otherwise idle cores (`SCHED_IDLE`, nice 19).
    #[default]
    Idle,
    /// Small share of a busy core (`SCHED_BATCH`, nice 19).
    Low,
    /// Default class of the system.
    Normal,
}

impl Priority {
    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Low => "low",
            Self::Normal => "normal",
        }
    }
}

/// Lowers the calling process, keeps it off a core, and ties its life to the thread that started it. Returns refused requests
/// as sentences; the process runs without them.
///
/// # Errors
/// `parent`, the process that started this one, has ended already.
pub fn lower(priority: Priority, avoid_cpu: Option<usize>, parent: u32) -> Result<Vec<String>, String> {
    let mut refused = Vec::new();
    let mut note = |what: &str, result: Result<(), String>| {
        refused.extend(result.err().map(|e| format!("{what}: {e}")));
    };
    note("this job would outlive a killed daemon", os::end_with_parent());
    if os::parent() != Some(parent) {
        return Err("the daemon that started this job is gone".to_owned());
    }
    note(
        "the memory score cannot be raised, so this job is not the first to end when memory runs out",
        os::offer_memory(),
    );
    if let Some(cpu) = avoid_cpu {
        note("the simulation's core cannot be left", os::avoid(cpu));
    }
    if priority != Priority::Normal {
        note("nice 19 was refused", os::be_nice());
        note("the lower scheduling class was refused", os::schedule(priority));
    }
    Ok(refused)
}

#[cfg(target_os = "linux")]
mod os {
    use rustix::process::{Signal, getppid, set_parent_process_death_signal, setpriority_process};
    use rustix::thread::{sched_getaffinity, sched_setaffinity};

    use super::Priority;

    /// SIGKILL, since a process that hangs ignores other signals; finished examples are on disk.
    pub(crate) fn end_with_parent() -> Result<(), String> {
        set_parent_process_death_signal(Some(Signal::KILL)).map_err(|e| e.to_string())
    }

    pub(crate) fn parent() -> Option<u32> {
        getppid().and_then(|pid| u32::try_from(pid.as_raw_nonzero().get()).ok())
    }

    pub(crate) fn offer_memory() -> Result<(), String> {
        std::fs::write("/proc/self/oom_score_adj", "1000").map_err(|e| e.to_string())
    }

    pub(crate) fn avoid(cpu: usize) -> Result<(), String> {
        let mut set = sched_getaffinity(None).map_err(|e| e.to_string())?;
        if cpu >= rustix::thread::CpuSet::MAX_CPU || !set.is_set(cpu) {
            return Ok(());
        }
        set.unset(cpu);
        if set.count() == 0 {
            return Err("there is no other core".to_owned());
        }
        sched_setaffinity(None, &set).map_err(|e| e.to_string())
    }

    pub(crate) fn be_nice() -> Result<(), String> {
        setpriority_process(None, 19).map_err(|e| e.to_string())
    }

    pub(crate) fn schedule(priority: Priority) -> Result<(), String> {
        let class = if priority == Priority::Idle { libc::SCHED_IDLE } else { libc::SCHED_BATCH };
        // SAFETY: `sched_param` is plain integers, for which zero is valid, and the priority that these classes want.
        let parameters: libc::sched_param = unsafe { std::mem::zeroed() };
        // SAFETY: 0 is the calling thread, the only one so far; `parameters` outlives the call.
        match unsafe { libc::sched_setscheduler(0, class, &raw const parameters) } {
            0 => Ok(()),
            _ => Err(std::io::Error::last_os_error().to_string()),
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod os {
    use rustix::process::{getppid, setpriority_process};

    pub(crate) fn end_with_parent() -> Result<(), String> {
        Err("asked for on Linux only".to_owned())
    }
    pub(crate) fn parent() -> Option<u32> {
        getppid().and_then(|pid| u32::try_from(pid.as_raw_nonzero().get()).ok())
    }
    pub(crate) fn offer_memory() -> Result<(), String> {
        Err("asked for on Linux only".to_owned())
    }
    pub(crate) fn avoid(_cpu: usize) -> Result<(), String> {
        Err("asked for on Linux only".to_owned())
    }
    pub(crate) fn be_nice() -> Result<(), String> {
        setpriority_process(None, 19).map_err(|e| e.to_string())
    }
    pub(crate) fn schedule(_priority: super::Priority) -> Result<(), String> {
        Err("asked for on Linux only".to_owned())
    }
}
