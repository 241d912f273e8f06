//! Tokens of a Rust source: names, `::` and single characters. Comments and literals are left out.

/// A piece of a source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Token {
    /// An identifier or keyword.
    Name(String),
    /// `::`.
    PathSeparator,
    /// Any other character that is not white space.
    Sign(char),
}

impl Token {
    pub(super) fn is(&self, name: &str) -> bool {
        matches!(self, Token::Name(own) if own == name)
    }

    pub(super) fn is_sign(&self, sign: char) -> bool {
        *self == Token::Sign(sign)
    }
}

pub(super) fn tokens(source: &str) -> Vec<Token> {
    let characters: Vec<char> = source.chars().collect();
    let (mut found, mut at) = (Vec::new(), 0);
    while at < characters.len() {
        at = take(&characters, at, &mut found);
    }
    found
}

/// Appends the token at `at`, if there is one, and returns where the next begins.
fn take(text: &[char], at: usize, found: &mut Vec<Token>) -> usize {
    let next = text.get(at + 1).copied();
    match (text[at], next) {
        ('/', Some('/')) => end_of_line(text, at),
        ('/', Some('*')) => end_of_block_comment(text, at),
        ('"', _) => end_of_string(text, at),
        ('\'', _) => end_of_quote(text, at),
        (':', Some(':')) => {
            found.push(Token::PathSeparator);
            at + 2
        }
        (c, _) if is_word(c) => {
            let end = at + text[at..].iter().take_while(|c| is_word(**c)).count();
            let word: String = text[at..end].iter().collect();
            if ["r", "br", "cr"].contains(&word.as_str()) && matches!(text.get(end), Some('"' | '#')) {
                return end_of_raw_string(text, end);
            }
            if !c.is_ascii_digit() {
                found.push(Token::Name(word));
            }
            end
        }
        (c, _) => {
            if !c.is_whitespace() {
                found.push(Token::Sign(c));
            }
            at + 1
        }
    }
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

fn end_of_line(text: &[char], at: usize) -> usize {
    at + text[at..].iter().take_while(|c| **c != '\n').count()
}

fn end_of_block_comment(text: &[char], at: usize) -> usize {
    let (mut depth, mut i) = (0, at);
    while i < text.len() {
        match (text[i], text.get(i + 1)) {
            ('/', Some('*')) => (depth, i) = (depth + 1, i + 2),
            ('*', Some('/')) => (depth, i) = (depth - 1, i + 2),
            _ => i += 1,
        }
        if depth == 0 {
            break;
        }
    }
    i
}

fn end_of_string(text: &[char], at: usize) -> usize {
    let mut i = at + 1;
    while i < text.len() && text[i] != '"' {
        i += if text[i] == '\\' { 2 } else { 1 };
    }
    i + 1
}

/// `at` is behind the `r`. A raw identifier, `r#type`, has no quote behind its `#`.
fn end_of_raw_string(text: &[char], at: usize) -> usize {
    let n_hashes = text[at..].iter().take_while(|c| **c == '#').count();
    let mut i = at + n_hashes;
    if text.get(i) != Some(&'"') {
        return i;
    }
    i += 1;
    while i < text.len() {
        let hashes = text[i + 1..].iter().take(n_hashes).take_while(|c| **c == '#').count();
        if text[i] == '"' && hashes == n_hashes {
            return i + 1 + n_hashes;
        }
        i += 1;
    }
    i
}

/// A character literal or a lifetime.
fn end_of_quote(text: &[char], at: usize) -> usize {
    match (text.get(at + 1), text.get(at + 2)) {
        (Some('\\'), _) => at + 4 + text[(at + 3).min(text.len())..].iter().take_while(|c| **c != '\'').count(),
        (Some(_), Some('\'')) => at + 3,
        _ => at + 1 + text[at + 1..].iter().take_while(|c| is_word(**c)).count(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(source: &str) -> Vec<String> {
        let name = |token| match token {
            Token::Name(name) => Some(name),
            _ => None,
        };
        tokens(source).into_iter().filter_map(name).collect()
    }

    #[test]
    fn comments_and_literals_hold_no_names() {
        assert_eq!(names("a // b\n/* c /* d */ e */ f"), ["a", "f"]);
        assert_eq!(names(r##"a("b \" c", r#"d " e"#, 'f', '\'', '\u{1F}', b"g", 1.5e3)"##), ["a", "b"]);
        assert_eq!(names("fn a<'b>(c: &'b str)"), ["fn", "a", "c", "str"]);
    }
}
