//! The command line.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use plica_client::pose_file::PoseFileArgs;
use plica_daemon::bus::BusOptions;
use plica_jobs::{Keep, Priority};
use plica_protocol::{DEFAULT_ENDPOINT, DEFAULT_SESSION};
use plica_trajectory::FIT_HELP;

/// Simulates a soft object that tools touch, at 1 kHz, and serves it on a Zenoh bus.
#[derive(Debug, Parser)]
#[command(name = "plicad", version, about, max_term_width = 110)]
pub struct Cli {
    /// Command.
    #[command(subcommand)]
    pub command: Command,
    /// Prints more on standard error; twice: everything.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub verbose: u8,
    /// Prints one JSON object as the last line of standard output.
    #[arg(long, global = true)]
    pub json: bool,
}

/// Commands of plicad.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Runs a scene in real time and serves it on the bus until Ctrl-C.
    ///
    /// Ends with code 0 after SIGINT or SIGTERM, 1 after an error, 76 if the bus has gone deaf: start it again then, as deploy/plicad.service does.
    Serve(ServeArgs),
    /// Trains a few examples, serves on loopback, drives the tool through a real client, prints a summary, writes pictures.
    Demo(DemoArgs),
    /// Runs a scene along recorded poses, without bus or clock; the same input gives the same bytes.
    Simulate(SimulateArgs),
    /// Times the tick, stage by stage, beside the memory limit measured in the same run.
    Bench(BenchArgs),
    /// Estimates the cost of a scene and checks that it can be served.
    Check(CheckArgs),
    /// Makes examples for a scene: solves interactions with both models and stores the difference of their skins.
    Train(TrainArgs),
    /// Evaluates enrichment methods on held-out accurate solutions: errors, time, degenerate inputs.
    Evaluate(EvaluateArgs),
    /// Charts speed against accuracy, one point per configuration, as SVG and JSON.
    Chart(ChartArgs),
    /// Prints the JSON Schema of scene files, or of case files.
    Schema(SchemaArgs),
    /// Solves a case with the accurate model: mesh, materials, supports and loads; prints the readings of its probes.
    Solve(SolveArgs),
    /// Becomes the process of a job.
    #[command(hide = true)]
    Child(ChildArgs),
}

/// Endpoint and session of the daemon.
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
    /// Converts to options of the bus.
    pub fn options(&self) -> BusOptions {
        BusOptions {
            listen: self.listen.clone(),
            session: self.session.clone(),
            zenoh_config: self.zenoh_config.clone(),
            databases: None,
        }
    }
}

/// `plicad serve`.
#[derive(Debug, Args)]
pub struct ServeArgs {
    /// Scene.
    #[arg(default_value = "wedge", help = SCENE_HELP)]
    pub scene: PathBuf,
    /// Endpoint and session of the daemon.
    #[command(flatten)]
    pub bus: BusArgs,
    /// Runs ticks only on rpc/step.
    #[arg(long)]
    pub lock_step: bool,
    /// Database for enrichment, in place of the scene's.
    #[arg(long, value_name = "FILE")]
    pub database: Option<PathBuf>,
    /// Folder for jobs and their results; one daemon at a time uses it.
    #[arg(long, value_name = "DIR", help = DATA_HELP)]
    pub data: Option<PathBuf>,
    /// Folder of the databases that clients may activate by name; without it they activate those of jobs only.
    #[arg(long, value_name = "DIR")]
    pub databases: Option<PathBuf>,
    /// Number of finished jobs that are kept; beyond it cancelled and failed ones are removed, then those that are done, oldest first.
    #[arg(long, value_name = "N", default_value_t = Keep::default().jobs as u32, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub keep_jobs: u32,
    /// Bytes of finished jobs that are kept, as 500MiB or 8GiB; unfinished jobs have as much room again.
    #[arg(long, value_name = "SIZE", default_value = "8GiB", value_parser = size)]
    pub keep_bytes: u64,
    /// Scheduling class of jobs.
    #[arg(long, value_enum, default_value_t, value_name = "CLASS")]
    pub job_priority: JobPriority,
}

