//! A recording gives back what was put into it, as far as the file goes, whoever wrote it.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::collections::BTreeMap;
use std::fs;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use plica_client::protocol::pose::Pose;
use plica_client::protocol::wrench::Wrench;
use plica_client::recording::{Kind, Recorded, Recorder, Recording, read, tool_of};
use tempfile::TempDir;

fn message(key: &str, kind: Kind, log_time_ns: u64, bytes: &[u8]) -> Recorded {
    Recorded { key: key.to_owned(), kind, log_time_ns, bytes: bytes.to_vec() }
}

fn some_messages() -> Vec<Recorded> {
    let pose = |sequence| Pose { sequence, source_id: 7, ..Pose::default() };
    vec![
        message("plica/v1/main/tool/left/pose", Kind::Pose, 100, &pose(1).encode()),
        message("plica/v1/main/tool/right/pose", Kind::Pose, 100, &pose(1).encode()),
        message("plica/v1/main/tool/left/pose", Kind::JsonPose, 150, pose(2).to_json().as_bytes()),
        message("plica/v1/main/tool/left/wrench", Kind::Wrench, 160, &Wrench::default().encode()),
        message("plica/v1/main/tool/left/pose", Kind::Pose, 200, b"not even a pose"),
        message("plica/v1/main/object/wedge/skin", Kind::Skin, 210, &vec![7; 3_000_000]),
    ]
}

/// `n` poses of one tool, 10 ms apart.
fn poses(n: u64) -> Vec<Recorded> {
    let pose = |i: u64| Pose { sequence: i + 1, position_m: [1e-3 * i as f64, 0.0, 0.0], ..Pose::default() };
    let key = "plica/v1/main/tool/probe/pose";
    (0..n).map(|i| message(key, Kind::Pose, 1_000_000_000 + 10_000_000 * i, &pose(i).encode())).collect()
}

fn written(folder: &TempDir, messages: &[Recorded]) -> PathBuf {
    let path = folder.path().join("a.mcap");
    let mut recorder = Recorder::create(&path).unwrap();
    for (n, message) in messages.iter().enumerate() {
        recorder.write(message).unwrap();
        if n % 20 == 19 {
            recorder.flush().unwrap();
        }
    }
    recorder.finish().unwrap();
    path
}

fn read_all(path: &Path) -> Recording {
    read(path, &Kind::ALL).unwrap()
}

/// A file of another program: one channel of poses in `messages`' order, one channel of its own, chunks of 20 messages.
fn foreign(messages: &[Recorded], own: u64) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let options = mcap::WriteOptions::new().compression(None).disable_seeking(true);
    let mut writer = options.create(&mut bytes).unwrap();
    let none = BTreeMap::new();
    let pose = writer.add_channel(0, &messages[0].key, Kind::Pose.encoding(), &none).unwrap();
    let image = writer.add_channel(0, "/camera/info", "cdr", &none).unwrap();
    let header = |channel_id, log_time| MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time };
    for (n, message) in messages.iter().enumerate() {
        writer.write_to_known_channel(&header(pose, message.log_time_ns), &message.bytes).unwrap();
        if (n as u64) < own {
            writer.write_to_known_channel(&header(image, message.log_time_ns), b"image").unwrap();
        }
        if n % 20 == 19 {
            writer.flush().unwrap();
        }
    }
    writer.finish().unwrap();
    drop(writer);
    bytes.into_inner()
}

