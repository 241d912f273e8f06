//! One file per command.

pub mod bench;
pub mod chart;
pub mod check;
pub mod child;
pub mod demo;
pub mod evaluate;
pub mod schema;
pub mod serve;
pub mod simulate;
pub mod solve;
pub mod train;

use std::path::{Path, PathBuf};

use plica_scene::{Config, ConfigError};

use crate::cli::{Cli, Command};

/// Runs the command that was typed.
pub fn run(cli: &Cli) -> anyhow::Result<()> {
    match &cli.command {
        Command::Serve(args) => serve::run(args, cli.json),
        Command::Demo(args) => demo::run(args, cli.json),
        Command::Simulate(args) => simulate::run(args, cli.json),
        Command::Bench(args) => bench::run(args, cli.json),
        Command::Check(args) => check::run(args, cli.json),
        Command::Train(args) => train::run(args, cli.json),
        Command::Evaluate(args) => evaluate::run(args, cli.json),
        Command::Chart(args) => chart::run(args, cli.json),
        Command::Schema(args) => schema::run(args, cli.json),
        Command::Solve(args) => solve::run(args, cli.json),
        Command::Child(args) => child::run(args),
    }
}

/// Whether a path means the built-in scene: `wedge`, where no such file exists.
fn is_built_in(path: &Path) -> bool {
    path == Path::new("wedge") && !path.is_file()
}

/// The scene of a path, or the built-in one.
fn scene(path: &Path) -> Result<Config, ConfigError> {
    let config = if is_built_in(path) { Config::built_in() } else { Config::from_file(path) }?;
    config.remarks().iter().for_each(|remark| tracing::warn!("{}: {remark}", config.file().display()));
    Ok(config)
}

/// The same, with other examples to start with.
fn scene_with(path: &Path, database: &Option<PathBuf>) -> Result<Config, ConfigError> {
    let mut config = scene(path)?;
    if let Some(file) = database {
        config.set_database(file.clone());
    }
    Ok(config)
}
