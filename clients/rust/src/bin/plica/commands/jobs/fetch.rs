//! `jobs fetch`: downloads a result; the file appears only when it is complete and checked.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use plica_client::protocol::chunk::ChunkHeader;
use plica_client::protocol::jobs::JobFile;
use plica_client::{Client, FetchError};
use serde_json::json;

use crate::args::jobs::Fetch;
use crate::output::{Output, progress};

pub(super) fn run(client: &Client, fetch: &Fetch, output: Output) -> anyhow::Result<ExitCode> {
    let file = JobFile::from(fetch.what);
    let path = match &fetch.out {
        Some(path) => path.clone(),
        None => default_path(&client.job(&fetch.id)?.scene_name, &fetch.id, file),
    };
    let part = path.with_added_extension("part");
    let fetched = write(client, &fetch.id, file, &part).and_then(|header| {
        fs::rename(&part, &path).with_context(|| format!("cannot write {}", path.display()))?;
        Ok(header)
    });
    if fetched.is_err() {
        // An incomplete download is of no use.
        let _ = fs::remove_file(&part);
    }
    let ChunkHeader { total_bytes, sha256, .. } = fetched?;
    let value = json!({"id": fetch.id, "file": path, "bytes": total_bytes, "sha256": sha256});
    output.result(&value, &format!("{}: {total_bytes} bytes, SHA-256 {sha256}", path.display()));
    Ok(ExitCode::SUCCESS)
}

fn default_path(scene_name: &str, id: &str, file: JobFile) -> PathBuf {
    let ending = match file {
        JobFile::Database => "safetensors",
        JobFile::Report => "json",
    };
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    let name: String = format!("{scene_name}-{id}").chars().map(plain).collect();
    PathBuf::from(format!("{name}.{ending}"))
}

fn write(client: &Client, id: &str, file: JobFile, part: &Path) -> anyhow::Result<ChunkHeader> {
    let out = File::create(part).with_context(|| format!("cannot write {}", part.display()))?;
    let mut out = BufWriter::new(out);
    let bar = progress(Some(1), "bytes");
    let header = client.fetch_job(id, file, &mut out, &mut |have, total| {
        bar.set_length(total);
        bar.set_position(have);
    });
    let header = header.map_err(|error| match error {
        FetchError::Client(error) => anyhow::Error::new(error),
        FetchError::Write(error) => anyhow::Error::new(error).context(format!("cannot write {}", part.display())),
    })?;
    bar.finish_and_clear();
    let synced = out.flush().and_then(|()| out.get_ref().sync_all());
    synced.with_context(|| format!("cannot write {}", part.display()))?;
    Ok(header)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_from_the_daemon_lead_nowhere() {
        assert_eq!(default_path("wedge", "0001", JobFile::Database), Path::new("wedge-0001.safetensors"));
        assert_eq!(default_path("../my scene", "0001", JobFile::Report), Path::new(".._my_scene-0001.json"));
    }
}
