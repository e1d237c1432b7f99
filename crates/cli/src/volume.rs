//! Volumes of voxels as inputs.

use volumes::{Body, Inside, Volume};

use crate::cli::{InputOptions, MessageOptions};
use crate::paths::absolute;
use crate::prelude::*;
use crate::values::Label;

const LISTED: usize = 20;

pub fn body(path: &Path, options: &InputOptions) -> Result<Body> {
    let volume = volumes::read(path)?;
    let inside = match (options.label, options.threshold) {
        (Some(Label::One(label)), _) => Inside::Label(label as f64),
        (Some(Label::All), _) => {
            refuse!(
                "--label all makes a surface of each label, and this command takes one: give its number",
            );
        }
        (None, Some(threshold)) => Inside::Above(threshold),
        (None, None) => usual(&volume, path)?,
    };
    Ok(volume.body(inside)?)
}

/// The larger one of two values.
fn usual(volume: &Volume, path: &Path) -> Result<Inside> {
    let [low, high] = volume.range();
    let found = match volume.labels().as_deref() {
        Some([_, (label, _)]) => return Ok(Inside::Label(*label)),
        Some(labels) if labels.len() > 2 => {
            let listed = labels.iter().take(LISTED);
            let listed: Vec<String> = listed.map(|(label, _)| label.to_string()).collect();
            let more = if labels.len() > LISTED { ", ..." } else { "" };
            let listed = listed.join(", ");
            format!("the values {listed}{more}: give --label N of one of them, --label all")
        }
        _ => format!("values from {low} to {high}: give --label N"),
    };
    refuse!(
        "{} holds {found}, or --threshold VALUE, above which is inside",
        path.display()
    )
}

/// Does the same with each label of a volume but 0, of which there must be some, if all are to become surfaces, and says whether they are.
/// Where one fails it goes on with the next, until it is interrupted.
pub fn with_each_label(
    options: &InputOptions,
    messages: MessageOptions,
    mut act: impl FnMut(i64) -> Result<()>,
) -> Result<bool> {
    let (Some(input), Some(Label::All)) = (&options.input, options.label) else {
        return Ok(false);
    };
    let path = absolute(input)?;
    let labels = volumes::read(&path)?.labels().unwrap_or_default();
    let labels = labels.iter().map(|(label, _)| *label as i64);
    let labels: Vec<i64> = labels.filter(|&label| label != 0).collect();
    if labels.is_empty() {
        refuse!(
            "{} holds no labels, which are whole numbers other than 0: give --threshold VALUE, above which is inside",
            path.display()
        );
    }
    let mut failed = Vec::new();
    for label in labels {
        match act(label) {
            Ok(()) => (),
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            Err(error) => {
                messages.warn(&format!("label {label}: {}", files::with_causes(&error)));
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

/// The name of a file or folder for one of several labels.
pub fn named(path: &Path, label: i64) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let (stem, extension) = match name.strip_suffix(".nii.gz") {
        Some(stem) => (stem, ".nii.gz"),
        None => name.split_at(name.rfind('.').unwrap_or(name.len())),
    };
    path.with_file_name(format!("{stem}-label{label}{extension}"))
}
