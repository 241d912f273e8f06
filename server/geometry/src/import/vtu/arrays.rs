//! `<DataArray>`s of a VTU file: location and number of their values.

use std::borrow::Cow;

use roxmltree::Node;

use super::blocks::{self, Compressor};
use super::numbers::{NumberType, text_numbers};
use crate::import::error::{DAMAGED, Fault, Place, fault};

/// Source and encoding of array values.
pub(super) struct Source<'a> {
    appended: Option<Stream<'a>>,
    pub(super) is_big_endian: bool,
    /// Bytes of a number in front of data.
    pub(super) header_bytes: usize,
    pub(super) compressor: Option<Compressor>,
}

/// Bytes as they stand in the file; base64 without white space.
#[derive(Clone)]
pub(super) enum Stream<'a> {
    Raw(&'a [u8]),
    Base64(Cow<'a, [u8]>),
}

/// One `<DataArray>`.
pub(super) struct Array<'a, 'input> {
    node: Node<'a, 'input>,
}

/// XML up to `<AppendedData`, closed again, and the data after its underscore, which need not be text.
pub(super) fn split_appended(bytes: &[u8]) -> (Cow<'_, [u8]>, Option<Stream<'_>>) {
    const TAG: &[u8] = b"<AppendedData";
    let Some(at) = bytes.windows(TAG.len()).position(|window| window == TAG) else {
        return (Cow::Borrowed(bytes), None);
    };
    let head = [&bytes[..at], b"</VTKFile>"].concat();
    let rest = &bytes[at..];
    let Some(end_of_tag) = rest.iter().position(|b| *b == b'>') else { return (Cow::Owned(head), None) };
    let (tag, data) = rest.split_at(end_of_tag);
    let Some(start) = data.iter().position(|b| *b == b'_') else { return (Cow::Owned(head), None) };
    let data = &data[start + 1..];
    let is_base64 = tag.windows(6).any(|window| window == b"base64");
    let base64_end = data.iter().position(|b| *b == b'<' || b.is_ascii_whitespace()).unwrap_or(data.len());
    let stream = if is_base64 { Stream::Base64(Cow::Borrowed(&data[..base64_end])) } else { Stream::Raw(data) };
    (Cow::Owned(head), Some(stream))
}

/// The array or section `name` at the line of `node`.
pub(super) fn place(node: Node<'_, '_>, name: &str) -> Place {
    let line = node.document().text_pos_at(node.range().start).row;
    Place::Field(name.to_owned(), Some(line as usize))
}

impl<'a> Source<'a> {
    pub(super) fn new(root: Node<'_, '_>, appended: Option<Stream<'a>>) -> Result<Self, Fault> {
        let is_big_endian = root.attribute("byte_order") == Some("BigEndian");
        let header_bytes = match root.attribute("header_type").unwrap_or("UInt32") {
            "UInt32" => 4,
            "UInt64" => 8,
            other => return fault(place(root, "header_type"), format!("`{other}`; UInt32 or UInt64"), DAMAGED),
        };
        let compressor = root.attribute("compressor").map(|name| Compressor::by_name(root, name)).transpose()?;
        Ok(Self { appended, is_big_endian, header_bytes, compressor })
    }

    /// `n` tuples of `n_components` numbers.
    pub(super) fn numbers(&self, array: &Array<'_, '_>, n: usize, n_components: usize) -> Result<Vec<f64>, Fault> {
        if array.n_components() != n_components {
            let problem = format!("has {} components, {n_components} are expected", array.n_components());
            return fault(array.place(), problem, DAMAGED);
        }
        let values = match self.stream(array)? {
            None => text_numbers::<f64>(array)?,
            Some(stream) => {
                let number_type = array.number_type()?;
                let bytes = blocks::read(self, array, stream)?;
                number_type.to_f64(&bytes, self.is_big_endian, array)?
            }
        };
        array.expect_length(values.len(), n * n_components)?;
        Ok(values)
    }

    /// `n` positions; some writers leave out that a position has three components.
    pub(super) fn positions(&self, array: &Array<'_, '_>, n: usize) -> Result<Vec<f64>, Fault> {
        if array.node.attribute("NumberOfComponents").is_none() {
            return self.numbers(array, 3 * n, 1);
        }
        self.numbers(array, n, 3)
    }

    /// Non-negative integers, `n` of them if known.
    pub(super) fn indices(&self, array: &Array<'_, '_>, n: Option<usize>) -> Result<Vec<u64>, Fault> {
        let values = match self.stream(array)? {
            None => text_numbers::<u64>(array)?,
            Some(stream) => {
                let number_type = array.number_type()?;
                let bytes = blocks::read(self, array, stream)?;
                number_type.to_u64(&bytes, self.is_big_endian, array)?
            }
        };
        array.expect_length(values.len(), n.unwrap_or(values.len()))?;
        Ok(values)
    }

    /// Bytes of the array; `None` if written as text.
    fn stream<'s>(&'s self, array: &Array<'s, '_>) -> Result<Option<Stream<'s>>, Fault> {
        match array.node.attribute("format").unwrap_or("ascii") {
            "ascii" => Ok(None),
            "binary" => {
                let bytes = array.text().bytes().filter(|b| !b.is_ascii_whitespace()).collect();
                Ok(Some(Stream::Base64(Cow::Owned(bytes))))
            }
            "appended" => self.appended_at(array).map(Some),
            other => fault(array.place(), format!("format `{other}`; ascii, binary or appended"), DAMAGED),
        }
    }

    fn appended_at<'s>(&'s self, array: &Array<'s, '_>) -> Result<Stream<'s>, Fault> {
        let offset = array.node.attribute("offset").and_then(|text| text.trim().parse::<usize>().ok());
        let stream = offset.and_then(|offset| match self.appended.as_ref()? {
            Stream::Raw(bytes) => bytes.get(offset..).map(Stream::Raw),
            Stream::Base64(bytes) => bytes.get(offset..).map(|bytes| Stream::Base64(Cow::Borrowed(bytes))),
        });
        match stream {
            Some(stream) => Ok(stream),
            None => fault(array.place(), format!("appended data has no offset {offset:?}"), DAMAGED),
        }
    }
}

impl<'a, 'input> Array<'a, 'input> {
    /// The arrays of a section.
    pub(super) fn all(section: Node<'a, 'input>) -> impl Iterator<Item = Self> {
        section.children().filter(|node| node.has_tag_name("DataArray")).map(|node| Self { node })
    }

    pub(super) fn name(&self) -> &'a str {
        self.node.attribute("Name").unwrap_or("Points")
    }

    pub(super) fn n_components(&self) -> usize {
        self.node.attribute("NumberOfComponents").map_or(1, |text| text.trim().parse().unwrap_or(0))
    }

    pub(super) fn is_numeric(&self) -> bool {
        self.node.attribute("type").and_then(NumberType::by_name).is_some()
    }

    pub(super) fn number_type(&self) -> Result<NumberType, Fault> {
        let name = self.node.attribute("type").unwrap_or_default();
        match NumberType::by_name(name) {
            Some(number_type) => Ok(number_type),
            None => fault(self.place(), format!("numbers of type `{name}`"), DAMAGED),
        }
    }

    pub(super) fn text(&self) -> &'a str {
        self.node.text().unwrap_or_default()
    }

    pub(super) fn place(&self) -> Place {
        place(self.node, self.name())
    }

    fn expect_length(&self, found: usize, expected: usize) -> Result<(), Fault> {
        if found == expected {
            return Ok(());
        }
        fault(self.place(), format!("holds {found} numbers, {expected} are expected"), DAMAGED)
    }
}
