//! What all files of text have.

use files::UTF8_MARK;

use super::FormatError;

/// What is behind the mark with which a file of text may begin.
pub(super) fn without_mark(bytes: &[u8]) -> Result<&[u8], FormatError> {
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        return Err(FormatError::Utf16);
    }
    Ok(files::without_mark(bytes))
}

/// The mark with which the file begins, or nothing.
pub(super) fn mark(bytes: &[u8]) -> &'static [u8] {
    let length = bytes.len() - files::without_mark(bytes).len();
    &UTF8_MARK[..length]
}

/// A line before its comment, which `#` begins, and the comment without the end of the line.
pub(super) fn split_comment(text: &str) -> (&str, &str) {
    let text = text.trim_end();
    text.split_at(text.find('#').unwrap_or(text.len()))
}

/// The end of a line, with the blanks before it.
pub(super) fn line_end(line: &[u8]) -> &[u8] {
    &line[line.trim_ascii_end().len()..]
}
