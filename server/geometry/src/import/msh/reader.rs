//! Lines, words and binary numbers of an MSH file, with the place where they stand.

use std::str::FromStr;

use crate::import::error::{DAMAGED, Fault, Place, fault};

/// Sequential reader of bytes; never reads beyond the end.
pub(super) struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    is_binary: bool,
    is_big_endian: bool,
}

/// A number that binary files hold in a fixed size and ASCII files as a word.
pub(super) trait Number: FromStr {
    const BYTES: usize;
    const NAME: &'static str;
    fn from_little_endian(bytes: &[u8]) -> Option<Self>;
}

macro_rules! number {
    ($type:ty, $name:literal) => {
        impl Number for $type {
            const BYTES: usize = size_of::<$type>();
            const NAME: &'static str = $name;
            fn from_little_endian(bytes: &[u8]) -> Option<Self> {
                bytes.try_into().ok().map(<$type>::from_le_bytes)
            }
        }
    };
}

number!(i32, "a whole number");
number!(u64, "a whole number from 0");
number!(f64, "a number");

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, is_binary: false, is_big_endian: false }
    }

    pub(super) fn is_binary(&self) -> bool {
        self.is_binary
    }

    /// Place of the reader, for messages.
    pub(super) fn place(&self) -> Place {
        if self.is_binary {
            return Place::Byte(self.at);
        }
        // The last item read may have ended its line.
        let read = self.bytes[..self.at].trim_ascii_end();
        Place::Line(1 + read.iter().filter(|b| **b == b'\n').count())
    }

    /// Largest number of items of at least `bytes` each in the rest of the file: bounds allocations.
    pub(super) fn room_for(&self, n: u64, bytes: usize) -> usize {
        usize::try_from(n).unwrap_or(usize::MAX).min((self.bytes.len() - self.at) / bytes)
    }

    /// The rest of the line, without white space around it.
    pub(super) fn line(&mut self) -> Result<&'a str, Fault> {
        let rest = &self.bytes[self.at..];
        if rest.is_empty() {
            return fault(self.place(), "the file ends here", DAMAGED);
        }
        let length = rest.iter().position(|b| *b == b'\n').map_or(rest.len(), |end| end + 1);
        self.at += length;
        match std::str::from_utf8(rest[..length].trim_ascii()) {
            Ok(line) => Ok(line),
            Err(_) => fault(self.place(), "is not text where text is expected", DAMAGED),
        }
    }

    /// Passes over all that may stand before `$MeshFormat`: sections of comments, and lines that begin no section.
    pub(super) fn skip_comments(&mut self) -> Result<(), Fault> {
        while !self.bytes[self.at..].trim_ascii().is_empty() {
            let begin = self.at;
            let line = self.line()?;
            match line.strip_prefix('$') {
                Some("Comments") => self.skip_section("Comments")?,
                Some(_) => {
                    self.at = begin;
                    return Ok(());
                }
                None => {}
            }
        }
        Ok(())
    }

    /// Advances to the next line that begins with `$` and returns the rest of it; `None` at the end of the file.
    pub(super) fn next_section(&mut self) -> Result<Option<&'a str>, Fault> {
        while !self.bytes[self.at..].trim_ascii().is_empty() {
            let line = self.line()?;
            if let Some(name) = line.strip_prefix('$') {
                return Ok(Some(name));
            }
            if !line.is_empty() && !["#", "//", "%"].iter().any(|mark| line.starts_with(mark)) {
                return fault(self.place(), format!("`{}` where a $Section is expected", shown(line)), DAMAGED);
            }
        }
        Ok(None)
    }

    /// Skips a section.
    pub(super) fn skip_section(&mut self, name: &str) -> Result<(), Fault> {
        let end = format!("$End{name}");
        let rest = &self.bytes[self.at..];
        match rest.windows(end.len()).position(|window| window == end.as_bytes()) {
            Some(start) => {
                self.at += start;
                self.line().map(|_| ())
            }
            None => fault(self.place(), format!("${} has no end", shown(name)), DAMAGED),
        }
    }

    pub(super) fn end_section(&mut self, name: &str) -> Result<(), Fault> {
        match self.next_section()? {
            Some(end) if end.strip_prefix("End") == Some(name) => Ok(()),
            found => {
                fault(self.place(), format!("{} where $End{name} is expected", found.unwrap_or("nothing")), DAMAGED)
            }
        }
    }

    /// Reads the number 1 that marks the byte order; numbers are binary from here on.
    pub(super) fn start_binary(&mut self) -> Result<(), Fault> {
        self.is_binary = true;
        let one = self.take(4)?;
        self.is_big_endian = one == 1_i32.to_be_bytes();
        if !self.is_big_endian && one != 1_i32.to_le_bytes() {
            return fault(self.place(), "the byte-order number is not 1", DAMAGED);
        }
        Ok(())
    }

    /// A number in the file's mode.
    pub(super) fn number<T: Number>(&mut self) -> Result<T, Fault> {
        if !self.is_binary {
            let word = self.word()?;
            return self.parsed(word, T::NAME);
        }
        let mut bytes = [0; 8];
        let bytes = &mut bytes[..T::BYTES];
        bytes.copy_from_slice(self.take(T::BYTES)?);
        if self.is_big_endian {
            bytes.reverse();
        }
        match T::from_little_endian(bytes) {
            Some(number) => Ok(number),
            None => fault(self.place(), format!("is not {}", T::NAME), DAMAGED),
        }
    }

    /// A count as text on its own line, in both modes.
    pub(super) fn count_line(&mut self) -> Result<u64, Fault> {
        let line = self.line()?;
        self.parsed(line, u64::NAME)
    }

    fn parsed<T: FromStr>(&self, text: &str, expected: &str) -> Result<T, Fault> {
        match text.parse() {
            Ok(number) => Ok(number),
            Err(_) => fault(self.place(), format!("`{}` is not {expected}", shown(text)), DAMAGED),
        }
    }

    fn word(&mut self) -> Result<&'a str, Fault> {
        let rest = &self.bytes[self.at..];
        let begin = rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(rest.len());
        let length = rest[begin..].iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len() - begin);
        self.at += begin + length;
        match std::str::from_utf8(&rest[begin..begin + length]) {
            Ok("") => fault(self.place(), "the file ends where a number is expected", DAMAGED),
            Ok(word) => Ok(word),
            Err(_) => fault(self.place(), "is not text where a number is expected", DAMAGED),
        }
    }

    fn take(&mut self, n: usize) -> Result<&'a [u8], Fault> {
        match self.bytes.get(self.at..self.at + n) {
            Some(bytes) => {
                self.at += n;
                Ok(bytes)
            }
            None => fault(self.place(), "the file ends where a number is expected", DAMAGED),
        }
    }
}

/// Beginning of the text found, for a message of one line.
fn shown(text: &str) -> String {
    const MOST: usize = 40;
    text.chars().take(MOST).map(|c| if c.is_control() { ' ' } else { c }).collect()
}
