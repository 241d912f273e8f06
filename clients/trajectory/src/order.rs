//! Rows judged by their neighbours: tools out of sight, times that repeat or go back.

use std::collections::HashMap;

use crate::report::BadRow;
use crate::rows::{Fault, Row, Rows};

/// A step to or from the origin this many times longer than any other step of the tool is no motion.
const NO_MOTION: f64 = 4.0;

/// Moves rows that their neighbours make unplayable from the good ones to the bad ones. Good rows are then in order of time,
/// which rises within each tool.
pub(crate) fn judge(rows: Rows) -> Rows {
    let Rows { good, mut bad } = rows;
    let mut kept = Vec::with_capacity(good.len());
    for rows in by_tool(good) {
        let (seen, lost) = part(rows, is_lost);
        bad.extend(lost.into_iter().map(|row| fault(&row, BadRow::Lost, LOST.to_owned())));
        kept.extend(rising(seen, &mut bad));
    }
    kept.sort_by(|a, b| a.stamp.since(b.stamp).total_cmp(&0.0).then(a.line.cmp(&b.line)));
    bad.sort_by_key(|fault| fault.line);
    Rows { good: kept, bad }
}

const LOST: &str = "the tool jumps to the origin: the tracker did not see it";

/// The first row whose time is before that of the row above, whatever their tools.
pub(crate) fn first_step_back(rows: &[Row]) -> Option<Fault> {
    let pair = rows.windows(2).find(|pair| pair[1].stamp.since(pair[0].stamp) < 0.0)?;
    Some(step_back(&pair[1], &pair[0]))
}

fn step_back(row: &Row, before: &Row) -> Fault {
    let (now, newest) = (row.stamp.value(), before.stamp.value());
    fault(row, BadRow::OutOfOrder, format!("time {now} is before that of line {} ({newest})", before.line))
}

fn fault(row: &Row, kind: BadRow, message: String) -> Fault {
    Fault { line: row.line, kind, message }
}

/// Rows of each tool, in the order in which tools appear.
fn by_tool(rows: Vec<Row>) -> Vec<Vec<Row>> {
    let mut places: HashMap<Option<String>, usize> = HashMap::new();
    let mut tools: Vec<Vec<Row>> = Vec::new();
    for row in rows {
        let place = *places.entry(row.tool.clone()).or_insert(tools.len());
        if place == tools.len() {
            tools.push(Vec::new());
        }
        tools[place].push(row);
    }
    tools
}

/// Rows that `drop` does not mark, and those that it does.
fn part(rows: Vec<Row>, drop: impl Fn(&[Row]) -> Vec<bool>) -> (Vec<Row>, Vec<Row>) {
    let marks = drop(&rows);
    let (dropped, kept): (Vec<_>, Vec<_>) = rows.into_iter().zip(marks).partition(|(_, mark)| *mark);
    let bare = |rows: Vec<(Row, bool)>| rows.into_iter().map(|(row, _)| row).collect();
    (bare(kept), bare(dropped))
}

/// Marks runs of rows at the very origin that the tool enters and leaves by a jump. A motion that starts at the origin, as
/// trackers with a frame of their own write it, leaves it by a step like any other.
fn is_lost(rows: &[Row]) -> Vec<bool> {
    let at_origin: Vec<bool> = rows.iter().map(|row| row.position_m == [0.0; 3]).collect();
    let step = |i: usize| distance(&rows[i - 1].position_m, &rows[i].position_m);
    let elsewhere = (1..rows.len()).filter(|&i| !at_origin[i - 1] && !at_origin[i]);
    let longest_step = elsewhere.map(step).fold(0.0, f64::max);
    let is_jump = |i: usize| step(i) > NO_MOTION * longest_step;
    let mut lost = vec![false; rows.len()];
    let mut start = 0;
    for run in at_origin.chunk_by(|a, b| a == b) {
        let end = start + run.len();
        let (has_before, has_after) = (start > 0, end < rows.len());
        let enters = !has_before || is_jump(start);
        let leaves = !has_after || is_jump(end);
        if run[0] && (has_before || has_after) && enters && leaves {
            lost[start..end].fill(true);
        }
        start = end;
    }
    lost
}

/// The most rows whose times rise, so that one wrong time costs one row and not all that follow; the others go to `bad`.
fn rising(rows: Vec<Row>, bad: &mut Vec<Fault>) -> Vec<Row> {
    let keep = longest_rise(&rows);
    let mut kept: Vec<Row> = Vec::with_capacity(rows.len());
    for (row, keep) in rows.into_iter().zip(keep) {
        match kept.last() {
            _ if keep => kept.push(row),
            Some(before) => bad.push(misplaced(&row, before)),
            None => bad.push(too_late(&row)),
        }
    }
    kept
}

fn misplaced(row: &Row, before: &Row) -> Fault {
    let after = row.stamp.since(before.stamp);
    if after == 0.0 {
        let message = format!("a second pose of the same tool at {}, as in line {}", row.stamp.value(), before.line);
        return fault(row, BadRow::Duplicate, message);
    }
    if after < 0.0 { step_back(row, before) } else { too_late(row) }
}

fn too_late(row: &Row) -> Fault {
    fault(row, BadRow::OutOfOrder, format!("time {} is after those of the lines below", row.stamp.value()))
}

/// Marks a longest subsequence whose times rise (patience sorting), the earliest of equal times.
fn longest_rise(rows: &[Row]) -> Vec<bool> {
    // The last row of the best rise of each length, and the row before each row in its best rise.
    let mut ends: Vec<usize> = Vec::new();
    let mut before: Vec<Option<usize>> = Vec::with_capacity(rows.len());
    for (i, row) in rows.iter().enumerate() {
        let length = ends.partition_point(|&end| row.stamp.since(rows[end].stamp) > 0.0);
        before.push(length.checked_sub(1).map(|l| ends[l]));
        if length == ends.len() {
            ends.push(i);
        } else if row.stamp.since(rows[ends[length]].stamp) < 0.0 {
            ends[length] = i;
        }
    }
    let mut marks = vec![false; rows.len()];
    let mut at = ends.last().copied();
    while let Some(i) = at {
        marks[i] = true;
        at = before[i];
    }
    marks
}

fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}
