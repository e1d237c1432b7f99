//! `willmore mcf`.

use operators::ComputeDevice;
use runs::StoredRun;
use solver::{FlowState, MeanCurvatureFlow};

use super::open_device;
use crate::cli::{McfMethod, McfOptions, MeshFormat, Scheme};
use crate::config;
use crate::error::Error;
use crate::input::{self, Loaded, Start};
use crate::motion::Motion;
use crate::outlet::{Plane, Space};
use crate::run::{Ending, Plan, Stop};
use crate::scales::{self, Operator};

const COMMAND: &str = "mcf";
/// Steps of a run that has no other end.
const STEPS: usize = 20;
/// Steps of a run that ends at a time.
const MANY_STEPS: usize = 100_000;

/// Runs, or continues what was stored.
///
/// # Errors
/// What any part of the run raises.
pub fn run(mut options: McfOptions, stored: Option<StoredRun>) -> Result<Ending, Error> {
    let learned = options.method == McfMethod::Network;
    if !learned && (options.scheme.network.is_some() || options.scheme.scheme != Scheme::Accurate) {
        return Err(Error::options(
            "--network and --scheme have no meaning for finite elements: leave them out, or choose --method network",
        ));
    }
    let many = if options.time.is_some() {
        MANY_STEPS
    } else {
        STEPS
    };
    let device = open_device(&mut options.common)?;
    let mut plan = Plan {
        command: COMMAND,
        config: String::new(),
        network: None,
        eps_over_h: options.scheme.eps_over_h,
        stop: Stop {
            steps: *options.steps.get_or_insert(many),
            time: options.time,
            energy: None,
        },
        keep: options.keep.clone(),
        format: MeshFormat::Ply,
        save: None,
        device: device.clone(),
        say: options.common.say,
    };
    plan.check()?;
    let operator = |dimension| -> Result<Option<Operator>, Error> {
        let find = || scales::operator(dimension, &options.scheme);
        learned.then(find).transpose()
    };
    let job = |operator| Job {
        operator,
        method: options.method,
        eps_over_h: options.scheme.eps_over_h,
        device: &device,
    };
    let stored = match stored {
        Some(stored) if stored.checkpoint().is_some() => {
            plan.config = stored.config()?;
            let dimension = stored.identity().grid.cells.len();
            let job = job(operator(dimension)?);
            plan.network = job.operator.as_ref().map(|o| o.name.clone());
            return match dimension {
                2 => plan.resume::<2, Plane>(stored, |start, state| job.motion(start, state)),
                _ => plan.resume::<3, Space>(stored, |start, state| job.motion(start, state)),
            };
        }
        stored => stored,
    };
    let mut input = options.input.clone();
    let loaded = input::load(&mut input, options.scheme.eps_over_h, plan.say)?;
    let dimension = match &loaded {
        Loaded::Plane(..) => 2,
        Loaded::Space(..) => 3,
    };
    let job = job(operator(dimension)?);
    plan.network = job.operator.as_ref().map(|o| o.name.clone());
    plan.config = match &stored {
        Some(stored) => stored.config()?,
        None => config::resolved(
            COMMAND,
            &McfOptions {
                input,
                ..options.clone()
            },
        )?,
    };
    match loaded {
        Loaded::Plane(start, _) => plan.start(&start, |s, state| job.motion(s, state), stored),
        Loaded::Space(start) => plan.start(&start, |s, state| job.motion(s, state), stored),
    }
}

/// The flow of a run.
struct Job<'a> {
    operator: Option<Operator>,
    method: McfMethod,
    eps_over_h: f64,
    device: &'a ComputeDevice,
}

impl Job<'_> {
    fn motion<const D: usize, O>(
        &self,
        start: &Start<D, O>,
        state: &FlowState<D>,
    ) -> Result<Motion<D>, Error> {
        let grid = start.field.grid();
        let params = scales::params(grid.spacing(), self.eps_over_h);
        let field = &state.current;
        let flow = match &self.operator {
            Some(operator) => {
                MeanCurvatureFlow::with_network(&operator.network, field, &params, self.device)?
            }
            None => {
                let implicit = self.method == McfMethod::FeImplicit;
                let step = scales::elements(implicit, grid, &params)?;
                MeanCurvatureFlow::new(step, field, self.device)?
            }
        };
        Ok(Motion::MeanCurvature {
            flow: Box::new(flow),
            field: field.clone(),
            eps: params.eps,
            tau: params.mcf_step,
            step: state.step,
            time: state.time,
        })
    }
}
