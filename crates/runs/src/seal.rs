//! JSON that carries its own checksum.
//!
//! The first line holds the SHA-256 of all bytes after it, and before the checksum only one sequence
//! of bytes is allowed, so that a flipped bit anywhere is noticed:
//!
//! ```text
//! { "sha256": "<64 digits>",
//!   "content": ... }
//! ```

use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::digest::{fingerprint, is_digest};
use crate::{Damage, Error};

const HEAD: &str = "{ \"sha256\": \"";
const MIDDLE: &str = "\",\n  \"content\": ";
const TAIL: &str = " }\n";

/// Longest `timings.json` in bytes.
pub(crate) const MAX_TIMINGS: u64 = 1 << 20;

/// The sealed text of some content, of `limit` bytes at most.
pub(crate) fn seal(
    what: &'static str,
    content: &impl Serialize,
    limit: u64,
) -> Result<String, Error> {
    let content = serde_json::to_string_pretty(content)
        .map_err(|source| Error::Json { what, source })?
        .replace('\n', "\n  ");
    let rest = format!("{MIDDLE}{content}{TAIL}");
    let text = format!("{HEAD}{}{rest}", fingerprint(&rest));
    match text.len() as u64 {
        length if length > limit => Err(Error::TooLong {
            what,
            length,
            limit,
        }),
        _ => Ok(text),
    }
}

/// The content of a sealed text.
pub(crate) fn unseal<T: DeserializeOwned>(bytes: &[u8], path: &Path) -> Result<T, Error> {
    let failed = |damage| Error::damaged(path, damage);
    let text = std::str::from_utf8(bytes).map_err(|_| failed(Damage::Checksum))?;
    let (checksum, rest) = text
        .strip_prefix(HEAD)
        .and_then(|text| text.split_at_checked(64))
        .filter(|(checksum, _)| is_digest(checksum))
        .ok_or_else(|| failed(Damage::Content("it does not begin with a checksum".into())))?;
    if fingerprint(rest) != checksum {
        return Err(failed(Damage::Checksum));
    }
    let content = rest
        .strip_prefix(MIDDLE)
        .and_then(|rest| rest.strip_suffix(TAIL))
        .ok_or_else(|| failed(Damage::Content("nothing follows its checksum".into())))?;
    serde_json::from_str(content).map_err(|e| failed(Damage::json("its content", &e)))
}
