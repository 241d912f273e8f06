//! `plicad child`: becomes the process of a job, once that makes room for everything else.

use std::os::unix::process::CommandExt;
use std::process::Command;

use anyhow::Context;
use plica_jobs::lower;

use crate::cli::ChildArgs;

/// Lowers this process and replaces it; comes back only if that fails.
pub fn run(args: &ChildArgs) -> anyhow::Result<()> {
    let refused = lower(args.priority.into(), args.avoid_cpu, args.parent).map_err(anyhow::Error::msg)?;
    for refusal in refused {
        tracing::warn!("{refusal}");
    }
    let (program, arguments) = args.command.split_first().context("no command is given")?;
    let error = Command::new(program).args(arguments).exec();
    Err(error).with_context(|| format!("{} cannot be started", program.display()))
}
