//! NRRD files, with the voxels in the same file or in one beside it (NHDR).
//!
//! <https://teem.sourceforge.net/nrrd/format.html>.

mod axes;
mod entries;

use std::io::BufReader;

use flate2::read::MultiGzDecoder;

use super::stream::Stream;
use super::{Contents, Header, length};
use crate::volume::Voxels;
use crate::{FormatError, Volume};
use entries::{Encoding, Entries, first_line};

pub(super) fn is_nrrd(bytes: &[u8]) -> bool {
    files::without_mark(bytes).starts_with(b"NRRD000")
}

/// The name of the file with the voxels, if these bytes are NRRD and it is another file.
pub(super) fn data_file(bytes: &[u8]) -> Result<Option<&str>, FormatError> {
    if !is_nrrd(bytes) {
        return Ok(None);
    }
    Entries::of(bytes)?.0.data_file()
}

pub(super) fn decode(contents: Contents<'_>) -> Result<Volume, FormatError> {
    let (entries, behind) = Entries::of(contents.bytes)?;
    let data = match (entries.data_file()?, contents.beside) {
        (None, _) => behind,
        (Some(_), Some(beside)) => beside,
        (Some(name), None) => {
            let requirement = "left out: in memory there is no file beside this one";
            return bad("data file", name, requirement);
        }
    };
    let encoding = entries.encoding()?;
    let mut header = entries.header(encoding)?;
    let data = without_lines(data, entries.line_skip()?);
    let skip = entries.byte_skip(encoding)?;
    match encoding {
        Encoding::Text => text(data, &header, entries.is_whole()?, contents),
        Encoding::Raw => {
            let length = length(header.size, header.element, contents.limit())?;
            let all = length.saturating_mul(header.frames.count);
            // Without a number the voxels are the last bytes.
            header.start = skip.unwrap_or((data.len() as u64).saturating_sub(all));
            Stream::new(data).volume(&header, contents)
        }
        Encoding::Gzip => {
            header.start = skip.unwrap_or(0);
            let unpacked = BufReader::new(MultiGzDecoder::new(data));
            Stream::new(unpacked).volume(&header, contents)
        }
    }
}

fn bad<T>(entry: &'static str, value: &str, requirement: &'static str) -> Result<T, FormatError> {
    FormatError::entry("NRRD", entry, &files::shortened(value, 60), requirement)
}

fn without_lines(data: &[u8], count: u64) -> &[u8] {
    let mut rest = data;
    for _ in 0..count {
        if rest.is_empty() {
            break;
        }
        rest = first_line(rest).1;
    }
    rest
}

/// The wanted volume of numbers in text.
fn text(
    data: &[u8],
    header: &Header,
    is_whole: bool,
    contents: Contents<'_>,
) -> Result<Volume, FormatError> {
    let damaged = |message: String| Err(FormatError::damaged("NRRD", &message));
    let frames = header.frames;
    let frame = frames.chosen(contents.frame)?;
    let length = length(header.size, header.element, contents.limit())?;
    let expected = (length / header.element.size() as u64).saturating_mul(frames.count);
    let (mut bytes, mut found) = (Vec::new(), 0);
    let words = data.split(|byte| byte.is_ascii_whitespace() || *byte == b',');
    for word in words.filter(|word| !word.is_empty()) {
        let number = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
        let number = number.filter(|value: &f64| !is_whole || value.fract() == 0.0);
        let Some(value) = number else {
            let shown =
                files::shortened(&word[..word.len().min(60)].escape_ascii().to_string(), 20);
            return damaged(format!("{shown} is no number of the type"));
        };
        if found / frames.row % frames.count == frame {
            bytes.extend(value.to_le_bytes());
        }
        found += 1;
        if found > expected {
            break;
        }
    }
    if found != expected {
        let more = if found > expected { " or more" } else { "" };
        return damaged(format!(
            "there should be {expected} numbers, and there are {found}{more}"
        ));
    }
    let voxels = Voxels {
        bytes,
        element: header.element,
        big_endian: false,
        scale: header.scale,
    };
    Volume::new(header.size.map(|n| n as usize), header.affine, voxels)
}
