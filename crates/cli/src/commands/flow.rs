//! `willmore flow`, and what it has in common with `fair` and `inpaint`.

use std::path::PathBuf;

use operators::ComputeDevice;
use runs::StoredRun;
use serde::Serialize;
use solver::{FlowParams, FlowState, WillmoreFlow};

use super::open_device;
use crate::cli::{FlowOptions, MeshFormat};
use crate::config;
use crate::error::Error;
use crate::input::{self, Loaded, Start};
use crate::motion::Motion;
use crate::outlet::{Outlet, Plane, Space};
use crate::run::{Ending, Plan, Stop};
use crate::scales::{self, Operator};
use crate::tau::Tau;

/// Steps of a run that has no other end.
const STEPS: usize = 20;
/// Steps of a run that ends at a time or an energy.
const MANY_STEPS: usize = 1000;

/// A command that is Willmore flow of something.
pub trait Willmore: Serialize {
    /// Its name.
    const COMMAND: &'static str;

    /// The options of the flow.
    fn flow(&mut self) -> &mut FlowOptions;

    /// Refuses options before anything is read.
    ///
    /// # Errors
    /// [`Error::Options`].
    fn check(&mut self) -> Result<(), Error> {
        Ok(())
    }

    /// The rule for time steps unless one is chosen, for an inner step `mcf_step`.
    fn tau(&self, _mcf_step: f64) -> Tau {
        Tau::Auto(None)
    }

    /// What becomes of the input before it flows, with interface width `eps`.
    ///
    /// # Errors
    /// What belongs to the command.
    fn prepare(&self, input: Loaded, _eps: f64) -> Result<Loaded, Error> {
        Ok(input)
    }

    /// Format of meshes, and a file besides those of the run.
    fn mesh(&self) -> (MeshFormat, Option<PathBuf>) {
        (MeshFormat::Ply, None)
    }
}

impl Willmore for FlowOptions {
    const COMMAND: &'static str = "flow";

    fn flow(&mut self) -> &mut FlowOptions {
        self
    }
}

/// Runs, or continues what was stored.
///
/// # Errors
/// What any part of the run raises.
pub fn run<W: Willmore>(mut options: W, stored: Option<StoredRun>) -> Result<Ending, Error> {
    options.check()?;
    let mut plan = plan(&mut options)?;
    let stored = match stored {
        Some(stored) if stored.checkpoint().is_some() => {
            plan.config = stored.config()?;
            let flow = options.flow();
            let dimension = stored.identity().grid.cells.len();
            let operator = scales::operator(dimension, &flow.scheme)?;
            plan.network = Some(operator.name.clone());
            let job = Job::new(flow, operator, &plan.device);
            return match dimension {
                2 => job.resume::<2, Plane>(&plan, stored),
                _ => job.resume::<3, Space>(&plan, stored),
            };
        }
        stored => stored,
    };
    let flow = options.flow();
    let loaded = input::load(&mut flow.input, flow.scheme.eps_over_h, plan.say)?;
    let (dimension, h) = match &loaded {
        Loaded::Plane(start, _) => (2, start.field.grid().spacing()),
        Loaded::Space(start) => (3, start.field.grid().spacing()),
    };
    let flow = options.flow();
    let operator = scales::operator(dimension, &flow.scheme)?;
    let params = scales::params(h, flow.scheme.eps_over_h);
    let chosen = flow.steps.tau;
    let tau = chosen.unwrap_or_else(|| options.tau(params.mcf_step));
    let loaded = options.prepare(loaded, params.eps)?;
    let flow = options.flow();
    flow.steps.tau = Some(tau.resolved(params.mcf_step));
    plan.network = Some(operator.name.clone());
    let job = Job::new(flow, operator, &plan.device);
    plan.config = match &stored {
        Some(stored) => stored.config()?,
        None => config::resolved(W::COMMAND, &options)?,
    };
    match loaded {
        Loaded::Plane(start, _) => job.start(&plan, &start, stored),
        Loaded::Space(start) => job.start(&plan, &start, stored),
    }
}

/// What is known before the input is read.
fn plan<W: Willmore>(options: &mut W) -> Result<Plan, Error> {
    let (format, save) = options.mesh();
    let flow = options.flow();
    let until = flow.steps.time.is_some() || flow.steps.energy.is_some();
    let steps = if until { MANY_STEPS } else { STEPS };
    let plan = Plan {
        command: W::COMMAND,
        config: String::new(),
        network: None,
        eps_over_h: flow.scheme.eps_over_h,
        stop: Stop {
            steps: *flow.steps.steps.get_or_insert(steps),
            time: flow.steps.time,
            energy: flow.steps.energy,
        },
        keep: flow.keep.clone(),
        format,
        save,
        device: open_device(&mut flow.common)?,
        say: flow.common.say,
    };
    plan.check()?;
    Ok(plan)
}

/// The flow of a run.
struct Job {
    operator: Operator,
    eps_over_h: f64,
    tau: Tau,
    device: ComputeDevice,
}

impl Job {
    fn new(flow: &FlowOptions, operator: Operator, device: &ComputeDevice) -> Self {
        Self {
            operator,
            eps_over_h: flow.scheme.eps_over_h,
            tau: flow.steps.tau.unwrap_or(Tau::Auto(None)),
            device: device.clone(),
        }
    }

    fn start<const D: usize, O: Outlet<D>>(
        &self,
        plan: &Plan,
        start: &Start<D, O>,
        stored: Option<StoredRun>,
    ) -> Result<Ending, Error> {
        plan.start(start, |start, state| self.motion(start, state), stored)
    }

    fn resume<const D: usize, O: Outlet<D>>(
        &self,
        plan: &Plan,
        stored: StoredRun,
    ) -> Result<Ending, Error> {
        plan.resume::<D, O>(stored, |start, state| self.motion(start, state))
    }

    fn motion<const D: usize, O>(
        &self,
        start: &Start<D, O>,
        state: &FlowState<D>,
    ) -> Result<Motion<D>, Error> {
        let grid = start.field.grid();
        let params = FlowParams {
            calibration: self.operator.factors,
            ..scales::params(grid.spacing(), self.eps_over_h)
        };
        let (network, device) = (&self.operator.network, &self.device);
        let mut flow = WillmoreFlow::with_network(network, &start.field, params, device)?;
        if let Some(region) = &start.region {
            flow.restrict_to(region)?;
        }
        flow.restore(state)?;
        Ok(Motion::Willmore {
            flow: Box::new(flow),
            tau: self.tau.resolved(params.mcf_step),
            largest: Motion::largest_step(grid),
        })
    }
}
