//! `timings.json`: wall times and the like, with their own checksum.

use std::io::Read;
use std::path::Path;

use serde_json::Value;

use crate::digest::{self, fingerprint};
use crate::{Error, names};

const LONGEST: u64 = 4 << 20;

/// The text of the file, if it can be read again.
pub(crate) fn encode(timings: &Value) -> Result<String, Error> {
    let text = seal(timings);
    if text.len() as u64 > LONGEST || unseal(text.as_bytes()).is_none() {
        return Err(Error::file(names::TIMINGS, "it is too long or too deep"));
    }
    Ok(text)
}

pub(crate) fn read(folder: &Path) -> Result<Value, Error> {
    let path = folder.join(names::TIMINGS);
    let mut bytes = Vec::new();
    let read = digest::open(&path)?.take(LONGEST).read_to_end(&mut bytes);
    read.map_err(files::Error::of("read", &path))?;
    unseal(&bytes).ok_or_else(|| digest::wrong_checksum(&path))
}

fn seal(content: &Value) -> String {
    let content = format!("{content:#}").replace('\n', "\n  ");
    let sha256 = fingerprint(&content);
    format!("{{\n  \"sha256\": \"{sha256}\",\n  \"content\": {content}\n}}\n")
}

fn unseal(bytes: &[u8]) -> Option<Value> {
    let mut sealed: Value = serde_json::from_slice(bytes).ok()?;
    let content = sealed.get_mut("content")?.take();
    // There is one text for every content, so that a change anywhere is noticed.
    (seal(&content).as_bytes() == bytes).then_some(content)
}
