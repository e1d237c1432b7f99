//! Which names files of a run may have, and the names that are given.

use crate::Error;

pub(crate) const LOCK: &str = "lock";
pub(crate) const CHECKPOINTS: &str = "checkpoints";

pub(crate) fn checkpoint(step: u64) -> String {
    format!("{CHECKPOINTS}/step-{step:08}.ckpt")
}

pub(crate) fn step(name: &str) -> Option<u64> {
    let number = name.rsplit('-').next()?.strip_suffix(".ckpt")?;
    let step = number.parse().ok()?;
    (checkpoint(step) == name).then_some(step)
}

/// Accepts names as they are the same on every system: components of letters, digits, `.`, `-` and
/// `_`, joined by `/`, that do not begin with a dot; and none that the run uses itself.
pub(crate) fn check(name: &str) -> Result<(), Error> {
    let plain = |part: &str| {
        !part.is_empty()
            && !part.starts_with('.')
            && (part.bytes()).all(|b| b.is_ascii_alphanumeric() || b"._-".contains(&b))
    };
    if name.len() > 512 || !name.split('/').all(plain) {
        return Err(Error::file(
            name,
            "give up to 512 letters, digits, '.', '-' and '_', folders separated by '/', none \
             beginning with '.'",
        ));
    }
    let first = name.split('/').next().unwrap_or(name);
    // Without regard to case, as some systems do not distinguish them.
    let reserved = |own: &&str| own.eq_ignore_ascii_case(first);
    if [LOCK, CHECKPOINTS].iter().any(reserved) {
        return Err(Error::file(name, "the run directory uses the name itself"));
    }
    Ok(())
}
