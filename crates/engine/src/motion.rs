//! Mean curvature flow and Willmore flow behind one interface.

use std::any::Any;

use fem::{FiniteElementStep, Statistics};
use geometry::Stored;
use model::Network;
use operators::ComputeDevice;
use solver::{Constraints, FlowState, MeanCurvatureFlow, StepRecord, WillmoreFlow};

use crate::{Case, Error, Flow, Method, Order, Storage};

/// The flow of a case, between two steps.
pub(crate) trait Motion<const D: usize> {
    /// A time step of this size that ends with these sizes held, or one step of mean curvature flow, whose size is that of its operator. A step
    /// of second order is made only if `accept` takes it; the second value says so.
    fn advance(
        &mut self,
        size: f64,
        constraints: Constraints,
        accept: &mut dyn FnMut(&StepRecord) -> bool,
    ) -> Result<(Option<StepRecord>, bool), solver::Error>;

    /// The phase field, as it is stored.
    fn stored(&self) -> Result<Stored<D>, solver::Error>;

    /// How many cells of the phase field are stored now, where that need not be all.
    fn stored_cells(&self) -> Option<usize>;

    /// All that the following steps depend on, after so many minimizations or steps and at this time.
    fn state(&self, count: usize, time: f64) -> Result<FlowState<D>, solver::Error>;

    /// Goes to such a state.
    fn restore(&mut self, state: &FlowState<D>) -> Result<(), solver::Error>;

    /// Work of the linear solves inside finite elements so far.
    fn statistics(&self) -> Option<Statistics>;
}

/// Makes the flow of a case, at a state of it or at its start.
type Make<const D: usize> =
    fn(&Case<D>, Option<&FlowState<D>>, &ComputeDevice) -> Result<Box<dyn Motion<D>>, Error>;

/// A [`Make`] for each dimension. The solver is generic in it, and what is generic is compiled in every crate that calls it; what a static
/// names is compiled here, once for all programs and tests.
static MAKES: [&(dyn Any + Send + Sync); 2] = [
    &(SolverFlow::motion as Make<2>),
    &(SolverFlow::motion as Make<3>),
];

/// The flow of a case, at a state of it or at its start, if it fits into the memory.
pub(crate) fn of<const D: usize>(
    case: &Case<D>,
    state: Option<&FlowState<D>>,
    device: &ComputeDevice,
) -> Result<Box<dyn Motion<D>>, Error> {
    let (nodes, takes_bricks) = (case.grid().len(), case.takes_bricks());
    let whole = !takes_bricks || case.operator.storage == Storage::Dense;
    if whole {
        check_memory(case, device, nodes, takes_bricks)?;
    }
    let make = (MAKES.iter()).find_map(|make| make.downcast_ref::<Make<D>>());
    let motion = make.expect("a case is in the plane or in space")(case, state, device)?;
    if !whole {
        // How many cells are stored is known only now; little is allocated yet.
        check_memory(case, device, motion.stored_cells().unwrap_or(nodes), true)?;
    }
    Ok(motion)
}

/// Refuses a flow of which so many cells are stored if the memory of the CPU is too small for it.
fn check_memory<const D: usize>(
    case: &Case<D>,
    device: &ComputeDevice,
    stored: usize,
    takes_bricks: bool,
) -> Result<(), Error> {
    if device.kind().is_cpu() {
        Storage::check(case.flow, case.grid(), stored, takes_bricks)?;
    }
    Ok(())
}

/// A flow of the solver.
struct SolverFlow<const D: usize> {
    flow: Either<D>,
    /// The finite-element step inside, for its statistics.
    elements: Option<FiniteElementStep<D>>,
    order: Order,
}

enum Either<const D: usize> {
    Willmore(Box<WillmoreFlow<D>>),
    MeanCurvature(Box<MeanCurvatureFlow<D>>),
}

