//! A commit: the state of a computation, and what the run consists of, in one file.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use files::Sha256;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_bytes::{ByteBuf, Bytes};
use serde_json::Value;

use crate::digest::{self, Seal};
use crate::{Error, names};

/// Not text, not any other format, and changed by programs that convert line ends.
const MAGIC: [u8; 8] = *b"\x8fckpt\r\n\x1a";
/// Bumped when a reader of the old format would misread the new one.
const FORMAT: u32 = 6;
/// Notes that are nested more deeply could not be read back.
const DEEPEST: usize = 200;

/// What a run goes on from: all that the caller needs, so that the next step has the same bits as
/// without an interruption.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CheckpointState<'a> {
    /// Number of steps done.
    pub step: u64,
    /// Anything but large arrays, nested by at most 200 levels. JSON has no NaN and no infinity: what may become either belongs in an array.
    pub notes: Value,
    /// Named arrays, stored bit by bit.
    pub arrays: BTreeMap<String, Array<'a>>,
}

/// Values that are stored as bytes, little endian, and equal if these are.
#[derive(Debug, Clone)]
pub struct Array<'a>(pub Cow<'a, [f64]>);

impl PartialEq for Array<'_> {
    fn eq(&self, other: &Self) -> bool {
        let bits = |v: &f64| v.to_bits();
        self.0.iter().map(bits).eq(other.0.iter().map(bits))
    }
}

impl Serialize for Array<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let bytes: Vec<[u8; 8]> = self.0.iter().map(|v| v.to_le_bytes()).collect();
        Bytes::new(bytes.as_flattened()).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Array<'_> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let bytes = ByteBuf::deserialize(deserializer)?;
        match bytes.as_chunks() {
            (values, []) => Ok(Self(
                values.iter().map(|b| f64::from_le_bytes(*b)).collect(),
            )),
            _ => Err(serde::de::Error::custom("a number is cut off")),
        }
    }
}

impl<'a> CheckpointState<'a> {
    /// A state without arrays.
    pub fn new(step: u64, notes: Value) -> Self {
        Self {
            step,
            notes,
            arrays: BTreeMap::new(),
        }
    }

    /// Adds an array.
    #[must_use]
    pub fn with_array(mut self, name: &str, values: impl Into<Cow<'a, [f64]>>) -> Self {
        self.arrays.insert(name.into(), Array(values.into()));
        self
    }

    /// An array.
    pub fn array(&self, name: &str) -> Option<&[f64]> {
        self.arrays.get(name).map(|array| &*array.0)
    }

    pub(crate) fn refused(&self, reason: &str) -> Error {
        let step = self.step;
        Error::Invalid(format!("the state of step {step} cannot be used: {reason}"))
    }

    /// Refuses what could not be read back: better now than on the day of the restart.
    pub(crate) fn check(&self) -> Result<(), Error> {
        if depth(&self.notes) > DEEPEST {
            return Err(self.refused("its notes are nested too deeply"));
        }
        Ok(())
    }
}

fn depth(notes: &Value) -> usize {
    let inside = match notes {
        Value::Array(items) => items.iter().map(depth).max(),
        Value::Object(entries) => entries.values().map(depth).max(),
        _ => return 0,
    };
    1 + inside.unwrap_or(0)
}

/// The files of a run, apart from those that it makes itself, with the seals of those that never change.
pub(crate) type Files = BTreeMap<String, Option<Seal>>;

/// How many checkpoints a run keeps.
pub(crate) fn kept(finished: bool) -> usize {
    if finished { 1 } else { 2 }
}

/// What a checkpoint says of a run. Its format is
///
/// | bytes | content |
/// |---|---|
/// | 8 | magic `8f 63 6b 70 74 0d 0a 1a` |
/// | 4 | format version, little endian: [`FORMAT`] |
/// | … | the array of these three as CBOR (RFC 8949) |
/// | 32 | SHA-256 of all bytes before |
pub(crate) struct Commit {
    /// Whether the run is finished.
    pub(crate) finished: bool,
    pub(crate) files: Files,
    pub(crate) state: CheckpointState<'static>,
}

/// Writes a checkpoint.
pub(crate) fn write(
    out: &mut dyn Write,
    finished: bool,
    files: &Files,
    state: &CheckpointState<'_>,
) -> io::Result<()> {
    let mut hashed = Hashed(out, Sha256::default());
    hashed.write_all(&MAGIC)?;
    hashed.write_all(&FORMAT.to_le_bytes())?;
    ciborium::into_writer(&(finished, files, state), &mut hashed).map_err(|e| match e {
        ciborium::ser::Error::Io(error) => error,
        ciborium::ser::Error::Value(reason) => io::Error::other(reason),
    })?;
    let Hashed(out, hash) = hashed;
    out.write_all(&hash.finish())
}

/// Bytes on their way, and their checksum.
struct Hashed<'a>(&'a mut dyn Write, Sha256);

impl Write for Hashed<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.1.update(bytes);
        self.0.write_all(bytes)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

pub(crate) fn other_version(path: PathBuf, found: u32) -> Error {
    Error::Version {
        path,
        found,
        supported: FORMAT,
    }
}

/// The bytes of a checkpoint, if its checksum holds, and its path.
pub(crate) fn content(folder: &Path, step: u64) -> Result<(Vec<u8>, PathBuf), Error> {
    let path = folder.join(names::checkpoint(step));
    let mut bytes = digest::read(&path)?;
    let length = match bytes.split_last_chunk() {
        Some((all, sum)) if Sha256::of(all) == *sum => all.len(),
        _ => return Err(digest::wrong_checksum(&path)),
    };
    bytes.truncate(length);
    Ok((bytes, path))
}

/// Reads the checkpoint of a step.
pub(crate) fn read(folder: &Path, step: u64) -> Result<Commit, Error> {
    let (bytes, path) = content(folder, step)?;
    let damaged = |what: String| Error::damaged(&path, what);
    let mut rest = match bytes.strip_prefix(&MAGIC).map(<[u8]>::split_first_chunk) {
        Some(Some((format, rest))) if u32::from_le_bytes(*format) == FORMAT => rest,
        Some(Some((format, _))) => return Err(other_version(path, u32::from_le_bytes(*format))),
        _ => return Err(damaged("it does not begin as a checkpoint does".into())),
    };
    let read = ciborium::from_reader(&mut rest);
    let (finished, files, state): (bool, Files, CheckpointState<'_>) = read.map_err(|error| {
        // It may quote anything.
        let quoted = files::shortened(&error.to_string(), 300);
        damaged(format!("its content is not as expected: {quoted}"))
    })?;
    if state.step != step || !rest.is_empty() {
        let (found, more) = (state.step, rest.len());
        return Err(damaged(format!(
            "it is of step {found}, or has {more} bytes too many"
        )));
    }
    if let Some(name) = files.keys().find(|name| names::check(name).is_err()) {
        let shown = files::shortened(name, 60);
        return Err(damaged(format!("it lists a file with the name {shown:?}")));
    }
    Ok(Commit {
        finished,
        files,
        state,
    })
}
