//! `plicad schema`.

use crate::cli::SchemaArgs;

/// Prints the JSON Schema of scene files, or of case files; on one line where `json` says so.
pub fn run(args: &SchemaArgs, json: bool) -> anyhow::Result<()> {
    let schema = if args.case { plica_scene::case::schema() } else { plica_scene::scene::schema() };
    let print = if json { serde_json::to_string } else { serde_json::to_string_pretty };
    println!("{}", print(&schema)?);
    Ok(())
}
