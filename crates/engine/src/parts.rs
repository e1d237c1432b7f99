//! The problem of a case, its scheme, and where it starts.

use std::any::Any;
use std::sync::Arc;

use direct::Direct;
use fem::FiniteElementStep;
use mean_curvature::MeanCurvatureStep;
use model::MeanCurvatureOperator;
use operators::ComputeDevice;
use solver::{Euler, MeanCurvatureFlow, Problem, Scheme, SecondOrder, State};

use crate::{Case, Error, Flow, Method, Order, Storage};

/// What a run of a case is made of.
pub(crate) struct Parts<const D: usize> {
    pub(crate) problem: Problem<D>,
    pub(crate) start: State<D>,
    pub(crate) scheme: Box<dyn Scheme<D>>,
    /// The finite-element step inside, for its statistics.
    pub(crate) elements: Option<FiniteElementStep<D>>,
}

/// Makes the parts of a case.
type Make<const D: usize> = fn(&Case<D>, &ComputeDevice) -> Result<Parts<D>, Error>;

/// A [`Make`] for each dimension. The solver is generic in it, and what is generic is compiled in every crate that calls it; what a static
/// names is compiled here, once for all programs and tests.
static MAKES: [&(dyn Any + Send + Sync); 2] = [&(make as Make<2>), &(make as Make<3>)];

/// The parts of a case, if it fits into the memory.
pub(crate) fn of<const D: usize>(
    case: &Case<D>,
    device: &ComputeDevice,
) -> Result<Parts<D>, Error> {
    let (kind, grid, storage) = (device.kind(), case.grid(), case.operator.storage);
    let needs_grid = match (case.flow, case.operator.discretization.method) {
        (Flow::MeanCurvature, _) => Some("mean curvature flows"),
        (Flow::Willmore, Method::Hybrid | Method::Own) => {
            matches!(case.steps.order, Order::Direct(_)).then_some("direct steps")
        }
        (Flow::Willmore, _) => Some("finite elements"),
    };
    if let Some(what) = needs_grid.filter(|_| storage == Storage::Bricks) {
        return Err(solver::Error::NeedsGrid { what }.into());
    }
    let takes_bricks = needs_grid.is_none();
    let whole = !takes_bricks || storage == Storage::Dense;
    if whole {
        let nodes = grid.len();
        Storage::check(kind, grid, nodes, case.bytes(nodes), takes_bricks)?;
    }
    let make = (MAKES.iter()).find_map(|make| make.downcast_ref::<Make<D>>());
    let made = make.expect("a case is in the plane or in space")(case, device)?;
    if !whole {
        // How many cells are stored is known only now; little is allocated yet.
        let stored = made.start.field.nodes().len();
        Storage::check(kind, grid, stored, case.bytes(stored), true)?;
    }
    Ok(made)
}

fn make<const D: usize>(case: &Case<D>, device: &ComputeDevice) -> Result<Parts<D>, Error> {
    let (params, operator, grid) = (case.params(), &case.operator, case.grid());
    let mut elements = None;
    let step: Arc<dyn MeanCurvatureStep<D>> = match (operator.own_step(), operator.network()) {
        (Some(own), _) => own.clone(),
        (None, Some(named)) => Arc::new(MeanCurvatureOperator::new(&named.network, device)?),
        (None, None) => Arc::new(
            elements
                .insert(operator.elements(grid, &case.scales)?)
                .clone(),
        ),
    };
    let mut problem = Problem::with(step, grid, params, device)?;
    let start = start(case, &problem)?;
    if case.flow == Flow::Willmore {
        willmore(case, &mut problem, &start)?;
    }
    let scheme = scheme(case, &problem, &start)?;
    Ok(Parts {
        problem,
        start,
        scheme,
        elements,
    })
}

/// The scheme that makes the steps of a case.
fn scheme<const D: usize>(
    case: &Case<D>,
    problem: &Problem<D>,
    start: &State<D>,
) -> Result<Box<dyn Scheme<D>>, Error> {
    Ok(match (&case.own.scheme, case.flow, case.steps.order) {
        (Some(make), ..) => make(),
        (None, Flow::MeanCurvature, _) => Box::new(MeanCurvatureFlow),
        (None, Flow::Willmore, Order::First) => Box::new(Euler::new()),
        (None, Flow::Willmore, Order::Second | Order::Controlled(_)) => {
            Box::new(SecondOrder::new())
        }
        (None, Flow::Willmore, Order::Direct(params)) => {
            Direct::check(problem, start)?;
            Box::new(Direct::with(params)?)
        }
    })
}

/// Adds what Willmore flow has besides an operator.
fn willmore<const D: usize>(
    case: &Case<D>,
    problem: &mut Problem<D>,
    start: &State<D>,
) -> Result<(), Error> {
    if case.operator.half_grids && start.field.nodes().bricks().is_none() {
        problem.begin_on_half_grids()?;
    }
    let mut terms = case.energy.terms()?;
    terms.extend(case.own.terms.iter().cloned());
    if !terms.is_empty() {
        problem.set_energy(terms, case.operator.response)?;
    }
    if let Some(region) = &case.region {
        problem.restrict_to(region)?;
    }
    if let Some(distance) = case.max_distance {
        problem.keep_within(distance, &case.initial)?;
    }
    // What no shape has is refused before the first step: the targets, and sizes on the way to them.
    problem.hold(case.held)?;
    Ok(case.held.check(case.grid())?)
}

/// The start of a case, of what is to be stored.
fn start<const D: usize>(case: &Case<D>, problem: &Problem<D>) -> Result<State<D>, Error> {
    use solver::Error::{Geometry, NoInterface, Operator};
    /// Bricks that are more than this part of the grid do not pay.
    const PAYS: f64 = 0.5;
    let dense = || -> Result<_, Error> { Ok(problem.start(&case.initial.field()?)?) };
    let bricks = || problem.start_on_bricks(&case.initial);
    let method = case.operator.discretization.method;
    let elements = [Method::FeImplicit, Method::FeSemi].contains(&method);
    let direct = matches!(case.steps.order, Order::Direct(_));
    if case.flow == Flow::MeanCurvature || elements || direct {
        return dense();
    }
    Ok(match case.operator.storage {
        Storage::Dense => dense()?,
        Storage::Bricks => bricks()?,
        Storage::Auto => match bricks() {
            Ok(state) if (state.field.nodes().len() as f64) < PAYS * case.grid().len() as f64 => {
                state
            }
            Ok(_) | Err(Operator(_) | NoInterface | Geometry(geometry::Error::Bricks { .. })) => {
                // Bricks are no alternative.
                let (kind, nodes) = (problem.device.kind(), case.grid().len());
                Storage::check(kind, case.grid(), nodes, case.bytes(nodes), false)?;
                dense()?
            }
            Err(error) => return Err(error.into()),
        },
    })
}
