//! Reading motion files.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use crate::error::TrajectoryError;
use crate::gate::Gate;
use crate::layout::Layout;
use crate::options::{OnBadRow, QuaternionOrder, ReadOptions};
use crate::order::{first_step_back, judge};
use crate::pose::TrackedPose;
use crate::report::{BadRow, MotionReport};
use crate::rows::{Fault, Row, Rows, content_lines, read_rows};
use crate::time::{Stamp, TimeUnit, recognise};

/// A step is a gap if it takes this many medians ...
const GAP_MEDIANS: f64 = 10.0;
/// ... and this long \[s\].
const GAP_S: f64 = 0.1;
/// What else can be done about a row that cannot be played.
const SKIP: &str = "mend the row, or leave out such rows with --on-bad-row skip (in a scene: on_bad_row = \"skip\")";

/// A motion from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// At least one pose, in order of time; the first is at 0.
    pub poses: Vec<TrackedPose>,
    /// What the file held.
    pub report: MotionReport,
}

/// Reads a motion file, CSV or TUM (see the crate). Each pose has passed `gate`.
///
/// # Errors
/// [`TrajectoryError`] with file and line.
pub fn read(path: impl AsRef<Path>, options: ReadOptions, gate: impl Gate) -> Result<Trajectory, TrajectoryError> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|source| TrajectoryError::Io { path: path.to_owned(), source })?;
    let at_line = |(line, message)| TrajectoryError::Line { path: path.to_owned(), line, message };
    let text = text_of(&bytes).map_err(at_line)?;
    let empty = || TrajectoryError::Empty { path: path.to_owned() };
    let mut lines = content_lines(&text).peekable();
    let Some(&(first_line, first)) = lines.peek() else { return Err(empty()) };
    let named_csv = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
    let layout = Layout::of(first, named_csv).map_err(|message| at_line((first_line, message)))?;
    // Named columns are in place already; the option is for columns that are named otherwise, or not at all.
    let order = options.quaternion_order.filter(|_| !layout.names_w_first).unwrap_or(QuaternionOrder::Xyzw);
    let rows = read_rows(lines.skip(usize::from(layout.has_header)), &layout, order, &gate);
    let rows = playable(rows, options.on_bad_row).map_err(at_line)?;
    let first = rows.good.first().ok_or_else(empty)?.stamp;
    let steps = steps(&rows.good);
    let asked = options.time_unit.or(layout.time_unit);
    let unit = time_unit(asked, first, &steps, rows.good.len());
    let unit = unit.map_err(|message| TrajectoryError::TimeUnit { path: path.to_owned(), message })?;
    let report = MotionReport {
        time_unit_recognised: asked.is_none(),
        quaternion_order: if layout.names_w_first { QuaternionOrder::Wxyz } else { order },
        quaternion_order_assumed: !layout.names_w_first && options.quaternion_order.is_none(),
        ..report(&rows, unit, &steps)
    };
    let poses = rows.good.into_iter().map(|row| pose(row, first, unit)).collect();
    Ok(Trajectory { poses, report })
}

/// A line number, from 1 on, and a sentence.
type AtLine = (u64, String);

/// The text without byte-order mark, with one kind of line end.
fn text_of(bytes: &[u8]) -> Result<String, AtLine> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err((1, "the file is UTF-16; save it as UTF-8".to_owned()));
    }
    let text = std::str::from_utf8(bytes).map_err(|error| not_text(bytes, error.valid_up_to()))?;
    Ok(text.strip_prefix('\u{feff}').unwrap_or(text).replace("\r\n", "\n").replace('\r', "\n"))
}

fn not_text(bytes: &[u8], at: usize) -> AtLine {
    let line = 1 + bytes[..at].iter().filter(|byte| **byte == b'\n').count() as u64;
    (line, "not text".to_owned())
}

/// The rows that are played, or the first row that cannot be, as the policy has it.
fn playable(rows: Rows, policy: OnBadRow) -> Result<Rows, AtLine> {
    let step_back = first_step_back(&rows.good);
    let judged = judge(rows);
    // A row out of order is named by the place where time goes back, whichever of the two rows is wrong.
    let in_order = judged.bad.iter().filter(|fault| step_back.is_none() || fault.kind != BadRow::OutOfOrder);
    let first = in_order.chain(&step_back).min_by_key(|fault| fault.line);
    let refused = |fault: &Fault| (fault.line, format!("{}; {SKIP}", fault.message));
    match (policy, first) {
        (OnBadRow::Error, Some(fault)) => Err(refused(fault)),
        (OnBadRow::Skip, Some(fault)) if judged.good.is_empty() => {
            Err((fault.line, format!("no row can be played: {}", fault.message)))
        }
        _ => clock_runs_on(judged),
    }
}

