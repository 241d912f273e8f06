//! Trajectory files: what is read, what is refused and where, and how a motion is fitted into a workspace.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use plica_protocol::pose::gate;
use plica_trajectory::{ReadOptions, Terrain, TrackedPose, Workspace, fit, fit_above, fitted_depth_m, read};
use tempfile::TempDir;

fn read_text(name: &str, text: &str) -> Result<Vec<TrackedPose>, String> {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    let folder = format!("{}/", folder.path().display());
    let read = read(&path, ReadOptions::default(), gate);
    read.map(|motion| motion.poses).map_err(|error| error.to_string().replace(&folder, ""))
}

/// What an error of a bad row ends with.
const SKIP: &str = "; mend the row, or leave out such rows with --on-bad-row skip (in a scene: on_bad_row = \"skip\")";

const HEADER: &str = "time_s,tool,px,py,pz,qx,qy,qz,qw\n";

#[test]
fn csv_of_two_tools() {
    let rows = "0,left,0,0,0.1,0,0,0,1\n0,right,1,0,0,0,0,0,1\n# a note\n0.004, left ,0,0,0.09,0,0,0.6,0.8\n";
    let poses = read_text("a.csv", &format!("{HEADER}{rows}")).unwrap();
    assert_eq!(poses.len(), 3);
    assert_eq!(poses[1].tool.as_deref(), Some("right"));
    let last = TrackedPose {
        time_s: 0.004,
        tool: Some("left".to_owned()),
        position_m: [0.0, 0.0, 0.09],
        orientation_xyzw: [0.0, 0.0, 0.6, 0.8],
    };
    assert_eq!(poses[2], last);
}

#[test]
fn csv_without_tool_names_and_without_the_extension() {
    let poses = read_text("poses", &format!("{HEADER}0.5,,0,0,0,0,0,0,1\n")).unwrap();
    assert_eq!((poses[0].time_s, &poses[0].tool), (0.0, &None));
}

#[test]
fn tum_starts_at_zero_and_is_normalised() {
    let text =
        "# timestamp tx ty tz qx qy qz qw\n1305031098.50 1.3 0.6 1.6 0.0 0.0 0.0 1.004\n1305031098.75 1 2 3 0 0 0 1\n";
    let poses = read_text("a.tum", text).unwrap();
    assert_eq!((poses[0].time_s, poses[1].time_s), (0.0, 0.25));
    assert_eq!(poses[0].orientation_xyzw, [0.0, 0.0, 0.0, 1.0]);
    assert_eq!((poses[1].position_m, &poses[1].tool), ([1.0, 2.0, 3.0], &None));
}

#[test]
fn faults_name_file_and_line() {
    let said = |name: &str, text: &str| {
        let error = read_text(name, text).unwrap_err();
        error.strip_suffix(SKIP).map_or_else(|| format!("{error} (no remedy)"), str::to_owned)
    };
    let csv = |rows: &str| said("a.csv", &format!("{HEADER}{rows}"));
    let tum = |rows: &str| said("a.tum", rows);
    assert_eq!(csv("0,a,0,0,x,0,0,0,1\n"), "a.csv:2: `pz` is `x`, expected a number");
    assert_eq!(csv("0,a,0,0,nan,0,0,0,1\n"), "a.csv:2: `pz` is `nan`, expected a finite number");
    assert_eq!(csv("0,a,0,0,,0,0,0,1\n"), "a.csv:2: `pz` is empty");
    assert_eq!(csv("0,a,0,0,0,0,0,0,1\n0.1,a,0,0,0\n"), "a.csv:3: 5 columns, expected 9");
    assert_eq!(
        csv("0,a,0,0,0,0,0,0,1\n0,a,0,0,0,0,0,0,1\n"),
        "a.csv:3: a second pose of the same tool at 0, as in line 2"
    );
    assert_eq!(csv("1,a,0,0,0,0,0,0,1\n0,b,0,0,0,0,0,0,1\n"), "a.csv:3: time 0 is before that of line 2 (1)");
    assert_eq!(csv("0,a,0,0,0,0,0,0,2\n"), "a.csv:2: orientation has length 2, expected 1 within 0.01");
    assert_eq!(csv("0,a,2000,0,0,0,0,0,1\n"), "a.csv:2: `position` is 2000, at most 1000 is accepted");
    assert!(csv("0,a/b,0,0,0,0,0,0,1\n").starts_with("a.csv:2: `a/b` is not a name"));
    assert_eq!(tum("0 1 2 3\n"), "a.tum:1: 4 columns, expected `timestamp tx ty tz qx qy qz qw`");
    assert_eq!(tum("# x\n0 1 2 3 0 0 0 one\n"), "a.tum:2: `qw` is `one`, expected a number");
    for empty in ["", HEADER] {
        assert_eq!(read_text("a.csv", empty).unwrap_err(), "a.csv: the file has no poses");
    }
    assert_eq!(read_text("a.tum", "# nothing\n\n").unwrap_err(), "a.tum: the file has no poses");
    assert!(read_text("a.csv", "t,x\n").unwrap_err().starts_with("a.csv:1: the header must be `time_s,tool,px"));
    let error = read("no/such/file.csv", ReadOptions::default(), gate).unwrap_err();
    assert!(error.to_string().starts_with("no/such/file.csv: "));
}

