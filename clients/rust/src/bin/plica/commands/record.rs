//! `record`: published messages to an MCAP file.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use anyhow::Context;
use plica_client::recording::{Kind, Recorded, Recorder};
use plica_client::{Client, RawMessage, SourceClock};
use serde_json::json;

use super::Stop;
use crate::args::Record;
use crate::output::{Output, progress};

/// Queue of about two seconds of all streams; a full queue drops and counts new messages.
const WAITING: usize = 4096;
const LOOK: Duration = Duration::from_millis(50);
/// Interval after which messages are in the file, however the recorder ends.
const FLUSH_EVERY: Duration = Duration::from_millis(500);
const POSE: &str = "pose";

/// Messages written, by kind.
type Counts = BTreeMap<&'static str, u64>;

pub(crate) fn run(client: &Client, record: &Record, output: Output) -> anyhow::Result<()> {
    let stop = Stop::on_signals()?;
    let clock = SourceClock::new();
    let mut recorder = Recorder::create(&record.out)?;
    let messages = client.subscribe_raw(&keys(client, record), WAITING)?;
    if client.status().is_err() {
        output.note("no plicad serves this session; recording what others publish");
    }
    // Scripts wait for this line; the query above was sent after the subscription, so that is active now.
    output.note(&format!("recording to {}", record.out.display()));
    let bar = progress(None, "messages");
    let start = Instant::now();
    let mut flushed = start;
    let mut counts = Counts::new();
    let late = || record.seconds.is_some_and(|s| start.elapsed().as_secs_f64() >= s);
    let enough = |counts: &Counts| record.max_poses.is_some_and(|most| counts.get(POSE).copied().unwrap_or(0) >= most);
    while !late() && !stop.is_set() && !enough(&counts) {
        if let Some(message) = messages.next(LOOK) {
            write(&mut recorder, message, clock, &mut counts)?;
            bar.inc(1);
        }
        if flushed.elapsed() >= FLUSH_EVERY {
            recorder.flush()?;
            flushed = Instant::now();
        }
    }
    // Messages that wait at the end belong to the recording, later ones do not.
    for message in std::iter::from_fn(|| messages.try_next()).take(WAITING) {
        if enough(&counts) {
            break;
        }
        write(&mut recorder, message, clock, &mut counts)?;
    }
    recorder.finish()?;
    bar.finish_and_clear();
    let count = |kind: &str| counts.get(kind).copied().unwrap_or(0);
    let (seconds, dropped) = (start.elapsed().as_secs_f64(), messages.stats().dropped);
    let (poses, skins, wrenches) = (count(POSE), count("skin"), count("wrench"));
    let value = json!({
        "file": record.out, "seconds": seconds, "poses": poses, "skins": skins, "wrenches": wrenches, "dropped": dropped,
    });
    let file = record.out.display();
    let text =
        format!("{file}: {poses} poses, {skins} skins, {wrenches} wrenches in {seconds:.1} s, {dropped} dropped");
    output.result(&value, &text);
    Ok(())
}

fn keys(client: &Client, record: &Record) -> Vec<String> {
    let keys = client.keys();
    let mut wanted = vec![keys.pose("*")];
    wanted.extend(record.skins.then(|| keys.skin("*")));
    wanted.extend(record.wrenches.then(|| keys.wrench("*")));
    wanted
}

fn write(recorder: &mut Recorder, message: RawMessage, clock: SourceClock, counts: &mut Counts) -> anyhow::Result<()> {
    let RawMessage { key, bytes, json, received } = message;
    let kind = Kind::of(&key, json).with_context(|| format!("unexpected key `{key}`"))?;
    let name = match kind {
        Kind::Pose | Kind::JsonPose => POSE,
        Kind::Skin => "skin",
        Kind::Wrench => "wrench",
    };
    *counts.entry(name).or_default() += 1;
    recorder.write(&Recorded { key, kind, log_time_ns: clock.at_ns(received), bytes })?;
    Ok(())
}
