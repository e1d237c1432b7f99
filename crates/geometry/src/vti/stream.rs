//! The bytes of data arrays: base64, blocks, compression, numbers.

use std::io::Read;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use files::{Number, unsigned};
use flate2::read::ZlibDecoder;

/// How the numbers of a file are stored.
#[derive(Clone, Copy)]
pub(super) struct Format {
    pub big_endian: bool,
    /// Bytes of a number that tells a length.
    pub header: usize,
    /// By zlib.
    pub compressed: bool,
}

/// The type of the numbers of an array.
pub(super) fn number(name: &str) -> Option<Number> {
    Some(match name {
        "UInt8" => Number::U8,
        "Int8" => Number::I8,
        "UInt16" => Number::U16,
        "Int16" => Number::I16,
        "UInt32" => Number::U32,
        "Int32" => Number::I32,
        "UInt64" => Number::U64,
        "Int64" => Number::I64,
        "Float32" => Number::F32,
        "Float64" => Number::F64,
        _ => return None,
    })
}

/// Why there are no bytes.
pub(super) enum Fault {
    /// The data say that they have this many bytes.
    Length(u64),
    /// They cannot be decoded.
    Broken(&'static str),
}

impl From<&'static str> for Fault {
    fn from(reason: &'static str) -> Self {
        Self::Broken(reason)
    }
}

/// Bytes, raw or behind base64.
pub(super) struct Stream<'a> {
    rest: &'a [u8],
    base64: bool,
    /// Decoded, not yet taken.
    pending: Vec<u8>,
}

impl<'a> Stream<'a> {
    pub fn raw(bytes: &'a [u8]) -> Self {
        Self {
            rest: bytes,
            base64: false,
            pending: Vec::new(),
        }
    }

    pub fn base64(text: &'a [u8]) -> Self {
        Self {
            base64: true,
            ..Self::raw(text)
        }
    }

    /// The next bytes. Nothing is allocated that is not there.
    fn take(&mut self, count: usize) -> Result<Vec<u8>, &'static str> {
        const SHORT: &str = "the file ends, or the data end, early";
        if !self.base64 {
            let (taken, rest) = self.rest.split_at_checked(count).ok_or(SHORT)?;
            self.rest = rest;
            return Ok(taken.to_vec());
        }
        let mut taken = std::mem::take(&mut self.pending);
        while taken.len() < count {
            // Padding may end any group: headers are encoded by themselves, or not.
            let mut group = [0; 4];
            for symbol in &mut group {
                let white = self.rest.iter().take_while(|b| b.is_ascii_whitespace());
                let skipped = &self.rest[white.count()..];
                let (&first, rest) = skipped.split_first().ok_or(SHORT)?;
                (*symbol, self.rest) = (first, rest);
            }
            let mut bytes = [0; 3];
            let decoded = STANDARD.decode_slice(group, &mut bytes);
            let length = decoded.map_err(|_| "it is not base64")?;
            taken.extend(&bytes[..length]);
        }
        self.pending = taken.split_off(count);
        Ok(taken)
    }

    fn length(&mut self, format: Format) -> Result<u64, &'static str> {
        Ok(unsigned(&self.take(format.header)?, format.big_endian))
    }

    /// The data of one array of which `expected` bytes are wanted.
    pub fn block(&mut self, format: Format, expected: u64) -> Result<Vec<u8>, Fault> {
        let memory = |length| usize::try_from(length).map_err(|_| Fault::Length(length));
        if !format.compressed {
            let length = self.length(format)?;
            if length != expected {
                return Err(Fault::Length(length));
            }
            return Ok(self.take(memory(length)?)?);
        }
        // Number of blocks, their size, that of the last one unless it is whole, stored sizes.
        let count = self.length(format)?;
        let (whole, part) = (self.length(format)?, self.length(format)?);
        let last = if part == 0 { whole } else { part };
        let full = count.saturating_sub(1).saturating_mul(whole);
        let total = if count == 0 {
            0
        } else {
            full.saturating_add(last)
        };
        if total != expected {
            return Err(Fault::Length(total));
        }
        let mut stored = Vec::new();
        for _ in 0..count {
            stored.push(memory(self.length(format)?)?);
        }
        let mut bytes = Vec::new();
        for (k, size) in stored.into_iter().enumerate() {
            let wanted = if k as u64 + 1 == count { last } else { whole };
            let block = self.take(size)?;
            let before = bytes.len() as u64;
            // One byte more than wanted shows that there is more.
            ZlibDecoder::new(&block[..])
                .take(wanted.saturating_add(1))
                .read_to_end(&mut bytes)
                .map_err(|_| "a compressed block is broken")?;
            if bytes.len() as u64 - before != wanted {
                return Err("a compressed block has the wrong length".into());
            }
        }
        Ok(bytes)
    }
}
