//! The `plica` command: asks, drives, records and replays a running daemon.

mod args;
mod commands;
mod output;

use std::process::ExitCode;

use clap::Parser;

use args::{Args, Command};
use commands::{ask, export, jobs, latency, probe, record, replay};
use output::Output;

fn main() -> ExitCode {
    let args = match Args::try_parse() {
        Ok(args) => args,
        Err(answer) => return Output::say(&answer),
    };
    let output = Output { json: args.common.json, verbose: args.common.verbose };
    match run(&args, output) {
        Ok(code) => code,
        Err(error) => {
            output.error(&error);
            ExitCode::FAILURE
        }
    }
}

fn run(args: &Args, output: Output) -> anyhow::Result<ExitCode> {
    let connect = || args.common.connect();
    let done = match &args.command {
        Command::Jobs(command) => return jobs::run(&connect()?, command, output),
        Command::Status => ask::status(&connect()?, output),
        Command::Rpc(rpc) => ask::rpc(&connect()?, rpc, output),
        Command::Probe(probe) => probe::run(&connect()?, probe, output),
        Command::Record(record) => record::run(&connect()?, record, output),
        Command::Replay(replay) => replay::run(&connect()?, replay, output),
        Command::Latency(latency) => latency::run(&connect()?, latency, output),
        Command::Export(export) => export::run(&connect()?, export, output),
    };
    done.map(|()| ExitCode::SUCCESS)
}
