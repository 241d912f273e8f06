//! Arguments of `plica jobs`.

use std::path::PathBuf;

use clap::{Subcommand, ValueEnum};
use plica_client::protocol::jobs::{JobFile, JobKind, MAX_EXAMPLES, MAX_THREADS};

#[derive(Debug, Subcommand)]
pub(crate) enum Jobs {
    /// Queue a job; it runs in the daemon's background and outlives this command and the daemon.
    Submit(Submit),
    /// All jobs that the daemon knows, oldest first.
    List,
    /// Show the progress of a job until it is over; Ctrl-C ends the showing, not the job.
    Watch(Watch),
    /// End a job that waits or runs; its finished examples are kept.
    Cancel(Id),
    /// Queue a failed or cancelled job again; its finished examples are not repeated.
    Resume(Resume),
    /// Get the result of a job that is done, with its SHA-256 checked.
    Fetch(Fetch),
    /// Enrich the daemon's skin with the examples of a job that is done, without a dropped frame.
    Activate(Id),
}

#[derive(Debug, clap::Args)]
pub(crate) struct Submit {
    /// Scene file (TOML); left out: the scene that the daemon serves.
    pub(crate) scene: Option<PathBuf>,
    /// What to make.
    #[arg(long, value_enum, default_value = "training")]
    pub(crate) kind: KindName,
    /// How many examples; left out: what the scene says.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_EXAMPLES)))]
    pub(crate) examples: Option<u32>,
    /// Seed of the interactions; left out: what the scene says.
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Threads; left out: all cores of the daemon's machine but one. The result does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_THREADS)))]
    pub(crate) threads: Option<u32>,
    /// Name of this request: submitting twice with one name is one job. Drawn at random if left out.
    #[arg(long, value_name = "NAME")]
    pub(crate) client_id: Option<String>,
    /// Show its progress until it is over.
    #[arg(long)]
    pub(crate) watch: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum KindName {
    /// Examples to learn from.
    Training,
    /// Held-out interactions that are never trained on.
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
    /// Which job: see `plica jobs list`.
    pub(crate) id: String,
}

#[derive(Debug, clap::Args)]
pub(crate) struct Watch {
    /// Which job; left out: the first that is not over.
    pub(crate) id: Option<String>,
}

#[derive(Debug, clap::Args)]
pub(crate) struct Resume {
    /// Which job: see `plica jobs list`.
    pub(crate) id: String,
    /// Show its progress until it is over.
    #[arg(long)]
    pub(crate) watch: bool,
}

#[derive(Debug, clap::Args)]
pub(crate) struct Fetch {
    /// Which job: see `plica jobs list`.
    pub(crate) id: String,
    /// Which file.
    #[arg(long, value_enum, default_value = "database")]
    pub(crate) what: FileName,
    /// Where to write it [default: SCENE-ID.safetensors or SCENE-ID.json].
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
