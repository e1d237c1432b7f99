//! Volumes of voxels as inputs.

use volumes::{Body, Inside, Volume};

use crate::events::Silent;
use crate::file::File;
use crate::input::{Reader, Source};
use crate::options::InputOptions;
use crate::paths::{of_text, to_text};
use crate::prelude::*;
use crate::values::Label;

const LISTED: usize = 20;

/// Tells the warnings of the volume in a file.
pub(crate) fn tell(file: &File, warnings: &[volumes::Warning], watcher: &dyn Watcher) {
    for warning in warnings {
        watcher.warning(&Warning::Volume {
            path: file.path.clone(),
            warning: warning.clone(),
        });
    }
}

pub(crate) fn body(file: &File, options: &InputOptions, watcher: &dyn Watcher) -> Result<Body> {
    let volume = file.volume(options.frame)?;
    tell(file, volume.warnings(), watcher);
    let inside = match (options.label, options.threshold) {
        (Some(Label::One(label)), _) => Inside::Label(label as f64),
        (Some(Label::All), _) => {
            return Err(Refusal::AllLabels.into());
        }
        (None, Some(threshold)) => Inside::Above(threshold),
        (None, None) => usual(&volume, &file.path)?,
    };
    Ok(volume.body(inside)?)
}

/// The larger one of two values.
fn usual(volume: &Volume, path: &Path) -> Result<Inside> {
    let path = path.to_owned();
    let refusal = match volume.labels().as_deref() {
        Some([_, (label, _)]) => return Ok(Inside::Label(*label)),
        Some(labels) if labels.len() > 2 => Refusal::SeveralLabels {
            path,
            first: (labels.iter().take(LISTED))
                .map(|(label, _)| *label)
                .collect(),
            more: labels.len() > LISTED,
        },
        _ => {
            let [lowest, highest] = volume.range();
            Refusal::NoThreshold {
                path,
                lowest,
                highest,
            }
        }
    };
    Err(refusal.into())
}

/// The labels of a volume but 0, of which there must be some, if all of them are to become surfaces.
///
/// # Errors
/// An input that is no volume, a file that cannot be read, or that holds no labels.
pub fn labels(options: &InputOptions) -> Result<Option<Vec<i64>>> {
    if options.input.is_none() || options.label != Some(Label::All) {
        return Ok(None);
    }
    // No grid is made, so that the width of the interface is not asked for.
    let source = Reader::of(&mut options.clone(), f64::NAN, &Silent)?.source;
    let Source::Volume(file) = source else {
        unreachable!("a label of another input was refused");
    };
    let labels = file.volume(options.frame)?.labels().unwrap_or_default();
    let labels = labels.iter().map(|(label, _)| *label as i64);
    let labels: Vec<i64> = labels.filter(|&label| label != 0).collect();
    if labels.is_empty() {
        return Err(Refusal::NoLabels(file.path).into());
    }
    Ok(Some(labels))
}

/// The name of a file or folder for one of several labels.
pub fn named(path: &Path, label: i64) -> PathBuf {
    let name = to_text(path.file_name().unwrap_or_default());
    let (stem, extension) = match name.strip_suffix(".nii.gz") {
        Some(stem) => (stem, ".nii.gz"),
        None => name.split_at(name.rfind('.').unwrap_or(name.len())),
    };
    path.with_file_name(of_text(&format!("{stem}-label{label}{extension}")))
}