#[test]
fn a_file_that_is_no_text() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.tum");
    let said = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        read(&path, ReadOptions::default(), gate).unwrap_err().to_string()
    };
    assert!(said(b"0 0 0 0 0 0 0 1\n\xff\xfe\n").ends_with("a.tum:2: not text"));
    assert!(said(b"\xff\xfe0\0 \0").ends_with("a.tum:1: the file is UTF-16; save it as UTF-8"));
}

fn at(positions_m: &[[f64; 3]]) -> Vec<TrackedPose> {
    let pose = |(i, p): (usize, &[f64; 3])| TrackedPose {
        time_s: i as f64,
        tool: None,
        position_m: *p,
        orientation_xyzw: [0.0, 0.6, 0.0, 0.8],
    };
    positions_m.iter().enumerate().map(pose).collect()
}

const ROOM: Workspace = Workspace { min_m: [0.0, 0.0, 0.0], max_m: [0.1, 0.2, 0.3] };

#[test]
fn fit_has_one_scale_and_fills_the_tightest_axis() {
    let mut poses = at(&[[1.0, 1.0, 1.0], [3.0, 2.0, 1.5], [2.0, 1.0, 1.0]]);
    let done = fit(&mut poses, ROOM).unwrap();
    assert!((done.scale - 0.05).abs() < 1e-15);
    let expected = [[0.0, 0.075, 0.1375], [0.1, 0.125, 0.1625], [0.05, 0.075, 0.1375]];
    for (pose, expected) in poses.iter().zip(expected) {
        (0..3).for_each(|i| assert!((pose.position_m[i] - expected[i]).abs() < 1e-15, "{pose:?}"));
        assert_eq!(pose.orientation_xyzw, [0.0, 0.0, 0.0, 1.0]);
    }
}

#[test]
fn fit_starts_upright_and_turns_as_the_hand_turned() {
    let half = 0.5_f64.sqrt();
    let mut poses = at(&[[0.0; 3], [1.0; 3]]);
    // A quarter turn about x, then one about the world's z on top of it.
    poses[0].orientation_xyzw = [half, 0.0, 0.0, half];
    poses[1].orientation_xyzw = [0.5, 0.5, 0.5, 0.5];
    fit(&mut poses, ROOM).unwrap();
    for (pose, expected) in poses.iter().zip([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, half, half]]) {
        (0..4).for_each(|i| assert!((pose.orientation_xyzw[i] - expected[i]).abs() < 1e-15, "{pose:?}"));
    }
}

#[test]
fn fit_of_a_line_and_of_a_point() {
    let mut line = at(&[[0.0, 0.0, 5.0], [0.0, 0.0, 6.0]]);
    assert!((fit(&mut line, ROOM).unwrap().scale - 0.3).abs() < 1e-15);
    assert_eq!(line[0].position_m[..2], [0.05, 0.1]);
    let mut point = at(&[[7.0, 8.0, 9.0]]);
    assert_eq!(fit(&mut point, ROOM).unwrap().scale, 1.0);
    assert_eq!(point[0].position_m, [0.05, 0.1, 0.15]);
    assert_eq!(fit(&mut [], ROOM).unwrap().scale, 1.0);
}

#[test]
fn a_workspace_needs_room() {
    for max_m in [[0.1, 0.0, 0.1], [-0.1, 0.1, 0.1], [f64::NAN; 3], [f64::INFINITY; 3]] {
        let error = fit(&mut at(&[[0.0; 3]]), Workspace { min_m: [0.0; 3], max_m }).unwrap_err();
        assert!(error.to_string().contains("has no room"), "{error}");
    }
}

/// 100 x 60 mm, from 40 mm high at x = 0 to 10 mm.
fn slope() -> Terrain {
    let corners = [[0.0, 0.0, 0.04], [0.1, 0.0, 0.01], [0.1, 0.06, 0.01], [0.0, 0.06, 0.04], [0.0; 3]];
    Terrain::new(&corners, &[[0, 1, 2], [0, 2, 3], [0, 3, 4]]).unwrap()
}

#[test]
fn a_motion_fitted_above_an_object_presses_as_deep_as_asked_and_no_deeper() {
    let slope = slope();
    assert!((fitted_depth_m(&slope) - 0.3 * 0.025).abs() < 1e-9);
    for flat in [0.1, 10.0] {
        let mut poses = at(&[[0.0, 0.0, 1.0], [4.0, 1.0, 1.0 + flat], [4.0, 0.0, 1.0], [0.0, 1.0, 1.0]]);
        let done = fit_above(&mut poses, &slope, 0.007, 0.005).unwrap();
        let depth = |p: &TrackedPose| p.position_m[0] * 0.3 - 0.04 + p.position_m[2] - 0.007;
        let lowest = poses.iter().map(depth).fold(f64::INFINITY, f64::min);
        assert!((lowest + 0.005).abs() < 1e-6, "{lowest}");
        assert!(poses.iter().all(|p| (0.0249..0.0751).contains(&p.position_m[0])), "{poses:?}");
        let first = done.to_m[2] + done.scale * (1.0 - done.from_m[2]);
        assert!((poses[0].position_m[2] - first).abs() < 1e-12, "what it says it did");
    }
}
