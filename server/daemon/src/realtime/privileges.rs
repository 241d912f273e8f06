//! Privileges of the simulation thread: requests to the operating system, and refusals.

/// Requested privileges.
#[derive(Debug, Clone, Copy, Default)]
pub struct ThreadOptions {
    /// Requested `SCHED_FIFO` priority.
    pub priority: Option<u32>,
    /// Core to pin to.
    pub cpu: Option<usize>,
    /// Whether to lock memory.
    pub lock_memory: bool,
}

/// Granted privileges. Every refusal has a sentence in `warnings` with its effect and advice.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Grants {
    /// Whether the thread runs under `SCHED_FIFO`.
    pub fifo: bool,
    /// Whether memory is locked.
    pub memory_locked: bool,
    /// Timer slack \[ns\]; 0 if unknown.
    pub timer_slack_ns: u64,
    /// Refusals.
    pub warnings: Vec<String>,
}

/// Requests all privileges for the calling thread.
pub(super) fn acquire(options: &ThreadOptions) -> Grants {
    let mut grants = Grants::default();
    if let Some(cpu) = options.cpu {
        note(&mut grants, os::pin_to(cpu).err());
    }
    if options.lock_memory {
        let locked = os::lock_memory();
        grants.memory_locked = locked.is_ok();
        note(&mut grants, locked.err());
    }
    if let Some(priority) = options.priority {
        let fifo = os::use_fifo(priority);
        grants.fifo = fifo.is_ok();
        note(&mut grants, fifo.err());
    }
    match os::least_timer_slack() {
        Ok(ns) => grants.timer_slack_ns = ns,
        Err(warning) => grants.warnings.push(warning),
    }
    grants
}

fn note(grants: &mut Grants, warning: Option<String>) {
    grants.warnings.extend(warning);
}

#[cfg(target_os = "linux")]
mod os {
    use rustix::process::{Resource, getrlimit};
    use rustix::thread::{CpuSet, sched_setaffinity};

    pub(super) fn pin_to(cpu: usize) -> Result<(), String> {
        let mut set = CpuSet::new();
        if cpu < CpuSet::MAX_CPU {
            set.set(cpu);
        }
        sched_setaffinity(None, &set)
            .map_err(|e| format!("not pinned to core {cpu} ({e}): choose a core that exists in `runtime.cpu`"))
    }

    /// Locks pages as they are touched, now and later. Only where the limit cannot be reached: a process that runs
    /// into its memory-lock limit can no longer allocate.
    pub(super) fn lock_memory() -> Result<(), String> {
        let privileged = rustix::process::geteuid().is_root();
        if let Some(limit) = getrlimit(Resource::Memlock).current.filter(|_| !privileged) {
            return Err(format!(
                "memory is not locked (the limit is {} KiB): buffers are touched beforehand instead, and a tick may wait \
                 for a page under memory pressure; allow it with `ulimit -l unlimited` or LimitMEMLOCK=infinity",
                limit / 1024
            ));
        }
        let flags = libc::MCL_CURRENT | libc::MCL_FUTURE | libc::MCL_ONFAULT;
        // SAFETY: takes no pointers; it changes how pages are backed, not what they hold.
        match unsafe { libc::mlockall(flags) } {
            0 => Ok(()),
            _ => Err(format!("memory is not locked ({}): a tick may wait for a page", std::io::Error::last_os_error())),
        }
    }

    pub(super) fn use_fifo(priority: u32) -> Result<(), String> {
        // SAFETY: `sched_param` is plain integers, for which zero is valid (musl has reserved fields beside the priority).
        let mut parameters: libc::sched_param = unsafe { std::mem::zeroed() };
        parameters.sched_priority = priority as libc::c_int;
        // SAFETY: 0 is the calling thread; `parameters` outlives the call.
        match unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) } {
            0 => Ok(()),
            _ => Err(format!(
                "no real-time priority ({}): ticks start later under load; allow it with `ulimit -r {priority}`, LimitRTPRIO={priority} \
                 or CAP_SYS_NICE, or set `runtime.realtime_priority = 0`",
                std::io::Error::last_os_error()
            )),
        }
    }

    pub(super) fn least_timer_slack() -> Result<u64, String> {
        // SAFETY: PR_SET_TIMERSLACK takes one integer.
        match unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1, 0, 0, 0) } {
            0 => Ok(1),
            _ => Err(format!(
                "timer slack stays at 50 us ({}): ticks start that much later",
                std::io::Error::last_os_error()
            )),
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod os {
    pub(super) fn pin_to(_cpu: usize) -> Result<(), String> {
        Err("threads are pinned on Linux only".into())
    }
    pub(super) fn lock_memory() -> Result<(), String> {
        Err("memory is locked on Linux only: buffers are touched beforehand instead".into())
    }
    pub(super) fn use_fifo(_priority: u32) -> Result<(), String> {
        Err("real-time priority is asked for on Linux only: ticks start later under load".into())
    }
    pub(super) fn least_timer_slack() -> Result<u64, String> {
        Err("timer slack is set on Linux only".into())
    }
}
