//! The numbers of a PLY file. All types of the format fit into `f64`.

use std::borrow::Cow;

use files::Number;

use super::header::{Element, Encoding, Header};
use crate::read::{FormatError, shortened};

/// The values of the properties of one element; one value, or those of a list.
type Row = [Vec<f64>];

/// What follows the header.
pub(super) struct Body<'a> {
    encoding: Encoding,
    bytes: &'a [u8],
    position: usize,
    /// Lines read, of text.
    lines: usize,
}

impl<'a> Body<'a> {
    pub(super) fn new(header: &Header, bytes: &'a [u8], position: usize) -> Self {
        Self {
            encoding: header.encoding,
            bytes,
            position,
            lines: header.lines,
        }
    }

    /// Reads the elements of a kind and passes on each with its number.
    pub(super) fn rows(
        &mut self,
        element: &Element,
        mut each: impl FnMut(usize, &Row) -> Result<(), FormatError>,
    ) -> Result<(), FormatError> {
        let mut row = vec![Vec::new(); element.properties.len()];
        for number in 0..element.count {
            if self.encoding == Encoding::Ascii {
                self.text_row(element, &mut row)?;
            } else {
                self.binary_row(element, &mut row)?;
            }
            each(number, &row)?;
        }
        Ok(())
    }

    /// The whole file with the next element's values replaced where `value` has one for the number of a row and of a property.
    pub(super) fn rewritten(
        &mut self,
        element: &Element,
        value: impl Fn(usize, usize) -> Option<f64>,
    ) -> Result<Vec<u8>, FormatError> {
        let mut out = self.bytes[..self.position].to_vec();
        let mut row = vec![Vec::new(); element.properties.len()];
        for number in 0..element.count {
            let begin = self.position;
            if self.encoding == Encoding::Ascii {
                self.text_row(element, &mut row)?;
                let line = &self.bytes[begin..self.position.min(self.bytes.len())];
                let text = String::from_utf8_lossy(line);
                let mut words: Vec<Cow<str>> =
                    text.split_ascii_whitespace().map(Cow::from).collect();
                let mut word = 0;
                for (column, (property, values)) in element.properties.iter().zip(&row).enumerate()
                {
                    if let Some(value) = value(number, column) {
                        words[word] = value.to_string().into();
                    }
                    word += usize::from(property.length.is_some()) + values.len();
                }
                out.extend_from_slice(words.join(" ").as_bytes());
                out.extend_from_slice(&line[line.trim_ascii_end().len()..]);
                continue;
            }
            self.binary_row(element, &mut row)?;
            out.extend_from_slice(&self.bytes[begin..self.position]);
            let mut at = out.len() - (self.position - begin);
            for (column, (property, values)) in element.properties.iter().zip(&row).enumerate() {
                if let Some(value) = value(number, column) {
                    let big = self.encoding == Encoding::BigEndian;
                    let bytes = encode(property.scalar, value, big);
                    out[at..at + bytes.len()].copy_from_slice(&bytes);
                }
                at +=
                    property.length.map_or(0, Number::size) + values.len() * property.scalar.size();
            }
        }
        out.extend_from_slice(&self.bytes[self.position.min(self.bytes.len())..]);
        Ok(out)
    }

    fn binary_row(&mut self, element: &Element, row: &mut Row) -> Result<(), FormatError> {
        for (property, values) in element.properties.iter().zip(row) {
            let count = match property.length {
                Some(length) => self.numbers(element, length, 1)?.next(),
                None => Some(1.0),
            };
            // A negative length is none.
            let count = count.unwrap_or_default() as usize;
            values.clear();
            values.extend(self.numbers(element, property.scalar, count)?);
        }
        Ok(())
    }

    fn numbers(
        &mut self,
        element: &Element,
        scalar: Number,
        count: usize,
    ) -> Result<impl Iterator<Item = f64> + use<'a>, FormatError> {
        let size = scalar.size();
        let end = self.position.saturating_add(count.saturating_mul(size));
        let Some(bytes) = self.bytes.get(self.position..end) else {
            return Err(element.too_short(end, self.bytes.len()));
        };
        self.position = end;
        let big = self.encoding == Encoding::BigEndian;
        Ok(bytes
            .chunks_exact(size)
            .map(move |bytes| scalar.decode(bytes, big)))
    }

    fn text_row(&mut self, element: &Element, row: &mut Row) -> Result<(), FormatError> {
        let line = self.line()?;
        let mut words = line.split_ascii_whitespace();
        let mut number = |scalar: Number| {
            let word = words.next().unwrap_or_default();
            parsed(scalar, word).ok_or_else(|| FormatError::Line {
                line: self.lines,
                found: shortened(word),
                expected: "a number of the type in the header",
            })
        };
        for (property, values) in element.properties.iter().zip(row) {
            let count = property.length.map_or(Ok(1.0), &mut number)? as usize;
            values.clear();
            for _ in 0..count {
                values.push(number(property.scalar)?);
            }
        }
        Ok(())
    }

    /// The next line that is not blank.
    fn line(&mut self) -> Result<Cow<'a, str>, FormatError> {
        while self.position < self.bytes.len() {
            let rest = &self.bytes[self.position..];
            let length = rest.iter().position(|&byte| byte == b'\n');
            let line = &rest[..length.unwrap_or(rest.len())];
            self.position += line.len() + 1;
            self.lines += 1;
            if !line.trim_ascii().is_empty() {
                return Ok(String::from_utf8_lossy(line));
            }
        }
        Err(FormatError::EndOfText {
            line: self.lines,
            expected: "an element",
        })
    }
}

/// The bytes of a floating-point number of this type.
fn encode(number: Number, value: f64, big: bool) -> Vec<u8> {
    let mut bytes = match number {
        Number::F32 => (value as f32).to_le_bytes().to_vec(),
        _ => value.to_le_bytes().to_vec(),
    };
    if big {
        bytes.reverse();
    }
    bytes
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
