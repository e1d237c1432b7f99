//! Texts of files in messages.

use std::error::Error;

/// The byte order mark of UTF-8, with which a file of text may begin.
pub const UTF8_MARK: &[u8] = b"\xef\xbb\xbf";

/// The bytes behind the [mark](UTF8_MARK), if they begin with it.
pub fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(UTF8_MARK).unwrap_or(bytes)
}

/// The start of a text, in one line without control characters, for the message that complains of
/// it: `longest` characters, and ` ...` if there is more.
///
/// ```
/// assert_eq!(files::shortened("a\t b\n c", 60), "a b c");
/// assert_eq!(files::shortened("some long text", 8), "some lon ...");
/// ```
pub fn shortened(text: &str, longest: usize) -> String {
    let mut line = String::new();
    // Of a long text, no more than can be needed is looked at.
    for word in text.split_whitespace() {
        if !line.is_empty() {
            line.push(' ');
        }
        let plain = word.chars().filter(|c| !c.is_control());
        line.extend(plain.take(longest + 1));
        if let Some((end, _)) = line.char_indices().nth(longest) {
            line.truncate(end);
            return line + " ...";
        }
    }
    line
}

/// The message of an error with its causes, on one line.
pub fn with_causes(error: &dyn Error) -> String {
    let mut line = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let text = error.to_string();
        // Most messages already contain their cause's.
        if !line.contains(&text) {
            line = format!("{line}: {text}");
        }
        cause = error.source();
    }
    line.split_whitespace().collect::<Vec<_>>().join(" ")
}
