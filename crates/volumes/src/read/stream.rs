//! Voxels while they are unpacked.

use std::io::{self, BufRead};

use super::{Contents, Header, length};
use crate::volume::Voxels;
use crate::{FormatError, Volume};

/// Bytes one after the other.
pub(super) struct Stream<R> {
    from: R,
    /// How many have come.
    count: u64,
}

impl<R: BufRead> Stream<R> {
    pub fn new(from: R) -> Self {
        Self { from, count: 0 }
    }

    /// The wanted volume behind a header, of which the stream begins with the first byte.
    pub fn volume(
        mut self,
        header: &Header,
        contents: Contents<'_>,
    ) -> Result<Volume, FormatError> {
        let frames = header.frames;
        let frame = frames.chosen(contents.frame)?;
        let length = length(header.size, header.element, contents.limit())?;
        let all = length.checked_mul(frames.count);
        let expected = all.and_then(|all| all.checked_add(header.start));
        let expected = expected.unwrap_or(u64::MAX);
        let row = frames.row.saturating_mul(header.element.size() as u64);
        let mut bytes = Vec::new();
        let unpack = self.rows(header, [row, frame], expected, &mut bytes);
        unpack.map_err(|error| FormatError::damaged("gzip", &error))?;
        let found = self.count;
        if found < expected || (found > expected && !header.has_footer) {
            return Err(FormatError::Length {
                expected,
                found,
                longer: found > expected,
            });
        }
        let voxels = Voxels {
            bytes,
            element: header.element,
            big_endian: header.big_endian,
            scale: header.scale,
        };
        Volume::new(header.size.map(|n| n as usize), header.affine, voxels)
    }

    /// The rows of a frame, from which the same rows of other frames are taken out; and one byte more than expected, if there is one, tells
    /// that there are more.
    fn rows(
        &mut self,
        header: &Header,
        [row, frame]: [u64; 2],
        expected: u64,
        bytes: &mut Vec<u8>,
    ) -> io::Result<()> {
        self.pass(header.start, None)?;
        let after = header.frames.count - frame - 1;
        while self.count < expected {
            let before = self.count;
            self.pass(row.saturating_mul(frame), None)?;
            self.pass(row, Some(bytes))?;
            self.pass(row.saturating_mul(after), None)?;
            if self.count == before {
                return Ok(());
            }
        }
        self.pass(1, None)
    }

    /// So many bytes, unless the end comes before.
    fn pass(&mut self, count: u64, mut into: Option<&mut Vec<u8>>) -> io::Result<()> {
        let mut left = count;
        while left > 0 {
            let part = self.from.fill_buf()?;
            let part = &part[..part.len().min(left.try_into().unwrap_or(usize::MAX))];
            if part.is_empty() {
                return Ok(());
            }
            if let Some(into) = &mut into {
                into.extend_from_slice(part);
            }
            let length = part.len();
            self.from.consume(length);
            self.count += length as u64;
            left -= length as u64;
        }
        Ok(())
    }
}
