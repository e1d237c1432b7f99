//! What people look at: pictures, meshes, drawings.

use std::ffi::OsStr;
use std::fmt;

use engine::{METRICS, TIMINGS};
use serde::de::DeserializeOwned;

use crate::faired::Faired;
use crate::made::Shape;
use crate::paths::extension;
use crate::prelude::*;

/// Names of files that hold the shape at the beginning, without their extension.
pub const START: &str = "start";
pub const FINAL: &str = "final";
pub const DISPLACEMENT: &str = "final.displacement.svg";
pub const FRAMES: &str = "frames";
/// The files of a frame without their extensions.
pub fn frame(step: usize) -> String {
    format!("{FRAMES}/step-{step:06}")
}
pub const ANIMATION: &str = "animation.png";
/// The fields of the frames with their times.
pub const SERIES: &str = "frames.pvd";
pub const SUMMARY: &str = "summary.json";
pub const PAGE: &str = "index.html";

/// The parts and holes of a shape.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Topology {
    /// Closed curves or surfaces.
    pub components: usize,
    /// Of all surfaces together.
    pub euler_characteristic: Option<i64>,
}

impl Topology {
    /// Those of a surface.
    pub fn of(surface: &ClosedMesh) -> Self {
        Self {
            components: surface.components(),
            euler_characteristic: Some(surface.euler_characteristic()),
        }
    }
}

impl From<surfaces::Topology> for Topology {
    fn from(of_surface: surfaces::Topology) -> Self {
        Self {
            components: of_surface.components,
            euler_characteristic: Some(of_surface.euler_characteristic),
        }
    }
}

impl fmt::Display for Topology {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = if self.components == 1 { "" } else { "s" };
        write!(f, "{} closed part{plural}", self.components)?;
        match self.euler_characteristic {
            Some(number) => write!(f, " of Euler characteristic {number}"),
            None => Ok(()),
        }
    }
}

/// What an input asks of its flow.
#[derive(Default)]
pub struct Known<const D: usize> {
    /// Its volume, where that is known better than from the phase field.
    pub volume: Option<f64>,
    /// How far the interface may go.
    pub max_distance: Option<f64>,
    /// What is measured besides,
    pub measures: Vec<Measure<D>>,
    /// and what may end the flow besides.
    pub stops: Vec<Stop>,
}

/// How phase fields in `D` dimensions are shown.
pub trait Presentation<const D: usize>: Serialize + DeserializeOwned + Sync {
    /// That of a shape that is given on a grid or by a formula.
    fn of_box(grid: &Grid<D>) -> Result<Self>;

    /// Lets the axis that was chosen point up, or says which one does.
    fn turn(&mut self, up: &mut Option<UpAxis>) -> Result<()>;

    /// A picture, in the same frame for all steps of a flow from `start`.
    fn picture(&self, start: &Stored<D>, u: &Stored<D>, eps: f64) -> Result<Picture>;

    fn topology(&self, u: &Stored<D>) -> Result<Topology>;

    /// The extensions of files that hold it,
    const SAVED: &'static [&'static str];
    /// and that of the shape in the folder of a run,
    const USUAL: &'static str;

    /// but for what became of a surface at its end, which has this one.
    fn extension(&self) -> &str {
        Self::USUAL
    }

    /// Refuses other files.
    fn check_saved(path: &Path) -> Result<()> {
        if !Self::SAVED.contains(&&*extension(path)) {
            return Err(Error::Format {
                path: path.to_owned(),
                dimension: D,
                formats: Self::SAVED,
            });
        }
        Ok(())
    }

    /// The bytes of a file with the shape, in one of these formats.
    fn encode(&self, u: &Stored<D>, eps: f64, format: &str) -> Result<Vec<u8>>;

    /// The shape without its grid; `faired` is what became of a surface.
    fn shape(&self, u: &Stored<D>, eps: f64, faired: Option<Faired>) -> Result<Shape>;

    /// What becomes of a surface, and how far it has gone.
    fn faired(&self, _: &Stored<D>, _: &Stored<D>, _: f64) -> Result<Option<Faired>> {
        Ok(None)
    }

    /// Whether a copy of the input is the shape at the beginning.
    fn starts_as_input(&self) -> bool {
        false
    }

    /// The parts and holes of the input, where these are known better than from the phase field.
    fn input(&self) -> Option<Topology> {
        None
    }

    fn known(&self, _: &Stored<D>, _: f64) -> Result<Known<D>> {
        Ok(Known::default())
    }

    /// Names and bytes of the files that it takes to resume a run,
    fn inputs(&self) -> Result<Vec<(String, Vec<u8>)>>;

    /// and what becomes of them there.
    fn restore(&mut self, stored: &StoredRun) -> Result<()>;
}

/// Whether a file is written at the end of a run, where the shape has this extension.
pub fn is_of_end(name: &str, shape: &str) -> bool {
    is_stage(name, FINAL, shape) || [SUMMARY, ANIMATION, SERIES].contains(&name)
}

/// Whether a file in the folder of a run is one that it writes besides those that it begins with. Its shapes have these extensions, before the
/// end and there.
pub fn is_written(path: &Path, [shape, last]: &[String; 2]) -> bool {
    let name = path.file_name().and_then(OsStr::to_str).unwrap_or_default();
    let stem = name.split('.').next().unwrap_or_default();
    if path.parent() == Some(Path::new(FRAMES)) {
        return stem.starts_with("step-") && is_stage(name, stem, shape);
    }
    path == Path::new(name)
        && (is_of_end(name, last)
            || name == format!("{START}.{shape}")
            || [PAGE, METRICS, TIMINGS].contains(&name))
}

/// Whether a file shows the shape at a stage of the flow.
fn is_stage(name: &str, stage: &str, shape: &str) -> bool {
    let rest = name.strip_prefix(stage).unwrap_or_default();
    let mut formats = ["npy", "vti", "png", "displacement.svg", shape].into_iter();
    formats.any(|format| rest.strip_prefix('.') == Some(format))
}
