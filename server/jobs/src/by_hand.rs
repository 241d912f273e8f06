//! The folder of a job that is started by hand: scene, the files it names, and what is asked.

use std::fs;
use std::path::{Component, Path, PathBuf};

use plica_protocol::jobs::JobState;
use plica_scene::Config;
use plica_scene::scene::SceneFile;
use plica_training::{
    DatabaseKind, TrainingError, TrainingFolder, TrainingJob, TrainingReport, Writer, now_unix_s, write_atomically,
};

use crate::folder::{JobFolder, Standing};

/// What is asked on the command line.
#[derive(Debug, Clone, Copy)]
pub struct JobRequest {
    /// What the examples are for.
    pub kind: DatabaseKind,
    /// How many, if not what the scene says.
    pub examples: Option<u32>,
    /// Seed, if not what the scene says.
    pub seed: Option<u64>,
    /// Threads.
    pub threads: u32,
}

/// Why there is no folder.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// The folder cannot be used.
    #[error(transparent)]
    Training(#[from] TrainingError),
    /// A file cannot be put there.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
}

/// Makes `root` the folder of a job on `config`, or opens it if it is that already.
///
/// # Errors
/// See [`FolderError`].
pub fn make(root: &Path, config: &Config, request: &JobRequest) -> Result<(TrainingFolder, TrainingJob), FolderError> {
    let folder = TrainingFolder::open(root)?;
    folder.paths().sweep(Writer::Submitter).map_err(|source| FolderError::Io { path: root.to_owned(), source })?;
    let id = format!("{}-{}", config.name(), request.kind.name());
    let job = TrainingJob {
        client_id: id.clone(),
        id,
        kind: request.kind,
        scene_name: config.name().to_owned(),
        examples: request.examples,
        seed: request.seed,
        threads: Some(request.threads),
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

/// Copies a file beside the scene, under the path that the scene names; one that is not below the scene is named by its
/// absolute path instead.
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
        let bytes = fs::read(&file.path).map_err(at(&file.path))?;
        write_atomically(&copy, &bytes).map_err(at(&copy))?;
        return Ok(text);
    }
    let absolute = file.path.canonicalize().map_err(at(&file.path))?;
    Ok(text.replace(&format!("\"{}\"", file.typed), &format!("\"{}\"", absolute.display())))
}

/// Notes that this process works on the job.
pub fn begin(root: &Path) -> std::io::Result<Standing> {
    let standing = Standing {
        state: JobState::Running,
        reason: None,
        started_unix_s: Some(now_unix_s()),
        finished_unix_s: None,
        pid: Some(std::process::id()),
    };
    write(root, &standing)?;
    Ok(standing)
}

/// Notes how it ended, and why.
pub fn end(root: &Path, begun: Standing, result: &anyhow::Result<TrainingReport>) -> std::io::Result<()> {
    let (state, reason) = match result {
        Ok(_) => (JobState::Done, None),
        Err(error) => match error.downcast_ref() {
            Some(TrainingError::Interrupted) => (JobState::Paused, Some("interrupted".to_owned())),
            _ => (JobState::Failed, Some(format!("{error:#}"))),
        },
    };
    write(root, &Standing { state, reason, finished_unix_s: Some(now_unix_s()), pid: None, ..begun })
}

fn write(root: &Path, standing: &Standing) -> std::io::Result<()> {
    JobFolder::new(root.to_owned()).write_standing(standing)
}
