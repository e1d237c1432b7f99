//! By what files are recognised.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

use files::{Sha256, hexadecimal};
use serde::{Deserialize, Serialize};

use crate::Error;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Seal {
    length: u64,
    sha256: String,
}

impl Seal {
    pub fn of(path: &Path) -> Result<Self, Error> {
        let mut hash = Sha256::default();
        let read = io::copy(&mut open(path)?, &mut hash);
        Ok(Self {
            length: read.map_err(files::Error::of("read", path))?,
            sha256: hexadecimal(hash.finish()),
        })
    }
}

pub(crate) fn wrong_checksum(path: &Path) -> Error {
    Error::damaged(path, "it is not as it was written, by its checksum")
}

/// Opens an ordinary file for reading; anything else is damage.
pub(crate) fn open(path: &Path) -> Result<File, Error> {
    use io::ErrorKind::{NotADirectory, NotFound};
    let failed = |source: io::Error| match source.kind() {
        NotFound | NotADirectory => Error::damaged(path, "it is missing"),
        _ => files::Error::of("read", path)(source).into(),
    };
    // A link would lead out of the run, and reading a pipe would wait for ever.
    if !fs::symlink_metadata(path).map_err(failed)?.is_file() {
        return Err(Error::damaged(path, "it is not an ordinary file"));
    }
    File::open(path).map_err(failed)
}

/// Reads an ordinary file.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    let read = open(path)?.read_to_end(&mut bytes);
    read.map_err(files::Error::of("read", path))?;
    Ok(bytes)
}
