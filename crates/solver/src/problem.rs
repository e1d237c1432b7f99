//! What a flow is of: everything that its steps depend on but the state.

use std::sync::Arc;

use burn::tensor::Tensor;
use geometry::{Bricks, Field, Grid, NodeSet, Nodes, PhaseField, Stored, require};
use operators::ComputeDevice;

use crate::energy::check;
use crate::{
    Bounds, Cancel, DeviceField, Domain, DomainScales, EnergyTerms, Error, FlowParams, Held,
    MeanCurvatureStep, State, StepScales, TermCheck, bricks,
};

/// The side of the smallest bricks.
const SMALLEST: usize = 8;

/// A flow of phase fields: the step of mean curvature flow inside, the energy, and what may move.
#[derive(Clone)]
pub struct Problem<const D: usize> {
    /// The grid.
    pub grid: Grid<D>,
    /// Interface width, inner step, calibration, and settings of the minimization.
    pub params: FlowParams,
    /// The step of mean curvature flow, of size `params.mcf_step`, on the whole grid.
    pub operator: Arc<dyn MeanCurvatureStep<D>>,
    /// What the energy has besides bending.
    pub terms: EnergyTerms<D>,
    /// The motion of the step over that of the calibration (1 for an exact one; [`mean_curvature::Calibration::response`]).
    pub response: f64,
    /// The nodes whose values move, if not all; see [`Self::restrict_to`].
    pub region: Option<Arc<NodeSet>>,
    /// How far the interface may go, if there is a bound; see [`Self::keep_within`].
    pub bounds: Option<Arc<Bounds<D>>>,
    /// The sizes that are held.
    pub held: Held,
    /// The problem on the grid of half as many cells, where steps begin, if they do; see [`Self::begin_on`]. States on bricks do not look at it.
    pub half: Option<Arc<Problem<D>>>,
    /// Where it is computed.
    pub device: ComputeDevice,
    /// Whether a step is still wanted; see [`Self::set_cancel`].
    pub cancel: Cancel,
}

impl<const D: usize> Problem<D> {
    /// Willmore flow everywhere on a grid, with nothing held.
    ///
    /// # Errors
    /// [`Error::Geometry`] for parameters, [`Error::Operator`] if the step does not fit grid and parameters.
    pub fn new(
        operator: impl MeanCurvatureStep<D> + 'static,
        grid: &Grid<D>,
        params: FlowParams,
        device: &ComputeDevice,
    ) -> Result<Self, Error> {
        Self::with(Arc::new(operator), grid, params, device)
    }

