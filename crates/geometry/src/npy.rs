//! Fields as `NumPy` arrays (`.npy`), `float64`, C order, shape `(N, ..., N)`.
//!
//! An NPY file holds the values but not the box: the reader is told how to make the grid from the
//! number of cells it finds.
//!
//! ```
//! use geometry::{Field, Grid, npy};
//!
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("u.npy");
//! let u = Field::from_fn(Grid::<2>::centred(16, 2.0)?, |[x, y]| x * y);
//! npy::write(&path, &u)?;
//! let v = npy::read(&path, |cells| Grid::<2>::centred(cells, 2.0))?;
//! assert_eq!(u, v);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! No file, however broken, can cause more than a typed error: nothing is allocated on the word of
//! a header.

pub(crate) mod error;

use std::path::Path;

use files::{Number, write_atomically};
use serde::Deserialize;
use serde_json::Value;

use crate::grid::digits;
use crate::parallel::CHUNK;
use crate::{Error, Field, Grid, PhaseField};
pub use error::NpyError;

const MAGIC: &[u8; 6] = b"\x93NUMPY";
/// Longest header, in bytes, as NumPy has it.
const LONGEST_HEADER: usize = 10_000;
/// Most axes, as NumPy has it.
const MOST_AXES: usize = 64;
/// The header is padded so that the data start at a multiple of this.
const ALIGNMENT: usize = 64;

/// Writes a field on its whole grid, atomically (see [`write_atomically`]). What is not stored of it is never in memory as a whole.
///
/// # Errors
/// [`Error::Io`].
pub fn write<const D: usize>(
    path: impl AsRef<Path>,
    field: &impl PhaseField<D>,
) -> Result<(), Error> {
    let grid = field.nodes().grid();
    let header = header(&grid.shape());
    Ok(write_atomically(path, |out| {
        out.write_all(&header)?;
        let mut part = vec![0.0; CHUNK];
        for start in (0..grid.len()).step_by(CHUNK) {
            let part = &mut part[..CHUNK.min(grid.len() - start)];
            field.read(start, part);
            let mut values = part.iter();
            values.try_for_each(|value| out.write_all(&value.to_le_bytes()))?;
        }
        Ok(())
    })?)
}

/// Reads a field; `grid` makes the grid from the number of cells per side.
///
/// `float32` values are widened; both byte orders and Fortran order are understood.
///
/// Memory: at most four times the size of the file and 1 MiB, beside the file; the most is taken by
/// `float32` values in Fortran order.
///
/// # Errors
/// [`Error::Io`]; [`Error::Npy`] for a wrong type, rank or shape, for a truncated or overlong file
/// and for values that are not finite; what `grid` returns; [`Error::ValueCount`] if it makes a
/// grid of another size.
pub fn read<const D: usize>(
    path: impl AsRef<Path>,
    grid: impl FnOnce(usize) -> Result<Grid<D>, Error>,
) -> Result<Field<D>, Error> {
    let path = path.as_ref();
    let bytes = files::read(path)?;
    let (cells, values) = decode::<D>(&bytes).map_err(|source| Error::Npy {
        path: path.into(),
        source,
    })?;
    Field::from_values(grid(cells)?, values)
}

/// Magic, version 1.0, and the dictionary, padded to the alignment.
fn header(shape: &[usize]) -> Vec<u8> {
    let sides: Vec<String> = shape.iter().map(ToString::to_string).collect();
    // A tuple of one element needs its comma.
    let comma = if shape.len() == 1 { "," } else { "" };
    let mut text = format!(
        "{{'descr': '<f8', 'fortran_order': False, 'shape': ({}{comma}), }}",
        sides.join(", ")
    );
    let prefix = MAGIC.len() + 4;
    let padded = (prefix + text.len() + 1).next_multiple_of(ALIGNMENT) - prefix;
    text.extend(std::iter::repeat_n(' ', padded - text.len() - 1));
    text.push('\n');
    let length = u16::try_from(padded).expect("a header of a few axes is short");
    [
        MAGIC.as_slice(),
        &[1, 0],
        &length.to_le_bytes(),
        text.as_bytes(),
    ]
    .concat()
}

/// Cells per side and values in C order.
///
/// # Errors
/// See [`read`].
pub fn decode<const D: usize>(bytes: &[u8]) -> Result<(usize, Vec<f64>), NpyError> {
    let array = Array::of(bytes)?;
    if array.number.is_integer() {
        let found = array.data_type;
        return Err(NpyError::DataType { found });
    }
    let shape = &array.shape;
    if shape.len() != D {
        return Err(NpyError::Rank {
            expected: D,
            shape: array.shape,
        });
    }
    let side = shape.first().copied().unwrap_or(0);
    if shape.iter().any(|&s| s != side) {
        return Err(NpyError::NotCubical { shape: array.shape });
    }
    array.check_length()?;
    let stored: Vec<f64> = array.values().collect();
    let cells = side as usize;
    let values = if array.fortran_order {
        (0..stored.len())
            .map(|index| stored[reversed::<D>(index, cells)])
            .collect()
    } else {
        stored
    };
    match values.iter().enumerate().find(|(_, v)| !v.is_finite()) {
        None => Ok((cells, values)),
        Some((index, &value)) => Err(NpyError::NonFinite { index, value }),
    }
}

/// An array as it is in a file.
#[derive(Clone, Debug)]
pub struct Array<'a> {
    /// Sides of the array.
    pub shape: Vec<u64>,
    /// The type as written in the header, shortened.
    pub data_type: String,
    /// What the elements are; bool is `U8`.
    pub number: Number,
    /// Whether the highest byte of a number is the first one.
    pub big_endian: bool,
    /// Whether the first axis runs fastest, and not the last one.
    pub fortran_order: bool,
    /// All bytes behind the header.
    pub data: &'a [u8],
    /// How many bytes are before these.
    before: usize,
}

