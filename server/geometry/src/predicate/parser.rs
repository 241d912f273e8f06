//! Parser of words into an expression, by operator precedence.

use super::words::{Placed, Word, words};
use super::{Binary, Expression, PredicateError, Unary};

/// Largest nesting of parentheses.
const MAX_DEPTH: usize = 50;

/// An expression, and whether it is a condition or a number.
struct Typed {
    expression: Expression,
    is_condition: bool,
    column: usize,
}

struct Parser<'a> {
    words: &'a [Placed],
    at: usize,
    depth: usize,
    /// Column behind the last word.
    end: usize,
}

pub(super) fn parse(text: &str) -> Result<Expression, PredicateError> {
    let words = words(text)?;
    let mut parser = Parser { words: &words, at: 0, depth: 0, end: 1 + text.chars().count() };
    let whole = parser.expression(0)?;
    match parser.words.get(parser.at) {
        Some((word, column)) => Err(error(*column, format!("`{}` does not continue the condition", word.text()))),
        None if whole.is_condition => Ok(whole.expression),
        None => Err(error(whole.column, "this is a number, not a condition: compare it, as in `z < 1e-3`")),
    }
}

fn error(column: usize, problem: impl Into<String>) -> PredicateError {
    PredicateError { column, problem: problem.into() }
}

/// Binding power of an operator.
fn strength(operator: Binary) -> u8 {
    match operator {
        Binary::Or => 1,
        Binary::And => 2,
        Binary::Plus | Binary::Minus => 4,
        Binary::Times | Binary::Over => 5,
        _ => 3,
    }
}

impl Parser<'_> {
    fn next(&mut self) -> Option<Placed> {
        let word = self.words.get(self.at).cloned();
        self.at += usize::from(word.is_some());
        word
    }

    /// Operands joined by operators that bind more tightly than `least`.
    fn expression(&mut self, least: u8) -> Result<Typed, PredicateError> {
        let mut left = self.operand()?;
        while let Some((Word::Operator(operator), column)) = self.words.get(self.at).cloned() {
            if strength(operator) <= least {
                break;
            }
            self.at += 1;
            let right = self.expression(strength(operator))?;
            left = joined(operator, column, left, right)?;
        }
        Ok(left)
    }

    fn operand(&mut self) -> Result<Typed, PredicateError> {
        let Some((word, column)) = self.next() else {
            return Err(error(self.end, "the condition ends where something is expected"));
        };
        match word {
            Word::Number(number) => Ok(plain(Expression::Constant(number), column)),
            Word::Name(name) => self.named(&name, column),
            Word::Open => self.parenthesis(),
            Word::Not => self.unary(Unary::Not, column),
            Word::Operator(Binary::Minus) => self.unary(Unary::Negative, column),
            other => Err(error(column, format!("`{}` where a number or a coordinate is expected", other.text()))),
        }
    }

    fn named(&mut self, name: &str, column: usize) -> Result<Typed, PredicateError> {
        let function = match name {
            "x" => return Ok(plain(Expression::Coordinate(0), column)),
            "y" => return Ok(plain(Expression::Coordinate(1), column)),
            "z" => return Ok(plain(Expression::Coordinate(2), column)),
            "abs" => Unary::Absolute,
            "sqrt" => Unary::SquareRoot,
            other => return Err(error(column, format!("`{other}` is unknown; there are x, y, z, abs and sqrt"))),
        };
        match self.next() {
            Some((Word::Open, _)) => applied(function, column, self.parenthesis()?),
            _ => Err(error(column, format!("`{name}` needs its argument in parentheses"))),
        }
    }

    /// Expression after an opening parenthesis, with the closing one.
    fn parenthesis(&mut self) -> Result<Typed, PredicateError> {
        self.deeper()?;
        let inside = self.expression(0)?;
        self.depth -= 1;
        match self.next() {
            Some((Word::Close, _)) => Ok(inside),
            Some((word, column)) => Err(error(column, format!("`{}` where `)` is expected", word.text()))),
            None => Err(error(self.end, "a parenthesis is not closed")),
        }
    }

    fn unary(&mut self, operator: Unary, column: usize) -> Result<Typed, PredicateError> {
        self.deeper()?;
        let operand = self.operand()?;
        self.depth -= 1;
        applied(operator, column, operand)
    }

    fn deeper(&mut self) -> Result<(), PredicateError> {
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return Err(error(self.end, format!("more than {MAX_DEPTH} parentheses within each other")));
        }
        Ok(())
    }
}

fn plain(expression: Expression, column: usize) -> Typed {
    Typed { expression, is_condition: false, column }
}

fn applied(operator: Unary, column: usize, operand: Typed) -> Result<Typed, PredicateError> {
    let is_condition = operator == Unary::Not;
    if operand.is_condition != is_condition {
        return Err(mismatch(operand.column, is_condition));
    }
    Ok(Typed { expression: Expression::Unary(operator, Box::new(operand.expression)), is_condition, column })
}

fn joined(operator: Binary, column: usize, left: Typed, right: Typed) -> Result<Typed, PredicateError> {
    let needs_conditions = matches!(operator, Binary::Or | Binary::And);
    for side in [&left, &right] {
        if side.is_condition != needs_conditions {
            let at = if side.is_condition { column } else { side.column };
            return Err(mismatch(at, needs_conditions));
        }
    }
    let expression = Expression::Binary(operator, Box::new(left.expression), Box::new(right.expression));
    Ok(Typed { expression, is_condition: strength(operator) <= 3, column: left.column })
}

fn mismatch(column: usize, needs_conditions: bool) -> PredicateError {
    let problem = if needs_conditions {
        "a condition is expected, not a number: compare it, as in `z < 1e-3`"
    } else {
        "a number is expected, not a condition: write `0 < x && x < 1` for `0 < x < 1`"
    };
    error(column, problem)
}
