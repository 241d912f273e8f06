//! `plicad demo`.

use crate::cli::DemoArgs;

/// Serves on loopback, drives the tool through a real client, prints a summary, writes a picture and a GLB.
pub fn run(_args: &DemoArgs, _json: bool) -> anyhow::Result<()> {
    anyhow::bail!("demo is being written")
}
