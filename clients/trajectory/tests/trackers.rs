//! Motion files as trackers write them: times, separators, rows that cannot be played.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use plica_protocol::pose::gate;
use plica_trajectory::{BadRow, OnBadRow, QuaternionOrder, ReadOptions, TimeUnit, Trajectory, read};
use tempfile::TempDir;

const PLAIN: ReadOptions = ReadOptions { time_unit: None, quaternion_order: None, on_bad_row: OnBadRow::Error };
const SKIP: ReadOptions = ReadOptions { on_bad_row: OnBadRow::Skip, ..PLAIN };
const HEADER: &str = "time_s,tool,px,py,pz,qx,qy,qz,qw\n";

fn with(name: &str, text: &str, options: ReadOptions) -> Result<Trajectory, String> {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    read(&path, options, gate).map_err(|error| error.to_string().replace(&format!("{}/", folder.path().display()), ""))
}

/// A press of 1.5 s at 60 Hz: its times are `origin + unit * k / 60`, written with `n_digits` behind the point.
fn times(origin: f64, unit: f64, n_digits: usize) -> Vec<String> {
    (0..=90).map(|k| format!("{:.n_digits$}", origin + unit * f64::from(k) / 60.0)).collect()
}

fn height_m(k: usize) -> f64 {
    0.04 - 0.01 * (std::f64::consts::PI * k as f64 / 90.0).sin()
}

fn tum(times: &[String]) -> String {
    let mut text = String::new();
    times.iter().enumerate().for_each(|(k, t)| writeln!(text, "{t} 0.05 0.03 {} 0 0 0 1", height_m(k)).unwrap());
    text
}

fn csv(times: &[String]) -> String {
    let mut text = HEADER.to_owned();
    times.iter().enumerate().for_each(|(k, t)| writeln!(text, "{t},probe,0.05,0.03,{},0,0,0,1", height_m(k)).unwrap());
    text
}

fn plays_whole(motion: &Trajectory) {
    assert_eq!((motion.poses.len(), motion.poses[0].time_s), (91, 0.0));
    for (k, pose) in motion.poses.iter().enumerate() {
        assert!((pose.time_s - k as f64 / 60.0).abs() < 2e-6, "pose {k} plays at {} s", pose.time_s);
        assert!((pose.position_m[2] - height_m(k)).abs() < 1e-12);
    }
    assert!((motion.report.rate_hz.unwrap() - 60.0).abs() < 0.1, "{}", motion.report);
}

#[test]
fn times_of_any_unit_and_origin_play_from_zero() {
    let origins_s = [0.0, -0.75, 5.0, 86_400.0, 1_700_000_000.25];
    let units =
        [(TimeUnit::Seconds, 6), (TimeUnit::Milliseconds, 3), (TimeUnit::Microseconds, 0), (TimeUnit::Nanoseconds, 0)];
    for (unit, n_digits) in units {
        for origin_s in origins_s {
            let times = times(origin_s * unit.per_second(), unit.per_second(), n_digits);
            for (name, text) in [("a.tum", tum(&times)), ("a.csv", csv(&times))] {
                let motion = with(name, &text, PLAIN).unwrap();
                plays_whole(&motion);
                assert_eq!(motion.report.time_unit, unit, "{}", motion.report);
            }
        }
    }
}

#[test]
fn a_unit_that_is_asked_for_or_named_by_the_header_wins() {
    let rows = tum(&times(0.0, 1.0, 6));
    let asked = with("a.tum", &rows, ReadOptions { time_unit: Some(TimeUnit::Milliseconds), ..PLAIN }).unwrap();
    assert!((asked.report.duration_s - 1.5e-3).abs() < 1e-12 && !asked.report.time_unit_recognised);
    let named = csv(&times(0.0, 1e6, 0)).replace("time_s", "time_us");
    let named = with("a.csv", &named, PLAIN).unwrap();
    plays_whole(&named);
    assert!(!named.report.time_unit_recognised);
}

#[test]
fn a_unit_that_cannot_be_told_is_asked_for() {
    let rows: String = (0..500).map(|k| format!("{k} 0.05 0.03 0.04 0 0 0 1\n")).collect();
    let said = with("a.tum", &rows, PLAIN).unwrap_err();
    for part in ["a.tum: ", "500 rows, mostly 1 apart", "1 Hz in s or 1000 Hz in ms", "--time-unit s|ms"] {
        assert!(said.contains(part), "`{part}` in: {said}");
    }
    for (unit, duration_s) in [(TimeUnit::Seconds, 499.0), (TimeUnit::Milliseconds, 0.499)] {
        let motion = with("a.tum", &rows, ReadOptions { time_unit: Some(unit), ..PLAIN }).unwrap();
        assert!((motion.report.duration_s - duration_s).abs() < 1e-9);
    }
}

