//! The minimizing-movement energy as a Burn graph.

use std::sync::Arc;

use burn::tensor::{DType, Tensor};
use geometry::Grid;
use linearize::{Extensions, Graph, Inputs, Linearization, Value};
use mean_curvature::MeanCurvatureStep;
use operators::ComputeDevice;

use crate::{Cancel, Domain, DomainScales, Error, Precision};

pub(crate) mod check;
mod helfrich;
mod term;

pub use check::TermCheck;
pub use helfrich::{Helfrich, Pressure, SpontaneousCurvature, Tension};
pub use term::{EnergyTerm, EnergyTerms};

/// A twice differentiable function of a grid of values.
///
/// `evaluate` sets the point at which `hessian_vector_product` works; `value` leaves it alone.
pub trait Objective<const D: usize> {
    /// The function.
    fn value(&mut self, u: &Tensor<D>) -> Result<f64, Error>;

    /// The function and its gradient.
    fn evaluate(&mut self, u: &Tensor<D>) -> Result<(f64, Tensor<D>), Error>;

    /// The Hessian at the last evaluated point, applied to `p`.
    ///
    /// # Errors
    /// If nothing was evaluated, or the device fails.
    fn hessian_vector_product(&mut self, p: &Tensor<D>) -> Result<Tensor<D>, Error>;

    /// The float type of the vectors that `hessian_vector_product` takes and returns, if not that of the points.
    fn product_dtype(&self) -> Option<DType> {
        None
    }

    /// The size of the curvature where the function is flattest and convex: the weight of `1/2 |u|^2` in it.
    fn unit(&self) -> f64;
}

/// What the energy of a minimizing movement is made of.
pub struct MovementGraph<'a, const D: usize> {
    /// The step of mean curvature flow.
    pub step: Arc<dyn MeanCurvatureStep<D>>,
    /// Where the values are stored.
    pub domain: &'a Domain<D>,
    /// What the energy has besides bending.
    pub terms: &'a [Arc<dyn EnergyTerm<D>>],
    /// The factor that makes of these energies per area or volume what `1/2 (V[u] - u)^2` is in each node,
    /// [`FlowParams::energy_unit`](crate::FlowParams::energy_unit).
    pub unit: f64,
    /// The precision of Hessian-vector products, if the step allows single precision.
    pub products: Precision,
    /// Whether the motion has factors.
    pub weighted: bool,
}

/// The energy of one minimizing movement, scaled by `N / (2 eps)`:
///
/// `E(u) = 1/2 |u - a|^2 + c/2 (|V[u] - u + b(u)|^2 + 2 unit/h^D e(u))`, with sums over the grid in the step's inner product and
/// the [stiffness](crate::FlowParams::stiffness) `c`,
///
/// so that its Hessian is the identity (or mass matrix) plus what the curvature adds. The shifts `b` and energies `e` are those of the
/// [terms](EnergyTerm), if there are such. The anchor `a` is `u_k` in an implicit Euler step.
/// Stages of second-order steps have other anchors, and weigh the motion by positive numbers that are fixed during the minimization:
/// `1/2 |s (u - a)|^2`. Anchor, `c` and `s` are inputs of the traced graph: one trace serves until the stored nodes or the problem change.
pub struct MinimizingMovement<const D: usize> {
    linearization: Linearization,
    product_dtype: Option<DType>,
    step: Arc<dyn MeanCurvatureStep<D>>,
    device: ComputeDevice,
    anchor: Value,
    stiffness: Value,
    /// `s`, where the motion is weighted.
    factors: Option<Value>,
    /// Whether its minimum is still wanted.
    cancel: Cancel,
}

impl<const D: usize> MovementGraph<'_, D> {
    /// The energy at the inputs of a graph. Its variable is `u`; its parameters are the anchor, the stiffness, and the factors if the motion is weighted.
    fn energy(&self, inputs: &Inputs) -> Result<Tensor<1>, Error> {
        let u = inputs.variable::<D>(0);
        let mut motion = u.clone() - inputs.parameter::<D>(0);
        if self.weighted {
            motion = motion * inputs.parameter::<D>(2);
        }
        let domain = self.domain.at(&u.device());
        let residual = self.step.apply(u.clone()) - u.clone();
        let residual = term::shifted(residual, self.terms, &u, &domain)?;
        let square = |x: Tensor<D>| (x.clone() * self.step.mass(x)).sum();
        let mut curvature = square(residual);
        if let Some(energies) = term::energies(self.terms, &u, &domain)? {
            curvature = curvature + energies * (2.0 * self.unit / domain.cell_volume());
        }
        Ok((square(motion) + curvature * inputs.parameter::<1>(1)) * 0.5)
    }

    /// The error of linearizing, with the name of the term that contains an operation without a rule, if one does.
    fn error(&self, error: linearize::Error, extensions: &Extensions) -> Error {
        if !matches!(error, linearize::Error::NoRule { .. }) {
            return error.into();
        }
        for term in self.terms {
            let graph = check::graph_of_term(&**term, self.domain, check::whole_energy);
            let alone = graph.map(|graph| graph.linearize(extensions, None));
            if let Ok(Err(source)) = alone {
                let name = term.identity().name;
                return Error::Term { name, source };
            }
        }
        error.into()
    }
}