/// The same file with each chunk compressed.
fn compressed(file: &[u8], compression: &str) -> Vec<u8> {
    let mut out = file[..8].to_vec();
    let mut rest = &file[8..];
    while rest.len() > 9 {
        let length = u64::from_le_bytes(rest[1..9].try_into().unwrap()) as usize;
        let (record, after) = rest.split_at(9 + length);
        if record[0] == mcap::records::op::CHUNK {
            // Two times, size and checksum stay; the compression is empty in the source.
            let (head, data) = (&record[9..37], &record[49..]);
            let packed = packed(data, compression);
            let mut body = head.to_vec();
            body.extend((compression.len() as u32).to_le_bytes());
            body.extend(compression.as_bytes());
            body.extend((packed.len() as u64).to_le_bytes());
            body.extend(packed);
            out.push(record[0]);
            out.extend((body.len() as u64).to_le_bytes());
            out.extend(body);
        } else {
            out.extend(record);
        }
        rest = after;
    }
    out.extend(rest);
    out
}

fn packed(data: &[u8], compression: &str) -> Vec<u8> {
    // Two frames: a chunk may have several.
    let (first, second) = data.split_at(data.len() / 2);
    let lz4 = |part: &[u8]| {
        let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
        encoder.write_all(part).unwrap();
        encoder.finish().unwrap()
    };
    let zstd = |part| ruzstd::encoding::compress_to_vec(part, ruzstd::encoding::CompressionLevel::Fastest);
    match compression {
        "lz4" => [lz4(first), lz4(second)].concat(),
        "zstd" => [zstd(first), zstd(second)].concat(),
        _ => data.to_vec(),
    }
}

#[test]
fn what_goes_in_comes_out() {
    let folder = TempDir::new().unwrap();
    let path = written(&folder, &some_messages());
    let recording = read_all(&path);
    assert_eq!(recording.messages, some_messages());
    assert!(recording.has_end && recording.notes().is_empty(), "{:?}", recording.notes());
    let poses = read(&path, &Kind::POSES).unwrap();
    assert_eq!((poses.messages.len(), poses.n_messages), (4, 6));
}

#[test]
fn chunks_of_zstd_and_lz4_hold_the_same_messages() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.mcap");
    let (messages, plain) = (poses(100), foreign(&poses(100), 0));
    for compression in ["zstd", "lz4"] {
        fs::write(&path, compressed(&plain, compression)).unwrap();
        let recording = read_all(&path);
        assert_eq!((recording.messages, recording.n_damaged), (messages.clone(), 0), "{compression}");
        assert!(recording.has_end, "{compression}");
    }
    fs::write(&path, compressed(&plain, "brotli")).unwrap();
    let error = read(&path, &Kind::ALL).unwrap_err().to_string();
    assert!(
        error.ends_with("compressed with `brotli`; zstd, lz4 and none can be read: convert it with `mcap compress`")
    );
}

#[test]
fn messages_come_in_order_of_log_time_whatever_their_order_in_the_file() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.mcap");
    let mut shuffled = poses(100);
    shuffled.sort_by_key(|message| (message.log_time_ns / 10_000_000 * 37) % 101);
    assert_ne!(shuffled, poses(100));
    fs::write(&path, foreign(&shuffled, 0)).unwrap();
    assert_eq!(read_all(&path).messages, poses(100));
}

#[test]
fn a_file_cut_anywhere_gives_what_is_before_the_cut() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.mcap");
    let (messages, plain) = (poses(100), foreign(&poses(100), 0));
    for compression in ["", "zstd", "lz4"] {
        let whole = compressed(&plain, compression);
        let mut before = 0;
        for length in (8..whole.len()).step_by(7) {
            fs::write(&path, &whole[..length]).unwrap();
            let recording = read_all(&path);
            let n = recording.messages.len();
            assert!(!recording.has_end && recording.n_damaged == 0, "{compression} cut at {length}");
            assert!(n >= before, "{compression}: fewer messages of a longer file, {n} after {before}");
            assert_eq!(recording.messages, messages[..n]);
            let said =
                format!("{n} messages over {:.1} s were recovered", (10_000_000 * n.saturating_sub(1)) as f64 * 1e-9);
            assert!(recording.notes()[0].ends_with(&said), "{:?}", recording.notes());
            before = n;
        }
        assert_eq!(before, 100, "{compression}: all messages are before the summary");
    }
    // Uncompressed, no message is lost but the one that is cut: a third of the file has about a third of the messages.
    fs::write(&path, &plain[..plain.len() / 3]).unwrap();
    assert!((25..50).contains(&read_all(&path).messages.len()));
}

