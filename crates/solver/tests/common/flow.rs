//! A flow that is stepped by hand, by several schemes.
use geometry::{Field, NodeSet, PhaseField, Stored};
use model::{MeanCurvatureOperator, Network};
use operators::ComputeDevice;
use solver::{
    Candidate, EnergyTerms, Error, Euler, FlowParams, Held, MeanCurvatureFlow, MeanCurvatureStep,
    Problem, Scheme, SecondOrder, State, StepRecord, StepSize,
};

pub struct Flow<const D: usize> {
    pub problem: Problem<D>,
    pub state: State<D>,
    euler: Euler<D>,
    second_order: SecondOrder<D>,
}

/// A state that can be compared.
#[derive(Clone, Debug)]
pub struct Kept<const D: usize>(pub State<D>);

impl<const D: usize> PartialEq for Kept<D> {
    fn eq(&self, other: &Self) -> bool {
        let [a, b] = [&self.0, &other.0];
        let fields = |state: &State<D>| -> Vec<(String, Stored<D>)> {
            let fields = state.memory.fields.iter();
            let mut fields: Vec<_> = fields
                .map(|(name, field)| (name.clone(), field.stored().unwrap()))
                .collect();
            fields.push((String::new(), state.field.stored().unwrap()));
            fields
        };
        (a.step, a.time.to_bits()) == (b.step, b.time.to_bits())
            && a.memory.numbers == b.memory.numbers
            && fields(a) == fields(b)
    }
}

impl<const D: usize> Flow<D> {
    pub fn new(
        step: impl MeanCurvatureStep<D> + 'static,
        initial: &Field<D>,
        params: FlowParams,
        device: &ComputeDevice,
    ) -> Result<Self, Error> {
        let problem = Problem::new(step, initial.grid(), params, device)?;
        let state = problem.start(initial)?;
        Ok(Self::of(problem, state))
    }

    pub fn of(problem: Problem<D>, state: State<D>) -> Self {
        Self {
            problem,
            state,
            euler: Euler::new(),
            second_order: SecondOrder::new(),
        }
    }

    pub fn with_network(
        network: &Network,
        initial: &Field<D>,
        params: FlowParams,
        device: &ComputeDevice,
    ) -> Result<Self, Error> {
        let step = MeanCurvatureOperator::new(network, device)?;
        Self::new(step, initial, params, device)
    }

    pub fn on_bricks(
        network: &Network,
        initial: &impl PhaseField<D>,
        params: FlowParams,
        device: &ComputeDevice,
    ) -> Result<Self, Error> {
        let step = MeanCurvatureOperator::new(network, device)?;
        let problem = Problem::new(step, initial.nodes().grid(), params, device)?;
        let state = problem.start_on_bricks(initial)?;
        Ok(Self::of(problem, state))
    }

    fn take(&mut self, candidate: Candidate<D>) -> Option<StepRecord> {
        self.state = candidate.state;
        candidate.record
    }

    /// An implicit Euler step.
    pub fn advance(&mut self, tau: f64) -> Result<StepRecord, Error> {
        let size = StepSize::whole(tau);
        let candidate = self.euler.step(&self.problem, &self.state, size)?;
        Ok(self.take(candidate).unwrap())
    }

    /// A step of second order that is not taken.
    pub fn second_order_candidate(&mut self, tau: f64) -> Result<Candidate<D>, Error> {
        let size = StepSize::whole(tau);
        self.second_order.step(&self.problem, &self.state, size)
    }

    pub fn advance_second_order(&mut self, tau: f64) -> Result<StepRecord, Error> {
        let candidate = self.second_order_candidate(tau)?;
        Ok(self.take(candidate).unwrap())
    }

    pub fn advance_by_mean_curvature(&mut self) -> Result<(), Error> {
        let size = StepSize::whole(self.problem.params.mcf_step);
        let candidate = MeanCurvatureFlow.step(&self.problem, &self.state, size)?;
        assert!(self.take(candidate).is_none());
        Ok(())
    }

    pub fn restrict_to(&mut self, nodes: &NodeSet) -> Result<(), Error> {
        self.problem.restrict_to(nodes)
    }

    pub fn constrain(&mut self, held: impl Into<Held>) -> Result<(), Error> {
        self.problem.hold(held)
    }

    pub fn set_energy(&mut self, terms: EnergyTerms<D>, response: f64) -> Result<(), Error> {
        self.problem.set_energy(terms, response)
    }

    pub fn begin_on(&mut self, half: Self) -> Result<(), Error> {
        self.problem.begin_on(half.problem)
    }

    pub fn begin_on_half_grids(&mut self) -> Result<usize, Error> {
        self.problem.begin_on_half_grids()
    }

    pub fn state(&self) -> Kept<D> {
        Kept(self.state.clone())
    }

    pub fn restore(&mut self, kept: &Kept<D>) {
        self.state = kept.0.clone();
    }

    pub fn field(&self) -> Result<Field<D>, Error> {
        self.state.on_grid()
    }

    pub fn time(&self) -> f64 {
        self.state.time
    }

    pub fn steps(&self) -> usize {
        self.state.step
    }
}
