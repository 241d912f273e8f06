//! Separator and columns of a motion file, found from its first row.

use crate::time::TimeUnit;

/// Names of the columns of a CSV file with a tool.
pub(crate) const CSV_COLUMNS: [&str; 9] = ["time_s", "tool", "px", "py", "pz", "qx", "qy", "qz", "qw"];
/// Names of the columns of a TUM file.
const TUM_COLUMNS: [&str; 8] = ["timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw"];
/// Where the numbers of [`TUM_COLUMNS`] stand among [`CSV_COLUMNS`].
const NUMBERS: [usize; 8] = [0, 2, 3, 4, 5, 6, 7, 8];
/// Column of the tool in [`CSV_COLUMNS`].
const TOOL: usize = 1;

/// What parts the columns of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Separator {
    Character(char),
    Blanks,
}

/// How a row becomes numbers.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Layout {
    separator: Separator,
    n_columns: usize,
    names: &'static [&'static str],
    /// Column of time, position and quaternion `x y z w`.
    numbers: [usize; 8],
    tool: Option<usize>,
    pub(crate) has_header: bool,
    /// Unit of the times, if the header says it.
    pub(crate) time_unit: Option<TimeUnit>,
    /// Whether the header says that `w` comes first.
    pub(crate) names_w_first: bool,
}

impl Layout {
    /// Of the first row that is no comment. A file named `.csv` has a header, unless the row is eight numbers.
    ///
    /// # Errors
    /// A sentence: the row is neither a header nor numbers.
    pub(crate) fn of(row: &str, is_named_csv: bool) -> Result<Self, String> {
        let separator = Separator::of(row);
        let fields = separator.split(row);
        let are_numbers = fields.len() == TUM_COLUMNS.len() && fields.iter().all(|f| separator.number(f).is_some());
        if are_numbers || separator == Separator::Blanks && !is_named_csv && !names_a_column(&fields) {
            return Ok(Self::without_header(separator));
        }
        Self::from_header(separator, &fields).ok_or_else(|| {
            let expected = CSV_COLUMNS.join(",");
            format!(
                "the header must be `{expected}` (`time_ms`, `time_us` or `time_ns` for other units; `;` or tabs may \
                 stand for the commas), it is `{row}`"
            )
        })
    }

    fn without_header(separator: Separator) -> Self {
        Self {
            separator,
            n_columns: TUM_COLUMNS.len(),
            names: &TUM_COLUMNS,
            numbers: std::array::from_fn(|i| i),
            tool: None,
            has_header: false,
            time_unit: None,
            names_w_first: false,
        }
    }

    fn from_header(separator: Separator, fields: &[&str]) -> Option<Self> {
        let (time, rest) = fields.split_first()?;
        let unit = time.strip_prefix("time_").and_then(TimeUnit::from_name)?;
        let at = |name: &str| rest.iter().position(|field| *field == name).map(|i| i + 1);
        let tool = at(CSV_COLUMNS[TOOL]);
        let mut numbers = [0; 8];
        for (place, column) in numbers.iter_mut().zip(NUMBERS).skip(1) {
            *place = at(CSV_COLUMNS[column])?;
        }
        let n_columns = NUMBERS.len() + usize::from(tool.is_some());
        (fields.len() == n_columns).then_some(Self {
            separator,
            n_columns,
            names: &CSV_COLUMNS,
            numbers,
            tool,
            has_header: true,
            // `time_s` is the name that every example has: it proves nothing.
            time_unit: Some(unit).filter(|unit| *unit != TimeUnit::Seconds),
            names_w_first: numbers[7] < numbers[4],
        })
    }

    /// Fields of a row, or how many there are.
    pub(crate) fn fields<'a>(&self, row: &'a str) -> Result<Fields<'a>, String> {
        let fields = self.separator.split(row);
        if fields.len() != self.n_columns {
            let expected =
                if self.has_header { self.n_columns.to_string() } else { format!("`{}`", self.names.join(" ")) };
            return Err(format!("{} columns, expected {expected}", fields.len()));
        }
        Ok(Fields {
            numbers: self.numbers.map(|i| fields[i]),
            tool: self.tool.map(|i| fields[i]).filter(|name| !name.is_empty()),
        })
    }

    /// Name of the `i`-th of [`Fields::numbers`].
    pub(crate) fn name(&self, i: usize) -> &'static str {
        if self.has_header { CSV_COLUMNS[NUMBERS[i]] } else { TUM_COLUMNS[i] }
    }

    /// A field as a number.
    pub(crate) fn number(&self, field: &str) -> Option<f64> {
        self.separator.number(field)
    }
}

/// The fields of a row in the order of the format.
pub(crate) struct Fields<'a> {
    /// Time, position, quaternion as the columns stand for it.
    pub(crate) numbers: [&'a str; 8],
    pub(crate) tool: Option<&'a str>,
}

/// A header is taken for one where it names any column of a pose.
fn names_a_column(fields: &[&str]) -> bool {
    fields.iter().any(|field| field.starts_with("time_") || CSV_COLUMNS.contains(field))
}

impl Separator {
    fn of(row: &str) -> Self {
        let by = |character: char| row.contains(character).then_some(Self::Character(character));
        let tabs_are_columns = row.split('\t').count() >= TUM_COLUMNS.len();
        by(';').or_else(|| by(',')).or_else(|| by('\t').filter(|_| tabs_are_columns)).unwrap_or(Self::Blanks)
    }

    fn split(self, row: &str) -> Vec<&str> {
        match self {
            Self::Character(character) => row.split(character).map(unquoted).collect(),
            Self::Blanks => row.split_whitespace().collect(),
        }
    }

    /// A number, with a decimal comma where semicolons or blanks part the columns.
    fn number(self, field: &str) -> Option<f64> {
        let has_decimal_comma = self != Self::Character(',') && field.contains(',');
        if has_decimal_comma { field.replacen(',', ".", 1).parse().ok() } else { field.parse().ok() }
    }
}

fn unquoted(field: &str) -> &str {
    let field = field.trim();
    field.strip_prefix('"').and_then(|f| f.strip_suffix('"')).map_or(field, str::trim)
}
