//! What a PLY file announces.

use files::{Number, shortened};

use crate::read::FormatError;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

#[derive(Debug)]
pub(super) struct Property {
    name: String,
    /// Of the number of values, for a list.
    pub(super) length: Option<Number>,
    pub(super) scalar: Number,
}

#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Its lines, and its bytes.
    pub(super) lines: usize,
    pub(super) length: usize,
}

impl Header {
    /// The header, for whose counts the file is long enough.
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, FormatError> {
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        let (mut lines, mut begin) = (0, 0);
        loop {
            lines += 1;
            let Some(length) = bytes[begin..].iter().position(|&byte| byte == b'\n') else {
                return Err(FormatError::EndOfText(lines, "end_header"));
            };
            let line = String::from_utf8_lossy(&bytes[begin..begin + length]);
            begin += length + 1;
            let expected = |expected| FormatError::line(lines, &line, expected);
            let words = &mut line.split_ascii_whitespace();
            let keyword = words.next().unwrap_or_default();
            match keyword {
                "ply" if lines == 1 => {}
                _ if lines == 1 => return Err(expected("\"ply\"")),
                "comment" | "obj_info" => {}
                "format" => {
                    let known = Encoding::parse(words).ok_or_else(|| {
                        expected("format ascii, binary_little_endian or binary_big_endian 1.0")
                    })?;
                    encoding = Some(known);
                }
                "element" => {
                    let element = Element::parse(words);
                    let new = element.filter(|new| {
                        let read = ["vertex", "face", "tristrips"].contains(&new.name.as_str());
                        !(read && elements.iter().any(|known| known.name == new.name))
                    });
                    let new = new.ok_or_else(|| expected("a new element and its number"))?;
                    elements.push(new);
                }
                "property" => {
                    let last = elements.last_mut().zip(Property::parse(words));
                    let (element, property) = last.ok_or_else(|| {
                        expected("the type and the name of an element's property")
                    })?;
                    element.properties.push(property);
                }
                "end_header" => break,
                _ => return Err(expected("a line of a header")),
            }
        }
        let encoding = encoding.ok_or(FormatError::Undeclared("the format"))?;
        for element in &elements {
            element.check_length(encoding, begin, bytes.len())?;
        }
        Ok(Self {
            encoding,
            elements,
            lines,
            length: begin,
        })
    }

    pub(super) fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|element| element.name == name)
    }
}

impl Encoding {
    /// The bytes of a floating-point number of this type.
    pub(super) fn bytes(self, number: Number, value: f64) -> Vec<u8> {
        let mut bytes = match (self, number) {
            (Self::Ascii, Number::F32) => return (value as f32).to_string().into_bytes(),
            (Self::Ascii, _) => return value.to_string().into_bytes(),
            (_, Number::F32) => (value as f32).to_le_bytes().to_vec(),
            _ => value.to_le_bytes().to_vec(),
        };
        if self == Self::BigEndian {
            bytes.reverse();
        }
        bytes
    }

    fn parse<'a>(words: &mut impl Iterator<Item = &'a str>) -> Option<Self> {
        let encoding = match words.next()? {
            "ascii" => Self::Ascii,
            "binary_little_endian" => Self::LittleEndian,
            "binary_big_endian" => Self::BigEndian,
            _ => return None,
        };
        (words.next()? == "1.0").then_some(encoding)
    }
}

impl Element {
    fn parse<'a>(words: &mut impl Iterator<Item = &'a str>) -> Option<Self> {
        Some(Self {
            name: words.next()?.to_owned(),
            count: words.next()?.parse().ok()?,
            properties: Vec::new(),
        })
    }

    /// Number of the property of that name, if it is one value.
    pub(super) fn scalar(&self, name: &str) -> Option<usize> {
        let is_scalar = |p: &Property| p.name == name && p.length.is_none();
        self.properties.iter().position(is_scalar)
    }

    /// Those of three such names.
    pub(super) fn scalars(&self, names: [&str; 3]) -> Option<[usize; 3]> {
        let [x, y, z] = names.map(|name| self.scalar(name));
        Some([x?, y?, z?])
    }

    /// Number of the property of that name, if it is a list of integers.
    pub(super) fn indices(&self, name: &str) -> Option<usize> {
        let is_list = |p: &Property| p.name == name && p.length.is_some() && p.scalar.is_integer();
        self.properties.iter().position(is_list)
    }

    /// Refuses counts for which the file is too short, before anything is allocated.
    fn check_length(
        &self,
        encoding: Encoding,
        begin: usize,
        length: usize,
    ) -> Result<(), FormatError> {
        if self.properties.is_empty() && self.count > 0 {
            return Err(FormatError::NoProperties {
                element: shortened(&self.name, 60),
                count: self.count,
            });
        }
        // In text, a digit and a separator; a list may be empty.
        let least = |property: &Property| match encoding {
            Encoding::Ascii => 2,
            _ => property.length.unwrap_or(property.scalar).size(),
        };
        let each: usize = self.properties.iter().map(least).sum();
        // The last line of a text may lack its end.
        let missing = usize::from(encoding == Encoding::Ascii && self.count > 0);
        let expected = self.count.saturating_mul(each).saturating_add(begin) - missing;
        if expected > length {
            return Err(self.too_short(expected, length));
        }
        Ok(())
    }

    pub(super) fn too_short(&self, expected: usize, length: usize) -> FormatError {
        FormatError::Length {
            elements: format!("elements {:?}", shortened(&self.name, 60)),
            count: self.count as u64,
            expected: expected as u64,
            found: length as u64,
        }
    }
}

impl Property {
    fn parse<'a>(words: &mut impl Iterator<Item = &'a str>) -> Option<Self> {
        let first = words.next()?;
        let (length, scalar) = if first == "list" {
            let length = number(words.next()?)?;
            if !length.is_integer() {
                return None;
            }
            (Some(length), words.next()?)
        } else {
            (None, first)
        };
        Some(Self {
            scalar: number(scalar)?,
            name: words.next()?.to_owned(),
            length,
        })
    }
}

/// The type of numbers of that name.
fn number(word: &str) -> Option<Number> {
    Some(match word {
        "char" | "int8" => Number::I8,
        "uchar" | "uint8" => Number::U8,
        "short" | "int16" => Number::I16,
        "ushort" | "uint16" => Number::U16,
        "int" | "int32" => Number::I32,
        "uint" | "uint32" => Number::U32,
        "float" | "float32" => Number::F32,
        "double" | "float64" => Number::F64,
        _ => return None,
    })
}
