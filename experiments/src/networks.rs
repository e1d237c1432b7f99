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

/// The learned operator in the paper's scheme,
pub const PAPERS: (Method, Scheme) = (Method::Hybrid, Scheme::Paper);
/// and in that of the least errors.
pub const ACCURATE: (Method, Scheme) = (Method::Hybrid, Scheme::Accurate);
/// The finite elements of the paper's references.
pub const ELEMENTS: (Method, Scheme) = (Method::FeImplicit, Scheme::Paper);

/// Options for programs that use trained networks.
#[derive(Args, Clone, Debug, Default)]
pub struct NetworkOptions {
    /// Use this safetensors file in place of the shipped network of the paper's recipe with its ratios; can be repeated
    #[arg(long, value_name = "FILE")]
    pub network: Vec<PathBuf>,
}

impl NetworkOptions {
    /// Where the networks of the paper's and the calibrated scheme come from; files that meet none of the needs are refused.
    pub fn load(&self, needs: &[NeededNetwork]) -> Result<Chosen> {
        Ok(Chosen(Networks::load(&self.network, needs)?))
    }
}

/// Whether a user's network takes part.
pub fn takes_networks((method, scheme): (Method, Scheme)) -> bool {
    method.is_learned() && scheme != Scheme::Accurate
}

/// The user's networks in place of those of the paper's recipe, before the shipped ones.
#[derive(Clone, Debug, Default)]
pub struct Chosen(Networks);

impl Chosen {
    /// Where the network of a scheme comes from; that of the accurate recipe is always the shipped one.
    pub fn of(&self, scheme: Scheme) -> Networks {
        match scheme {
            Scheme::Accurate => Networks::default(),
            Scheme::Paper | Scheme::Calibrated => self.0.clone(),
        }
    }

    pub fn find(&self, scheme: Scheme, needed: &NeededNetwork) -> Result<NamedNetwork> {
        Ok(self.of(scheme).find(scheme.shipped(), needed)?)
    }

    pub fn learned<const D: usize>(
        &self,
        scheme: Scheme,
        needed: &NeededNetwork,
    ) -> Result<Operator<D>> {
        Ok(Operator::learned(scheme, self.find(scheme, needed)?)?)
    }

    /// The operator of a method in a scheme at resolution `n` of the convergence tests.
    pub fn operator(&self, (method, scheme): (Method, Scheme), n: usize) -> Result<Operator<2>> {
        if method.is_learned() {
            return self.learned(scheme, &convergence_network(n)?);
        }
        let grid = Grid::<2>::per_unit(n, 1.0)?;
        let elements = Operator::finite_elements(method, scheme, &grid, &scales());
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
    (flow, operator): (Flow, &Operator<2>),
    shape: &str,
    initial: Field<2>,
    (tau, steps): (f64, usize),
) -> Case<2> {
    let mut scales = scales();
    if flow == Flow::MeanCurvature {
        scales.mcf_step = tau;
    }
    let time = (StepRule::Constant(tau), steps);
    Case {
        flow,
        measures: Vec::new(),
        ..Case::willmore(shape, initial, operator.clone(), scales, time)
    }
}

/// The operator of a method in a scheme with the shipped network for the scales of a grid.
pub fn operator<const D: usize>(
    variant: (Method, Scheme),
    grid: &Grid<D>,
    scales: &Scales,
) -> Result<Operator<D>> {
    let (needed, networks) = (scales.needs(D, grid.spacing()), Networks::default());
    Ok(Operator::new(variant, &networks, &needed, grid, scales)?)
}
