//! Arguments of `plica jobs`.

use std::path::PathBuf;

use clap::{Subcommand, ValueEnum};
use plica_client::protocol::jobs::{JobFile, JobKind, MAX_EXAMPLES, MAX_THREADS};

#[derive(Debug, Subcommand)]
pub(crate) enum Jobs {
    /// Queue a job; it runs in the background of the daemon, and continues after this command and after a restart of the daemon.
    Submit(Submit),
    /// List all jobs of the daemon, oldest first.
    List,
    /// Show the progress of a job until it ends; Ctrl-C stops the display, not the job.
    Watch(Watch),
    /// Cancel a queued or running job; its finished examples are kept.
    Cancel(Id),
    /// Queue a failed or cancelled job again; its finished examples are not repeated.
    Resume(Resume),
    /// Download the result of a finished job and check its SHA-256.
    Fetch(Fetch),
    /// Activate the examples of a finished job for enrichment, without a dropped frame.
    Activate(Id),
}

#[derive(Debug, clap::Args)]
pub(crate) struct Submit {
    /// Scene file (TOML) [default: the scene that the daemon serves].
    pub(crate) scene: Option<PathBuf>,
    /// Kind of the database.
    #[arg(long, value_enum, default_value = "training")]
    pub(crate) kind: KindName,
    /// Number of examples [default: the scene's].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_EXAMPLES)))]
    pub(crate) examples: Option<u32>,
    /// Seed of the interactions [default: the scene's].
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Number of threads; the result does not depend on it [default: all cores of the daemon's machine but one].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_THREADS)))]
    pub(crate) threads: Option<u32>,
    /// Name of this request; two submissions with the same name are one job [default: random].
    #[arg(long, value_name = "NAME")]
    pub(crate) client_id: Option<String>,
    /// Show its progress until it ends.
    #[arg(long)]
    pub(crate) watch: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum KindName {
    /// Examples to train on.
    Training,
    /// Held-out interactions, never trained on.
    Evaluation,
}

impl From<KindName> for JobKind {
    fn from(name: KindName) -> Self {
        match name {
            KindName::Training => Self::Training,
            KindName::Evaluation => Self::Evaluation,
        }
    }
}

#[derive(Debug, clap::Args)]
pub(crate) struct Id {
    /// Id of the job, as in `plica jobs list`.
    pub(crate) id: String,
}

#[derive(Debug, clap::Args)]
pub(crate) struct Watch {
    /// Id of the job [default: the oldest that has not ended].
    pub(crate) id: Option<String>,
}

#[derive(Debug, clap::Args)]
pub(crate) struct Resume {
    /// Id of the job, as in `plica jobs list`.
    pub(crate) id: String,
    /// Show its progress until it ends.
    #[arg(long)]
    pub(crate) watch: bool,
}

#[derive(Debug, clap::Args)]
pub(crate) struct Fetch {
    /// Id of the job, as in `plica jobs list`.
    pub(crate) id: String,
    /// File to download.
    #[arg(long, value_enum, default_value = "database")]
    pub(crate) what: FileName,
    /// File to write [default: SCENE-ID.safetensors or SCENE-ID.json].
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum FileName {
    /// The examples (safetensors).
    Database,
    /// Times, counts and rejections (JSON).
    Report,
}

impl From<FileName> for JobFile {
    fn from(name: FileName) -> Self {
        match name {
            FileName::Database => Self::Database,
            FileName::Report => Self::Report,
        }
    }
}
