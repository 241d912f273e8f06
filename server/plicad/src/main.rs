//! `plicad`: see `plicad --help`.

use std::process::ExitCode;

use clap::Parser;
use plicad::cli::Cli;
use plicad::deafness::{DEAF, Deafness};

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(answer) => return say(&answer),
    };
    plicad::logging::start(cli.verbose);
    match plicad::commands::run(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let message = plica_jobs::sentence(&error);
            eprintln!("plicad: {message}");
            if cli.json {
                print_error(&message);
            }
            exit_code(&error)
        }
    }
}

/// A job that was asked to stop is not one that failed, and a deaf daemon is to be started again.
fn exit_code(error: &anyhow::Error) -> ExitCode {
    if error.is::<Deafness>() {
        return ExitCode::from(DEAF);
    }
    match error.downcast_ref() {
        Some(plica_training::TrainingError::Interrupted) => ExitCode::from(plica_training::INTERRUPTED),
        _ => ExitCode::FAILURE,
    }
}

/// Help, the version, or what is wrong with the arguments.
fn say(answer: &clap::Error) -> ExitCode {
    // Without standard output or error there is nothing left to say.
    let _ = answer.print();
    if answer.use_stderr() && std::env::args_os().any(|argument| argument == "--json") {
        print_error(answer.to_string().trim());
    }
    ExitCode::from(u8::try_from(answer.exit_code()).unwrap_or(1))
}

/// The one JSON object of a command that failed.
fn print_error(message: &str) {
    println!("{}", serde_json::json!({ "error": { "message": message } }));
}
