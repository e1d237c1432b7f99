//! Mean curvature flow and Willmore flow behind one interface.

use std::any::Any;

use fem::FiniteElementStep;
use geometry::Stored;
use operators::ComputeDevice;
use solver::{Constraints, FlowState, StepRecord, WillmoreFlow};

use crate::{Case, Error, Flow, Method, Order, Storage};

/// The flow of a case, between two steps. What is behind it is compiled in this crate alone.
pub(crate) trait Motion<const D: usize> {
    /// A time step of this size that ends with these sizes held, or one step of mean curvature flow, whose size is that of its operator. A step
    /// of second order is made only if `accept` takes it; the second value says so.
    fn advance(
        &mut self,
        size: f64,
        order: Order,
        constraints: Constraints,
        accept: &mut dyn FnMut(&StepRecord) -> bool,
    ) -> Result<(Option<StepRecord>, bool), solver::Error>;

    /// The phase field, as it is stored.
    fn stored(&self) -> Result<Stored<D>, solver::Error>;

    /// How many cells of the phase field are stored now.
    fn stored_cells(&self) -> usize;

    /// All that the following steps depend on.
    fn state(&self) -> Result<FlowState<D>, solver::Error>;

    /// Goes to such a state.
    fn restore(&mut self, state: &FlowState<D>) -> Result<(), solver::Error>;
}

impl<const D: usize> Motion<D> for (Flow, WillmoreFlow<D>) {
    fn advance(
        &mut self,
        size: f64,
        order: Order,
        constraints: Constraints,
        accept: &mut dyn FnMut(&StepRecord) -> bool,
    ) -> Result<(Option<StepRecord>, bool), solver::Error> {
        let (kind, flow) = self;
        if *kind == Flow::MeanCurvature {
            flow.advance_by_mean_curvature()?;
            return Ok((None, true));
        }
        flow.constrain(constraints)?;
        let (record, accepted) = match order {
            Order::First => (flow.advance(size)?, true),
            Order::Second | Order::Controlled(_) => flow.advance_second_order(size, accept)?,
        };
        Ok((Some(record), accepted))
    }

    fn stored(&self) -> Result<Stored<D>, solver::Error> {
        self.1.stored_field()
    }

    fn stored_cells(&self) -> usize {
        self.1.stored_cells()
    }

    fn state(&self) -> Result<FlowState<D>, solver::Error> {
        self.1.state()
    }

    fn restore(&mut self, state: &FlowState<D>) -> Result<(), solver::Error> {
        self.1.restore(state)
    }
}

/// The flow of a case, and the finite-element step inside, for its statistics.
type Made<const D: usize> = (Box<dyn Motion<D>>, Option<FiniteElementStep<D>>);

/// Makes the flow of a case, at a state of it or at its start.
type Make<const D: usize> =
    fn(&Case<D>, Option<&FlowState<D>>, &ComputeDevice) -> Result<Made<D>, Error>;

/// A [`Make`] for each dimension. The solver is generic in it, and what is generic is compiled in every crate that calls it; what a static
/// names is compiled here, once for all programs and tests.
static MAKES: [&(dyn Any + Send + Sync); 2] = [&(make as Make<2>), &(make as Make<3>)];

/// The flow of a case, at a state of it or at its start, if it fits into the memory.
pub(crate) fn of<const D: usize>(
    case: &Case<D>,
    state: Option<&FlowState<D>>,
    device: &ComputeDevice,
) -> Result<Made<D>, Error> {
    let (kind, grid, storage) = (device.kind(), case.grid(), case.operator.storage);
    let needs_grid = match (case.flow, case.operator.method) {
        (Flow::Willmore, Method::Hybrid) => None,
        (Flow::MeanCurvature, _) => Some("mean curvature flows"),
        (Flow::Willmore, _) => Some("finite elements"),
    };
    if let Some(what) = needs_grid.filter(|_| storage == Storage::Bricks) {
        return Err(solver::Error::NeedsGrid { what }.into());
    }
    let takes_bricks = needs_grid.is_none();
    let whole = !takes_bricks || storage == Storage::Dense;
    if whole {
        let nodes = grid.len();
        Storage::check(kind, grid, (nodes, case.bytes(nodes)), takes_bricks)?;
    }
    let make = (MAKES.iter()).find_map(|make| make.downcast_ref::<Make<D>>());
    let made = make.expect("a case is in the plane or in space")(case, state, device)?;
    if !whole {
        // How many cells are stored is known only now; little is allocated yet.
        let stored = made.0.stored_cells();
        Storage::check(kind, grid, (stored, case.bytes(stored)), true)?;
    }
    Ok(made)
}

fn make<const D: usize>(
    case: &Case<D>,
    state: Option<&FlowState<D>>,
    device: &ComputeDevice,
) -> Result<Made<D>, Error> {
    let (params, operator) = (case.params(), &case.operator);
    let elements = match operator.network() {
        Some(_) => None,
        None => Some(operator.elements(case.grid(), &case.scales)?),
    };
    let mut flow = match elements.clone() {
        Some(step) => WillmoreFlow::new(step, &case.initial.field()?, params, device)?,
        None => learned(case, device)?,
    };
    if case.flow == Flow::Willmore {
        if !case.energy.is_willmore() {
            flow.set_energy(case.energy.terms()?, operator.response)?;
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
    }
    if let Some(state) = state {
        flow.restore(state)?;
    }
    Ok((Box::new((case.flow, flow)), elements))
}

/// The flow with a network, of what is to be stored.
fn learned<const D: usize>(
    case: &Case<D>,
    device: &ComputeDevice,
) -> Result<WillmoreFlow<D>, Error> {
    use solver::Error::{Geometry, Model, NoInterface};
    /// Bricks that are more than this part of the grid do not pay.
    const PAYS: f64 = 0.5;
    let named = case.operator.network();
    let network = &named.expect("a learned operator has a network").network;
    let (initial, params) = (&case.initial, case.params());
    let dense = || WillmoreFlow::with_network(network, &initial.field()?, params, device);
    let bricks = || WillmoreFlow::on_bricks(network, initial, params, device);
    // Where bricks are no alternative.
    let dense_instead = || -> Result<_, Error> {
        let nodes = case.grid().len();
        let needed = (nodes, case.bytes(nodes));
        Storage::check(device.kind(), case.grid(), needed, false)?;
        Ok(dense()?)
    };
    if case.flow == Flow::MeanCurvature {
        return Ok(dense()?);
    }
    let mut flow = match case.operator.storage {
        Storage::Dense => dense()?,
        Storage::Bricks => bricks()?,
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
