//! `metrics.csv`, which only grows.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use files::Storage;
use serde::Serialize;
use sha2::{Digest, Sha256};

use crate::index::Extent;
use crate::{Error, digest};

#[derive(Debug)]
pub(crate) struct Metrics {
    path: PathBuf,
    file: File,
    length: u64,
    hash: Sha256,
    /// The first line with its end, once there is one.
    columns: Option<Vec<u8>>,
}

impl Metrics {
    /// An empty file, flushed.
    pub fn create(storage: &dyn Storage, path: PathBuf) -> Result<Self, Error> {
        let file = storage
            .create_file(&path)
            .map_err(Error::io("create", &path))?;
        storage
            .sync_file(&file, &path)
            .map_err(Error::io("flush to disk", &path))?;
        Ok(Self {
            path,
            file,
            length: 0,
            hash: Sha256::new(),
            columns: None,
        })
    }

    /// The first `length` bytes of a file, which have been checked; the rest is cut off. Returns the
    /// number of bytes that were.
    pub fn resume(storage: &dyn Storage, path: PathBuf, length: u64) -> Result<(Self, u64), Error> {
        let (file, real) = digest::open(&path)?;
        let (hash, _) = digest::hash_prefix(file, length, &path)?;
        let columns = match length {
            0 => None,
            _ => Some(first_line(&path)?),
        };
        let mut file = File::options()
            .write(true)
            .open(&path)
            .map_err(Error::io("open", &path))?;
        if real > length {
            storage
                .set_length(&file, &path, length)
                .map_err(Error::io("shorten", &path))?;
        }
        file.seek(SeekFrom::Start(length))
            .map_err(Error::io("write", &path))?;
        let metrics = Self {
            path,
            file,
            length,
            hash,
            columns,
        };
        Ok((metrics, real.saturating_sub(length)))
    }

    /// The bytes that a row adds, with the columns before the first one.
    pub fn encode(&mut self, row: &impl Serialize) -> Result<Vec<u8>, Error> {
        let mut out = csv::Writer::from_writer(Vec::new());
        let failed = |source| Error::Row { source };
        out.serialize(row).map_err(failed)?;
        let mut bytes = out
            .into_inner()
            .map_err(|e| failed(e.into_error().into()))?;
        // A struct gives two records. Quoted columns may hold line ends, so csv has to find the first.
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .from_reader(bytes.as_slice());
        let mut record = csv::ByteRecord::new();
        reader.read_byte_record(&mut record).map_err(failed)?;
        let end = reader.position().byte() as usize;
        let (columns, values) = bytes.split_at(end);
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim_end().to_owned();
        let refused = |expected: String, found: String| Error::Columns {
            path: self.path.clone(),
            expected,
            found,
        };
        match &self.columns {
            _ if values.is_empty() => Err(refused("the names of a struct".into(), String::new())),
            Some(expected) if expected != columns => Err(refused(text(expected), text(columns))),
            Some(_) => Ok(bytes.split_off(end)),
            None => {
                self.columns = Some(columns.to_vec());
                Ok(bytes)
            }
        }
    }

    pub fn append(&mut self, storage: &dyn Storage, bytes: &[u8]) -> Result<(), Error> {
        let Self { path, file, .. } = self;
        Appending {
            storage,
            file,
            path,
        }
        .write_all(bytes)
        .map_err(Error::io("write", path.as_path()))?;
        self.hash.update(bytes);
        self.length += bytes.len() as u64;
        Ok(())
    }

    pub fn sync(&self, storage: &dyn Storage) -> Result<Extent, Error> {
        storage
            .sync_file(&self.file, &self.path)
            .map_err(Error::io("flush to disk", &self.path))?;
        Ok(self.extent())
    }

    pub fn extent(&self) -> Extent {
        Extent {
            length: self.length,
            sha256: digest::hex(self.hash.clone().finalize()),
        }
    }
}

/// `write_all` on a storage.
struct Appending<'a> {
    storage: &'a dyn Storage,
    file: &'a mut File,
    path: &'a Path,
}

impl Write for Appending<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.storage.write(self.file, self.path, bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn first_line(path: &Path) -> Result<Vec<u8>, Error> {
    use std::io::Read;
    let failed = |source| Error::Row { source };
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .from_path(path)
        .map_err(failed)?;
    let mut record = csv::ByteRecord::new();
    reader.read_byte_record(&mut record).map_err(failed)?;
    let end = reader.position().byte();
    let mut line = Vec::new();
    File::open(path)
        .and_then(|file| file.take(end).read_to_end(&mut line))
        .map_err(Error::io("read", path))?;
    Ok(line)
}
