//! `plicad schema`.

use crate::config::RawConfig;

/// Prints the JSON Schema of scene files.
pub fn run() -> anyhow::Result<()> {
    println!("{}", serde_json::to_string_pretty(&schemars::schema_for!(RawConfig))?);
    Ok(())
}
