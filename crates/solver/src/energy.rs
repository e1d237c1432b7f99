//! The minimizing-movement energy as a Burn graph.

use std::sync::Arc;

use burn::tensor::{DType, Tensor};
use linearize::{Graph, Linearization, Value};
use mean_curvature::MeanCurvatureStep;
use operators::ComputeDevice;

use crate::{Error, HelfrichTerms, Precision};

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

/// The energy of one minimizing movement, scaled by `N / (2 eps)`:
///
/// `E(u) = 1/2 |u - a|^2 + c/2 |V[u] - u|^2`, with sums over the grid in the step's inner product and
/// the [stiffness](crate::FlowParams::stiffness) `c`,
///
/// so that its Hessian is the identity (or mass matrix) plus what the curvature adds; [`HelfrichTerms`] change the second term. The anchor `a` is `u_k` in an implicit Euler step.
/// Stages of second-order steps have other anchors, and weigh the motion by positive numbers that are fixed during the minimization:
/// `1/2 |s (u - a)|^2`. Anchor, `c` and `s` are inputs of the traced graph: one trace serves a whole run.
pub struct MinimizingMovement<const D: usize> {
    linearization: Linearization,
    product_dtype: Option<DType>,
    step: Arc<dyn MeanCurvatureStep<D>>,
    device: ComputeDevice,
    anchor: Value,
    stiffness: Value,
    /// `s`, where the motion is weighted.
    factors: Option<Value>,
}

impl<const D: usize> MinimizingMovement<D> {
    /// Traces the energy for grids of `cells^D` and loads it on the device. Hessian-vector products have the device's precision.
    ///
    /// # Errors
    /// [`Error::Linearize`] if the step contains an operation without a rule.
    pub fn new(
        step: Arc<dyn MeanCurvatureStep<D>>,
        cells: usize,
        device: &ComputeDevice,
    ) -> Result<Self, Error> {
        let shape = [cells; D];
        Self::with_terms(step, shape, Precision::Device, (false, None), device)
    }

    /// As [`Self::new`], for tensors of any shape that the step takes, such as that of active bricks; with Hessian-vector products in single
    /// precision if asked for and if the step allows it; with factors of the motion if `weighted`; and with spontaneous curvature, tension and
    /// pressure, if there are such.
    pub fn with_terms(
        step: Arc<dyn MeanCurvatureStep<D>>,
        shape: [usize; D],
        products: Precision,
        (weighted, terms): (bool, Option<&HelfrichTerms<D>>),
        device: &ComputeDevice,
    ) -> Result<Self, Error> {
        let options = (device.device(), device.dtype());
        let anchor = Value::from(Tensor::<D>::zeros(shape, options));
        let stiffness = Value::from(device.tensor::<1>(&[1.0], [1]));
        let factors = weighted.then(|| Value::from(Tensor::<D>::ones(shape, options)));
        let mut parameters = vec![anchor.clone(), stiffness.clone()];
        parameters.extend(factors.clone());
        let graph = Graph::gradient(std::slice::from_ref(&anchor), &parameters, |inputs| {
            let u = inputs.variable::<D>(0);
            let mut motion = u.clone() - inputs.parameter::<D>(0);
            if weighted {
                motion = motion * inputs.parameter::<D>(2);
            }
            let mut residual = step.apply(u.clone()) - u.clone();
            if let Some(terms) = terms {
                residual = terms.shifted(residual, &u);
            }
            let square = |x: Tensor<D>| (x.clone() * step.mass(x)).sum();
            let mut curvature = square(residual);
            if let Some(sizes) = terms.and_then(|terms| terms.sizes(&u)) {
                curvature = curvature + sizes * 2.0;
            }
            (square(motion) + curvature * inputs.parameter::<1>(1)) * 0.5
        })?;
        let extensions = step.extensions();
        let single = products == Precision::Single && step.allows_single_precision();
        let product_dtype = (single && device.dtype() != DType::F32).then_some(DType::F32);
        let program = graph.linearize(&extensions, product_dtype)?;
        Ok(Self {
            linearization: program.on(device.device(), &extensions)?,
            product_dtype,
            step,
            device: device.clone(),
            anchor,
            stiffness,
            factors,
        })
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
        let parameters = self.parameters();
        let evaluation = self.linearization.at(&[u.clone().into()], &parameters)?;
        let value = self.device.scalar(evaluation.value.tensor::<1>()?)?;
        self.check()?;
        Ok((value, evaluation.gradients[0].tensor::<D>()?))
    }

    fn hessian_vector_product(&mut self, p: &Tensor<D>) -> Result<Tensor<D>, Error> {
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