impl<const D: usize> SolverFlow<D> {
    fn motion(
        case: &Case<D>,
        state: Option<&FlowState<D>>,
        device: &ComputeDevice,
    ) -> Result<Box<dyn Motion<D>>, Error> {
        let (params, operator) = (case.params(), &case.operator);
        let whole = match (case.flow, operator.method) {
            (Flow::Willmore, Method::Hybrid) => None,
            (Flow::MeanCurvature, _) => Some("mean curvature flows"),
            (Flow::Willmore, _) => Some("finite elements"),
        };
        if let Some(what) = whole.filter(|_| operator.storage == Storage::Bricks) {
            return Err(solver::Error::NeedsGrid { what }.into());
        }
        let elements = match operator.network() {
            Some(_) => None,
            None => Some(operator.elements(case.grid(), &case.scales)?),
        };
        let flow = match case.flow {
            Flow::Willmore => {
                let mut flow = match &elements {
                    Some(step) => {
                        WillmoreFlow::new(step.clone(), &case.initial.field()?, params, device)?
                    }
                    None => learned(case, device)?,
                };
                if !case.energy.is_willmore() {
                    flow.set_energy(case.energy, operator.response)?;
                }
                if let Some(region) = &case.region {
                    flow.restrict_to(region)?;
                }
                // What no shape has is refused before the first step: the targets, and sizes on the way to them.
                flow.constrain(case.held.targets())?;
                case.held.check(case.grid())?;
                for step in 1..=case.held.steps() {
                    flow.constrain(case.held.at(step as f64))?;
                }
                Either::Willmore(Box::new(flow))
            }
            Flow::MeanCurvature => {
                let from = case.initial.field()?;
                let flow = match &elements {
                    Some(step) => MeanCurvatureFlow::new(step.clone(), &from, device)?,
                    None => MeanCurvatureFlow::with_network(network(case), &from, &params, device)?,
                };
                Either::MeanCurvature(Box::new(flow))
            }
        };
        let order = case.steps.order;
        let mut motion = Self {
            flow,
            elements,
            order,
        };
        if let Some(state) = state {
            motion.restore(state)?;
        }
        Ok(Box::new(motion))
    }
}

impl<const D: usize> Motion<D> for SolverFlow<D> {
    fn advance(
        &mut self,
        size: f64,
        constraints: Constraints,
        accept: &mut dyn FnMut(&StepRecord) -> bool,
    ) -> Result<(Option<StepRecord>, bool), solver::Error> {
        if let Either::Willmore(flow) = &mut self.flow {
            flow.constrain(constraints)?;
        }
        match &mut self.flow {
            Either::Willmore(flow) if self.order == Order::First => {
                Ok((Some(flow.advance(size)?), true))
            }
            Either::Willmore(flow) => {
                let (record, accepted) = flow.advance_second_order(size, accept)?;
                Ok((Some(record), accepted))
            }
            Either::MeanCurvature(flow) => Ok((flow.advance().map(|()| None)?, true)),
        }
    }

    fn stored(&self) -> Result<Stored<D>, solver::Error> {
        match &self.flow {
            Either::Willmore(flow) => flow.stored_field(),
            Either::MeanCurvature(flow) => Ok(Stored::whole(flow.field()?)),
        }
    }

    fn stored_cells(&self) -> Option<usize> {
        match &self.flow {
            Either::Willmore(flow) => Some(flow.stored_cells()),
            Either::MeanCurvature(_) => None,
        }
    }

    fn state(&self, count: usize, time: f64) -> Result<FlowState<D>, solver::Error> {
        match &self.flow {
            Either::Willmore(flow) => flow.state(),
            // Nothing else is known of it.
            Either::MeanCurvature(flow) => Ok(FlowState {
                current: flow.field()?.into_values(),
                step: count,
                time,
                ..FlowState::default()
            }),
        }
    }

    fn restore(&mut self, state: &FlowState<D>) -> Result<(), solver::Error> {
        match &mut self.flow {
            Either::Willmore(flow) => flow.restore(state),
            Either::MeanCurvature(flow) => flow.restore(state),
        }
    }

    fn statistics(&self) -> Option<Statistics> {
        self.elements.as_ref().map(FiniteElementStep::statistics)
    }
}

fn network<const D: usize>(case: &Case<D>) -> &Network {
    let named = case.operator.network();
    &named.expect("a learned operator has a network").network
}

/// Willmore flow with a network, of what is to be stored.
fn learned<const D: usize>(
    case: &Case<D>,
    device: &ComputeDevice,
) -> Result<WillmoreFlow<D>, Error> {
    use solver::Error::{Geometry, Model, NoInterface};
    /// Bricks that are more than this part of the grid do not pay.
    const PAYS: f64 = 0.5;
    let (network, initial, params) = (network(case), &case.initial, case.params());
    let dense = || WillmoreFlow::with_network(network, &initial.field()?, params, device);
    let bricks = || WillmoreFlow::on_bricks(network, initial, params, device);
    // Where bricks are no alternative.
    let dense_instead = || -> Result<_, Error> {
        check_memory(case, device, case.grid().len(), false)?;
        Ok(dense()?)
    };
    let mut flow = match case.operator.storage {
        Storage::Dense => dense()?,
        Storage::Bricks => bricks()?,
        Storage::Auto if !case.takes_bricks() => dense_instead()?,
        Storage::Auto => match bricks() {
            Ok(flow) if (flow.stored_cells() as f64) < PAYS * case.grid().len() as f64 => flow,
            Ok(_) | Err(Model(_) | NoInterface | Geometry(geometry::Error::Bricks { .. })) => {
                dense_instead()?
            }
            Err(error) => return Err(error.into()),
        },
    };
    if case.operator.half_grids {
        flow.begin_on_half_grids(network)?;
    }
    Ok(flow)
}
