//! The command line.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use plica_daemon::bus::BusOptions;
use plica_jobs::Priority;
use plica_protocol::{DEFAULT_ENDPOINT, DEFAULT_SESSION};

/// Simulates a soft object that tools touch, at 1 kHz, and serves it on a Zenoh bus.
#[derive(Debug, Parser)]
#[command(name = "plicad", version, about, max_term_width = 110)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// Says more on standard error; twice: everything.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub verbose: u8,
    /// Prints one JSON object as the last line of standard output.
    #[arg(long, global = true)]
    pub json: bool,
}

/// What plicad can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Runs a scene in real time and serves it on the bus until Ctrl-C.
    Serve(ServeArgs),
    /// Trains a few examples, serves on loopback, drives the tool through a real client, prints a summary, writes pictures.
    Demo(DemoArgs),
    /// Runs a scene along recorded poses, without bus or clock; the same input gives the same bytes.
    Simulate(SimulateArgs),
    /// Times the tick, stage by stage, beside the memory limit measured in the same run.
    Bench(BenchArgs),
    /// Says what a scene will cost, and whether it can be served.
    Check(CheckArgs),
    /// Makes examples of a scene: the tool interacts, both models settle, what the coarse one misses is kept.
    Train(TrainArgs),
    /// Judges every way to enrich by held-out accurate solutions: errors, time, degenerate inputs.
    Evaluate(EvaluateArgs),
    /// Charts speed against accuracy, one point per configuration, as SVG and JSON.
    Chart(ChartArgs),
    /// Prints the JSON Schema of scene files.
    Schema,
    /// Solves a case accurately: a mesh, its materials, supports and loads; prints what its probes tell.
    Solve(SolveArgs),
    /// Becomes the process of a job.
    #[command(hide = true)]
    Child(ChildArgs),
}

/// Where the daemon is found.
#[derive(Debug, Args)]
pub struct BusArgs {
    /// Zenoh endpoint to listen on.
    #[arg(long, value_name = "ENDPOINT", help = format!("Zenoh endpoint to listen on [default: {DEFAULT_ENDPOINT}]"))]
    pub listen: Option<String>,
    /// Session name in every key: `plica/v1/SESSION/...`
    #[arg(long, default_value = DEFAULT_SESSION)]
    pub session: String,
    /// Zenoh configuration (JSON5) in place of the built-in one, for TLS, access control, routers: see configs/zenoh.
    #[arg(long, value_name = "FILE")]
    pub zenoh_config: Option<PathBuf>,
}

impl BusArgs {
    /// The same as options of the bus.
    pub fn options(&self) -> BusOptions {
        BusOptions {
            listen: self.listen.clone(),
            session: self.session.clone(),
            zenoh_config: self.zenoh_config.clone(),
        }
    }
}

/// `plicad serve`.
#[derive(Debug, Args)]
pub struct ServeArgs {
    /// Scene file; left out: the built-in wedge.
    pub scene: Option<PathBuf>,
    /// Where the daemon is found.
    #[command(flatten)]
    pub bus: BusArgs,
    /// Ticks only when rpc/step says so.
    #[arg(long)]
    pub lock_step: bool,
    /// Examples to enrich the skin with, in place of those that the scene names.
    #[arg(long, value_name = "FILE")]
    pub database: Option<PathBuf>,
    /// Folder for jobs and their results; one daemon at a time uses it.
    #[arg(long, value_name = "DIR", help = DATA_HELP)]
    pub data: Option<PathBuf>,
    /// How much of the machine jobs may take from others.
    #[arg(long, value_enum, default_value_t, value_name = "CLASS")]
    pub job_priority: JobPriority,
}

/// How low jobs run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum JobPriority {
    /// Only when a core has nothing else to do (`SCHED_IDLE`, nice 19).
    #[default]
    Idle,
    /// Little where others want the core too (`SCHED_BATCH`, nice 19).
    Low,
    /// Like any program.
    Normal,
}

impl From<JobPriority> for Priority {
    fn from(priority: JobPriority) -> Self {
        match priority {
            JobPriority::Idle => Self::Idle,
            JobPriority::Low => Self::Low,
            JobPriority::Normal => Self::Normal,
        }
    }
}

const DATA_HELP: &str =
    "Folder for jobs and their results; one daemon at a time uses it [default: ~/.local/share/plica/SESSION]";

/// `plicad child`.
#[derive(Debug, Args)]
pub struct ChildArgs {
    /// Process that starts it; without that one it ends.
    #[arg(long)]
    pub parent: u32,
    /// How low it runs.
    #[arg(long, value_enum)]
    pub priority: JobPriority,
    /// Core that it keeps off.
    #[arg(long)]
    pub avoid_cpu: Option<usize>,
    /// What it becomes.
    #[arg(last = true, required = true)]
    pub command: Vec<OsString>,
}

/// `plicad simulate`.
#[derive(Debug, Args)]
pub struct SimulateArgs {
    /// Scene file, or `wedge` for the built-in one.
    pub scene: PathBuf,
    /// Poses: CSV (time_s,tool,px,py,pz,qx,qy,qz,qw) or a TUM trajectory.
    #[arg(long, value_name = "FILE")]
    pub poses: PathBuf,
    /// Result, a safetensors file.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Examples to enrich the skin with, in place of those that the scene names.
    #[arg(long, value_name = "FILE")]
    pub database: Option<PathBuf>,
    /// One frame every so many ticks.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub every: u64,
    /// Maps the trajectory's box into the room above the object.
    #[arg(long)]
    pub fit: bool,
    /// Tool of poses that name none; needed where the scene has several.
    #[arg(long, value_name = "NAME")]
    pub tool: Option<String>,
}

