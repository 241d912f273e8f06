//! `replay`: publishes the poses of a recording, byte by byte, at their recorded times.
//!
//! `source_id`, `sequence` and `source_time_ns` stay as recorded, so that recording a replay gives the same bytes.
//! `--new-source` gives each replay an id of its own and changes those four bytes only.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use anyhow::bail;
use plica_client::recording::{Kind, Recorded, read, tool_of};
use plica_client::{Client, PosePublisher, PoseSource};
use serde_json::json;

use super::Stop;
use super::rejected::Before;
use crate::args::Replay;
use crate::output::{Output, progress};

/// Bytes of `source_id` in a binary pose.
const SOURCE_ID: std::ops::Range<usize> = 24..28;

pub(crate) fn run(client: &Client, replay: &Replay, output: Output) -> anyhow::Result<()> {
    let poses = poses(replay, output)?;
    let before = Before::new(client);
    let stop = Stop::on_signals()?;
    let publishers = publishers(client, &poses)?;
    let bar = progress(Some(poses.len() as u64), "poses");
    let (start, first_ns) = (Instant::now(), poses[0].log_time_ns);
    let new_source = replay.new_source.then(|| PoseSource::new().source_id);
    let mut published = 0_u64;
    for pose in poses {
        let due = due(&pose, first_ns, replay);
        if !stop.sleep_until(start + due) {
            break;
        }
        let bytes = with_source(pose.bytes, pose.kind, new_source);
        publishers[&pose.key].publish_bytes(bytes, pose.kind == Kind::JsonPose)?;
        published += 1;
        bar.inc(1);
    }
    bar.finish_and_clear();
    let seconds = start.elapsed().as_secs_f64();
    let rejected = before.since(client);
    let value = json!({
        "file": replay.file, "poses": published, "tools": publishers.len(), "seconds": seconds,
        "poses_rejected": rejected.json(),
    });
    let text = format!("{published} poses of {} tool(s) in {seconds:.1} s", publishers.len());
    output.result(&value, &rejected.below(text));
    Ok(())
}

/// Poses in order of log time.
fn poses(replay: &Replay, output: Output) -> anyhow::Result<Vec<Recorded>> {
    let recording = read(&replay.file, &Kind::POSES)?;
    recording.notes().iter().for_each(|note| output.note(note));
    if recording.messages.is_empty() {
        let file = replay.file.display();
        if recording.n_messages == 0 && !recording.foreign.is_empty() {
            bail!("{file}: no poses; it holds {}", recording.foreign_messages());
        }
        bail!("{file}: no poses; was a tracker publishing during the recording?");
    }
    Ok(recording.messages)
}

/// One publisher per recorded key, in the session of this connection.
fn publishers(client: &Client, poses: &[Recorded]) -> anyhow::Result<HashMap<String, PosePublisher>> {
    let mut publishers = HashMap::new();
    for pose in poses {
        if !publishers.contains_key(&pose.key) {
            let Some(tool) = tool_of(&pose.key) else { bail!("`{}` is not a pose key", pose.key) };
            publishers.insert(pose.key.clone(), client.lossless_pose_publisher(tool)?);
        }
    }
    Ok(publishers)
}

fn due(pose: &Recorded, first_ns: u64, replay: &Replay) -> Duration {
    let after_ns = pose.log_time_ns.saturating_sub(first_ns);
    if replay.fast { Duration::ZERO } else { Duration::from_nanos(after_ns).div_f64(replay.speed) }
}

fn with_source(mut bytes: Vec<u8>, kind: Kind, new_source: Option<u32>) -> Vec<u8> {
    if let (Some(source_id), Kind::Pose, Some(field)) = (new_source, kind, bytes.get_mut(SOURCE_ID)) {
        field.copy_from_slice(&source_id.to_le_bytes());
    }
    bytes
}