/// A clock that starts again in the midst of a file leaves no order to be had by leaving out rows.
fn clock_runs_on(rows: Rows) -> Result<Rows, AtLine> {
    let mut back = rows.bad.iter().filter(|fault| fault.kind == BadRow::OutOfOrder);
    let n_back = back.clone().count();
    match back.next() {
        Some(fault) if 2 * n_back > rows.good.len() => {
            let message =
                format!("{}, and {} more rows: the clock starts again; split the file", fault.message, n_back - 1);
            Err((fault.line, message))
        }
        _ => Ok(rows),
    }
}

/// Steps between poses of a tool in the file's unit, the shortest first.
fn steps(rows: &[Row]) -> Vec<f64> {
    let mut newest: HashMap<Option<&str>, Stamp> = HashMap::new();
    let step = |row: &Row, before: Option<Stamp>| before.map(|before| row.stamp.since(before));
    let mut steps: Vec<f64> =
        rows.iter().filter_map(|row| step(row, newest.insert(row.tool.as_deref(), row.stamp))).collect();
    steps.sort_by(f64::total_cmp);
    steps
}

fn median(sorted: &[f64]) -> Option<f64> {
    sorted.get(sorted.len() / 2).copied()
}

fn time_unit(asked: Option<TimeUnit>, first: Stamp, steps: &[f64], n_rows: usize) -> Result<TimeUnit, String> {
    let (None, Some(step)) = (asked, median(steps)) else { return Ok(asked.unwrap_or(TimeUnit::Seconds)) };
    recognise(first.value(), step, n_rows).map_err(|possible| {
        let rate = |unit: &TimeUnit| format!("{} Hz in {}", digits(unit.per_second() / step), unit.name());
        let rates: Vec<_> = possible.iter().map(rate).collect();
        let names: Vec<_> = possible.iter().map(|unit| unit.name()).collect();
        format!(
            "the unit of its times cannot be told: {n_rows} rows, mostly {} apart, are {}; say it with --time-unit {} (in \
             a scene: time_unit)",
            digits(step),
            rates.join(" or "),
            names.join("|")
        )
    })
}

/// Three significant digits at least, no digits that say nothing.
fn digits(value: f64) -> String {
    if (0.01..1e6).contains(&value) { format!("{}", (value * 1e3).round() / 1e3) } else { format!("{value:.2e}") }
}

fn report(rows: &Rows, unit: TimeUnit, steps: &[f64]) -> MotionReport {
    let seconds = |time: f64| time / unit.per_second();
    let gap_s = median(steps).map_or(f64::INFINITY, |step| (GAP_MEDIANS * seconds(step)).max(GAP_S));
    let mut skipped = BTreeMap::new();
    rows.bad.iter().for_each(|fault| *skipped.entry(fault.kind).or_insert(0) += 1);
    let ends = rows.good.first().zip(rows.good.last());
    MotionReport {
        rows: (rows.good.len() + rows.bad.len()) as u64,
        poses: rows.good.len() as u64,
        time_unit: unit,
        time_unit_recognised: false,
        quaternion_order: QuaternionOrder::Xyzw,
        quaternion_order_assumed: false,
        first_time: ends.map_or(0.0, |(first, _)| first.stamp.value()),
        duration_s: ends.map_or(0.0, |(first, last)| seconds(last.stamp.since(first.stamp))),
        rate_hz: median(steps).map(|step| 1.0 / seconds(step)),
        gaps: steps.iter().filter(|step| seconds(**step) > gap_s).count() as u64,
        longest_step_s: steps.last().map_or(0.0, |step| seconds(*step)),
        skipped,
    }
}

fn pose(row: Row, first: Stamp, unit: TimeUnit) -> TrackedPose {
    TrackedPose {
        time_s: row.stamp.since(first) / unit.per_second(),
        tool: row.tool,
        position_m: row.position_m,
        orientation_xyzw: row.orientation_xyzw,
    }
}
