//! The fields of headers.

use files::Number;

use super::axes::Axes;
use super::bad;
use crate::FormatError;
use crate::read::Header;

/// The names of types without `signed`, `int` behind another word, `_t` and blanks, and with `u` for `unsigned`.
const TYPES: [(&str, Number); 18] = [
    ("char", Number::I8),
    ("int8", Number::I8),
    ("uchar", Number::U8),
    ("uint8", Number::U8),
    ("short", Number::I16),
    ("int16", Number::I16),
    ("ushort", Number::U16),
    ("uint16", Number::U16),
    ("int", Number::I32),
    ("int32", Number::I32),
    ("uint", Number::U32),
    ("uint32", Number::U32),
    ("longlong", Number::I64),
    ("int64", Number::I64),
    ("ulonglong", Number::U64),
    ("uint64", Number::U64),
    ("float", Number::F32),
    ("double", Number::F64),
];

/// How the voxels are written.
#[derive(Clone, Copy, PartialEq)]
pub enum Encoding {
    Raw,
    Gzip,
    Text,
}

/// Fields as they are written.
#[derive(Default)]
pub struct Entries<'a> {
    pub dimension: Option<&'a str>,
    pub sizes: Option<&'a str>,
    pub kinds: Option<&'a str>,
    pub space: Option<&'a str>,
    pub directions: Option<&'a str>,
    pub origin: Option<&'a str>,
    pub spacings: Option<&'a str>,
    pub axis_mins: Option<&'a str>,
    element: Option<&'a str>,
    encoding: Option<&'a str>,
    endian: Option<&'a str>,
    line_skip: Option<&'a str>,
    byte_skip: Option<&'a str>,
    data_file: Option<&'a str>,
}

/// A line without its end, and what is behind it.
pub fn first_line(bytes: &[u8]) -> (&[u8], &[u8]) {
    let end = bytes.iter().position(|&byte| byte == b'\n');
    let (line, rest) = match end {
        Some(end) => (&bytes[..end], &bytes[end + 1..]),
        None => (bytes, &[][..]),
    };
    (line.strip_suffix(b"\r").unwrap_or(line), rest)
}

impl<'a> Entries<'a> {
    /// The fields, and what is behind the empty line that ends them. A header whose voxels are elsewhere may end with the file.
    pub fn of(bytes: &'a [u8]) -> Result<(Self, &'a [u8]), FormatError> {
        let (mut entries, (_, mut rest)) = (Self::default(), first_line(bytes));
        while !rest.is_empty() {
            let (line, after) = first_line(rest);
            rest = after;
            if line.is_empty() {
                return Ok((entries, rest));
            }
            // Comments, and notes as key:=value, may have any bytes.
            let field = std::str::from_utf8(line).ok();
            if let Some((name, value)) = field.and_then(|line| line.split_once(": ")) {
                entries.put(name, value.trim());
            }
        }
        if entries.data_file.is_none() {
            let message = "no empty line ends the header";
            return Err(FormatError::damaged("NRRD", &message));
        }
        Ok((entries, rest))
    }

    /// Notes a field; others say nothing here.
    fn put(&mut self, name: &str, value: &'a str) {
        let field = match name {
            "dimension" => &mut self.dimension,
            "type" => &mut self.element,
            "sizes" => &mut self.sizes,
            "encoding" => &mut self.encoding,
            "endian" => &mut self.endian,
            "space" => &mut self.space,
            "space directions" => &mut self.directions,
            "space origin" => &mut self.origin,
            "spacings" => &mut self.spacings,
            "axis mins" | "axismins" => &mut self.axis_mins,
            "kinds" => &mut self.kinds,
            "line skip" | "lineskip" => &mut self.line_skip,
            "byte skip" | "byteskip" => &mut self.byte_skip,
            "data file" | "datafile" => &mut self.data_file,
            _ => return,
        };
        *field = Some(value);
    }

    /// The name of the file with the voxels, if it is another one.
    pub fn data_file(&self) -> Result<Option<&'a str>, FormatError> {
        match self.data_file {
            Some(name) if name.starts_with("LIST") || name.contains('%') => {
                bad("data file", name, "the name of one file for all slices")
            }
            name => Ok(name),
        }
    }

    pub fn encoding(&self) -> Result<Encoding, FormatError> {
        match self.encoding.unwrap_or("missing") {
            "raw" => Ok(Encoding::Raw),
            "gzip" | "gz" => Ok(Encoding::Gzip),
            "text" | "txt" | "ascii" => Ok(Encoding::Text),
            other => bad("encoding", other, "raw, gzip or text"),
        }
    }

    /// How many lines are before the voxels.
    pub fn line_skip(&self) -> Result<u64, FormatError> {
        let value = self.line_skip.unwrap_or("0");
        match value.parse() {
            Ok(count) => Ok(count),
            Err(_) => bad("line skip", value, "a whole number, not negative"),
        }
    }

    /// How many bytes are before the voxels; nothing for all but the voxels.
    pub fn byte_skip(&self, encoding: Encoding) -> Result<Option<u64>, FormatError> {
        let value = self.byte_skip.unwrap_or("0");
        match value.parse() {
            Ok(count) => Ok(Some(count)),
            Err(_) if value == "-1" && encoding == Encoding::Raw => Ok(None),
            Err(_) => bad("byte skip", value, "a whole number, or -1 for raw voxels"),
        }
    }

    /// Whether all values are whole numbers.
    pub fn is_whole(&self) -> Result<bool, FormatError> {
        Ok(self.element()?.is_integer())
    }

    fn element(&self) -> Result<Number, FormatError> {
        let name = self.element.unwrap_or("missing");
        let words = name
            .split([' ', '_'])
            .filter(|word| *word != "signed" && *word != "t");
        let plain = words.collect::<String>().replace("unsigned", "u");
        let short = plain.strip_suffix("int").filter(|word| word.len() > 1);
        let known = |word: &str| TYPES.iter().find(|(known, _)| *known == word);
        match known(short.unwrap_or(&plain)) {
            Some((_, number)) => Ok(*number),
            None => bad("type", name, "a whole number, float or double"),
        }
    }

    fn is_big_endian(&self) -> Result<bool, FormatError> {
        match self.endian.unwrap_or("missing") {
            "big" => Ok(true),
            "little" => Ok(false),
            other => bad("endian", other, "little or big"),
        }
    }

    pub fn header(&self, encoding: Encoding) -> Result<Header, FormatError> {
        let element = match encoding {
            Encoding::Text => Number::F64,
            Encoding::Raw | Encoding::Gzip => self.element()?,
        };
        let axes = Axes::of(self)?;
        Ok(Header {
            size: axes.size,
            frames: axes.frames,
            element,
            big_endian: encoding != Encoding::Text && element.size() > 1 && self.is_big_endian()?,
            scale: [1.0, 0.0],
            affine: axes.affine,
            start: 0,
            has_footer: false,
        })
    }
}
