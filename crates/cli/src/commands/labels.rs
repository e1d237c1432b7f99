//! `--label all`: the same with each label of a volume.

use std::path::Path;

use jobs::InputOptions;
use jobs::values::Label;
use runs::Interrupt;

use crate::console::Console;
use crate::error::{Error, Result, refuse};

/// Does the same with each label of a volume, if all are to become surfaces, and says whether they are. Where one fails it goes on with the next,
/// until it is interrupted.
pub fn with_each(
    input: &InputOptions,
    console: &Console,
    mut act: impl FnMut(i64) -> Result<()>,
) -> Result<bool> {
    let Some(labels) = jobs::labels(input)? else {
        return Ok(false);
    };
    let mut failed = Vec::new();
    for (number, label) in labels.into_iter().enumerate() {
        // A signal may have come after the last step of the label before. Before the first one none is caught: it ends the reading at once.
        if number > 0 && Interrupt::catch()?.requested() {
            console.note(&format!("interrupted before label {label}"));
            return Err(Error::Interrupted);
        }
        match act(label) {
            Ok(()) => (),
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            Err(error) => {
                console.warn(&format!("label {label}: {}", files::with_causes(&error)));
                failed.push(label.to_string());
            }
        }
    }
    if !failed.is_empty() {
        refuse!(
            "these labels failed, as the warnings say: {}",
            failed.join(", ")
        );
    }
    Ok(true)
}

/// The options of an input, for one label.
pub fn choose(input: &mut InputOptions, label: i64) {
    input.label = Some(Label::One(label));
}

/// The name of the file or folder of one label.
pub fn named(path: &mut std::path::PathBuf, label: i64) {
    *path = jobs::named(Path::new(path), label);
}
