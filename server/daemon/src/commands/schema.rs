//! `plicad schema`.

use crate::config::RawConfig;

/// Prints the JSON Schema of scene files; on one line where `json` says so.
pub fn run(json: bool) -> anyhow::Result<()> {
    let schema = schemars::schema_for!(RawConfig);
    let print = if json { serde_json::to_string } else { serde_json::to_string_pretty };
    println!("{}", print(&schema)?);
    Ok(())
}
