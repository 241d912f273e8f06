//! The examples that the demo serves: trained once, kept beside its pictures.

use std::path::{Path, PathBuf};
use std::time::Instant;

use plica_jobs::by_hand::{JobOptions, make};
use plica_scene::Config;
use plica_scene::hash::scene_hash;
use plica_training::{Database, DatabaseKind, JobPaths};

use crate::commands::train::{OnTerminal, work};
use crate::demo::Trained;

/// Trains `n` examples of a scene into a folder below `out`, or finds them there.
pub(super) fn examples(config: &Config, out: &Path, n: u32) -> anyhow::Result<Trained> {
    let begin = Instant::now();
    let hash = scene_hash(config)?;
    let root = folder(out, &hash, n);
    let kept = JobPaths::new(root.clone()).database();
    if let Ok(database) = Database::read(&kept, Some(&hash)) {
        return Ok(Trained { examples: database.examples.len(), seconds: 0.0, database: kept });
    }
    let n_threads = std::thread::available_parallelism().map_or(1, usize::from);
    let request =
        JobOptions { kind: DatabaseKind::Training, examples: Some(n), seed: None, threads: u32::try_from(n_threads)? };
    let (folder, job) = make(&root, config, &request)?;
    eprintln!("trains {n} examples in {}, once", root.display());
    let watch = OnTerminal::new(None);
    let report = work(config, &job, &folder, n_threads, &mut |p| watch.observe(&p));
    watch.finish();
    let examples = report?.result.examples;
    Ok(Trained {
        examples: examples as usize,
        seconds: begin.elapsed().as_secs_f64(),
        database: folder.paths().database(),
    })
}

/// Folder by scene hash and number of examples, so that its content is never out of date.
fn folder(out: &Path, hash: &str, n: u32) -> PathBuf {
    out.join("demo-training").join(format!("{}-{n}", hash.get(..12).unwrap_or(hash)))
}