impl ServeArgs {
    /// Bounds of the jobs that are kept.
    pub fn keep(&self) -> Keep {
        Keep { jobs: self.keep_jobs as usize, bytes: self.keep_bytes }
    }
}

/// Bytes of a size such as `500MiB`.
fn size(text: &str) -> Result<u64, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit: u64 = match &text[digits.len()..] {
        "" | "B" => 1,
        "KiB" => 1 << 10,
        "MiB" => 1 << 20,
        "GiB" => 1 << 30,
        "TiB" => 1 << 40,
        other => return Err(format!("`{other}` is no unit; give B, KiB, MiB, GiB or TiB")),
    };
    let number: u64 = digits.trim().parse().map_err(|_| format!("`{text}` is no size; give one as 8GiB"))?;
    number.checked_mul(unit).filter(|bytes| *bytes > 0).ok_or_else(|| format!("`{text}` is out of range"))
}

/// Scheduling class of jobs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum JobPriority {
    /// Runs on otherwise idle cores (`SCHED_IDLE`, nice 19).
    #[default]
    Idle,
    /// Small share of a busy core (`SCHED_BATCH`, nice 19).
    Low,
    /// Default class of the system.
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

const SCENE_HELP: &str = "Scene file, or `wedge`, the built-in one";
const BENCH_SCENE_HELP: &str = "Scene file with a [bench] table, or `wedge`, the built-in one";
const DATA_HELP: &str =
    "Folder for jobs and their results; one daemon at a time uses it [default: ~/.local/share/plica/SESSION]";

/// `plicad child`.
#[derive(Debug, Args)]
pub struct ChildArgs {
    /// Process id of the daemon; the child ends without it.
    #[arg(long)]
    pub parent: u32,
    /// Scheduling class.
    #[arg(long, value_enum)]
    pub priority: JobPriority,
    /// Core to leave free.
    #[arg(long)]
    pub avoid_cpu: Option<usize>,
    /// Command to execute.
    #[arg(last = true, required = true)]
    pub command: Vec<OsString>,
}

/// `plicad simulate`.
#[derive(Debug, Args)]
pub struct SimulateArgs {
    /// Scene.
    #[arg(help = SCENE_HELP)]
    pub scene: PathBuf,
    /// Poses: CSV (time_s,tool,px,py,pz,qx,qy,qz,qw) or a TUM trajectory; the first one plays at 0.
    #[arg(long, value_name = "FILE")]
    pub poses: PathBuf,
    /// How the file is read.
    #[command(flatten)]
    pub reading: PoseFileArgs,
    /// Runs even if it writes more than the disk has free, or takes hours.
    #[arg(long)]
    pub no_limits: bool,
    /// Result, a safetensors file.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Database for enrichment, in place of the scene's.
    #[arg(long, value_name = "FILE")]
    pub database: Option<PathBuf>,
    /// Ticks per frame.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub every: u64,
    /// Scales and moves the motion onto the object.
    #[arg(long, help = FIT_HELP)]
    pub fit: bool,
    /// Tool of poses without a tool name; required if the scene has several tools.
    #[arg(long, value_name = "NAME")]
    pub tool: Option<String>,
}

/// `plicad bench`.
#[derive(Debug, Args)]
pub struct BenchArgs {
    /// Scene with a bench table.
    #[arg(help = BENCH_SCENE_HELP)]
    pub scene: PathBuf,
    /// Ticks to time; the scene's motion is repeated.
    #[arg(long, default_value_t = 3000, value_parser = clap::value_parser!(u64).range(100..=10_000_000))]
    pub ticks: u64,
    /// Element in place of the scene's.
    #[arg(long)]
    pub element: Option<Element>,
    /// Database for enrichment, in place of the scene's.
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
    /// Scene.
    #[arg(required_unless_present = "job", help = SCENE_HELP)]
    pub scene: Option<PathBuf>,
    /// Runs or continues the job of an existing folder.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["scene", "out", "folder", "kind", "examples", "seed", "sensitivity"])]
    pub job: Option<PathBuf>,
    /// Copies the finished database here.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Folder of the job; an unfinished job in it is continued [default: out/train/SCENE-KIND].
    #[arg(long, value_name = "DIR")]
    pub folder: Option<PathBuf>,
    /// Kind of the database.
    #[arg(long, default_value = "training")]
    pub kind: TrainKind,
    /// Number of examples; for an evaluation, of those in the trained region [default: the scene's].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub examples: Option<u32>,
    /// Seed of the interactions [default: the scene's].
    #[arg(long)]
    pub seed: Option<u64>,
    /// Number of threads [default: all cores but one].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub threads: Option<u32>,
    /// Instead of training, reports the sensitivity of the accurate skin to mesh, tie and reference, over N interactions.
    #[arg(long, value_name = "N", conflicts_with_all = ["out", "folder", "kind", "examples", "seed"],
          value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub sensitivity: Option<u32>,
}

