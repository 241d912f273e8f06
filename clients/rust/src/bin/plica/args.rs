//! The command line.

pub(crate) mod jobs;

use std::path::PathBuf;

use clap::{ArgGroup, Parser, Subcommand, ValueEnum};
use plica_client::pattern::Pattern;
use plica_client::pose_file::PoseFileArgs;
use plica_client::protocol::{DEFAULT_ENDPOINT, DEFAULT_SESSION};
use plica_client::{Client, ClientError, ClientOptions};
use plica_trajectory::FIT_HELP;

/// Queries, drives, records and replays a running plicad.
#[derive(Debug, Parser)]
#[command(name = "plica", version, about)]
pub(crate) struct Args {
    #[command(flatten)]
    pub(crate) common: Common,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Options of every command.
#[derive(Debug, clap::Args)]
pub(crate) struct Common {
    /// Endpoint of the daemon.
    #[arg(long, global = true, default_value = DEFAULT_ENDPOINT)]
    pub(crate) connect: String,
    /// Zenoh configuration file (JSON5) for the connection, in place of --connect.
    #[arg(long, global = true)]
    pub(crate) config: Option<PathBuf>,
    /// Session name of the daemon.
    #[arg(long, global = true, default_value = DEFAULT_SESSION)]
    pub(crate) session: String,
    /// Print one JSON object as the last line of standard output.
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Add the text of the library beneath to an error.
    #[arg(short, long, global = true)]
    pub(crate) verbose: bool,
}

impl Common {
    pub(crate) fn connect(&self) -> Result<Client, ClientError> {
        Client::connect(&ClientOptions {
            endpoint: self.connect.clone(),
            session: self.session.clone(),
            config_file: self.config.clone(),
            ..ClientOptions::default()
        })
    }
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Show the status of the daemon.
    Status,
    /// Move a tool by a script or along a recorded trajectory.
    Probe(Probe),
    /// Write poses (and skins and wrenches) to an MCAP file until Ctrl-C.
    Record(Record),
    /// Publish the poses of a recording (MCAP) in order of their times, byte by byte.
    Replay(Replay),
    /// Submit, watch and fetch long-running work: examples for enrichment.
    #[command(subcommand)]
    Jobs(jobs::Jobs),
    /// Call a method.
    Rpc(Rpc),
    /// Measure the time from a pose to the resulting force.
    Latency(Latency),
    /// Write the mesh, the present skin, or both to files.
    Export(Export),
}

/// Tool and scripted motion.
#[derive(Debug, clap::Args)]
pub(crate) struct Motion {
    /// Tool to move; may be left out if the scene has one tool.
    #[arg(long)]
    pub(crate) tool: Option<String>,
    /// Object to touch; may be left out if the scene has one object.
    #[arg(long)]
    pub(crate) object: Option<String>,
    /// Scripted motion.
    #[arg(long, value_enum, default_value = "press")]
    pub(crate) pattern: PatternName,
    /// Poses per second.
    #[arg(long, default_value_t = 250.0, value_parser = positive)]
    pub(crate) rate_hz: f64,
    /// Seconds to run.
    #[arg(long, default_value_t = 10.0, value_parser = positive)]
    pub(crate) seconds: f64,
    /// Point of the surface to press on, `x,y,z` [default: above the middle of the object].
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    pub(crate) at_m: Option<[f64; 3]>,
    /// Depth of the press in metres [default: 0.004; with --fit 0.008, at most 0.3 of the object's height].
    #[arg(long, value_parser = positive)]
    pub(crate) depth_m: Option<f64>,
    /// Radius of the tool's tip.
    #[arg(long, default_value_t = 0.007)]
    pub(crate) tip_radius_m: f64,
    /// Length of a slide, diameter of a circle.
    #[arg(long, default_value_t = 0.02)]
    pub(crate) span_m: f64,
    /// Duration of one cycle.
    #[arg(long, default_value_t = 2.0, value_parser = positive)]
    pub(crate) period_s: f64,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum PatternName {
    Press,
    Slide,
    Circle,
}

impl From<PatternName> for Pattern {
    fn from(name: PatternName) -> Self {
        match name {
            PatternName::Press => Self::Press,
            PatternName::Slide => Self::Slide,
            PatternName::Circle => Self::Circle,
        }
    }
}

#[derive(Debug, clap::Args)]
pub(crate) struct Probe {
    #[command(flatten)]
    pub(crate) motion: Motion,
    /// Trajectory (CSV or TUM) to follow at its recorded times, in place of a pattern.
    #[arg(long, conflicts_with_all = ["pattern", "rate_hz", "seconds"])]
    pub(crate) poses: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) reading: PoseFileArgs,
    /// Plays a trajectory of more than an hour.
    #[arg(long, requires = "poses")]
    pub(crate) no_limits: bool,
    #[arg(long, requires = "poses", help = FIT_HELP)]
    pub(crate) fit: bool,
}

#[derive(Debug, clap::Args)]
pub(crate) struct Record {
    /// File to write.
    pub(crate) out: PathBuf,
    /// Seconds to record [default: until Ctrl-C].
    #[arg(long, value_parser = positive)]
    pub(crate) seconds: Option<f64>,
    /// Stop after this many poses.
    #[arg(long, value_name = "N")]
    pub(crate) max_poses: Option<u64>,
    /// Record skin frames as well.
    #[arg(long)]
    pub(crate) skins: bool,
    /// Record wrenches as well.
    #[arg(long)]
    pub(crate) wrenches: bool,
}

#[derive(Debug, clap::Args)]
pub(crate) struct Replay {
    /// Recording to play.
    pub(crate) file: PathBuf,
    /// Factor on the recorded speed.
    #[arg(long, default_value_t = 1.0, value_parser = positive, conflicts_with = "fast")]
    pub(crate) speed: f64,
    /// Publish as fast as the bus accepts poses.
    #[arg(long)]
    pub(crate) fast: bool,
    /// Replace each source_id, so that a daemon that has received these poses before accepts them again.
    #[arg(long)]
    pub(crate) new_source: bool,
}

#[derive(Debug, clap::Args)]
pub(crate) struct Rpc {
    /// reset, pause, resume, step, snapshot, restore, activate (with {"database": "JOB or FILE"}), or a method of jobs: job_list, job_get, ...
    pub(crate) method: String,
    /// Arguments as JSON.
    #[arg(default_value = "{}")]
    pub(crate) arguments: String,
}

#[derive(Debug, clap::Args)]
pub(crate) struct Latency {
    #[command(flatten)]
    pub(crate) motion: Motion,
}

/// Either file suffices.
#[derive(Debug, clap::Args)]
#[command(group = ArgGroup::new("files").args(["mesh", "skin"]).required(true).multiple(true))]
pub(crate) struct Export {
    /// Object to write; may be left out if the scene has one object.
    #[arg(long)]
    pub(crate) object: Option<String>,
    /// File for the mesh (GLB).
    #[arg(long)]
    pub(crate) mesh: Option<PathBuf>,
    /// File for the present skin, as the message of the protocol.
    #[arg(long)]
    pub(crate) skin: Option<PathBuf>,
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("expected a number above 0".to_owned()),
    }
}

fn point(text: &str) -> Result<[f64; 3], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    let numbers = numbers.ok().and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
    numbers.filter(|p| p.iter().all(|c| c.is_finite())).ok_or_else(|| "expected three numbers `x,y,z`".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Args::command().debug_assert();
    }
}