#[test]
fn a_step_is_exact_to_the_nanosecond_since_1970() {
    let text = "1700000000250000001 0 0 1 0 0 0 1\n1700000000254000003 0 0 1 0 0 0 1\n";
    let motion = with("a.tum", text, ReadOptions { time_unit: Some(TimeUnit::Nanoseconds), ..PLAIN }).unwrap();
    assert_eq!(motion.poses[1].time_s, 4_000_002.0 / 1e9);
}

#[test]
fn separators_line_ends_marks_and_comments_of_any_system_are_read() {
    let times = times(0.0, 1.0, 6);
    let (csv, tum) = (csv(&times), tum(&times));
    let european = |text: &str| text.replace(',', ";").replace('.', ",");
    let quoted = csv.replace("probe", "\"probe\"");
    let without_tool = csv.replace("tool,", "").replace("probe,", "");
    let tabbed_without_name = csv.replace("probe", "").replace(',', "\t");
    let files = [
        ("semicolon.csv", csv.replace(',', ";")),
        ("european.csv", european(&csv)),
        ("tabs.csv", csv.replace(',', "\t")),
        ("tabs-empty-tool.csv", tabbed_without_name),
        ("blanks.csv", csv.replace(',', " ")),
        ("quoted.csv", quoted),
        ("no-tool.csv", without_tool),
        ("spaced.csv", csv.replace(',', " , ")),
        ("bom.csv", format!("\u{feff}{csv}")),
        ("crlf.csv", csv.replace('\n', "\r\n")),
        ("cr.csv", csv.replace('\n', "\r")),
        ("comments.csv", format!("# by a tracker; 60 Hz, probe\n\n{csv}# the end\n")),
        ("bom.tum", format!("\u{feff}{tum}")),
        ("bom-comment.tum", format!("\u{feff}# time x y z\n{tum}")),
        ("tabs.tum", tum.replace(' ', "\t")),
        ("commas.tum", tum.replace(' ', ",")),
        ("no-header.csv", tum.replace(' ', ",")),
        ("semicolons.tum", tum.replace(' ', ";")),
        ("crlf.tum", tum.replace('\n', "\r\n")),
        ("percent.tum", format!("% exported\n{}", tum.replace('\n', " % seen\n"))),
        ("indented.tum", tum.replace('\n', "  \n   ")),
    ];
    for (name, text) in files {
        let motion = with(name, &text, PLAIN).unwrap_or_else(|error| panic!("{error}"));
        plays_whole(&motion);
    }
}

#[test]
fn a_header_of_other_columns_is_refused_with_its_separator_and_ours() {
    for header in ["time_s;tool;x;y;z;qx;qy;qz;qw", "Frame,Time (Seconds),X,Y,Z", "time_s|tool|px|py|pz|qx|qy|qz|qw"] {
        let said = with("a.csv", &format!("{header}\n0;;0;0;0;0;0;0;1\n"), PLAIN).unwrap_err();
        assert!(said.starts_with("a.csv:1: the header must be `time_s,tool,px,py,pz,qx,qy,qz,qw`"), "{said}");
        assert!(said.contains("`;` or tabs") && said.contains(header), "{said}");
    }
}

#[test]
fn quaternions_with_w_first_are_read_by_option_or_by_the_names_of_columns() {
    let text = "0 0.05 0.03 0.04 0.8 0 0 0.6\n0.01 0.05 0.03 0.04 0.8 0 0 0.6\n";
    let turned = [0.0, 0.0, 0.6, 0.8];
    let w_first = ReadOptions { quaternion_order: Some(QuaternionOrder::Wxyz), ..PLAIN };
    assert_eq!(with("a.tum", text, w_first).unwrap().poses[1].orientation_xyzw, turned);
    let named = "time_s,px,py,pz,qw,qx,qy,qz\n0,0.05,0.03,0.04,0.8,0,0,0.6\n";
    for options in [PLAIN, w_first] {
        assert_eq!(with("a.csv", named, options).unwrap().poses[0].orientation_xyzw, turned);
    }
}

/// Rows of the press with some of them exchanged: what a row becomes, and how it is counted.
fn exchanged(rows: &[(usize, &str)]) -> String {
    let mut lines: Vec<String> = tum(&times(100.0, 1.0, 6)).lines().map(str::to_owned).collect();
    for (k, row) in rows {
        let time = lines[*k].split(' ').next().unwrap().to_owned();
        lines[*k] = row.replace('T', &time);
    }
    lines.join("\n")
}