/// Kind of a database.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum TrainKind {
    /// Examples to train on.
    Training,
    /// Held-out examples in the trained region and outside of it, with both references.
    Evaluation,
}

/// The two databases of a scene.
#[derive(Debug, Args)]
pub struct DatabaseArgs {
    /// Training examples [default: out/train/SCENE-training/database.safetensors].
    #[arg(long, value_name = "FILE")]
    pub training: Option<PathBuf>,
    /// Held-out examples [default: out/train/SCENE-evaluation/database.safetensors].
    #[arg(long, value_name = "FILE")]
    pub held_out: Option<PathBuf>,
}

/// `plicad evaluate`.
#[derive(Debug, Args)]
pub struct EvaluateArgs {
    /// Scene.
    #[arg(default_value = "wedge", help = SCENE_HELP)]
    pub scene: PathBuf,
    /// Training and held-out examples.
    #[command(flatten)]
    pub databases: DatabaseArgs,
    /// Methods, separated by commas [default: all of them].
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub methods: Vec<String>,
    /// Trains on the first N examples [default: all of them].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=100_000))]
    pub examples: Option<u32>,
    /// Also slides through the trained region, with an accurate solution at every step, and reports second differences of the detail.
    #[arg(long)]
    pub slide: bool,
}

/// `plicad chart`.
#[derive(Debug, Args)]
pub struct ChartArgs {
    /// Scene with a bench table.
    #[arg(help = BENCH_SCENE_HELP)]
    pub scene: PathBuf,
    /// Training and held-out examples.
    #[command(flatten)]
    pub databases: DatabaseArgs,
    /// Folder for chart.svg and chart.json [default: out/chart/SCENE].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Measures all points again, also those of an earlier run.
    #[arg(long)]
    pub fresh: bool,
    /// Leaves out other coarse models, each of which must be driven to all held-out interactions.
    #[arg(long)]
    pub quick: bool,
    /// Ticks to time for each coarse model.
    #[arg(long, default_value_t = 3000, value_parser = clap::value_parser!(u64).range(100..=10_000_000))]
    pub ticks: u64,
}

/// `plicad check`.
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// Scene.
    #[arg(help = SCENE_HELP)]
    pub scene: PathBuf,
}

/// `plicad solve`.
#[derive(Debug, Args)]
pub struct SolveArgs {
    /// Case file; configs/cases/cantilever.toml documents every key.
    pub case: PathBuf,
    /// Result for ParaView (.vtu): displacement, Cauchy and von Mises stress, det F, regions.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Leaves unstable equilibria along their softest mode, for stable ones.
    #[arg(long)]
    pub follow_stable: bool,
}

/// `plicad schema`.
#[derive(Debug, Args)]
pub struct SchemaArgs {
    /// Of case files, in place of scene files.
    #[arg(long)]
    pub case: bool,
}

/// `plicad demo`.
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Seconds of the scripted motion.
    #[arg(long, default_value_t = 8.0)]
    pub seconds: f64,
    /// Poses to play in place of the scripted motion, in real time: CSV or TUM.
    #[arg(long, value_name = "FILE")]
    pub poses: Option<PathBuf>,
    /// How the file is read.
    #[command(flatten)]
    pub reading: PoseFileArgs,
    /// Scales and moves the motion onto the object.
    #[arg(long, requires = "poses", help = FIT_HELP)]
    pub fit: bool,
    /// Folder for pictures, GLB and the examples of the first run.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Number of examples that the first run trains.
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u32).range(2..=100_000))]
    pub examples: u32,
}
