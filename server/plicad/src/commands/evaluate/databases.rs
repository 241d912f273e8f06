//! The two databases of an evaluation: the files given, or those that `plicad train` writes by default.

use std::path::{Path, PathBuf};

use plica_scene::Config;
use plica_training::{Database, DatabaseKind, JobPaths, Setup};

use crate::cli::DatabaseArgs;
use crate::commands::train::default_folder;

/// The two databases of an evaluation.
pub(in crate::commands) struct Databases {
    /// Examples to train methods on.
    pub(in crate::commands) training: Database,
    /// Held-out examples.
    pub(in crate::commands) held_out: Database,
}

/// Reads and checks both databases.
///
/// # Errors
/// A file is missing, damaged, or belongs to another scene.
pub(in crate::commands) fn read(config: &Config, setup: &Setup, args: &DatabaseArgs) -> anyhow::Result<Databases> {
    let read = |given: &Option<PathBuf>, kind| {
        let path = given.clone().unwrap_or_else(|| default_path(config, kind));
        if !path.exists() {
            anyhow::bail!(
                "{}: there is no such file; `{}` makes it",
                path.display(),
                command(config, kind, &path, given)
            );
        }
        let database = Database::read(&path, Some(&setup.scene_hash))?;
        anyhow::ensure!(
            database.about.kind == kind,
            "{}: is a database of kind {}, one of kind {} is needed here",
            path.display(),
            database.about.kind.name(),
            kind.name()
        );
        Ok(database)
    };
    Ok(Databases {
        training: read(&args.training, DatabaseKind::Training)?,
        held_out: read(&args.held_out, DatabaseKind::Evaluation)?,
    })
}

fn default_path(config: &Config, kind: DatabaseKind) -> PathBuf {
    JobPaths::new(default_folder(config, kind)).database()
}

/// Command that makes the missing file.
fn command(config: &Config, kind: DatabaseKind, path: &Path, given: &Option<PathBuf>) -> String {
    let file = config.file();
    let scene = if file.exists() { file.display().to_string() } else { config.name().to_owned() };
    let kind = if kind == DatabaseKind::Training { "" } else { " --kind evaluation" };
    let out = given.as_ref().map_or(String::new(), |_| format!(" --out {}", path.display()));
    format!("plicad train {scene}{kind}{out}")
}
