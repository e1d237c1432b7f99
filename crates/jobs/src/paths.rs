//! Files that options name.

use std::ffi::{OsStr, OsString};

use crate::prelude::*;

/// The extensions of meshes, the usual one first.
pub const MESHES: [&str; 4] = ["ply", "obj", "stl", "off"];

/// The path of a file from wherever the program may run later.
///
/// # Errors
/// Where the current folder is not known.
pub fn absolute(path: impl AsRef<Path>) -> Result<PathBuf> {
    let path = path.as_ref();
    Ok(std::path::absolute(path).map_err(files::Error::of("find", path))?)
}

/// The path of a file that may not be there yet, without links in that of its folder.
///
/// # Errors
/// As [`absolute`].
pub(crate) fn real(path: &Path) -> Result<PathBuf> {
    let path = absolute(path)?;
    let parts = path.parent().zip(path.file_name());
    let found = parts.and_then(|(folder, name)| Some(folder.canonicalize().ok()?.join(name)));
    Ok(found.unwrap_or(path))
}

/// The extension of a file in lower case.
pub fn extension(path: &Path) -> String {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    extension.to_ascii_lowercase()
}

/// What stands before a byte of a name that is no UTF-8, of which the hexadecimal digits follow. No name of a file has this character.
#[cfg(unix)]
const BYTE: char = '\0';

/// The name of a file as a text from which [`of_text`] gets it back.
#[cfg(unix)]
pub fn to_text(name: &OsStr) -> String {
    use std::os::unix::ffi::OsStrExt;
    let mut text = String::new();
    for chunk in name.as_bytes().utf8_chunks() {
        text += chunk.valid();
        for byte in chunk.invalid() {
            text.push(BYTE);
            text += &files::hexadecimal([*byte]);
        }
    }
    text
}

/// The name of a file whose text this is. A text without such bytes is the name itself.
#[cfg(unix)]
pub fn of_text(text: &str) -> OsString {
    use std::os::unix::ffi::OsStringExt;
    let mut parts = text.split(BYTE);
    let mut name = parts.next().unwrap_or_default().as_bytes().to_vec();
    for part in parts {
        let byte = part.get(..2).and_then(|d| u8::from_str_radix(d, 16).ok());
        match byte {
            Some(byte) => {
                name.push(byte);
                name.extend_from_slice(&part.as_bytes()[2..]);
            }
            // No text of a name has it: as it is, no file will have that name.
            None => name.extend_from_slice(&[b"\0", part.as_bytes()].concat()),
        }
    }
    OsString::from_vec(name)
}

/// The name of a file as a text. Elsewhere than on Unix, names are nearly always text.
#[cfg(not(unix))]
pub fn to_text(name: &OsStr) -> String {
    name.to_string_lossy().into_owned()
}

/// The name of a file whose text this is.
#[cfg(not(unix))]
pub fn of_text(text: &str) -> OsString {
    text.into()
}

/// For serde: a path as its [text](to_text).
#[expect(clippy::ref_option, reason = "serde passes the field")]
pub(crate) fn serialized<S: Serializer>(
    path: &Option<PathBuf>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let text = path.as_ref().map(|path| to_text(path.as_os_str()));
    text.serialize(serializer)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::ffi::OsStringExt;

    #[test]
    fn names_that_are_no_text_come_back() {
        for name in [
            &b"a b.ply"[..],
            b"caf\xe9.ply",
            b"\xff\xfe",
            b"\xf0\x9f.obj",
            "é\u{10ffff}".as_bytes(),
        ] {
            let name = OsString::from_vec(name.to_vec());
            assert_eq!(of_text(&to_text(&name)), name);
        }
        assert_eq!(to_text(OsStr::new("é.ply")), "é.ply");
        // Nonsense stays nonsense.
        for text in ["a\0", "a\0x1", "\0é"] {
            assert_eq!(of_text(text), OsString::from(text));
        }
    }
}
