//! `plicad`: see `plicad --help`.

use std::process::ExitCode;

use clap::Parser;
use plicad::cli::Cli;

fn main() -> ExitCode {
    let cli = Cli::parse();
    plicad::logging::start(cli.verbose);
    match plicad::commands::run(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("plicad: {error:#}");
            ExitCode::FAILURE
        }
    }
}