    /// The same with an operator that is shared.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with(
        operator: Arc<dyn MeanCurvatureStep<D>>,
        grid: &Grid<D>,
        params: FlowParams,
        device: &ComputeDevice,
    ) -> Result<Self, Error> {
        params.validate()?;
        let scales = StepScales::on(grid, params.eps, params.mcf_step);
        operator.check(&scales).map_err(Error::Operator)?;
        Ok(Self {
            grid: *grid,
            params,
            operator,
            terms: Vec::new(),
            response: 1.0,
            region: None,
            bounds: None,
            held: Held::default(),
            half: None,
            device: device.clone(),
            cancel: Cancel::default(),
        })
    }

    /// The start from a phase field on the whole grid.
    ///
    /// # Errors
    /// [`Error::NonFinite`]; [`Error::Geometry`] for another grid.
    pub fn start(&self, initial: &Field<D>) -> Result<State<D>, Error> {
        self.check(initial)?;
        let values = self.device.tensor(initial.values(), self.grid.shape());
        Ok(State::at(self.on_whole_grid(values)))
    }

    /// The start on bricks, which follow the interface: bricks that are further from it than 8 `eps` are not stored, and the phase field is
    /// constant there. That changes a flow by about a millionth of its motion; work and memory are in proportion to the length or area of the interface.
    ///
    /// # Errors
    /// As [`Self::start`]; [`Error::Operator`] for an operator that does not work on bricks, [`Error::Geometry`] if the grid cannot be divided
    /// into bricks, and [`Error::NoInterface`].
    pub fn start_on_bricks(&self, initial: &impl PhaseField<D>) -> Result<State<D>, Error> {
        self.check(initial)?;
        let side = self.operator.brick_side().unwrap_or(SMALLEST);
        let nodes = bricks::near(initial, side, self.params.eps)?;
        // An operator that does not work on bricks says why.
        self.operator.on(&nodes).map_err(Error::Operator)?;
        let bricks = nodes.bricks().expect("they are near the interface");
        let values = (self.device).tensor(&initial.values_on(bricks), bricks.shape());
        let phase_values = self.operator.phase_values();
        Ok(State::at(DeviceField::new(
            values,
            nodes,
            phase_values,
            &self.device,
        )))
    }

    fn check(&self, initial: &impl PhaseField<D>) -> Result<(), Error> {
        self.grid.same_as(initial.nodes().grid())?;
        let finite = initial.check_finite();
        finite.map_err(|_| Error::non_finite(0, "phase field"))
    }

    /// Lets only the values at these nodes move; the others stay, bit for bit where they are stored. The energy is that of the whole field.
    ///
    /// # Errors
    /// [`Error::Region`] for nodes of another grid, or none.
    pub fn restrict_to(&mut self, nodes: &NodeSet) -> Result<(), Error> {
        if nodes.grid_len() != self.grid.len() || nodes.is_empty() {
            return Err(Error::Region {
                marks: nodes.grid_len(),
                nodes: self.grid.len(),
                marked: nodes.len(),
            });
        }
        self.region = Some(Arc::new(nodes.clone()));
        self.restrict_half(nodes)
    }

    /// Restricts the problem on the half grid to a region's nodes there; where it has none, steps do not begin there.
    fn restrict_half(&mut self, nodes: &NodeSet) -> Result<(), Error> {
        if let Some(half) = self.half.take() {
            let coarser = every_other_node(self.grid, nodes);
            if !coarser.is_empty() {
                let mut half = Arc::unwrap_or_clone(half);
                half.restrict_to(&coarser)?;
                self.half = Some(Arc::new(half));
            }
        }
        Ok(())
    }

    /// Keeps the interface within a distance of that of a phase field: every minimization is one under [bounds](Bounds) on the values near it. Nodes that go
    /// beyond a bound are held there, and go free again where the energy pulls them back, until there are none of either (a primal-dual active set:
    /// M. Hintermüller, K. Ito, K. Kunisch: The primal-dual active set strategy as a semismooth Newton method. SIAM J. Optim. 13, 2003). A minimization begins
    /// without them, also on the half grid. Mean curvature flow has no such bounds.
    ///
    /// # Errors
    /// [`Error::Geometry`] for another grid, and as [`Bounds::within`].
    pub fn keep_within(&mut self, distance: f64, of: &Stored<D>) -> Result<(), Error> {
        self.grid.same_as(of.nodes().grid())?;
        let bounds = Bounds::within(distance, of, self.params.eps)?;
        self.bounds = Some(Arc::new(bounds));
        Ok(())
    }

    /// Holds these sizes from the next step on exactly: to a relative `1e-12` in double precision. A target that is not the present value is
    /// reached in the next step, so change it slowly. Where [bounds](Self::keep_within) still let nodes come and go after the last of their rounds, the
    /// sizes are not exact.
    ///
    /// # Errors
    /// As [`Constraints::check`](crate::Constraints::check) for the targets, [`Error::Way`] and [`Error::LeastStart`] for sizes on the way to them.
    pub fn hold(&mut self, held: impl Into<Held>) -> Result<(), Error> {
        let held = held.into();
        held.check_way(&self.grid, self.params.eps)?;
        self.held = held;
        Ok(())
    }

    /// Ends the step that is being made as soon as it is not wanted any more, also where it begins on the half grids.
    pub fn set_cancel(&mut self, cancel: Cancel) {
        if let Some(half) = self.half.take() {
            let mut half = Arc::unwrap_or_clone(half);
            half.set_cancel(cancel.clone());
            self.half = Some(Arc::new(half));
        }
        self.cancel = cancel;
    }

    /// Makes bending and these terms the energy, by a step of mean curvature flow with this [response](Self::response). The Willmore energies of the
    /// records are then this energy.
    ///
    /// # Errors
    /// [`Error::Geometry`] unless the response is positive; what the densities and shifts of the terms raise.
    pub fn set_energy(&mut self, terms: EnergyTerms<D>, response: f64) -> Result<(), Error> {
        let response = geometry::positive("response", response)?;
        self.check_terms(&terms)?;
        self.response = response;
        self.terms.clone_from(&terms);
        if let Some(half) = self.half.take() {
            let mut half = Arc::unwrap_or_clone(half);
            half.set_energy(terms, response)?;
            self.half = Some(Arc::new(half));
        }
        Ok(())
    }

    /// Refuses terms that do not fit: on one brick, if the grid has bricks.
    fn check_terms(&self, terms: &EnergyTerms<D>) -> Result<(), Error> {
        let first = |place: [usize; D]| place == [0; D];
        let nodes = match Bricks::new(self.grid.cells(), SMALLEST, first, |_| false) {
            Ok(brick) => Nodes::on_bricks(self.grid, Arc::new(brick)),
            Err(_) => self.grid.into(),
        };
        let (domain, extensions) = (self.domain(&nodes), self.operator.extensions());
        let mut terms = terms.iter();
        terms.try_for_each(|term| check::fits(&**term, &domain, &extensions))
    }

    /// Taylor tests of the terms of the energy at a phase field, in their order.
    ///
    /// # Errors
    /// What the terms raise, [`Error::Operators`] if the device fails.
    pub fn check_derivatives(&self, u: &DeviceField<D>) -> Result<Vec<TermCheck>, Error> {
        let (domain, extensions) = (self.domain(u.nodes()), self.operator.extensions());
        let checks = self.terms.iter();
        let checks = checks.map(|term| check::check(&**term, u.values(), &domain, &extensions));
        checks.collect()
    }

    /// Lets every step of Euler's method begin with the motion that `half`, the problem on the grid of every other node, makes in that step. A step that cannot be
    /// made there begins as if it were not there. The results differ by less than the tolerance of the minimization, which still decides on this
    /// grid; only the way to them gets shorter.
    ///
    /// `half` may itself begin on its half grid.
    ///
    /// # Errors
    /// [`Error::Geometry`] if its grid is not the half of this one, or for another `eps` or `tautilde`.
    pub fn begin_on(&mut self, mut half: Self) -> Result<(), Error> {
        self.grid.half()?.same_as(&half.grid)?;
        for (name, own, other) in [
            ("eps of the half grid", self.params.eps, half.params.eps),
            (
                "tautilde of the half grid",
                self.params.mcf_step,
                half.params.mcf_step,
            ),
        ] {
            let expected = "that of the flow, which begins there";
            require(name, other, expected, |other| {
                other.to_bits() == own.to_bits()
            })?;
        }
        half.set_energy(self.terms.clone(), self.response)?;
        self.half = Some(Arc::new(half));
        let nodes = self.region.clone();
        nodes.map_or(Ok(()), |nodes| self.restrict_half(&nodes))
    }

    /// [Begins](Self::begin_on) on the half grid, that on its half, and so on, as far as the operator [is there](MeanCurvatureStep::coarser) on
    /// coarser grids. Says how many grids there are below this one.
    ///
    /// # Errors
    /// Those of making the operators.
    pub fn begin_on_half_grids(&mut self) -> Result<usize, Error> {
        let Ok(grid) = self.grid.half() else {
            return Ok(0);
        };
        let coarser = self.operator.coarser(self.params.calibration);
        let Some(coarser) = coarser.map_err(Error::Operator)? else {
            return Ok(0);
        };
        let mut params = self.params;
        params.calibration = coarser.factors;
        let mut half = Self::with(coarser.step, &grid, params, &self.device)?;
        let levels = 1 + half.begin_on_half_grids()?;
        self.begin_on(half)?;
        Ok(levels)
    }

    /// The values of phase fields in the negative and in the positive phase where nothing is stored.
    fn phase_values(&self, nodes: &Nodes<D>) -> [f64; 2] {
        let of_bricks = nodes.bricks().map(|_| self.operator.phase_values());
        of_bricks.unwrap_or([-1.0, 1.0])
    }

    /// A field on the whole grid whose values are on the device.
    pub(crate) fn on_whole_grid(&self, values: Tensor<D>) -> DeviceField<D> {
        DeviceField::new(values, self.grid.into(), [-1.0, 1.0], &self.device)
    }

    /// A field on the device, with the rest values of phase fields.
    pub fn upload(&self, u: &Stored<D>) -> DeviceField<D> {
        let values = DeviceField::upload(u, &self.device).values().clone();
        let phase_values = self.phase_values(u.nodes());
        DeviceField::new(values, u.nodes().clone(), phase_values, &self.device)
    }

    /// The state on the bricks near its interface, if it is on bricks.
    ///
    /// # Errors
    /// [`Error::Geometry`] for a state on another grid.
    pub(crate) fn followed(&self, state: &State<D>) -> Result<State<D>, Error> {
        self.grid.same_as(state.field.nodes().grid())?;
        match bricks::following(&state.field, self.params.eps)? {
            Some(nodes) => state.on(&nodes),
            None => state.on(state.field.nodes()),
        }
    }

    /// The operator where values are stored.
    pub(crate) fn operator_on(
        &self,
        nodes: &Nodes<D>,
    ) -> Result<Arc<dyn MeanCurvatureStep<D>>, Error> {
        match nodes.bricks() {
            Some(_) => self.operator.on(nodes).map_err(Error::Operator),
            None => Ok(self.operator.clone()),
        }
    }

    /// Where values are stored, as the terms of the energy see it.
    pub fn domain(&self, nodes: &Nodes<D>) -> Domain<D> {
        let scales = DomainScales {
            eps: self.params.eps,
            mcf_step: self.params.mcf_step,
            response: self.response,
        };
        Domain::new(
            nodes.clone(),
            self.phase_values(nodes),
            scales,
            &self.device,
        )
    }

    /// The scaled energy counts points; this makes it the paper's, with true L2 norms: `2 eps h^D`, over the factor of the metric.
    pub fn energy_scale(&self) -> f64 {
        2.0 * self.params.eps * self.grid.cell_volume() / self.params.calibration.metric
    }
}

/// Those that are nodes of the half grid.
fn every_other_node<const D: usize>(grid: Grid<D>, nodes: &NodeSet) -> NodeSet {
    let marks = nodes.iter().enumerate().filter(|(i, _)| {
        grid.multi_index(*i)
            .iter()
            .all(|index| index.is_multiple_of(2))
    });
    marks.map(|(_, mark)| mark).collect()
}
