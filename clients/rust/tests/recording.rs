//! A recording gives back what was put into it.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use plica_client::protocol::pose::Pose;
use plica_client::protocol::wrench::Wrench;
use plica_client::recording::{Kind, Recorded, Recorder, read, tool_of};
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

#[test]
fn what_goes_in_comes_out() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.mcap");
    let mut recorder = Recorder::create(&path).unwrap();
    some_messages().iter().for_each(|message| recorder.write(message).unwrap());
    recorder.finish().unwrap();
    let back: Vec<Recorded> = read(&path).unwrap().map(Result::unwrap).collect();
    assert_eq!(back, some_messages());
}

#[test]
fn a_file_cut_short_gives_its_beginning_and_an_error() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.mcap");
    let mut recorder = Recorder::create(&path).unwrap();
    some_messages().iter().for_each(|message| recorder.write(message).unwrap());
    recorder.finish().unwrap();
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, &whole[..whole.len() - 1_000_000]).unwrap();
    let results: Vec<_> = read(&path).unwrap().collect();
    assert!(results.last().unwrap().is_err());
    let error = results.last().unwrap().as_ref().unwrap_err().to_string();
    assert!(error.contains("a.mcap: "), "{error}");
}

#[test]
fn other_files_are_refused() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.mcap");
    std::fs::write(&path, "time_s,tool\n").unwrap();
    assert!(read(&path).unwrap().next().unwrap().is_err());
    assert!(read(folder.path().join("none")).is_err());
}

#[test]
fn keys_of_any_session_name_their_tool() {
    assert_eq!(tool_of("plica/v1/other/tool/probe/pose"), Some("probe"));
    assert_eq!(tool_of("plica/v1/other/tool/probe/wrench"), None);
    assert_eq!(Kind::of("plica/v1/main/status", true), None);
}
