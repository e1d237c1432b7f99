//! The two flows as one thing that advances.

use geometry::measure::{perimeter, zero_set_volume};
use geometry::{Field, Grid};
use serde::Serialize;
use solver::{Error as SolverError, FlowState, MeanCurvatureFlow, WillmoreFlow};

use crate::error::Error;
use crate::outlet::Topology;
use crate::tau::Tau;

/// A row of `metrics.csv`.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Row {
    /// Number of the step, from 1.
    pub step: usize,
    /// Time at its end.
    pub time: f64,
    /// Its size.
    pub tau: f64,
    /// Energy of standing still.
    pub energy_before: Option<f64>,
    /// Energy of the step.
    pub energy: Option<f64>,
    /// Willmore energy of the result.
    pub willmore_energy: Option<f64>,
    /// Length or area.
    pub perimeter: f64,
    /// Area or volume.
    pub volume: f64,
    /// Newton steps.
    pub newton: Option<usize>,
    /// Hessian-vector products.
    pub hvp: Option<usize>,
    /// How often the step was halved.
    pub halvings: Option<usize>,
}

/// What the next step depends on besides the phase fields.
#[derive(Clone, Copy, Debug)]
pub struct Memory {
    /// Size of the next automatic step; NaN before the first.
    pub next: f64,
    /// Willmore energy before the first step; NaN before it.
    pub first_energy: f64,
    /// Willmore energy now; NaN before the first step.
    pub energy: f64,
    /// 1 while a shape that comes to the side of the box ends the run, 0 if it was there from the beginning.
    pub free: f64,
    /// The parts of the shape at the beginning.
    pub topology: Topology,
    /// Steps in a row, nearly of the largest automatic size, that took away next to nothing.
    pub still: f64,
}

impl Memory {
    /// Before the first step.
    pub const START: Self = Self {
        next: f64::NAN,
        first_energy: f64::NAN,
        energy: f64::NAN,
        free: 1.0,
        topology: Topology {
            components: 0,
            euler_characteristic: None,
        },
        still: 0.0,
    };
}

/// How often a step is halved before the run gives up.
const HALVINGS: usize = 24;
/// A step that takes away less than this part of the energy takes away next to nothing.
const STILL: f64 = 1e-4;
/// So many of them in a row are the end: larger steps would jump to other minimizers, such as an empty box.
const STILL_STEPS: f64 = 3.0;

/// A flow with its rule for time steps.
pub enum Motion<const D: usize> {
    /// Willmore flow.
    Willmore {
        /// The flow.
        flow: Box<WillmoreFlow<D>>,
        /// The rule.
        tau: Tau,
        /// The largest automatic step.
        largest: f64,
    },
    /// Mean curvature flow.
    MeanCurvature {
        /// The flow.
        flow: Box<MeanCurvatureFlow<D>>,
        /// The phase field now.
        field: Field<D>,
        /// The interface width.
        eps: f64,
        /// Size of all steps.
        tau: f64,
        /// Steps done.
        step: usize,
        /// Time reached.
        time: f64,
    },
}

impl<const D: usize> Motion<D> {
    /// The largest automatic step in a box: beyond it nothing is left to be seen.
    pub fn largest_step(grid: &Grid<D>) -> f64 {
        grid.side().powi(4) / 1024.0
    }

    /// Steps done and time reached.
    pub fn position(&self) -> (usize, f64) {
        match self {
            Self::Willmore { flow, .. } => (flow.steps(), flow.time()),
            Self::MeanCurvature { step, time, .. } => (*step, *time),
        }
    }

    /// The phase field now.
    ///
    /// # Errors
    /// If the device fails.
    pub fn field(&self) -> Result<Field<D>, Error> {
        Ok(match self {
            Self::Willmore { flow, .. } => flow.field()?,
            Self::MeanCurvature { field, .. } => field.clone(),
        })
    }

    /// Where it is.
    ///
    /// # Errors
    /// If the device fails.
    pub fn state(&self) -> Result<FlowState<D>, Error> {
        Ok(match self {
            Self::Willmore { flow, .. } => flow.state()?,
            Self::MeanCurvature {
                field, step, time, ..
            } => FlowState {
                current: field.clone(),
                previous: None,
                half_motions: Vec::new(),
                step: *step,
                time: *time,
            },
        })
    }

    /// Whether it stands still.
    pub fn is_still(&self, memory: &Memory) -> bool {
        matches!(self, Self::Willmore { tau, .. } if tau.adapts()) && memory.still >= STILL_STEPS
    }

    /// One step, that ends at `until` at the latest.
    ///
    /// # Errors
    /// [`Error::TooStiff`] if halving an automatic step does not help; [`Error::Solver`].
    pub fn advance(&mut self, memory: &mut Memory, until: Option<f64>) -> Result<Row, Error> {
        match self {
            Self::Willmore { flow, tau, largest } => willmore(flow, *tau, *largest, memory, until),
            Self::MeanCurvature {
                flow,
                field,
                eps,
                tau,
                step,
                time,
            } => {
                flow.advance()?;
                *field = flow.field()?;
                *step += 1;
                *time += *tau;
                Ok(Row {
                    step: *step,
                    time: *time,
                    tau: *tau,
                    energy_before: None,
                    energy: None,
                    willmore_energy: None,
                    perimeter: perimeter(field, *eps)?,
                    volume: zero_set_volume(field),
                    newton: None,
                    hvp: None,
                    halvings: None,
                })
            }
        }
    }
}

fn willmore<const D: usize>(
    flow: &mut WillmoreFlow<D>,
    rule: Tau,
    largest: f64,
    memory: &mut Memory,
    until: Option<f64>,
) -> Result<Row, Error> {
    let step = flow.steps() + 1;
    let wanted = rule.size(step, memory.next);
    let left = until.map_or(f64::INFINITY, |until| until - flow.time());
    let mut tau = wanted.min(left);
    let mut halvings = 0;
    let record = loop {
        match flow.advance(tau) {
            Ok(record) => break record,
            Err(source @ (SolverError::NotConverged { .. } | SolverError::NonFinite { .. }))
                if rule.adapts() =>
            {
                if halvings == HALVINGS {
                    return Err(Error::TooStiff {
                        step,
                        tau,
                        halvings,
                        source: Box::new(source),
                    });
                }
                tau *= 0.5;
                halvings += 1;
            }
            Err(error) => return Err(error.into()),
        }
    };
    let before = record.energy_before / (2.0 * record.tau);
    if memory.first_energy.is_nan() {
        memory.first_energy = before;
    }
    memory.energy = record.willmore_energy;
    // A step that was cut short says nothing about the next one.
    if halvings > 0 || wanted <= left {
        memory.next = Tau::after(&record, largest);
    }
    let still =
        record.tau >= 0.25 * largest && (before - record.willmore_energy).abs() < STILL * before;
    memory.still = if still { memory.still + 1.0 } else { 0.0 };
    Ok(Row {
        step: record.step,
        time: record.time,
        tau: record.tau,
        energy_before: Some(record.energy_before),
        energy: Some(record.energy),
        willmore_energy: Some(record.willmore_energy),
        perimeter: record.perimeter,
        volume: record.volume,
        newton: Some(record.newton.newton),
        hvp: Some(record.newton.hvp),
        halvings: Some(halvings),
    })
}
