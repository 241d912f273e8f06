//! Jobs in a folder of their own, whose process is a shell script.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use plica_client::protocol::jobs::{Job, JobKind, JobState, JobSubmitRequest};
use plica_jobs::{DataFolder, Jobs, Keep, Launch, Priority, ServedScene, Supervision};
use plica_scene::BUILT_IN_SCENE;
use tempfile::TempDir;

/// What every script begins with. It is called as `script train --job DIR`.
const PRELUDE: &str = r#"#!/bin/sh
dir=$3
progress() {
    printf '{"stage": "examples", "done": %s, "rejected": 0, "total": %s, "seconds_left": null}' $1 $2 >$dir/p
    mv $dir/p $dir/progress.json
}
finish() {
    printf 'the examples' >$dir/database.safetensors
    printf '{}' >$dir/report.json
}
"#;

/// Short, for tests of processes that do not stop by themselves.
const GRACE: Duration = Duration::from_millis(300);

/// A data folder and the script that its jobs run.
pub(crate) struct Workplace {
    folder: TempDir,
    launcher: Option<PathBuf>,
    pub(crate) priority: Priority,
    pub(crate) avoid_cpu: Option<usize>,
    /// How long a process that was asked to stop may take.
    pub(crate) grace: Duration,
    /// Finished jobs that are kept.
    pub(crate) keep: Keep,
}

impl Workplace {
    pub(crate) fn new(script: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let workplace = Self {
            folder,
            launcher: None,
            priority: Priority::Normal,
            avoid_cpu: None,
            grace: GRACE,
            keep: Keep::default(),
        };
        workplace.replace_script(script);
        workplace
    }

    /// Jobs are lowered by `plicad child`, as the daemon's are.
    pub(crate) fn with_launcher(script: &str, priority: Priority) -> Self {
        let launcher = Some(PathBuf::from(env!("CARGO_BIN_EXE_plicad")));
        Self { launcher, priority, ..Self::new(script) }
    }

    pub(crate) fn replace_script(&self, script: &str) {
        let new = self.folder.path().join("new");
        fs::write(&new, format!("{PRELUDE}{script}\n")).unwrap();
        fs::set_permissions(&new, fs::Permissions::from_mode(0o755)).unwrap();
        fs::rename(new, self.script()).unwrap();
    }

    pub(crate) fn script(&self) -> PathBuf {
        self.folder.path().join("script")
    }

    pub(crate) fn path(&self, below: &str) -> PathBuf {
        self.folder.path().join("data").join(below)
    }

    /// A file in the folder of a job.
    pub(crate) fn in_job(&self, id: &str, file: &str) -> PathBuf {
        self.path("jobs").join(id).join(file)
    }

    /// A daemon's jobs start.
    pub(crate) fn open(&self) -> Daemon {
        let launch = Launch {
            program: self.script(),
            launcher: self.launcher.clone(),
            priority: self.priority,
            avoid_cpu: self.avoid_cpu,
            grace: self.grace,
        };
        let served = ServedScene { name: "wedge".to_owned(), folder: None, text: BUILT_IN_SCENE.to_owned() };
        let folder = DataFolder::open(&self.path(""), "main").unwrap();
        let (jobs, supervision) = Jobs::start(folder, served, launch, self.keep).unwrap();
        Daemon { jobs, supervision: Some(supervision) }
    }
}

/// The jobs of one run of a daemon. Dropped, it shuts down.
pub(crate) struct Daemon {
    pub(crate) jobs: Jobs,
    supervision: Option<Supervision>,
}

impl Daemon {
    pub(crate) fn submit(&self, client_id: &str) -> Job {
        self.jobs.submit(&JobSubmitRequest::new(client_id, JobKind::Training)).unwrap().job
    }

    pub(crate) fn get(&self, id: &str) -> Job {
        self.jobs.get(id).unwrap()
    }

    /// Waits until a job is over, and checks how.
    pub(crate) fn wait_for(&self, id: &str, state: JobState) -> Job {
        wait_until(&format!("job {id} to be {state:?}"), || {
            let job = self.get(id);
            assert!(job.state == state || !job.state.is_over(), "job {id}: {job:?}");
            (job.state == state).then_some(job)
        })
    }

    pub(crate) fn stop(mut self) {
        self.supervision = None;
    }
}

/// Polls for at most a minute.
pub(crate) fn wait_until<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let begin = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(begin.elapsed() < Duration::from_secs(60), "waited a minute for {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Waits for a file with something in it.
pub(crate) fn wait_for_file(path: &Path) -> String {
    wait_until(&path.display().to_string(), || fs::read_to_string(path).ok().filter(|text| !text.is_empty()))
}
