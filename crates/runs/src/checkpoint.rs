//! A commit: the state of a computation, and what the run consists of, in one file.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use files::Sha256;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::digest::{self, Seal};
use crate::{Error, names};

/// Not text, not any other format, and changed by programs that convert line ends.
const MAGIC: [u8; 8] = *b"\x8fckpt\r\n\x1a";
/// Bumped when a reader of the old format would misread the new one.
const FORMAT: u32 = 3;
/// Bytes after the arrays.
const END: usize = 32;
/// Longest header in bytes, enough for a third of a million files.
const MAX_HEADER: usize = 1 << 26;
/// Values of an array that are stored as one where they are the same, as those far from the interface of a phase field.
const BLOCK: usize = 64;
/// Blocks that are written at a time.
const PIECE: usize = 1 << 7;

/// A name and values.
pub type Array<'a> = (String, Cow<'a, [f64]>);

/// What a run goes on from: all that the caller needs, so that the next step has the same bits as
/// without an interruption.
#[derive(Debug, Clone, PartialEq)]
pub struct State<'a> {
    /// Number of steps done.
    pub step: u64,
    /// Small things, at most [`State::MAX_NOTES`] bytes. JSON has no NaN and no infinity: what may
    /// become either belongs in an array.
    pub notes: Value,
    /// Text of any length, for what grows with the number of steps.
    pub text: String,
    /// Named arrays, stored bit by bit. Names differ and are not empty.
    pub arrays: Vec<Array<'a>>,
}

impl<'a> State<'a> {
    /// Longest notes in bytes of JSON: 1 MiB. A reader takes 160 times as much memory at worst (small
    /// maps).
    pub const MAX_NOTES: usize = 1 << 20;

    /// A state without arrays.
    pub fn new(step: u64, notes: Value) -> Self {
        Self {
            step,
            notes,
            text: String::new(),
            arrays: Vec::new(),
        }
    }

    /// Adds an array.
    #[must_use]
    pub fn with_array(mut self, name: &str, values: impl Into<Cow<'a, [f64]>>) -> Self {
        self.arrays.push((name.into(), values.into()));
        self
    }

    /// An array.
    pub fn array(&self, name: &str) -> Option<&[f64]> {
        let found = self.arrays.iter().find(|(other, _)| other == name);
        found.map(|(_, values)| &**values)
    }

    pub(crate) fn refused(&self, reason: &str) -> Error {
        let step = self.step;
        Error::Invalid(format!("the state of step {step} cannot be used: {reason}"))
    }

    /// Whether the two are stored as the same bytes.
    pub(crate) fn is_same(&self, other: &State<'_>) -> bool {
        let same = |(a, b): (&Array<'_>, &Array<'_>)| {
            let bits = |v: &f64| v.to_bits();
            a.0 == b.0 && a.1.iter().map(bits).eq(b.1.iter().map(bits))
        };
        self.notes == other.notes
            && self.text == other.text
            && self.arrays.len() == other.arrays.len()
            && self.arrays.iter().zip(&other.arrays).all(same)
    }
}

/// The files of a run, apart from those that it makes itself.
pub(crate) type Files = BTreeMap<String, Kind>;

/// How a file belongs to a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Kind {
    /// Written once.
    Written(Seal),
    /// Replaced at any time; sealed only when the run is finished.
    Derived(Option<Seal>),
}

/// How many checkpoints a run keeps.
pub(crate) fn kept(finished: bool) -> usize {
    if finished { 1 } else { 2 }
}

/// What a checkpoint file says besides notes, text and arrays. Its format:
///
/// | bytes | content |
/// |---|---|
/// | 8 | magic `8f 63 6b 70 74 0d 0a 1a` |
/// | 4 | format version, little endian: 3 |
/// | 4 + 4 | lengths of the header and of the notes, little endian |
/// | … | header: this as JSON |
/// | … | notes: JSON |
/// | … | the text, UTF-8 |
/// | … | the arrays one after the other, in blocks of 64 values: a byte, and if it is 0 the value that all of a block have, else all values, `f64`, little endian |
/// | 32 | SHA-256 of all bytes before |
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Header {
    step: u64,
    pub finished: bool,
    pub files: Files,
    /// Bytes of the text.
    #[serde(default)]
    text: u64,
    /// Names and numbers of values.
    arrays: Vec<(String, u64)>,
}

/// The bytes before text and arrays, once it is certain that they can be read back.
pub(crate) fn start(state: &State<'_>, files: &Files, finished: bool) -> Result<Vec<u8>, Error> {
    let lengths = |(name, values): &Array<'_>| (name.clone(), values.len() as u64);
    let header = Header {
        step: state.step,
        finished,
        files: files.clone(),
        text: state.text.len() as u64,
        arrays: state.arrays.iter().map(lengths).collect(),
    };
    if !are_names(&header.arrays) {
        return Err(state.refused("its arrays need names, and different ones"));
    }
    let header = serde_json::to_vec(&header).expect("it is names and numbers");
    let notes = serde_json::to_vec(&state.notes).expect("it is JSON");
    // Deep nesting is not read: better now than on the day of the restart.
    if !serde_json::from_slice(&notes).is_ok_and(|back: Value| back == state.notes) {
        return Err(state.refused("its notes are nested too deeply"));
    }
    for (what, length, limit) in [
        ("notes take", notes.len(), State::MAX_NOTES),
        ("list of files and arrays takes", header.len(), MAX_HEADER),
    ] {
        if length > limit {
            let reason = format!("its {what} {length} bytes, and at most {limit} can be read");
            return Err(state.refused(&reason));
        }
    }
    let length = |json: &[u8]| (json.len() as u32).to_le_bytes();
    let lengths = [length(&header), length(&notes)].concat();
    Ok([&MAGIC[..], &FORMAT.to_le_bytes(), &lengths, &header, &notes].concat())
}