#[test]
fn a_chunk_that_its_recorder_never_closed_is_read_to_the_end_of_the_file() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.mcap");
    // A recorder that fills in lengths afterwards leaves the largest number there when it is killed.
    let mut bytes = foreign(&poses(15), 0);
    let chunk = starts(&bytes, mcap::records::op::CHUNK)[0];
    for length in [chunk + 1, chunk + 25, chunk + 41] {
        bytes[length..length + 8].fill(0xff);
    }
    bytes.truncate(chunk + 1200);
    fs::write(&path, &bytes).unwrap();
    let recording = read_all(&path);
    assert!((3..15).contains(&recording.messages.len()), "{}", recording.messages.len());
    assert_eq!(recording.messages, poses(15)[..recording.messages.len()]);
}

#[test]
fn a_damaged_chunk_is_left_out_and_counted() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.mcap");
    for compression in ["", "zstd", "lz4"] {
        let mut bytes = compressed(&foreign(&poses(100), 0), compression);
        // A bit in the second of five chunks.
        let chunks: Vec<usize> = starts(&bytes, mcap::records::op::CHUNK);
        bytes[chunks[1] + 100] ^= 0x10;
        fs::write(&path, &bytes).unwrap();
        let recording = read_all(&path);
        assert_eq!((recording.messages.len(), recording.n_damaged), (80, 1), "{compression}");
        assert!(recording.notes()[0].ends_with("1 damaged part(s) of the file were left out"));
    }
}

/// Places of the records with an operation code.
fn starts(file: &[u8], code: u8) -> Vec<usize> {
    let (mut at, mut found) = (8, Vec::new());
    while at + 9 < file.len() {
        let length = u64::from_le_bytes(file[at + 1..at + 9].try_into().unwrap()) as usize;
        if file[at] == code {
            found.push(at);
        }
        at += 9 + length;
    }
    found
}

#[test]
fn channels_of_other_programs_are_left_out_and_counted() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.mcap");
    fs::write(&path, foreign(&poses(100), 30)).unwrap();
    let recording = read_all(&path);
    assert_eq!(recording.messages, poses(100));
    let said = "30 messages on 1 channel(s) of other programs (/camera/info) were left out";
    assert!(recording.notes()[0].ends_with(said), "{:?}", recording.notes());
}

#[test]
fn empty_and_other_files_are_refused_with_a_sentence() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.mcap");
    for (content, said) in [
        ("", "a.mcap: the file is empty; the recorder ended before it wrote anything"),
        ("\u{89}", "a.mcap: not an MCAP file; expected a recording made by `plica record`"),
        ("time_s,tool\n", "a.mcap: not an MCAP file; expected a recording made by `plica record`"),
    ] {
        fs::write(&path, content).unwrap();
        let error = read(&path, &Kind::ALL).unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
    fs::write(&path, &mcap::MAGIC[..5]).unwrap();
    let error = read(&path, &Kind::ALL).unwrap_err().to_string();
    assert!(error.ends_with("the file ends within its first eight bytes; nothing can be recovered"), "{error}");
    let error = read(folder.path().join("none"), &Kind::ALL).unwrap_err().to_string();
    assert!(error.contains("none: cannot be read: No such file"), "{error}");
    assert!(read(folder.path(), &Kind::ALL).unwrap_err().to_string().ends_with("not a regular file"));
}

#[test]
fn keys_of_any_session_name_their_tool() {
    assert_eq!(tool_of("plica/v1/other/tool/probe/pose"), Some("probe"));
    assert_eq!(tool_of("plica/v1/other/tool/probe/wrench"), None);
    assert_eq!(Kind::of("plica/v1/main/status", true), None);
}