#[test]
fn rows_that_cannot_be_played_are_refused_with_their_line_or_left_out_and_counted() {
    let lost = "T 0 0 0 0 0 0 1";
    let cases: [(&[(usize, &str)], BadRow); 14] = [
        (&[(40, "T nan nan nan nan nan nan nan")], BadRow::NotFinite),
        (&[(40, "nan 0.05 0.03 0.04 0 0 0 1")], BadRow::NotFinite),
        (&[(40, "T 0.05 inf 0.04 0 0 0 1")], BadRow::NotFinite),
        (&[(40, "T 0 0 0 0 0 0 0"), (41, "T 0.05 0.03 0.04 0 0 0 0")], BadRow::Lost),
        (&[(40, lost), (41, lost), (42, lost)], BadRow::Lost),
        (&[(0, lost), (1, lost)], BadRow::Lost),
        (&[(89, lost), (90, lost)], BadRow::Lost),
        (&[(40, "T 0.05 0.03 0.04 0 0 0 3")], BadRow::Refused),
        (&[(40, "T -3.69e28 -3.69e28 -3.69e28 0 0 0 1")], BadRow::Refused),
        (&[(40, "T MISSING 0.03 0.04 0 0 0 1")], BadRow::Unreadable),
        (&[(90, "T 0.05 0.0")], BadRow::Unreadable),
        (&[(40, "100.650000 0.05 0.03 0.04 0 0 0 1")], BadRow::Duplicate),
        (&[(40, "100.1 0.05 0.03 0.04 0 0 0 1"), (60, "100.2 0.05 0.03 0.04 0 0 0 1")], BadRow::OutOfOrder),
        (&[(40, "99999 0.05 0.03 0.04 0 0 0 1")], BadRow::OutOfOrder),
    ];
    for (rows, kind) in cases {
        let text = exchanged(rows);
        let refused = with("a.tum", &text, PLAIN).unwrap_err();
        // A time far ahead shows in the row after it.
        let line = rows[0].0 + 1;
        let named = [line, line + 1].iter().any(|line| refused.starts_with(&format!("a.tum:{line}: ")));
        assert!(named && refused.contains("--on-bad-row skip"), "{rows:?}: {refused}");
        let motion = with("a.tum", &text, SKIP).unwrap();
        assert_eq!(motion.report.skipped, [(kind, rows.len() as u64)].into(), "{rows:?}");
        assert_eq!((motion.report.rows, motion.report.poses), (91, 91 - rows.len() as u64));
        assert!(motion.poses.iter().all(|p| p.position_m[0] == 0.05), "{rows:?}: the tool leaves its line");
        assert!(motion.poses.windows(2).all(|pair| pair[0].time_s < pair[1].time_s));
        assert!(motion.report.to_string().contains(&format!("left out of 91 rows: {} ", rows.len())));
    }
}

#[test]
fn an_empty_column_of_a_csv_is_a_row_without_sight_of_the_tool() {
    let text = csv(&times(0.0, 1.0, 6)).replace("0.05,0.03,0.04,", ",,,");
    let motion = with("a.csv", &text, SKIP).unwrap();
    assert_eq!(motion.report.skipped, [(BadRow::Empty, 2)].into(), "the first row and the last one");
    assert!(with("a.csv", &text, PLAIN).unwrap_err().starts_with("a.csv:2: `px` is empty; "));
}

#[test]
fn a_motion_that_starts_at_the_origin_of_its_own_frame_is_seen_there() {
    let rows: String =
        (0..50).map(|k| format!("{} {} 0 0 0 0 0 1\n", 0.01 * f64::from(k), 1e-3 * f64::from(k))).collect();
    let motion = with("a.tum", &rows, PLAIN).unwrap();
    assert_eq!((motion.poses.len(), motion.report.n_skipped()), (50, 0));
    // And one that passes through it.
    let rows: String =
        (0..50).map(|k| format!("{} {} 0 0 0 0 0 1\n", 0.01 * f64::from(k), 1e-3 * f64::from(k - 25))).collect();
    assert_eq!(with("a.tum", &rows, PLAIN).unwrap().poses.len(), 50);
}

