//! The words of a condition.

use super::{Binary, PredicateError};

/// A word and the one-based column where it begins.
pub(super) type Placed = (Word, usize);

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Word {
    Number(f64),
    Name(String),
    Operator(Binary),
    Not,
    Open,
    Close,
}

impl Word {
    pub(super) fn text(&self) -> String {
        match self {
            Self::Number(number) => number.to_string(),
            Self::Name(name) => name.clone(),
            Self::Operator(operator) => {
                OPERATORS.iter().find(|(_, known)| known == operator).map_or("", |(text, _)| text).to_owned()
            }
            Self::Not => "!".to_owned(),
            Self::Open => "(".to_owned(),
            Self::Close => ")".to_owned(),
        }
    }
}

/// Longer operators first.
const OPERATORS: [(&str, Binary); 12] = [
    ("||", Binary::Or),
    ("&&", Binary::And),
    ("<=", Binary::AtMost),
    (">=", Binary::AtLeast),
    ("==", Binary::Equal),
    ("!=", Binary::Different),
    ("<", Binary::Less),
    (">", Binary::More),
    ("+", Binary::Plus),
    ("-", Binary::Minus),
    ("*", Binary::Times),
    ("/", Binary::Over),
];

pub(super) fn words(text: &str) -> Result<Vec<Placed>, PredicateError> {
    let mut words = Vec::new();
    let mut rest = text;
    loop {
        rest = rest.trim_start();
        let column = 1 + text[..text.len() - rest.len()].chars().count();
        let Some(first) = rest.chars().next() else { return Ok(words) };
        let (word, length) = match first {
            '0'..='9' | '.' => number(rest, column)?,
            'a'..='z' | 'A'..='Z' | '_' => {
                let length = rest.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(rest.len());
                (Word::Name(rest[..length].to_owned()), length)
            }
            '(' => (Word::Open, 1),
            ')' => (Word::Close, 1),
            _ => operator(rest, first, column)?,
        };
        words.push((word, column));
        rest = &rest[length..];
    }
}

fn operator(rest: &str, first: char, column: usize) -> Result<(Word, usize), PredicateError> {
    match OPERATORS.iter().find(|(text, _)| rest.starts_with(text)) {
        Some((text, operator)) => Ok((Word::Operator(*operator), text.len())),
        None if first == '!' => Ok((Word::Not, 1)),
        None => {
            let hint = match first {
                '=' => "; equal is ==",
                '&' => "; and is &&",
                '|' => "; or is ||",
                _ => "",
            };
            Err(PredicateError { column, problem: format!("`{first}` has no meaning here{hint}") })
        }
    }
}

/// Digits, a point, and an exponent whose sign belongs to it.
fn number(rest: &str, column: usize) -> Result<(Word, usize), PredicateError> {
    let bytes = rest.as_bytes();
    let continues = |i: usize| match bytes[i] {
        b'0'..=b'9' | b'.' | b'e' | b'E' | b'_' => true,
        b'+' | b'-' => i > 0 && matches!(bytes[i - 1], b'e' | b'E'),
        other => other.is_ascii_alphabetic(),
    };
    let length = (0..bytes.len()).find(|&i| !continues(i)).unwrap_or(bytes.len());
    match rest[..length].parse::<f64>() {
        Ok(number) if number.is_finite() => Ok((Word::Number(number), length)),
        _ => Err(PredicateError { column, problem: format!("`{}` is not a number", &rest[..length]) }),
    }
}
