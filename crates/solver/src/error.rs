#![allow(missing_docs, reason = "messages and names say it")]

use mean_curvature::StepFailure;
use thiserror::Error as ThisError;

/// A computed number with the five digits that a message needs.
pub fn rounded(number: f64) -> f64 {
    format!("{number:.4e}").parse().unwrap_or(number)
}

/// The next number with five digits, upwards or downwards, so that what a message says of a bound can be given.
fn outwards(number: f64, up: bool) -> f64 {
    let near = rounded(number);
    let beyond = if up { near >= number } else { near <= number };
    if beyond {
        return near;
    }
    let unit = 10_f64.powf(number.abs().log10().floor() - 4.0);
    rounded(if up { near + unit } else { near - unit })
}

/// What can stop a minimization or a flow.
#[derive(Debug, ThisError)]
pub enum Error {
    #[error(
        "step {step}: {field} is not finite; the initial phase field or the step size is unsuitable"
    )]
    NonFinite {
        /// Time step, counted from 1 (0: the initial data).
        step: usize,
        field: &'static str,
    },
    #[error(
        "step {step}: the minimization stopped at {estimate:.1e} of the step, above the tolerance {tolerance:.1e}; \
         use a smaller time step"
    )]
    NotConverged {
        /// Time step, counted from 1.
        step: usize,
        /// Estimated distance to the minimizer relative to the motion.
        estimate: f64,
        tolerance: f64,
    },
    #[error(
        "step {step}: the {measure} could not be brought from {value} to {target}; use smaller time steps, or change the target slowly"
    )]
    NotHeld {
        /// Time step, counted from 1.
        step: usize,
        measure: &'static str,
        value: f64,
        target: f64,
    },
    #[error(
        "step {step}: the sizes that are held change faster than the shape can follow, so that nothing can be told of its energy; let them reach their \
         targets in more steps"
    )]
    Rushed {
        /// Time step, counted from 1.
        step: usize,
    },
    #[error(
        "the {} {} cannot enclose the {} {}: the reduced volume would be {reduced_volume:.4}, above 1; the {} has to be larger than {}",
        .names[0], rounded(*.perimeter), .names[1], rounded(*.volume), .names[0], outwards(*.least, true)
    )]
    PerimeterTooSmall {
        names: [&'static str; 2],
        perimeter: f64,
        volume: f64,
        least: f64,
        reduced_volume: f64,
    },
    #[error(
        "a reduced volume of {target} is not possible: a ball has 1, any other shape less, this one {present:.4} at the beginning"
    )]
    ReducedVolume { target: f64, present: f64 },
    #[error(
        "no shape in the box with the {1} {2} has a smaller {0} than {3}, so that nothing could move: hold one of the two sizes, or a larger {0} with \
         this {1} (a smaller reduced volume)",
        .names[0], .names[1], rounded(*.volume), rounded(*.perimeter)
    )]
    LeastPerimeter {
        names: [&'static str; 2],
        perimeter: f64,
        volume: f64,
    },
    #[error(
        "the flow cannot begin: no shape in the box with the {1} {2} has a smaller {0} than {3}, and from such a shape the two cannot be changed \
         apart from each other; start from another shape, or hold one of the two sizes",
        .names[0], .names[1], rounded(*.volume), rounded(*.perimeter)
    )]
    LeastStart {
        names: [&'static str; 2],
        perimeter: f64,
        volume: f64,
    },
    #[error(
        "the sizes cannot change together: after {:.0} % of the way to their targets, the {} {} could not enclose the {} {}; change the {first} in a \
         run of its own, and the other one after it",
        100.0 * .part, .names[0], rounded(*.perimeter), .names[1], rounded(*.volume)
    )]
    Way {
        part: f64,
        first: &'static str,
        names: [&'static str; 2],
        perimeter: f64,
        volume: f64,
    },
    #[error(
        "the {measure} {} is too small to hold: a ball with the width {} of the interface as its radius has {}; give at least that, or more cells",
        rounded(*.target), rounded(*.eps), outwards(*.least, true)
    )]
    SizeTooSmall {
        measure: &'static str,
        target: f64,
        least: f64,
        eps: f64,
    },
    #[error(
        "the {measure} {} does not fit the box: interfaces of width {} are at least two widths apart, which leaves room for {}; give less than that, or \
         more cells",
        rounded(*.perimeter), rounded(*.eps), outwards(*.most, false)
    )]
    PerimeterTooLarge {
        measure: &'static str,
        perimeter: f64,
        most: f64,
        eps: f64,
    },
    #[error("the {measure} {} does not fit a box of the {measure} {}", rounded(*.volume), rounded(*.box_volume))]
    VolumeTooLarge {
        measure: &'static str,
        volume: f64,
        box_volume: f64,
    },
    #[error(
        "a region of {marked} of {marks} nodes does not fit a grid of {nodes} nodes; it needs nodes of that grid, one at least"
    )]
    Region {
        marks: usize,
        nodes: usize,
        marked: usize,
    },
    #[error(
        "there is no interface for active bricks to follow; give a phase field of both signs, or store the whole grid"
    )]
    NoInterface,
    #[error("{what} need the whole grid; store that instead of active bricks")]
    NeedsGrid { what: &'static str },
    /// Somebody [did not want it](crate::Cancel) any more.
    #[error("the step was cancelled")]
    Cancelled,
    #[error("direct steps do not take {what}: use minimizing steps")]
    NotDirect { what: &'static str },
    /// What a step of mean curvature flow refuses: a grid, scales, bricks.
    #[error("{0}")]
    Operator(StepFailure),
    #[error("the step of mean curvature flow failed: {0}")]
    Step(StepFailure),
    #[error("the term `{name}` of the energy has no derivatives")]
    Term {
        name: String,
        source: linearize::Error,
    },
    #[error(
        "the term `{name}` of the energy has tensors of shape {found:?} where the phase field has {expected:?}; make densities and shifts node by node"
    )]
    TermShape {
        name: String,
        found: Vec<usize>,
        expected: Vec<usize>,
    },
    #[error(
        "the term `{name}` of the energy has no finite derivative {place}; a root or a logarithm needs an offset there, as in `Domain::area`"
    )]
    TermDerivative { name: String, place: &'static str },
    #[error(transparent)]
    Model(#[from] model::Error),
    #[error(transparent)]
    Linearize(#[from] linearize::Error),
    #[error(transparent)]
    Operators(#[from] operators::Error),
    #[error(transparent)]
    Geometry(#[from] geometry::Error),
}

impl Error {
    /// Of a field after so many steps.
    pub(crate) fn non_finite(step: usize, field: &'static str) -> Self {
        Self::NonFinite { step, field }
    }

    /// The same of this time step.
    pub(crate) fn at(mut self, number: usize) -> Self {
        if let Self::NonFinite { step, .. } | Self::NotHeld { step, .. } | Self::Rushed { step } =
            &mut self
        {
            *step = number;
        }
        self
    }

    /// Whether a step that failed so may succeed if it is shorter.
    pub fn shorter_step_may_succeed(&self) -> bool {
        matches!(
            self,
            Self::NotConverged { .. } | Self::NonFinite { .. } | Self::NotHeld { .. }
        )
    }
}
