//! Folder of a job that is started from the command line: scene, files that it names, options.

use std::fs;
use std::path::{Component, Path, PathBuf};

use plica_protocol::jobs::JobState;
use plica_scene::Config;
use plica_scene::scene::{MAX_FILE_BYTES, SceneFile};
use plica_training::{
    DatabaseKind, RegularFile, TrainingError, TrainingFolder, TrainingJob, TrainingReport, Writer, now_unix_s,
    write_atomically,
};

use crate::folder::{JobFolder, StoredStatus};
use crate::sentence::sentence;

/// Options of a job on the command line.
#[derive(Debug, Clone, Copy)]
pub struct JobOptions {
    /// Kind of the database.
    pub kind: DatabaseKind,
    /// Number of examples; `None`: the scene's.
    pub examples: Option<u32>,
    /// Seed; `None`: the scene's.
    pub seed: Option<u64>,
    /// Number of threads.
    pub threads: u32,
}

/// Why the folder cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// The folder cannot be used.
    #[error(transparent)]
    Training(#[from] TrainingError),
    /// A file cannot be written there.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
}

/// Makes `root` the folder of a job on `config`, or opens the folder of that job.
///
/// # Errors
/// See [`FolderError`].
pub fn make(root: &Path, config: &Config, options: &JobOptions) -> Result<(TrainingFolder, TrainingJob), FolderError> {
    let folder = TrainingFolder::open(root)?;
    folder.paths().sweep(Writer::Submitter).map_err(|source| FolderError::Io { path: root.to_owned(), source })?;
    let id = format!("{}-{}", config.name(), options.kind.name());
    let job = TrainingJob {
        client_id: id.clone(),
        id,
        kind: options.kind,
        scene_name: config.name().to_owned(),
        examples: options.examples,
        seed: options.seed,
        threads: Some(options.threads),
        submitted_unix_s: now_unix_s(),
    };
    folder.set_job(&job)?;
    let mut text = config.text().to_owned();
    for file in config.files() {
        text = bring(root, file, text)?;
    }
    let scene = folder.paths().scene();
    write_atomically(&scene, text.as_bytes()).map_err(|source| FolderError::Io { path: scene, source })?;
    Ok((folder, job))
}

/// Copies a file into the folder, under the path in the scene. A file outside of the scene's folder stays where it is, and
/// `text` gets its absolute path.
fn bring(root: &Path, file: &SceneFile, text: String) -> Result<String, FolderError> {
    let at = |path: &Path| {
        let path = path.to_owned();
        move |source| FolderError::Io { path, source }
    };
    let typed = Path::new(&file.typed);
    if typed.is_absolute() {
        return Ok(text);
    }
    if typed.components().all(|c| matches!(c, Component::Normal(_))) {
        let copy = root.join(typed);
        fs::create_dir_all(copy.parent().unwrap_or(root)).map_err(at(&copy))?;
        let read = RegularFile::open(&file.path, MAX_FILE_BYTES).and_then(RegularFile::read);
        let bytes = read.map_err(|fault| at(&file.path)(std::io::Error::other(fault)))?;
        write_atomically(&copy, &bytes).map_err(at(&copy))?;
        return Ok(text);
    }
    let absolute = file.path.canonicalize().map_err(at(&file.path))?;
    Ok(text.replace(&format!("\"{}\"", file.typed), &format!("\"{}\"", absolute.display())))
}

/// Writes that this process runs the job.
pub fn begin(root: &Path) -> std::io::Result<StoredStatus> {
    let status = StoredStatus {
        state: JobState::Running,
        reason: None,
        started_unix_s: Some(now_unix_s()),
        finished_unix_s: None,
        pid: Some(std::process::id()),
    };
    write(root, &status)?;
    Ok(status)
}

/// Writes the final state of the job and its reason.
pub fn end(root: &Path, started: StoredStatus, result: &anyhow::Result<TrainingReport>) -> std::io::Result<()> {
    let (state, reason) = match result {
        Ok(_) => (JobState::Done, None),
        Err(error) => match error.downcast_ref() {
            Some(TrainingError::Interrupted) => (JobState::Paused, Some("interrupted".to_owned())),
            _ => (JobState::Failed, Some(sentence(error))),
        },
    };
    write(root, &StoredStatus { state, reason, finished_unix_s: Some(now_unix_s()), pid: None, ..started })
}

fn write(root: &Path, status: &StoredStatus) -> std::io::Result<()> {
    JobFolder::new(root.to_owned()).write_status(status)
}
