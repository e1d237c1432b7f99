//! Which names files of a run may have, and the names that are given.

use crate::Error;

pub(crate) const INDEX: &str = "index.json";
pub(crate) const LOCK: &str = "lock";
pub(crate) const METRICS: &str = "metrics.csv";
pub(crate) const MANIFEST: &str = "manifest.json";
pub(crate) const CONFIG: &str = "config.toml";
pub(crate) const TIMINGS: &str = "timings.json";
pub(crate) const CHECKPOINTS: &str = "checkpoints";
/// Folders that every run has.
pub(crate) const FOLDERS: [&str; 3] = [CHECKPOINTS, "figures", "fields"];

pub(crate) fn checkpoint(step: u64) -> String {
    format!("{CHECKPOINTS}/step-{step:08}.ckpt")
}

/// Accepts names as they are the same on every system: components of letters, digits, `.`, `-` and
/// `_`, joined by `/`, that do not begin with a dot.
pub(crate) fn check(name: &str) -> Result<(), Error> {
    let refused = |reason| {
        Err(Error::Name {
            name: name.into(),
            reason,
        })
    };
    let plain = |part: &str| {
        !part.is_empty()
            && !part.starts_with('.')
            && part
                .bytes()
                .all(|b| b.is_ascii_alphanumeric() || b"._-".contains(&b))
    };
    if name.len() > 512 || !name.split('/').all(plain) {
        return refused(
            "give up to 512 letters, digits, '.', '-' and '_', folders separated by '/', none \
             beginning with '.'",
        );
    }
    Ok(())
}

/// Accepts the names that a caller may write.
pub(crate) fn check_free(name: &str) -> Result<(), Error> {
    check(name)?;
    let first = name.split('/').next().unwrap_or(name);
    let reserved = [INDEX, LOCK, METRICS, MANIFEST, CONFIG, TIMINGS, CHECKPOINTS];
    // Without regard to case, as some systems do not distinguish them.
    if reserved.iter().any(|r| r.eq_ignore_ascii_case(first)) {
        return Err(Error::Name {
            name: name.into(),
            reason: "the run directory uses it itself",
        });
    }
    Ok(())
}
