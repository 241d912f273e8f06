//! Reading trajectory files.

use std::collections::HashMap;
use std::path::Path;

use crate::error::TrajectoryError;
use crate::pose::{CSV_HEADER, TrackedPose};

const TUM_COLUMNS: [&str; 8] = ["timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw"];

/// Check of a pose: maps tool, position \[m\] and orientation `xyzw` of a line to the normalised orientation, or to a sentence
/// why the line is refused.
pub trait Gate: Fn(Option<&str>, [f64; 3], [f64; 4]) -> Result<[f64; 4], String> {}

impl<F: Fn(Option<&str>, [f64; 3], [f64; 4]) -> Result<[f64; 4], String>> Gate for F {}

/// Reads a trajectory, CSV or TUM (see the crate). The result has at least one pose, and each has passed `gate`.
///
/// # Errors
/// [`TrajectoryError`] with file and line.
pub fn read(path: impl AsRef<Path>, gate: impl Gate) -> Result<Vec<TrackedPose>, TrajectoryError> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|source| TrajectoryError::Io { path: path.to_owned(), source })?;
    let at_line = |(line, message)| TrajectoryError::Line { path: path.to_owned(), line, message };
    let text = std::str::from_utf8(&bytes).map_err(|error| at_line(not_text(&bytes, error.valid_up_to())))?;
    let numbered = if is_csv(path, text) { csv_poses(text, &gate) } else { tum_poses(text, &gate) }.map_err(at_line)?;
    check_order(&numbered).map_err(at_line)?;
    if numbered.is_empty() {
        return Err(TrajectoryError::Empty { path: path.to_owned() });
    }
    Ok(numbered.into_iter().map(|(_, pose)| pose).collect())
}

/// Line number, from 1 on, and error.
type Fault = (u64, String);

fn not_text(bytes: &[u8], at: usize) -> Fault {
    let line = 1 + bytes[..at].iter().filter(|byte| **byte == b'\n').count() as u64;
    (line, "not text".to_owned())
}

fn is_csv(path: &Path, text: &str) -> bool {
    let content = |line: &&str| !line.trim().is_empty() && !line.trim_start().starts_with('#');
    let named_csv = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
    named_csv || text.lines().find(content).is_some_and(|line| line.contains(','))
}

fn csv_poses(text: &str, gate: &impl Gate) -> Result<Vec<(u64, TrackedPose)>, Fault> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(text.as_bytes());
    let header = reader.headers().map_err(csv_fault)?;
    if header != CSV_HEADER.as_slice() {
        return Err((1, format!("the header must be `{}`", CSV_HEADER.join(","))));
    }
    reader.into_records().map(|record| csv_pose(&record.map_err(csv_fault)?, gate)).collect()
}

fn csv_fault(error: csv::Error) -> Fault {
    let line = error.position().map_or(1, csv::Position::line);
    let message = match error.kind() {
        csv::ErrorKind::UnequalLengths { len, expected_len, .. } => format!("{len} columns, expected {expected_len}"),
        _ => error.to_string(),
    };
    (line, message)
}

fn csv_pose(record: &csv::StringRecord, gate: &impl Gate) -> Result<(u64, TrackedPose), Fault> {
    let line = record.position().map_or(0, csv::Position::line);
    let number = |i: usize| number(CSV_HEADER[i], &record[i]).map_err(|message| (line, message));
    let tool = Some(&record[1]).filter(|name| !name.is_empty());
    let mut values = [0.0; 8];
    for (value, column) in values.iter_mut().zip([0, 2, 3, 4, 5, 6, 7, 8]) {
        *value = number(column)?;
    }
    let pose = checked(values, tool, gate).map_err(|message| (line, message))?;
    Ok((line, pose))
}

fn tum_poses(text: &str, gate: &impl Gate) -> Result<Vec<(u64, TrackedPose)>, Fault> {
    let mut poses = Vec::new();
    for (line, content) in (1..).zip(text.lines()) {
        let content = content.split('#').next().unwrap_or_default().trim();
        if !content.is_empty() {
            poses.push((line, tum_pose(content, gate).map_err(|message| (line, message))?));
        }
    }
    let start_s = poses.first().map_or(0.0, |(_, pose)| pose.time_s);
    poses.iter_mut().for_each(|(_, pose)| pose.time_s -= start_s);
    Ok(poses)
}

fn tum_pose(content: &str, gate: &impl Gate) -> Result<TrackedPose, String> {
    let columns: Vec<&str> = content.split_whitespace().collect();
    let columns: [&str; 8] = columns
        .try_into()
        .map_err(|got: Vec<&str>| format!("{} columns, expected `{}`", got.len(), TUM_COLUMNS.join(" ")))?;
    let mut values = [0.0; 8];
    for (i, value) in values.iter_mut().enumerate() {
        *value = number(TUM_COLUMNS[i], columns[i])?;
    }
    checked(values, None, gate)
}

fn number(column: &str, text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("`{column}` is `{text}`, expected a number"))?;
    value.is_finite().then_some(value).ok_or_else(|| format!("`{column}` is `{text}`, expected a finite number"))
}

/// `[time, position, orientation]` through the gate.
fn checked(values: [f64; 8], tool: Option<&str>, gate: &impl Gate) -> Result<TrackedPose, String> {
    let [time_s, px, py, pz, qx, qy, qz, qw] = values;
    let position_m = [px, py, pz];
    let orientation_xyzw = gate(tool, position_m, [qx, qy, qz, qw])?;
    Ok(TrackedPose { time_s, tool: tool.map(str::to_owned), position_m, orientation_xyzw })
}

fn check_order(poses: &[(u64, TrackedPose)]) -> Result<(), Fault> {
    let mut newest_s = f64::NEG_INFINITY;
    let mut newest_of_tool: HashMap<Option<&str>, f64> = HashMap::new();
    for (line, pose) in poses {
        if pose.time_s < newest_s {
            return Err((*line, format!("time {} s is before the line above it ({newest_s} s)", pose.time_s)));
        }
        newest_s = pose.time_s;
        if newest_of_tool.insert(pose.tool.as_deref(), newest_s).is_some_and(|before| before >= newest_s) {
            return Err((*line, format!("a second pose of the same tool at {newest_s} s")));
        }
    }
    Ok(())
}
