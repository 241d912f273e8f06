//! Rows of a motion file: text to numbers, each row by itself.

use crate::gate::Gate;
use crate::layout::Layout;
use crate::options::QuaternionOrder;
use crate::report::BadRow;
use crate::time::Stamp;

/// A quaternion with no component above this is none: the tracker did not see the tool.
const ZERO: f64 = 1e-6;

/// A row that can be played as far as it can be judged alone.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Row {
    /// Line number, from 1 on.
    pub(crate) line: u64,
    pub(crate) stamp: Stamp,
    pub(crate) tool: Option<String>,
    pub(crate) position_m: [f64; 3],
    pub(crate) orientation_xyzw: [f64; 4],
}

/// A row that cannot be played.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Fault {
    pub(crate) line: u64,
    pub(crate) kind: BadRow,
    pub(crate) message: String,
}

/// Rows that can be played, and those that cannot, both in the order of the file.
#[derive(Debug, Default)]
pub(crate) struct Rows {
    pub(crate) good: Vec<Row>,
    pub(crate) bad: Vec<Fault>,
}

/// Line numbers from 1 on, and what stands there without comment; empty lines are left out.
pub(crate) fn content_lines(text: &str) -> impl Iterator<Item = (u64, &str)> {
    let without_comment = |line: &'_ str| line.find(['#', '%']).unwrap_or(line.len());
    (1..).zip(text.lines()).filter_map(move |(number, line)| {
        // Tabs at the end are empty columns.
        let content = line[..without_comment(line)].trim_end_matches([' ', '\r']).trim_start_matches(' ');
        (!content.trim().is_empty()).then_some((number, content))
    })
}

/// Reads the rows of a text whose layout is known.
pub(crate) fn read_rows<'a>(
    lines: impl Iterator<Item = (u64, &'a str)>,
    layout: &Layout,
    order: QuaternionOrder,
    gate: &impl Gate,
) -> Rows {
    let mut rows = Rows::default();
    for (line, text) in lines {
        match row(layout, order, line, text, gate) {
            Ok(row) => rows.good.push(row),
            Err((kind, message)) => rows.bad.push(Fault { line, kind, message }),
        }
    }
    rows
}

fn row(
    layout: &Layout,
    order: QuaternionOrder,
    line: u64,
    text: &str,
    gate: &impl Gate,
) -> Result<Row, (BadRow, String)> {
    let fields = layout.fields(text).map_err(|message| (BadRow::Unreadable, message))?;
    let mut values = [0.0; 8];
    for (i, (value, field)) in values.iter_mut().zip(fields.numbers).enumerate() {
        *value = finite(layout, layout.name(i), field)?;
    }
    let [time, px, py, pz, q @ ..] = values;
    if q.iter().all(|c| c.abs() <= ZERO) {
        let message = "the quaternion is zero: the tracker did not see the tool".to_owned();
        return Err((BadRow::Lost, message));
    }
    let position_m = [px, py, pz];
    let orientation = gate(fields.tool, position_m, order.to_xyzw(q)).map_err(|message| (BadRow::Refused, message))?;
    Ok(Row {
        line,
        stamp: Stamp::new(time, fields.numbers[0]),
        tool: fields.tool.map(str::to_owned),
        position_m,
        orientation_xyzw: orientation,
    })
}

fn finite(layout: &Layout, name: &str, field: &str) -> Result<f64, (BadRow, String)> {
    if field.is_empty() {
        return Err((BadRow::Empty, format!("`{name}` is empty")));
    }
    let value = layout
        .number(field)
        .ok_or_else(|| (BadRow::Unreadable, format!("`{name}` is `{field}`, expected a number")))?;
    let not_finite = || (BadRow::NotFinite, format!("`{name}` is `{field}`, expected a finite number"));
    value.is_finite().then_some(value).ok_or_else(not_finite)
}