#[test]
fn a_gap_is_counted_and_the_tool_is_held() {
    let text: String = tum(&times(0.0, 1.0, 6))
        .lines()
        .enumerate()
        .filter(|(k, _)| !(30..50).contains(k))
        .fold(String::new(), |text, (_, line)| text + line + "\n");
    let motion = with("a.tum", &text, PLAIN).unwrap();
    assert_eq!((motion.poses.len(), motion.report.gaps), (71, 1));
    assert!((motion.report.longest_step_s - 21.0 / 60.0).abs() < 1e-5);
    assert!(motion.report.to_string().contains("1 gaps in which the tool is held, the longest 0.350 s"));
}

#[test]
fn a_clock_that_starts_again_is_refused_even_where_rows_may_be_left_out() {
    let text = tum(&times(0.0, 1.0, 6)) + &tum(&times(0.0, 1.0, 6));
    let said = with("a.tum", &text.replacen("0.000000", "0.000001", 1), SKIP).unwrap_err();
    assert!(said.contains("the clock starts again; split the file"), "{said}");
}

#[test]
fn rows_of_two_tools_are_judged_by_tool() {
    let row = |t: f64, tool: &str, x: f64| format!("{t},{tool},{x},0.03,0.04,0,0,0,1\n");
    let block = |tool: &str, x: f64| (0..20).fold(String::new(), |text, k| text + &row(f64::from(k) / 60.0, tool, x));
    let text = format!("{HEADER}{}{}", block("left", 0.05), block("right", 0.07));
    let motion = with("a.csv", &text, SKIP).unwrap();
    assert_eq!((motion.poses.len(), motion.report.n_skipped()), (40, 0));
    assert!(motion.poses.windows(2).all(|pair| pair[0].time_s <= pair[1].time_s));
    assert!(with("a.csv", &text, PLAIN).unwrap_err().contains("a.csv:22: time 0 is before that of line 21"));
}

#[test]
fn nothing_to_play_is_an_error_with_the_first_reason() {
    let said = with("a.tum", "0 nan 0 0 0 0 0 1\n1 0 0 0 0 0 0 0\n", SKIP).unwrap_err();
    assert_eq!(said, "a.tum:1: no row can be played: `tx` is `nan`, expected a finite number");
}

/// Folder of shared inputs beside the repository, if there is one.
fn shared(folder: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared").join(folder);
    let found = path.exists().then_some(path);
    if found.is_none() {
        println!("skipped: no {folder} beside the repository");
    }
    found
}

#[test]
fn each_case_of_a_motion_file_plays_or_says_what_is_wrong() {
    let Some(folder) = shared("cases/poses") else { return };
    type Expected = Result<(usize, f64), &'static str>;
    let cases: [(&str, Expected); 9] = [
        ("ms.tum", Ok((91, 1.5))),
        ("epoch.csv", Ok((91, 1.5))),
        ("epoch_ns.csv", Ok((91, 1.5))),
        ("negative.csv", Ok((91, 1.5))),
        ("late.csv", Ok((91, 1.5))),
        ("bom.tum", Ok((91, 1.5))),
        ("semicolon.csv", Ok((91, 1.5))),
        ("lost.tum", Err("41: the tool jumps to the origin: the tracker did not see it")),
        ("dup.tum", Err("41: a second pose of the same tool at 0.65, as in line 40")),
    ];
    for (name, expected) in cases {
        let read = read(folder.join(name), PLAIN, gate);
        match expected {
            Ok((n_poses, duration_s)) => {
                let motion = read.unwrap();
                assert_eq!(motion.poses.len(), n_poses, "{name}");
                assert!((motion.report.duration_s - duration_s).abs() < 1e-4, "{name}: {}", motion.report);
            }
            Err(part) => {
                let said = read.unwrap_err().to_string();
                assert!(said.contains(&format!("{name}:{part}")), "{said}");
            }
        }
    }
    let counted = |name: &str| read(folder.join(name), SKIP, gate).unwrap().report.skipped;
    assert_eq!(counted("lost.tum"), [(BadRow::Lost, 12)].into());
    assert_eq!(counted("dup.tum"), [(BadRow::Duplicate, 1)].into());
}

#[test]
fn a_published_hand_motion_is_read_whole() {
    let Some(folder) = shared("data/poses") else { return };
    let motion = read(folder.join("handheld_xyz.tum"), PLAIN, gate).unwrap();
    assert_eq!((motion.report.rows, motion.report.n_skipped()), (motion.report.poses, 0));
    assert!(
        motion.report.duration_s > 30.0 && (motion.report.rate_hz.unwrap() - 100.0).abs() < 1.0,
        "{}",
        motion.report
    );
    println!("{}", motion.report);
}
