//! Times as trackers write them: any origin, seconds to nanoseconds.

use serde::{Deserialize, Serialize};

/// Unit of a file's times.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum TimeUnit {
    /// Seconds.
    #[serde(rename = "s")]
    Seconds,
    /// Milliseconds.
    #[serde(rename = "ms")]
    Milliseconds,
    /// Microseconds.
    #[serde(rename = "us")]
    Microseconds,
    /// Nanoseconds.
    #[serde(rename = "ns")]
    Nanoseconds,
}

impl TimeUnit {
    /// All of them, the longest first.
    pub const ALL: [Self; 4] = [Self::Seconds, Self::Milliseconds, Self::Microseconds, Self::Nanoseconds];

    /// The name that options and files use.
    pub fn name(self) -> &'static str {
        match self {
            Self::Seconds => "s",
            Self::Milliseconds => "ms",
            Self::Microseconds => "us",
            Self::Nanoseconds => "ns",
        }
    }

    /// The unit of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| unit.name() == name)
    }

    /// How many of them make a second.
    pub fn per_second(self) -> f64 {
        match self {
            Self::Seconds => 1.0,
            Self::Milliseconds => 1e3,
            Self::Microseconds => 1e6,
            Self::Nanoseconds => 1e9,
        }
    }
}

/// A time as it stands in a file. Whole numbers stay whole, since nanoseconds since 1970 do not fit into an `f64`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stamp {
    value: f64,
    whole: Option<i64>,
}

impl Stamp {
    /// The number and its text.
    pub(crate) fn new(value: f64, text: &str) -> Self {
        Self { value, whole: text.parse().ok() }
    }

    /// Units of the file from `origin` to here.
    pub(crate) fn since(self, origin: Self) -> f64 {
        match (self.whole, origin.whole) {
            (Some(a), Some(b)) => (i128::from(a) - i128::from(b)) as f64,
            _ => self.value - origin.value,
        }
    }

    /// The number.
    pub(crate) fn value(self) -> f64 {
        self.value
    }
}

/// Rates at which tracked tools are written, poses per second.
const TRACKED_HZ: [f64; 2] = [2.0, 2_000.0];
/// Rates at which a slow device writes, or a person types key frames.
const SLOW_HZ: [f64; 2] = [0.2, 2.0];
/// Slow rates that are as likely as a tracked one a thousand times higher, however many rows there are.
const AS_LIKELY_HZ: [f64; 2] = [0.5, 2.0];
/// Rates at which anything is written at all.
const POSSIBLE_HZ: [f64; 2] = [0.2, 20_000.0];
/// Rates of times since 1970, which say their unit by themselves.
const SINCE_1970_HZ: [f64; 2] = [1e-3, 20_000.0];
/// Seconds since 1970 of the years 2001 to 2100.
const EPOCH_S: [f64; 2] = [1e9, 4.1e9];
/// No tracker writes fewer rows: they are key frames.
const FEW_ROWS: usize = 10;
/// Nobody types more key frames.
const MANY_ROWS: usize = 50;

/// The unit of times whose first is `first` and whose median step is `step`, both in that unit; the units that fit as well
/// as each other where it cannot be told.
///
/// ```text
/// since 1970    first / unit in 1e9 ... 4.1e9 s
/// else          unit / step in 2 Hz ... 2 kHz, and no other unit makes a likely slow rate of it
/// ```
/// A step of 1 is 1 kHz in ms and 1 Hz in s: of many rows it cannot be told, a few are key frames in seconds.
pub(crate) fn recognise(first: f64, step: f64, n_rows: usize) -> Result<TimeUnit, Vec<TimeUnit>> {
    let within = |value: f64, [low, high]: [f64; 2]| (low..=high).contains(&value);
    let fits = |unit: TimeUnit, range| within(unit.per_second() / step, range);
    let find = |range| TimeUnit::ALL.into_iter().find(|unit| fits(*unit, range));
    let since_1970 = |unit: &TimeUnit| within(first / unit.per_second(), EPOCH_S) && fits(*unit, SINCE_1970_HZ);
    if let Some(unit) = TimeUnit::ALL.into_iter().find(since_1970) {
        return Ok(unit);
    }
    let slow = find(if n_rows < MANY_ROWS { SLOW_HZ } else { AS_LIKELY_HZ });
    match (find(TRACKED_HZ), slow) {
        (_, Some(TimeUnit::Seconds)) if n_rows < FEW_ROWS => Ok(TimeUnit::Seconds),
        (Some(unit), None) if unit == TimeUnit::Seconds || n_rows >= FEW_ROWS => Ok(unit),
        _ => {
            let possible: Vec<_> = TimeUnit::ALL.into_iter().filter(|unit| fits(*unit, POSSIBLE_HZ)).collect();
            Err(if possible.is_empty() { TimeUnit::ALL.to_vec() } else { possible })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_recognised_by_a_plausible_rate() {
        for unit in TimeUnit::ALL {
            for rate_hz in [2.5, 30.0, 60.0, 100.0, 250.0] {
                for origin_s in [0.0, -3.0, 77.0, 1.7e9] {
                    let [first, step] = [origin_s, 1.0 / rate_hz].map(|s| s * unit.per_second());
                    assert_eq!(recognise(first, step, 500), Ok(unit), "{rate_hz} Hz from {origin_s} s in {unit:?}");
                }
            }
            let since_1970 = 1.7e9 * unit.per_second();
            assert_eq!(recognise(since_1970, unit.per_second() / 1e3, 500), Ok(unit), "1 kHz since 1970 in {unit:?}");
        }
    }

    #[test]
    fn a_unit_that_cannot_be_told_is_asked_for() {
        // 1 Hz in seconds, or 1 kHz in milliseconds.
        assert_eq!(recognise(0.0, 1.0, 500), Err(vec![TimeUnit::Seconds, TimeUnit::Milliseconds]));
        assert_eq!(recognise(0.0, 1e3, 500), Err(vec![TimeUnit::Milliseconds, TimeUnit::Microseconds]));
        assert_eq!(recognise(0.0, 20.0, 3), Err(vec![TimeUnit::Milliseconds]), "three rows 20 s or 20 ms apart");
        assert_eq!(recognise(0.0, 1e-9, 500), Err(TimeUnit::ALL.to_vec()));
        assert_eq!(recognise(0.0, 1e13, 500), Err(TimeUnit::ALL.to_vec()));
    }

    #[test]
    fn a_few_key_frames_are_in_seconds() {
        assert_eq!(recognise(0.0, 1.0, 4), Ok(TimeUnit::Seconds));
        assert_eq!(recognise(0.0, 0.25, 2), Ok(TimeUnit::Seconds));
    }

    #[test]
    fn whole_times_lose_no_nanosecond() {
        let stamp = |text: &str| Stamp::new(text.parse().unwrap_or_default(), text);
        assert_eq!(stamp("1700000000250000001").since(stamp("1700000000250000000")), 1.0);
        assert_eq!(stamp("0.75").since(stamp("-1")), 1.75);
    }
}
