//! `export`: the mesh or the present skin.

use std::path::Path;

use anyhow::Context;
use plica_client::Client;
use serde_json::json;

use super::choose;
use crate::args::Export;
use crate::output::Output;

pub(crate) fn run(client: &Client, export: &Export, output: Output) -> anyhow::Result<()> {
    let object = choose("object", export.object.as_deref(), &client.status()?.objects)?;
    let mut value = json!({"object": object});
    let mut lines = Vec::new();
    if let Some(path) = &export.mesh {
        let glb = client.mesh(&object)?;
        write(path, &glb)?;
        value["mesh"] = json!({"file": path, "bytes": glb.len()});
        lines.push(format!("{}: mesh of `{object}`, {} bytes of GLB", path.display(), glb.len()));
    }
    if let Some(path) = &export.skin {
        let skin = client.skin_now(&object)?;
        write(path, &skin.bytes)?;
        let (tick, n_vertices) = (skin.header.tick, skin.header.n_vertices);
        value["skin"] = json!({"file": path, "bytes": skin.bytes.len(), "tick": tick, "n_vertices": n_vertices});
        lines.push(format!("{}: skin of `{object}` at tick {tick}, {n_vertices} vertices", path.display()));
    }
    output.result(&value, &lines.join("\n"));
    Ok(())
}

fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    std::fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}