impl<'a> Array<'a> {
    /// The array in the bytes of a file. There may be fewer or more elements than its shape says: see [`Array::check_length`].
    ///
    /// # Errors
    /// A file that is not NPY, a damaged header, and elements that are neither bool nor real numbers of 32 or 64 bits or whole ones.
    pub fn of(bytes: &'a [u8]) -> Result<Self, NpyError> {
        let (header, data) = split(bytes)?;
        let header = Header::parse(header)?;
        let data_type = header.descr.as_str().unwrap_or("a record");
        let (number, big_endian) = number(data_type)?;
        Ok(Self {
            data_type: files::shortened(data_type, 20),
            shape: header.shape,
            number,
            big_endian,
            fortran_order: header.fortran_order,
            data,
            before: bytes.len() - data.len(),
        })
    }

    /// The elements that are there, as they are ordered in the file.
    pub fn values(&self) -> impl Iterator<Item = f64> + '_ {
        let elements = self.data.chunks_exact(self.number.size());
        elements.map(|element| self.number.decode(element, self.big_endian))
    }

    /// Whether there are as many elements as the shape says.
    ///
    /// # Errors
    /// [`NpyError::Length`] if not.
    pub fn check_length(&self) -> Result<(), NpyError> {
        let size = self.number.size() as u64;
        let mut sides = self.shape.iter();
        let expected = sides.try_fold(size, |product, &s| product.checked_mul(s));
        if expected == Some(self.data.len() as u64) {
            return Ok(());
        }
        let before = self.before as u64;
        Err(NpyError::Length {
            expected: expected.unwrap_or(u64::MAX).saturating_add(before),
            found: before + self.data.len() as u64,
        })
    }
}

/// Position in Fortran order of the element at `index` in C order.
fn reversed<const D: usize>(index: usize, cells: usize) -> usize {
    let digits = digits::<D>(index, cells);
    (digits.iter().rev()).fold(0, |position, digit| position * cells + digit)
}

/// Separates the text of the header from the data.
fn split(bytes: &[u8]) -> Result<(&[u8], &[u8]), NpyError> {
    let rest = bytes.strip_prefix(MAGIC).ok_or(NpyError::NotNpy)?;
    let truncated = |expected: usize| NpyError::Length {
        expected: expected as u64,
        found: bytes.len() as u64,
    };
    let (version, rest) = rest.split_first_chunk::<2>().ok_or(truncated(8))?;
    let (length, rest) = match version {
        [1, 0] => {
            let (length, rest) = rest.split_first_chunk::<2>().ok_or(truncated(10))?;
            (usize::from(u16::from_le_bytes(*length)), rest)
        }
        [2 | 3, 0] => {
            let (length, rest) = rest.split_first_chunk::<4>().ok_or(truncated(12))?;
            (u32::from_le_bytes(*length) as usize, rest)
        }
        &[major, minor] => return Err(NpyError::Version { major, minor }),
    };
    let before = bytes.len() - rest.len();
    let parts = rest.split_at_checked(length);
    let parts = parts.ok_or(truncated(before.saturating_add(length)))?;
    if length > LONGEST_HEADER {
        return Err(NpyError::HeaderLength {
            length,
            limit: LONGEST_HEADER,
        });
    }
    Ok(parts)
}

/// Kind and byte order of the numbers.
fn number(data_type: &str) -> Result<(Number, bool), NpyError> {
    let native_big = cfg!(target_endian = "big");
    let (big_endian, kind) = match data_type.split_at_checked(1) {
        Some(("<", kind)) => (false, kind),
        Some((">", kind)) => (true, kind),
        Some(("=" | "|", kind)) => (native_big, kind),
        _ => (native_big, data_type),
    };
    let number = match kind {
        "f8" => Number::F64,
        "f4" => Number::F32,
        "i1" => Number::I8,
        "i2" => Number::I16,
        "i4" => Number::I32,
        "i8" => Number::I64,
        "b1" | "u1" => Number::U8,
        "u2" => Number::U16,
        "u4" => Number::U32,
        "u8" => Number::U64,
        _ => {
            let found = files::shortened(data_type, 20);
            return Err(NpyError::DataType { found });
        }
    };
    Ok((number, big_endian))
}

/// The three entries of the dictionary.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    /// A string; anything else is the description of a record, which is not a number.
    descr: Value,
    fortran_order: bool,
    shape: Vec<u64>,
}

impl Header {
    fn parse(text: &[u8]) -> Result<Self, NpyError> {
        let malformed = |reason: &str| NpyError::Header {
            reason: files::shortened(reason, 120),
        };
        let header: Self = serde_json::from_str(&json(&String::from_utf8_lossy(text)))
            .map_err(|error| malformed(&error.to_string()))?;
        if header.shape.len() > MOST_AXES {
            return Err(malformed("more than 64 axes"));
        }
        Ok(header)
    }
}

/// The literals of Python that headers consist of, in JSON.
fn json(literals: &str) -> String {
    let mut json = String::with_capacity(literals.len());
    for c in literals.chars() {
        // Python may have a comma behind the last item, JSON may not.
        if matches!(c, ')' | '}') {
            let items = json
                .trim_end()
                .strip_suffix(',')
                .map_or(json.len(), str::len);
            json.truncate(items);
        }
        json.push(match c {
            '\'' => '"',
            '(' => '[',
            ')' => ']',
            _ => c,
        });
    }
    json.replace("True", "true").replace("False", "false")
}