/// The graph of a function that can fail, with its gradient.
fn graph_of(
    variables: &[Value],
    parameters: &[Value],
    function: impl Fn(&Inputs) -> Result<Tensor<1>, Error>,
) -> Result<Graph, Error> {
    let mut failure = None;
    let graph = Graph::gradient(variables, parameters, |inputs| {
        function(inputs).unwrap_or_else(|error| {
            failure = Some(error);
            Tensor::zeros([1], &inputs.device())
        })
    });
    match failure {
        Some(error) => Err(error),
        None => Ok(graph?),
    }
}

impl<const D: usize> MinimizingMovement<D> {
    /// The energy of bending for grids of `cells^D`, on the device. Hessian-vector products have the device's precision.
    ///
    /// # Errors
    /// As [`Self::traced`].
    pub fn new(
        step: Arc<dyn MeanCurvatureStep<D>>,
        cells: usize,
        device: &ComputeDevice,
    ) -> Result<Self, Error> {
        // The energy of bending has no scales of its own.
        let grid = Grid::new(cells, 1.0)?;
        let scales = DomainScales {
            eps: 1.0,
            mcf_step: 1.0,
            response: 1.0,
        };
        let domain = Domain::new(grid.into(), [-1.0, 1.0], scales, device);
        Self::traced(MovementGraph {
            step,
            domain: &domain,
            terms: &[],
            unit: 1.0,
            products: Precision::Device,
            weighted: false,
        })
    }

    /// Traces the energy and loads it on the device of the domain.
    ///
    /// # Errors
    /// [`Error::Term`] if a term, [`Error::Linearize`] if the step contains an operation without a rule; what the terms raise.
    pub fn traced(graph: MovementGraph<'_, D>) -> Result<Self, Error> {
        let (device, shape) = (graph.domain.device().clone(), graph.domain.shape());
        let options = (device.device(), device.dtype());
        let anchor = Value::from(Tensor::<D>::zeros(shape, options));
        let stiffness = Value::from(device.tensor::<1>(&[1.0], [1]));
        let factors = (graph.weighted).then(|| Value::from(Tensor::<D>::ones(shape, options)));
        let mut parameters = vec![anchor.clone(), stiffness.clone()];
        parameters.extend(factors.clone());
        let energy = graph_of(std::slice::from_ref(&anchor), &parameters, |inputs| {
            graph.energy(inputs)
        })?;
        let extensions = graph.step.extensions();
        let single = graph.products == Precision::Single && graph.step.allows_single_precision();
        let product_dtype = (single && device.dtype() != DType::F32).then_some(DType::F32);
        let program = (energy.linearize(&extensions, product_dtype))
            .map_err(|error| graph.error(error, &extensions))?;
        Ok(Self {
            linearization: program.on(device.device(), &extensions)?,
            product_dtype,
            step: graph.step,
            device,
            anchor,
            stiffness,
            factors,
            cancel: Cancel::default(),
        })
    }

    /// Ends the minimization with an error as soon as its minimum is not wanted any more.
    pub fn set_cancel(&mut self, cancel: Cancel) {
        self.cancel = cancel;
    }

    /// Sets the anchor and `c`, the [stiffness](crate::FlowParams::stiffness).
    ///
    /// # Errors
    /// [`Error::Geometry`] unless `c` is positive and finite.
    pub fn set(&mut self, anchor: &Tensor<D>, stiffness: f64) -> Result<(), Error> {
        geometry::positive("tau / tautilde^2", stiffness)?;
        self.anchor = anchor.clone().into();
        self.stiffness = self.device.tensor::<1>(&[stiffness], [1]).into();
        self.linearization.forget();
        Ok(())
    }

    /// Sets the factors `s` of the motion, which are 1 until then.
    pub(crate) fn set_factors(&mut self, factors: &Tensor<D>) {
        debug_assert!(self.factors.is_some(), "the energy is not weighted");
        self.factors = Some(factors.clone().into());
        self.linearization.forget();
    }

    fn check(&self) -> Result<(), Error> {
        match self.step.failure() {
            Some(failure) => Err(Error::Step(failure)),
            None => Ok(()),
        }
    }

    fn parameters(&self) -> Vec<Value> {
        let mut parameters = vec![self.anchor.clone(), self.stiffness.clone()];
        parameters.extend(self.factors.clone());
        parameters
    }
}

impl<const D: usize> Objective<D> for MinimizingMovement<D> {
    fn value(&mut self, u: &Tensor<D>) -> Result<f64, Error> {
        self.cancel.check()?;
        let parameters = self.parameters();
        let value = self.linearization.value(&[u.clone().into()], &parameters)?;
        let value = self.device.scalar(value.tensor::<1>()?)?;
        // Where the step fails the energy counts as infinite: a line search turns back.
        Ok(match self.step.failure() {
            Some(_) => f64::INFINITY,
            None => value,
        })
    }

    fn evaluate(&mut self, u: &Tensor<D>) -> Result<(f64, Tensor<D>), Error> {
        self.cancel.check()?;
        let parameters = self.parameters();
        let evaluation = self.linearization.at(&[u.clone().into()], &parameters)?;
        let value = self.device.scalar(evaluation.value.tensor::<1>()?)?;
        self.check()?;
        Ok((value, evaluation.gradients[0].tensor::<D>()?))
    }

    fn hessian_vector_product(&mut self, p: &Tensor<D>) -> Result<Tensor<D>, Error> {
        self.cancel.check()?;
        let product = self.linearization.apply(&[p.clone().into()])?;
        self.check()?;
        Ok(product[0].tensor::<D>()?)
    }

    fn product_dtype(&self) -> Option<DType> {
        self.product_dtype
    }

    fn unit(&self) -> f64 {
        1.0
    }
}
