//! Numbers at places of a header.

use crate::FormatError;

/// The bytes of a header, and how they are ordered.
pub(super) struct Fields<'a> {
    pub(super) format: &'static str,
    pub(super) bytes: &'a [u8],
    pub(super) big_endian: bool,
}

impl Fields<'_> {
    /// The bytes from a place in the header, in little-endian order.
    fn at<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut bytes: [u8; N] = std::array::from_fn(|i| self.bytes[at + i]);
        if self.big_endian {
            bytes.reverse();
        }
        bytes
    }

    pub(super) fn i16(&self, at: usize) -> i16 {
        i16::from_le_bytes(self.at(at))
    }

    pub(super) fn i32(&self, at: usize) -> i32 {
        i32::from_le_bytes(self.at(at))
    }

    pub(super) fn i64(&self, at: usize) -> i64 {
        i64::from_le_bytes(self.at(at))
    }

    pub(super) fn f32(&self, at: usize) -> f64 {
        f64::from(f32::from_le_bytes(self.at(at)))
    }

    pub(super) fn f64(&self, at: usize) -> f64 {
        f64::from_le_bytes(self.at(at))
    }

    /// An entry that cannot be used.
    pub(super) fn bad<T>(
        &self,
        entry: &'static str,
        value: &impl ToString,
        requirement: &'static str,
    ) -> Result<T, FormatError> {
        Err(FormatError::Header {
            format: self.format,
            entry,
            value: value.to_string(),
            requirement,
        })
    }

    /// Numbers of voxels.
    pub(super) fn size(&self, size: [i64; 3]) -> Result<[u64; 3], FormatError> {
        match size.iter().find(|&&n| n < 2) {
            Some(n) => self.bad("number of voxels", n, "2 at least along each axis"),
            None => Ok(size.map(|n| n as u64)),
        }
    }
}
