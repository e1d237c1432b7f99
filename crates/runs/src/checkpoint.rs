//! The state of a computation as one file.

use std::io::{self, Read, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::Digest;

use crate::digest::{self, Hashing, PIECE};
use crate::{Damage, Error, Identity};

/// Not text, not any other format, and changed by programs that convert line ends.
pub(crate) const MAGIC: [u8; 8] = *b"\x8fckpt\r\n\x1a";
/// Bumped when a reader of the old format would misread the new one.
pub(crate) const FORMAT: u32 = 1;
/// Bytes before the header: magic, format, length of the header.
pub(crate) const START: usize = 16;
/// Bytes after the arrays.
pub(crate) const END: usize = 32;

/// What the caller needs to go on: all of it, so that the next step has the same bits as without an
/// interruption.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Number of steps done.
    pub step: u64,
    /// Time of the flow, finite.
    pub time: f64,
    /// Small things. JSON has no NaN and no infinity: what may become either belongs in an array.
    pub notes: Value,
    /// Named arrays, stored bit by bit. Names differ and are not empty.
    pub arrays: Vec<(String, Vec<f64>)>,
}

impl State {
    /// A state without arrays and notes.
    pub fn new(step: u64, time: f64) -> Self {
        Self {
            step,
            time,
            notes: Value::Null,
            arrays: Vec::new(),
        }
    }

    /// Adds an array.
    #[must_use]
    pub fn with_array(mut self, name: impl Into<String>, values: Vec<f64>) -> Self {
        self.arrays.push((name.into(), values));
        self
    }

    /// Sets the small things.
    #[must_use]
    pub fn with_notes(mut self, notes: impl Into<Value>) -> Self {
        self.notes = notes.into();
        self
    }

    /// Takes an array out.
    ///
    /// # Errors
    /// [`Error::State`] if there is none of that name.
    pub fn take_array(&mut self, name: &str) -> Result<Vec<f64>, Error> {
        let found = self.arrays.iter().position(|(other, _)| other == name);
        match found {
            Some(i) => Ok(self.arrays.swap_remove(i).1),
            None => Err(Error::State {
                step: self.step,
                reason: format!("it has no array {name:?}"),
            }),
        }
    }
}

/// A state with what it belongs to.
///
/// # Format
///
/// | bytes | content |
/// |---|---|
/// | 8 | magic `8f 63 6b 70 74 0d 0a 1a` |
/// | 4 | format version, little endian: 1 |
/// | 4 | length of the header, little endian |
/// | … | header: JSON with `identity`, `step`, `time`, `notes` and `arrays`, a list of `name` and `length` |
/// | … | the arrays one after the other, `f64`, little endian |
/// | 32 | SHA-256 of all bytes before |
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// What the state belongs to.
    pub identity: Identity,
    /// The state.
    pub state: State,
}

#[derive(Serialize, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
struct Header {
    identity: Identity,
    step: u64,
    time: f64,
    notes: Value,
    arrays: Vec<ArrayHeader>,
}

#[derive(Serialize, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
struct ArrayHeader {
    name: String,
    /// Number of values.
    length: u64,
}

impl Checkpoint {
    /// Longest header in bytes: 1 MiB. A reader takes 160 times as much memory for it at
    /// worst (small maps in the notes), and for the arrays no more than the file is long.
    pub const MAX_HEADER: usize = 1 << 20;

    /// Reads a checkpoint file.
    ///
    /// # Errors
    /// [`Error::Damaged`], [`Error::Version`] or [`Error::Io`], with the path.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let (file, length) = digest::open(path)?;
        decode(file, length, path)
    }

    /// Reads a checkpoint from memory; `path` is what errors name.
    ///
    /// # Errors
    /// As [`Checkpoint::read`].
    pub fn from_bytes(bytes: &[u8], path: impl AsRef<Path>) -> Result<Self, Error> {
        decode(bytes, bytes.len() as u64, path.as_ref())
    }
}

/// The bytes before the arrays, once it is certain that they can be read back.
pub(crate) fn start(identity: &Identity, state: &State) -> Result<Vec<u8>, Error> {
    let failed = |reason: String| Error::State {
        step: state.step,
        reason,
    };
    let header = Header {
        identity: identity.clone(),
        step: state.step,
        time: state.time,
        notes: state.notes.clone(),
        arrays: state
            .arrays
            .iter()
            .map(|(name, values)| ArrayHeader {
                name: name.clone(),
                length: values.len() as u64,
            })
            .collect(),
    };
    check_names(&header.arrays).map_err(failed)?;
    let json = serde_json::to_vec(&header).map_err(|e| failed(e.to_string()))?;
    if json.len() > Checkpoint::MAX_HEADER {
        return Err(failed(format!(
            "its notes and names take {} bytes of at most {}; put numbers into arrays",
            json.len(),
            Checkpoint::MAX_HEADER
        )));
    }
    // NaN becomes null, and deep nesting is not read: better now than on the day of the restart.
    let same = serde_json::from_slice(&json).is_ok_and(|back: Header| back == header);
    if !same {
        return Err(failed(
            "its time, grid or notes do not survive as JSON; all numbers must be finite".into(),
        ));
    }
    let mut bytes = Vec::with_capacity(START + json.len());
    bytes.extend(MAGIC);
    bytes.extend(FORMAT.to_le_bytes());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(json);
    Ok(bytes)
}

