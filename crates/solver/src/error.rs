use thiserror::Error as ThisError;

/// Why a step of mean curvature flow failed.
pub type StepFailure = Box<dyn std::error::Error + Send + Sync>;

/// What can stop a minimization or a flow.
#[derive(Debug, ThisError)]
pub enum Error {
    /// A value became NaN or infinite.
    #[error(
        "step {step}: {field} is not finite; the initial phase field or the step size is unsuitable"
    )]
    NonFinite {
        /// Time step, counted from 1 (0: the initial data).
        step: usize,
        /// Which quantity.
        field: &'static str,
    },
    /// The minimization gave up before its stop test held.
    #[error(
        "step {step}: the minimization stopped ({reason}) at {estimate:.1e} of the step, above the tolerance {tolerance:.1e}; \
         use a smaller time step"
    )]
    NotConverged {
        /// Time step, counted from 1.
        step: usize,
        /// Why it stopped.
        reason: crate::Exit,
        /// Estimated distance to the minimizer relative to the motion.
        estimate: f64,
        /// What was asked for.
        tolerance: f64,
    },
    /// Perimeter or volume could not be brought to its target in a step.
    #[error(
        "step {step}: the {measure} could not be brought from {value} to {target}; use smaller time steps, or change the target slowly"
    )]
    NotHeld {
        /// Time step, counted from 1.
        step: usize,
        /// Which measure.
        measure: &'static str,
        /// Its value before the step.
        value: f64,
        /// What was asked for.
        target: f64,
    },
    /// No set of a volume has so small a perimeter.
    #[error(
        "a perimeter of {perimeter} cannot enclose a volume of {volume}: the reduced volume would be {reduced_volume}, above 1; the perimeter \
         has to be at least {least}"
    )]
    PerimeterTooSmall {
        /// The target of the perimeter.
        perimeter: f64,
        /// The target of the volume.
        volume: f64,
        /// The least perimeter.
        least: f64,
        /// The volume over that of the ball of the same perimeter.
        reduced_volume: f64,
    },
    /// A volume that the box does not hold.
    #[error("a volume of {volume} does not fit a box of volume {box_volume}")]
    VolumeTooLarge {
        /// The target of the volume.
        volume: f64,
        /// The volume of the box.
        box_volume: f64,
    },
    /// A parameter out of range.
    #[error("{name} = {value:e} is out of range: {expected}")]
    Parameter {
        /// Which parameter.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The range.
        expected: &'static str,
    },
    /// A region that does not fit the grid.
    #[error(
        "a region of {marked} of {marks} nodes does not fit a grid of {nodes} nodes; mark at least one node, and give a mark for each"
    )]
    Region {
        /// Marks given.
        marks: usize,
        /// Nodes of the grid.
        nodes: usize,
        /// Marks that are set.
        marked: usize,
    },
    /// A phase field without an interface on active bricks, which follow one.
    #[error(
        "there is no interface for active bricks to follow; give a phase field of both signs, or store the whole grid"
    )]
    NoInterface,
    /// Something that flows on active bricks cannot do.
    #[error("{what} need the whole grid; store that instead of active bricks")]
    NeedsGrid {
        /// What was asked for.
        what: &'static str,
    },
    /// The step of mean curvature flow failed.
    #[error("the step of mean curvature flow failed: {0}")]
    Step(StepFailure),
    /// From the network.
    #[error(transparent)]
    Model(#[from] model::Error),
    /// From the traced energy.
    #[error(transparent)]
    Linearize(#[from] linearize::Error),
    /// From the device.
    #[error(transparent)]
    Operators(#[from] operators::Error),
    /// From the phase field.
    #[error(transparent)]
    Geometry(#[from] geometry::Error),
}
