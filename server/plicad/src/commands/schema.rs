//! `plicad schema`.

/// Prints the JSON Schema of scene files; on one line where `json` says so.
pub fn run(json: bool) -> anyhow::Result<()> {
    let schema = plica_scene::scene::schema();
    let print = if json { serde_json::to_string } else { serde_json::to_string_pretty };
    println!("{}", print(&schema)?);
    Ok(())
}
