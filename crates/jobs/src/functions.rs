//! The jobs as functions.

use surfaces::Repaired;

use crate::file::Input;
use crate::input::repaired;
use crate::job::Job;
use crate::made::{Made, Results};
use crate::options::{FairOptions, FlowOptions, InpaintOptions, McfOptions};
use crate::prelude::*;
use crate::session::run_in_memory;
use crate::values::Label;
use crate::volume;

/// Willmore flow of an input, in memory.
///
/// # Errors
/// As [`run_in_memory`].
pub fn flow(options: FlowOptions, watcher: &dyn Watcher) -> Result<Results> {
    run_in_memory(Job::Flow(options), watcher)
}

/// Mean curvature flow of an input, in memory.
///
/// # Errors
/// As [`run_in_memory`].
pub fn mcf(options: McfOptions, watcher: &dyn Watcher) -> Result<Results> {
    run_in_memory(Job::Mcf(options), watcher)
}

/// Fills a region of an input smoothly, in memory.
///
/// # Errors
/// As [`run_in_memory`].
pub fn inpaint(options: InpaintOptions, watcher: &dyn Watcher) -> Result<Results> {
    run_in_memory(Job::Inpaint(options), watcher)
}

/// Takes the noise off a mesh, or makes a smooth mesh of a segmentation, in memory.
///
/// # Errors
/// As [`run_in_memory`].
pub fn fair(options: FairOptions, watcher: &dyn Watcher) -> Result<Made<3>> {
    match run_in_memory(Job::Fair(options), watcher)? {
        Results::Space(made) => Ok(made),
        Results::Plane(_) => unreachable!("curves were refused"),
    }
}

/// The surface of one label of a segmentation.
#[derive(Clone, Debug)]
pub struct LabelSurface {
    /// The label.
    pub label: i64,
    /// Its surface.
    pub made: Made<3>,
}

/// A smooth surface of each label of a segmentation but 0, in memory.
///
/// # Errors
/// As [`run_in_memory`], and for a volume without labels.
pub fn surfaces_of_labels(
    mut options: FairOptions,
    watcher: &dyn Watcher,
) -> Result<Vec<LabelSurface>> {
    options.input.label = Some(Label::All);
    let labels = volume::labels(&options.input)?;
    let of_label = |label| {
        let mut one = options.clone();
        one.input.label = Some(Label::One(label));
        let made = fair(one, watcher)?;
        Ok(LabelSurface { label, made })
    };
    labels.into_iter().flatten().map(of_label).collect()
}

/// A closed mesh of one that is open, crosses itself or is not oriented alike, with the changes.
///
/// # Errors
/// An input that is no mesh, or one of which no closed mesh can be made.
pub fn repair(input: &Input) -> Result<Repaired> {
    repaired(input)
}