/// Writes a checkpoint, given its [`start`].
pub(crate) fn write(out: &mut dyn Write, start: &[u8], state: &State) -> io::Result<()> {
    let mut out = Hashing::new(out);
    out.write_all(start)?;
    let mut piece = Vec::with_capacity(PIECE);
    for (_, values) in &state.arrays {
        for values in values.chunks(PIECE / 8) {
            piece.clear();
            piece.extend(values.iter().flat_map(|v| v.to_le_bytes()));
            out.write_all(&piece)?;
        }
    }
    out.inner.write_all(&out.hash.finalize())
}

fn check_names(arrays: &[ArrayHeader]) -> Result<(), String> {
    let mut names: Vec<&str> = arrays.iter().map(|a| a.name.as_str()).collect();
    names.sort_unstable();
    if names.first() == Some(&"") {
        return Err("an array has no name".into());
    }
    match names.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(format!("two arrays have the name {:?}", pair[0])),
        None => Ok(()),
    }
}

/// Reads a checkpoint of `length` bytes. Nothing is allocated by a number in the file before the
/// length of the file agrees with it.
fn decode(source: impl Read, length: u64, path: &Path) -> Result<Checkpoint, Error> {
    let damaged = |damage| Error::damaged(path, damage);
    let content = |what: String| damaged(Damage::Content(what));
    let failed = |e: io::Error| match e.kind() {
        // It was longer a moment ago.
        io::ErrorKind::UnexpectedEof => content("it ends early".into()),
        _ => Error::io("read", path)(e),
    };
    let mut source = Hashing::new(source);
    if length < (START + END) as u64 {
        return Err(content(format!("its {length} bytes are no checkpoint")));
    }
    let mut start = [0; START];
    source.read_exact(&mut start).map_err(failed)?;
    if start[..8] != MAGIC {
        return Err(content("it does not begin as a checkpoint does".into()));
    }
    let number = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| start[at + i]));
    if number(8) != FORMAT {
        return Err(Error::Version {
            path: path.into(),
            found: number(8),
            supported: FORMAT,
        });
    }
    let header_length = number(12) as usize;
    let rest = length - (START + END) as u64;
    if header_length > Checkpoint::MAX_HEADER || header_length as u64 > rest {
        return Err(content(format!("a header of {header_length} bytes")));
    }
    let mut header = vec![0; header_length];
    source.read_exact(&mut header).map_err(failed)?;
    let header: Header =
        serde_json::from_slice(&header).map_err(|e| damaged(Damage::json("its header", &e)))?;
    check_names(&header.arrays).map_err(content)?;
    let values = header
        .arrays
        .iter()
        .try_fold(0u64, |sum, a| sum.checked_add(a.length))
        .and_then(|sum| sum.checked_mul(8));
    let expected = values.and_then(|bytes| bytes.checked_add((START + END + header_length) as u64));
    if expected != Some(length) {
        return Err(damaged(Damage::Length {
            found: length,
            expected: expected.unwrap_or(u64::MAX),
        }));
    }
    let mut arrays = Vec::with_capacity(header.arrays.len());
    let mut piece = vec![0; PIECE.min(rest as usize)];
    for ArrayHeader { name, length } in header.arrays {
        let mut values: Vec<f64> = Vec::new();
        let mut left = usize::try_from(length)
            .ok()
            .filter(|&n| values.try_reserve_exact(n).is_ok())
            .ok_or_else(|| content(format!("{length} values of {name:?} exceed the memory")))?;
        while left > 0 {
            let now = left.min(PIECE / 8);
            let piece = &mut piece[..8 * now];
            source.read_exact(piece).map_err(failed)?;
            let read = piece.chunks_exact(8);
            values.extend(read.map(|b| f64::from_le_bytes(std::array::from_fn(|i| b[i]))));
            left -= now;
        }
        arrays.push((name, values));
    }
    let mut checksum = [0; END];
    let Hashing {
        mut inner, hash, ..
    } = source;
    inner.read_exact(&mut checksum).map_err(failed)?;
    if hash.finalize()[..] != checksum {
        return Err(damaged(Damage::Checksum));
    }
    Ok(Checkpoint {
        identity: header.identity,
        state: State {
            step: header.step,
            time: header.time,
            notes: header.notes,
            arrays,
        },
    })
}
