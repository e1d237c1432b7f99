//! SHA-256 of what passes by.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::Path;

use sha2::{Digest, Sha256};

use crate::{Damage, Error};

/// Bytes that are read at a time.
pub(crate) const PIECE: usize = 1 << 16;

/// The SHA-256 of some bytes in lower-case hexadecimal digits, for example as the fingerprint of the
/// options of a run.
pub fn fingerprint(bytes: impl AsRef<[u8]>) -> String {
    hex(Sha256::digest(bytes))
}

pub(crate) fn hex(digest: impl AsRef<[u8]>) -> String {
    use std::fmt::Write;
    digest.as_ref().iter().fold(String::new(), |mut text, b| {
        let _ = write!(text, "{b:02x}");
        text
    })
}

/// Whether a text is the SHA-256 of something, as [`fingerprint`] writes it.
pub(crate) fn is_digest(text: &str) -> bool {
    text.len() == 64 && text.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'))
}

/// Passes bytes on and keeps their number and checksum.
pub(crate) struct Hashing<T> {
    pub inner: T,
    pub hash: Sha256,
    pub length: u64,
}

impl<T> Hashing<T> {
    pub fn new(inner: T) -> Self {
        Self {
            inner,
            hash: Sha256::new(),
            length: 0,
        }
    }

    fn passed(&mut self, bytes: &[u8]) {
        self.hash.update(bytes);
        self.length += bytes.len() as u64;
    }
}

impl<W: Write> Write for Hashing<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.inner.write(bytes)?;
        self.passed(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

impl<R: Read> Read for Hashing<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let read = self.inner.read(bytes)?;
        self.passed(&bytes[..read]);
        Ok(read)
    }
}

/// Opens an ordinary file for reading and returns its length; anything else is damage.
pub(crate) fn open(path: &Path) -> Result<(File, u64), Error> {
    let failed = |source: io::Error| match source.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => {
            Error::damaged(path, Damage::Missing)
        }
        _ => Error::io("read", path)(source),
    };
    // A link would lead out of the run, and reading a pipe would wait for ever.
    let about = fs::symlink_metadata(path).map_err(failed)?;
    if !about.is_file() {
        return Err(Error::damaged(path, Damage::NotAFile));
    }
    Ok((File::open(path).map_err(failed)?, about.len()))
}

/// Reads a whole file of at most `limit` bytes.
pub(crate) fn read_small(path: &Path, limit: u64) -> Result<Vec<u8>, Error> {
    let (file, length) = open(path)?;
    if length > limit {
        let damage = Damage::Content(format!(
            "it has {length} bytes where at most {limit} are possible"
        ));
        return Err(Error::damaged(path, damage));
    }
    let mut bytes = Vec::new();
    file.take(limit)
        .read_to_end(&mut bytes)
        .map_err(Error::io("read", path))?;
    Ok(bytes)
}

/// The checksum of the first `length` bytes of a file, and the number of bytes there really were.
pub(crate) fn hash_prefix(file: File, length: u64, path: &Path) -> Result<(Sha256, u64), Error> {
    let mut source = Hashing::new(file.take(length));
    let mut piece = vec![0; PIECE];
    loop {
        match source.read(&mut piece) {
            Ok(0) => return Ok((source.hash, source.length)),
            Ok(_) => {}
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(Error::io("read", path)(e)),
        }
    }
}
