//! The numbers of a PLY file. All types of the format fit into `f64`.

use std::ops::Range;

use files::Number;

use super::header::{Element, Encoding, Header};
use crate::read::FormatError;

/// What an element has of a property: one value, or those of a list.
#[derive(Clone, Default)]
pub(super) struct Values {
    pub(super) numbers: Vec<f64>,
    /// Where in the file the last of them stands.
    pub(super) place: Range<usize>,
}

/// What follows the header.
pub(super) struct Body<'a> {
    encoding: Encoding,
    bytes: &'a [u8],
    position: usize,
    /// Lines read, of text.
    lines: usize,
}

impl<'a> Body<'a> {
    pub(super) fn new(header: &Header, bytes: &'a [u8]) -> Self {
        Self {
            encoding: header.encoding,
            bytes,
            position: header.length,
            lines: header.lines,
        }
    }

    /// Reads the elements of a kind and passes on each with its number.
    pub(super) fn rows(
        &mut self,
        element: &Element,
        mut each: impl FnMut(usize, &[Values]) -> Result<(), FormatError>,
    ) -> Result<(), FormatError> {
        let mut row = vec![Values::default(); element.properties.len()];
        for number in 0..element.count {
            let end = match self.encoding {
                Encoding::Ascii => Some(self.line()?),
                _ => None,
            };
            for (property, values) in element.properties.iter().zip(&mut row) {
                let count = match property.length {
                    Some(length) => self.number(element, length)?.0,
                    None => 1.0,
                };
                values.numbers.clear();
                // A negative length is none.
                for _ in 0..count as usize {
                    let (value, place) = self.number(element, property.scalar)?;
                    values.numbers.push(value);
                    values.place = place;
                }
            }
            self.position = end.unwrap_or(self.position);
            each(number, &row)?;
        }
        Ok(())
    }

    /// The next number of an element, and where it stands.
    fn number(
        &mut self,
        element: &Element,
        number: Number,
    ) -> Result<(f64, Range<usize>), FormatError> {
        if self.encoding == Encoding::Ascii {
            let place = self.word();
            let word = String::from_utf8_lossy(&self.bytes[place.clone()]);
            let expected = "a number of the type in the header";
            let wrong = || FormatError::line(self.lines, &word, expected);
            return Ok((parsed(number, &word).ok_or_else(wrong)?, place));
        }
        let place = self.position..self.position.saturating_add(number.size());
        let Some(bytes) = self.bytes.get(place.clone()) else {
            return Err(element.too_short(place.end, self.bytes.len()));
        };
        self.position = place.end;
        let big_endian = self.encoding == Encoding::BigEndian;
        Ok((number.decode(bytes, big_endian), place))
    }

    /// Where the next word of the line is; it is empty at the end.
    fn word(&mut self) -> Range<usize> {
        let rest = &self.bytes[self.position..];
        let is_blank = |byte: &&u8| byte.is_ascii_whitespace() && **byte != b'\n';
        let start = self.position + rest.iter().take_while(is_blank).count();
        let word = self.bytes[start..].iter();
        self.position = start + word.take_while(|byte| !byte.is_ascii_whitespace()).count();
        start..self.position
    }

    /// Goes to the next line that is not blank, and says where the one behind it begins.
    fn line(&mut self) -> Result<usize, FormatError> {
        while self.position < self.bytes.len() {
            let rest = &self.bytes[self.position..];
            let length = rest.iter().position(|&byte| byte == b'\n');
            let line = &rest[..length.unwrap_or(rest.len())];
            let next = (self.position + line.len() + 1).min(self.bytes.len());
            self.lines += 1;
            if !line.trim_ascii().is_empty() {
                return Ok(next);
            }
            self.position = next;
        }
        Err(FormatError::EndOfText(self.lines, "an element"))
    }
}

/// The value of a word, if numbers of this type can have it.
fn parsed(number: Number, word: &str) -> Option<f64> {
    match number {
        Number::F32 => word.parse::<f32>().ok().map(f64::from),
        Number::F64 => word.parse().ok(),
        _ => {
            let value = word.parse::<i64>().ok()?;
            let read = number.decode(&value.to_le_bytes()[..number.size()], false);
            (read as i64 == value).then_some(read)
        }
    }
}
