//! Values of a step, products with its derivative, and with the transpose of that.

use burn::tensor::Tensor;
use linearize::{Graph, Linearization, Value};
use operators::ComputeDevice;

use crate::{Error, MeanCurvatureStep};

/// A step whose values and derivatives `J` are asked for as numbers. It is traced once.
pub(super) struct Derivative<'a, const D: usize> {
    step: &'a dyn MeanCurvatureStep<D>,
    device: &'a ComputeDevice,
    shape: [usize; D],
    forward: Linearization,
    /// That of `<v[u], y>` with a parameter `y`, if the transpose is asked for.
    reverse: Option<Linearization>,
    point: Value,
}

impl<'a, const D: usize> Derivative<'a, D> {
    /// At a constant, for the time being.
    pub(super) fn new(
        step: &'a dyn MeanCurvatureStep<D>,
        shape: [usize; D],
        constant: f64,
        device: &'a ComputeDevice,
    ) -> Result<Self, Error> {
        let point = Tensor::<D>::full(shape, constant, (device.device(), device.dtype()));
        let mut derivative = Self {
            step,
            device,
            shape,
            forward: trace(step, &point, device)?,
            reverse: None,
            point: point.into(),
        };
        derivative.go_to_point()?;
        Ok(derivative)
    }

    /// Goes to another point, and gives the value there.
    pub(super) fn at(&mut self, u: &[f64]) -> Result<Vec<f64>, Error> {
        self.point = self.tensor(u).into();
        self.go_to_point()
    }

    fn go_to_point(&mut self) -> Result<Vec<f64>, Error> {
        let point = std::slice::from_ref(&self.point);
        let value = self.forward.at(point, &[])?.value;
        self.checked(value.tensor()?)
    }

    /// `v[u]` elsewhere.
    pub(super) fn value(&mut self, u: &[f64]) -> Result<Vec<f64>, Error> {
        let value = self.forward.value(&[self.tensor(u).into()], &[])?;
        self.checked(value.tensor()?)
    }

    /// `J p`.
    pub(super) fn product(&mut self, p: &[f64]) -> Result<Vec<f64>, Error> {
        let product = self.forward.apply(&[self.tensor(p).into()])?;
        self.checked(product[0].tensor()?)
    }

    /// `J^T y`.
    pub(super) fn transposed(&mut self, y: &[f64]) -> Result<Vec<f64>, Error> {
        let y = [Value::from(self.tensor(y))];
        let point = std::slice::from_ref(&self.point);
        let reverse = match &mut self.reverse {
            Some(reverse) => reverse,
            None => {
                let graph = Graph::gradient(point, &y, |inputs| {
                    (self.step.apply(inputs.variable(0)) * inputs.parameter::<D>(0)).sum()
                })?;
                let extensions = self.step.extensions();
                let program = graph.linearize(&extensions, None)?;
                let reverse = program.on(self.device.device(), &extensions)?;
                self.reverse.insert(reverse)
            }
        };
        let gradient = reverse.at(point, &y)?.gradients[0].tensor()?;
        self.checked(gradient)
    }

    /// `M x`.
    pub(super) fn mass(&self, x: &[f64]) -> Result<Vec<f64>, Error> {
        self.checked(self.step.mass(self.tensor(x)))
    }

    fn tensor(&self, x: &[f64]) -> Tensor<D> {
        self.device.tensor(x, self.shape)
    }

    fn checked(&self, x: Tensor<D>) -> Result<Vec<f64>, Error> {
        let values = self.device.values(x)?;
        match self.step.failure() {
            Some(failure) => Err(Error::Step {
                step: self.step.identity().name,
                failure,
            }),
            None => Ok(values),
        }
    }
}

/// A step as a function that can be differentiated, for tensors like `point`.
pub(super) fn trace<const D: usize>(
    step: &dyn MeanCurvatureStep<D>,
    point: &Tensor<D>,
    device: &ComputeDevice,
) -> Result<Linearization, Error> {
    let graph = Graph::trace(&[point.into()], &[], |inputs| {
        vec![step.apply(inputs.variable::<D>(0)).into()]
    })?;
    let extensions = step.extensions();
    let program = graph.linearize(&extensions, None)?;
    Ok(program.on(device.device(), &extensions)?)
}
