//! `timings.json`: wall times, with their own checksum.

use std::path::Path;

use files::{Sha256, hexadecimal};
use serde::{Deserialize, Serialize};

use crate::{Error, digest, names};

#[derive(Deserialize)]
struct Sealed {
    content: Content<Vec<f64>>,
}

#[derive(Serialize, Deserialize)]
struct Content<T> {
    seconds: T,
}

/// The text of the file, if it can be read again.
pub(crate) fn encode(seconds: &[f64]) -> Result<String, Error> {
    if let Some(other) = seconds.iter().find(|seconds| !seconds.is_finite()) {
        let reason = format!("{other} is no wall time");
        return Err(Error::file(names::TIMINGS, &reason));
    }
    Ok(seal(seconds))
}

pub(crate) fn read(folder: &Path) -> Result<Vec<f64>, Error> {
    let path = folder.join(names::TIMINGS);
    let bytes = digest::read(&path)?;
    match serde_json::from_slice(&bytes) {
        // There is one text for every content, so that a change anywhere is noticed.
        Ok(Sealed { content }) if seal(&content.seconds).as_bytes() == bytes => Ok(content.seconds),
        _ => Err(digest::wrong_checksum(&path)),
    }
}

fn seal(seconds: &[f64]) -> String {
    let content = serde_json::to_string_pretty(&Content { seconds });
    let content = content.expect("it is numbers").replace('\n', "\n  ");
    let sha256 = hexadecimal(Sha256::of(&content));
    format!("{{\n  \"sha256\": \"{sha256}\",\n  \"content\": {content}\n}}\n")
}
