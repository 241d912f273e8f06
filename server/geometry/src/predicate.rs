//! Conditions on a point, written as text: `x > 0.5e-3 && y > 0.5e-3`.
//!
//! ```text
//! condition  = condition "||" condition | condition "&&" condition | "!" condition | "(" condition ")"
//!            | number ("<" | "<=" | ">" | ">=" | "==" | "!=") number
//! number     = literal | "x" | "y" | "z" | number ("+" | "-" | "*" | "/") number | "-" number | "(" number ")"
//!            | "abs" "(" number ")" | "sqrt" "(" number ")"
//! ```
//!
//! `!` and `-` bind tightest, then `* /`, `+ -`, comparisons, `&&`, `||`.

mod parser;
mod words;

use nalgebra::Point3;

/// A condition on the coordinates of a point.
#[derive(Clone, Debug, PartialEq)]
pub struct Predicate {
    condition: Expression,
}

/// Syntax error in the text of a condition.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("column {column}: {problem}")]
pub struct PredicateError {
    /// One-based column, in characters.
    pub column: usize,
    /// Cause.
    pub problem: String,
}

impl Predicate {
    /// Reads a condition; the grammar is that of [this module](self).
    ///
    /// # Errors
    /// [`PredicateError`]: text that is no condition.
    pub fn parse(text: &str) -> Result<Self, PredicateError> {
        parser::parse(text).map(|condition| Self { condition })
    }

    /// Whether the condition holds at `x` \[m\].
    pub fn holds(&self, x: &Point3<f64>) -> bool {
        self.condition.value(x) != 0.0
    }
}

/// A number, or a truth value as 1 or 0.
#[derive(Clone, Debug, PartialEq)]
enum Expression {
    Constant(f64),
    Coordinate(usize),
    Unary(Unary, Box<Self>),
    Binary(Binary, Box<Self>, Box<Self>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Unary {
    Not,
    Negative,
    Absolute,
    SquareRoot,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Binary {
    Or,
    And,
    Less,
    AtMost,
    More,
    AtLeast,
    Equal,
    Different,
    Plus,
    Minus,
    Times,
    Over,
}

impl Expression {
    fn value(&self, x: &Point3<f64>) -> f64 {
        match self {
            Self::Constant(number) => *number,
            Self::Coordinate(axis) => x[*axis],
            Self::Unary(operator, a) => operator.apply(a.value(x)),
            Self::Binary(operator, a, b) => operator.apply(a.value(x), b.value(x)),
        }
    }
}

impl Unary {
    fn apply(self, a: f64) -> f64 {
        match self {
            Self::Not => truth(a == 0.0),
            Self::Negative => -a,
            Self::Absolute => a.abs(),
            Self::SquareRoot => a.sqrt(),
        }
    }
}

impl Binary {
    fn apply(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Or => truth(a != 0.0 || b != 0.0),
            Self::And => truth(a != 0.0 && b != 0.0),
            Self::Less => truth(a < b),
            Self::AtMost => truth(a <= b),
            Self::More => truth(a > b),
            Self::AtLeast => truth(a >= b),
            Self::Equal => truth(a == b),
            Self::Different => truth(a != b),
            Self::Plus => a + b,
            Self::Minus => a - b,
            Self::Times => a * b,
            Self::Over => a / b,
        }
    }
}

fn truth(holds: bool) -> f64 {
    f64::from(u8::from(holds))
}
