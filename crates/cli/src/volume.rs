//! Volumes of voxels as inputs.

use derive_more::Display;
use volumes::{Body, Inside, Volume};

use crate::input::absolute;
use crate::prelude::*;

const LISTED: usize = 20;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Display)]
pub enum Label {
    /// Each but 0 becomes a surface of its own.
    #[display("all")]
    All,
    One(i64),
}

impl FromStr for Label {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse() {
            Ok(label) => Ok(Self::One(label)),
            Err(_) if text == "all" => Ok(Self::All),
            Err(_) => Err(format!("{text:?} is neither a whole number nor all")),
        }
    }
}

impl Serialize for Label {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Voxels {
    pub volume: f64,
    /// The side of a cube as large as a voxel.
    pub side: f64,
    /// How far its surface may go, root of the mean square, if that ends the flow.
    pub farthest: Option<f64>,
}

pub fn body(path: &Path, options: &InputOptions) -> Result<Body, Error> {
    let volume = volumes::read(path)?;
    let inside = match (options.label, options.threshold) {
        (Some(Label::One(label)), _) => Inside::Label(label as f64),
        (Some(Label::All), _) => {
            return Err(Error::options(
                "--label all makes a surface of each label, and this command takes one: give its number",
            ));
        }
        (None, Some(threshold)) => Inside::Above(threshold),
        (None, None) => usual(&volume, path)?,
    };
    Ok(volume.body(inside)?)
}

/// The larger one of two values.
fn usual(volume: &Volume, path: &Path) -> Result<Inside, Error> {
    let [low, high] = volume.range();
    let found = match volume.labels().as_deref() {
        Some([_, (label, _)]) => return Ok(Inside::Label(*label)),
        Some(labels) if labels.len() > 2 => {
            let listed = labels
                .iter()
                .take(LISTED)
                .map(|(label, _)| label.to_string());
            let more = if labels.len() > LISTED { ", ..." } else { "" };
            let listed = listed.collect::<Vec<_>>().join(", ");
            format!("the values {listed}{more}: give --label N of one of them, --label all")
        }
        _ => format!("values from {low} to {high}: give --label N"),
    };
    Err(Error::options(format!(
        "{} holds {found}, or --threshold VALUE, above which is inside",
        path.display()
    )))
}

/// The labels in a volume but 0, of which there must be some.
pub fn labels(path: &Path) -> Result<Vec<i64>, Error> {
    let labels = volumes::read(path)?.labels().unwrap_or_default();
    let labels = labels.iter().map(|(label, _)| *label as i64);
    let labels: Vec<i64> = labels.filter(|&label| label != 0).collect();
    if labels.is_empty() {
        return Err(Error::options(format!(
            "{} holds no labels, which are whole numbers other than 0: give --threshold VALUE, above which is inside",
            path.display()
        )));
    }
    Ok(labels)
}

/// The name of a file or folder for one of several labels.
pub fn named(path: &Path, label: i64) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let name = match path.extension() {
        Some(extension) => format!("{stem}-label{label}.{}", extension.to_string_lossy()),
        None => format!("{stem}-label{label}"),
    };
    path.with_file_name(name)
}

/// The volume whose labels are all to become surfaces, if they are.
pub fn of_all_labels(options: &InputOptions) -> Result<Option<PathBuf>, Error> {
    match (&options.input, options.label) {
        (Some(input), Some(Label::All)) => absolute(input).map(Some),
        _ => Ok(None),
    }
}