/// Writes a checkpoint, given its [`start`].
pub(crate) fn write(out: &mut dyn Write, start: &[u8], state: &State<'_>) -> io::Result<()> {
    let mut hash = Sha256::default();
    let mut put = |bytes: &[u8]| {
        hash.update(bytes);
        out.write_all(bytes)
    };
    put(start)?;
    put(state.text.as_bytes())?;
    for values in (state.arrays.iter()).flat_map(|(_, values)| values.chunks(PIECE * BLOCK)) {
        put(&values.chunks(BLOCK).flat_map(packed).collect::<Vec<u8>>())?;
    }
    out.write_all(&hash.finish())
}

/// The bytes of a block.
fn packed(block: &[f64]) -> impl Iterator<Item = u8> {
    let differs = block.iter().any(|v| v.to_bits() != block[0].to_bits());
    let stored = if differs { block } else { &block[..1] };
    std::iter::once(u8::from(differs)).chain(stored.iter().flat_map(|v| v.to_le_bytes()))
}

/// Whether all have names, and none two have the same.
fn are_names(arrays: &[(String, u64)]) -> bool {
    let mut seen = BTreeSet::from([""]);
    arrays.iter().all(|(name, _)| seen.insert(name))
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
    match bytes.split_last_chunk::<END>() {
        Some((all, sum)) if Sha256::of(all) == *sum => {}
        _ => return Err(digest::wrong_checksum(&path)),
    }
    bytes.truncate(bytes.len() - END);
    Ok((bytes, path))
}

/// Reads the checkpoint of a step. A length in it is never more than a request: if there are not as
/// many bytes, it is damaged.
pub(crate) fn read(folder: &Path, step: u64) -> Result<(Header, State<'static>), Error> {
    let (bytes, path) = content(folder, step)?;
    let damaged = |what: String| Error::damaged(&path, what);
    let mut rest = bytes.as_slice();
    let mut take = |length: usize| {
        let taken = rest.split_off(..length);
        taken.ok_or_else(|| damaged("it ends early".into()))
    };
    if take(MAGIC.len())? != MAGIC {
        return Err(damaged("it does not begin as a checkpoint does".into()));
    }
    let mut number = || take(4).map(|b| u32::from_le_bytes(std::array::from_fn(|i| b[i])));
    let (format, in_header, in_notes) = (number()?, number()? as usize, number()? as usize);
    if format != FORMAT {
        return Err(other_version(path, format));
    }
    if in_header > MAX_HEADER || in_notes > State::MAX_NOTES {
        let what = format!("it has {in_header} bytes of header and {in_notes} of notes");
        return Err(damaged(what));
    }
    let json = |e: serde_json::Error| Error::json(&path, &e);
    let header: Header = serde_json::from_slice(take(in_header)?).map_err(json)?;
    let mut state = State::new(step, serde_json::from_slice(take(in_notes)?).map_err(json)?);
    if header.step != step || !are_names(&header.arrays) {
        let what = format!("it is of step {}, or of arrays without names", header.step);
        return Err(damaged(what));
    }
    if let Some(name) = (header.files.keys()).find(|name| names::check(name).is_err()) {
        let shown = files::shortened(name, 60);
        return Err(damaged(format!("it lists a file with the name {shown:?}")));
    }
    let text = take(usize::try_from(header.text).unwrap_or(usize::MAX))?.to_vec();
    state.text = String::from_utf8(text).map_err(|e| damaged(e.to_string()))?;
    // A block takes nine bytes at least.
    let least = |(_, length): &(String, u64)| 9 * length.div_ceil(BLOCK as u64);
    let least = header.arrays.iter().map(least).fold(0, u64::saturating_add);
    if least > bytes.len() as u64 {
        return Err(damaged("it ends early".into()));
    }
    for (name, length) in &header.arrays {
        let length = *length as usize;
        let mut values = Vec::with_capacity(length);
        while values.len() < length {
            let count = BLOCK.min(length - values.len());
            let stored = match take(1)? {
                [0] => 1,
                [1] => count,
                _ => return Err(damaged(format!("its array {name:?} has no such block"))),
            };
            let stored = take(8 * stored)?.chunks_exact(8);
            let stored = stored.map(|b| f64::from_le_bytes(std::array::from_fn(|i| b[i])));
            values.extend(stored.cycle().take(count));
        }
        state.arrays.push((name.clone(), values.into()));
    }
    if !rest.is_empty() {
        return Err(damaged(format!("it has {} bytes too many", rest.len())));
    }
    Ok((header, state))
}
