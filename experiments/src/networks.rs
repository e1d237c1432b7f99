//! The scales and cases of the convergence tests, and where networks come from.

use model::{NamedNetwork, NeededNetwork, Networks, Ratios};

use crate::prelude::libraries::*;

/// Interface width `eps = 2^-6`.
pub const EPS: f64 = 1.0 / 64.0;
/// Time step `tau = tautilde = 2^-14` of both flows.
pub const STEP: f64 = 1.0 / 16384.0;

/// The time after so many of these steps.
pub fn time(step: usize) -> f64 {
    step as f64 * STEP
}

pub fn scales() -> Scales {
    Scales {
        eps: EPS,
        mcf_step: STEP,
        newton: NewtonParams::default(),
    }
}

/// The learned operator in the paper's formulation,
pub const PAPERS: Discretization = Discretization::new(Method::Hybrid, Formulation::Paper);
/// and in that of the least errors.
pub const ACCURATE: Discretization = Discretization::new(Method::Hybrid, Formulation::Accurate);
/// The finite elements of the paper's references.
pub const ELEMENTS: Discretization = Discretization::new(Method::FeImplicit, Formulation::Paper);

/// Options for programs that use trained networks.
#[derive(Args, Clone, Debug, Default)]
pub struct NetworkOptions {
    /// Use this safetensors file in place of the shipped network of the paper's recipe with its ratios; can be repeated
    #[arg(long, value_name = "FILE")]
    pub network: Vec<PathBuf>,
}

impl NetworkOptions {
    /// Where the networks of the paper's and the calibrated formulation come from; files that meet none of the needs are refused.
    pub fn load(&self, needs: &[NeededNetwork]) -> Result<Chosen> {
        Ok(Chosen(Networks::load(&self.network, needs)?))
    }
}

/// Whether a user's network takes part.
pub fn takes_networks(discretization: Discretization) -> bool {
    discretization.method.is_learned() && discretization.formulation != Formulation::Accurate
}

/// The user's networks in place of those of the paper's recipe, before the shipped ones.
#[derive(Clone, Debug, Default)]
pub struct Chosen(Networks);

impl Chosen {
    /// Where the network of a formulation comes from; that of the accurate recipe is always the shipped one.
    pub fn of(&self, formulation: Formulation) -> Networks {
        match formulation {
            Formulation::Accurate => Networks::default(),
            Formulation::Paper | Formulation::Calibrated => self.0.clone(),
        }
    }

    pub fn find(&self, formulation: Formulation, needed: &NeededNetwork) -> Result<NamedNetwork> {
        let networks = self.of(formulation);
        Ok(networks.find(formulation.shipped(), needed)?)
    }

    pub fn learned<const D: usize>(
        &self,
        formulation: Formulation,
        needed: &NeededNetwork,
    ) -> Result<Operator<D>> {
        let network = self.find(formulation, needed)?;
        Ok(Operator::learned(formulation, network)?)
    }

    /// The operator of a discretization at resolution `n` of the convergence tests.
    pub fn operator(&self, discretization: Discretization, n: usize) -> Result<Operator<2>> {
        if discretization.method.is_learned() {
            return self.learned(discretization.formulation, &convergence_network(n)?);
        }
        let grid = Grid::<2>::per_unit(n, 1.0)?;
        let elements = Operator::finite_elements(discretization, &grid, &scales());
        Ok(elements?)
    }
}

/// The network of the convergence tests in 2D at resolution `n`, with the paper's kernel width `n/8 + 1`.
pub fn convergence_network(n: usize) -> Result<NeededNetwork> {
    let message = format!(
        "n = {n} is not possible: the kernel width n/8 + 1 must be odd, so n must be a multiple of 16"
    );
    require(n > 0 && n.is_multiple_of(16), message)?;
    let ratios = Ratios::of_run(2, n / 8 + 1, 1.0 / n as f64, EPS, STEP);
    ratios.validate()?;
    Ok(NeededNetwork::exactly(ratios))
}

/// A flow at the scales of the convergence tests in equal steps, with nothing measured; the inner step of mean curvature flow is its step.
pub fn planar_flow(
    flow: Flow,
    operator: &Operator<2>,
    shape: &str,
    initial: Field<2>,
    tau: f64,
    steps: usize,
) -> Case<2> {
    let mut scales = scales();
    if flow == Flow::MeanCurvature {
        scales.mcf_step = tau;
    }
    let rule = StepRule::Constant(tau);
    Case {
        flow,
        measures: Vec::new(),
        ..Case::willmore(shape, initial, operator.clone(), scales, rule, steps)
    }
}

/// The operator of a discretization with the shipped network for the scales of a grid.
pub fn operator<const D: usize>(
    discretization: Discretization,
    grid: &Grid<D>,
    scales: &Scales,
) -> Result<Operator<D>> {
    let (needed, networks) = (scales.needs(D, grid.spacing()), Networks::default());
    let operator = Operator::new(discretization, &networks, &needed, grid, scales);
    Ok(operator?)
}
