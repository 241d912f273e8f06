//! How a job's process makes room for everything else. Run by the process itself, before it becomes the work.

/// How low jobs run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Priority {
    /// Only when a core has nothing else to do (`SCHED_IDLE`, nice 19).
    #[default]
    Idle,
    /// Little where others want the core too (`SCHED_BATCH`, nice 19).
    Low,
    /// Like any program.
    Normal,
}

impl Priority {
    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Low => "low",
            Self::Normal => "normal",
        }
    }
}

/// Lowers the calling process, keeps it off a core, and has it end with the thread that started it. What is refused
/// comes back as sentences; the work goes on without. Fails if `parent`, the process that started it, is gone already.
pub fn lower(priority: Priority, avoid_cpu: Option<usize>, parent: u32) -> Result<Vec<String>, String> {
    let mut refused = Vec::new();
    let mut note = |what: &str, result: Result<(), String>| {
        refused.extend(result.err().map(|e| format!("{what}: {e}")));
    };
    note("this job would outlive a killed daemon", os::end_with_parent());
    if os::parent() != Some(parent) {
        return Err("the daemon that started this job is gone".to_owned());
    }
    note("not the first to go when memory runs out", os::offer_memory());
    if let Some(cpu) = avoid_cpu {
        note("not kept off the simulation's core", os::avoid(cpu));
    }
    if priority != Priority::Normal {
        note("not niced", os::be_nice());
        note("no lower scheduling class", os::schedule(priority));
    }
    Ok(refused)
}

#[cfg(target_os = "linux")]
mod os {
    use rustix::process::{Signal, getppid, set_parent_process_death_signal, setpriority_process};
    use rustix::thread::{sched_getaffinity, sched_setaffinity};

    use super::Priority;

    /// SIGKILL: what is finished is on disk, and a process that hangs would not hear anything else.
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