/// `plicad bench`.
#[derive(Debug, Args)]
pub struct BenchArgs {
    /// Scene file with a \[bench\] table, or `wedge` for the built-in one.
    pub scene: PathBuf,
    /// Ticks to time; the scene's motion is repeated.
    #[arg(long, default_value_t = 3000, value_parser = clap::value_parser!(u64).range(100..=10_000_000))]
    pub ticks: u64,
    /// Element in place of the scene's.
    #[arg(long)]
    pub element: Option<Element>,
    /// Examples to enrich the skin with, in place of those that the scene names.
    #[arg(long, value_name = "FILE")]
    pub database: Option<PathBuf>,
}

/// Elements by name.
#[derive(Debug, Clone, Copy, ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum Element {
    /// Bends without locking.
    EnhancedStrain,
    /// Trilinear with 2x2x2 points.
    FullIntegration,
}

/// `plicad train`.
#[derive(Debug, Args)]
pub struct TrainArgs {
    /// Scene file, or `wedge` for the built-in one.
    #[arg(required_unless_present = "job")]
    pub scene: Option<PathBuf>,
    /// Runs the job of an existing folder, or goes on with it.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["scene", "out", "folder", "kind", "examples", "seed", "sensitivity"])]
    pub job: Option<PathBuf>,
    /// Copies the finished database here.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Folder of the job; the same folder goes on where it was [default: out/train/SCENE-KIND].
    #[arg(long, value_name = "DIR")]
    pub folder: Option<PathBuf>,
    /// What the examples are for.
    #[arg(long, default_value = "training")]
    pub kind: TrainKind,
    /// How many; of an evaluation: in the trained region [default: what the scene says].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub examples: Option<u32>,
    /// Seed of the interactions [default: what the scene says].
    #[arg(long)]
    pub seed: Option<u64>,
    /// Threads [default: all cores but one].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub threads: Option<u32>,
    /// Trains nothing: tabulates over so many interactions how firm the accurate skin is against mesh, tie and reference.
    #[arg(long, value_name = "N", conflicts_with_all = ["out", "folder", "kind", "examples", "seed"],
          value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub sensitivity: Option<u32>,
}

/// What examples are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum TrainKind {
    /// To learn from.
    Training,
    /// Held out, in the trained region and outside of it, with both references.
    Evaluation,
}

/// The two databases of a scene.
#[derive(Debug, Args)]
pub struct DatabaseArgs {
    /// Examples to learn from [default: out/train/SCENE-training/database.safetensors].
    #[arg(long, value_name = "FILE")]
    pub training: Option<PathBuf>,
    /// Held-out examples to judge by [default: out/train/SCENE-evaluation/database.safetensors].
    #[arg(long, value_name = "FILE")]
    pub held_out: Option<PathBuf>,
}

/// `plicad evaluate`.
#[derive(Debug, Args)]
pub struct EvaluateArgs {
    /// Scene file; left out: the built-in wedge.
    pub scene: Option<PathBuf>,
    /// What is learned from, and judged by.
    #[command(flatten)]
    pub databases: DatabaseArgs,
    /// Methods, separated by commas [default: all of them].
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub methods: Vec<String>,
    /// Learns from the first so many examples [default: all of them].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=100_000))]
    pub examples: Option<u32>,
    /// Slides through the trained region as well, with an accurate solution at every step: second differences of the detail.
    #[arg(long)]
    pub slide: bool,
}

/// `plicad chart`.
#[derive(Debug, Args)]
pub struct ChartArgs {
    /// Scene file with a \[bench\] table, or `wedge` for the built-in one.
    pub scene: PathBuf,
    /// What is learned from, and judged by.
    #[command(flatten)]
    pub databases: DatabaseArgs,
    /// Folder for chart.svg and chart.json [default: out/chart/SCENE].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Measures points again that an earlier run has finished.
    #[arg(long)]
    pub fresh: bool,
    /// Leaves out other coarse models, each of which is driven to all held-out interactions anew.
    #[arg(long)]
    pub quick: bool,
    /// Ticks to time for each coarse model.
    #[arg(long, default_value_t = 3000, value_parser = clap::value_parser!(u64).range(100..=10_000_000))]
    pub ticks: u64,
}

/// `plicad check`.
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// Scene file, or `wedge` for the built-in one.
    pub scene: PathBuf,
}

/// `plicad solve`.
#[derive(Debug, Args)]
pub struct SolveArgs {
    /// Case file; configs/cases/cantilever.toml explains every key.
    pub case: PathBuf,
    /// Result for ParaView, a .vtu file: displacement, Cauchy and von Mises stress, det F, regions.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

/// `plicad demo`.
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Seconds of the scripted motion.
    #[arg(long, default_value_t = 8.0)]
    pub seconds: f64,
    /// Poses to play in place of the scripted motion: CSV or TUM.
    #[arg(long, value_name = "FILE")]
    pub poses: Option<PathBuf>,
    /// Maps the trajectory's box into the room above the object.
    #[arg(long, requires = "poses")]
    pub fit: bool,
    /// Folder for pictures, GLB, and the examples that the first run trains.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// How many examples the first run trains.
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u32).range(2..=100_000))]
    pub examples: u32,
}
