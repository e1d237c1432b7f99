//! Whether terms of an energy fit a flow, and whether their derivatives are their own.

use burn::tensor::Tensor;
use linearize::taylor::{Remainder, halvings, remainder};
use linearize::{Extensions, Graph, Linearization, Value};
use operators::ComputeDevice;

use super::graph_of;
use crate::{Domain, EnergyTerm, Error};

/// A Taylor test of a term at a phase field, along a motion of the interface.
#[derive(Clone, Debug, PartialEq)]
pub struct TermCheck {
    /// The name of the term.
    pub name: String,
    /// Its energy; none for a term that shifts the curvature and has no energy of its own.
    pub energy: Option<f64>,
    /// What the gradient leaves of the energy: it falls with the second power of the motion.
    pub gradient: Remainder,
    /// What gradient and Hessian leave: it falls with the third power.
    pub hessian: Remainder,
}

impl TermCheck {
    /// Whether both fall as they should.
    pub fn is_consistent(&self) -> bool {
        const TOLERANCE: f64 = 0.2;
        self.gradient.is_consistent(TOLERANCE) && self.hessian.is_consistent(TOLERANCE)
    }
}

/// A term alone: its energy and the sum of its shifts as one function, with its derivatives.
struct Alone<const D: usize> {
    linearization: Linearization,
    device: ComputeDevice,
}

impl<const D: usize> Alone<D> {
    fn new(
        term: &dyn EnergyTerm<D>,
        on: &Domain<D>,
        energy: EnergyOf<D>,
        extensions: &Extensions,
    ) -> Result<Self, Error> {
        let graph = graph_of_term(term, on, energy)?;
        let named = |source| Error::Term {
            name: term.identity().name,
            source,
        };
        let program = graph.linearize(extensions, None).map_err(named)?;
        let device = on.device().clone();
        Ok(Self {
            linearization: program.on(device.device(), extensions)?,
            device,
        })
    }

    fn value(&mut self, u: &Tensor<D>) -> Result<f64, Error> {
        let value = self.linearization.value(&[u.clone().into()], &[])?;
        Ok(self.device.scalar(value.tensor::<1>()?)?)
    }

    fn gradient(&mut self, u: &Tensor<D>) -> Result<Vec<f64>, Error> {
        let evaluation = self.linearization.at(&[u.clone().into()], &[])?;
        Ok(evaluation.gradients[0].to_vec())
    }

    /// The Hessian at the point of the last gradient, applied to a motion.
    fn product(&mut self, p: &Tensor<D>) -> Result<Vec<f64>, Error> {
        Ok(self.linearization.apply(&[p.clone().into()])?[0].to_vec())
    }
}

/// An energy of a term.
type EnergyOf<const D: usize> =
    fn(&dyn EnergyTerm<D>, &Tensor<D>, &Domain<D>) -> Result<Option<Tensor<1>>, Error>;

/// All of it.
pub(super) fn whole_energy<const D: usize>(
    term: &dyn EnergyTerm<D>,
    u: &Tensor<D>,
    on: &Domain<D>,
) -> Result<Option<Tensor<1>>, Error> {
    term.energy(u, on)
}

/// That of the stored nodes, where the rest would take the work of the whole grid.
fn stored_energy<const D: usize>(
    term: &dyn EnergyTerm<D>,
    u: &Tensor<D>,
    on: &Domain<D>,
) -> Result<Option<Tensor<1>>, Error> {
    match term.density(u, on)? {
        Some(density) => Ok(Some(density.sum() * on.cell_volume())),
        None => term.energy(u, on),
    }
}

/// An energy of a term and the sum of its shifts as a graph.
pub(super) fn graph_of_term<const D: usize>(
    term: &dyn EnergyTerm<D>,
    on: &Domain<D>,
    energy: EnergyOf<D>,
) -> Result<Graph, Error> {
    let device = on.device();
    let zeros = Tensor::<D>::zeros(on.shape(), (device.device(), device.dtype()));
    graph_of(&[Value::from(zeros)], &[], |inputs| {
        let u = inputs.variable::<D>(0);
        let on = on.at(&u.device());
        let shift = term.shift(&u, &on)?.map(Tensor::sum);
        let sum = energy(term, &u, &on)?
            .into_iter()
            .chain(shift)
            .reduce(|a, b| a + b);
        Ok(sum.unwrap_or_else(|| u.sum() * 0.0))
    })
}

/// Refuses a term whose tensors have another shape than the field, or whose derivatives are not finite on a flat interface or in a pure phase.
pub(crate) fn fits<const D: usize>(
    term: &dyn EnergyTerm<D>,
    on: &Domain<D>,
    extensions: &Extensions,
) -> Result<(), Error> {
    let interface = on.grid().origin()[0] + 4.0 * on.spacing();
    let profile = on.sample(|x| (0.75 * (x[0] - interface) / on.eps()).tanh());
    for part in [term.density(&profile, on)?, term.shift(&profile, on)?] {
        if let Some(part) = part.filter(|part| part.dims() != on.shape()) {
            return Err(Error::TermShape {
                name: term.identity().name,
                found: part.dims().to_vec(),
                expected: on.shape().to_vec(),
            });
        }
    }
    let mut alone = Alone::new(term, on, stored_energy, extensions)?;
    let constant = |value: f64| on.sample(|_| value);
    for (u, place) in [
        (profile, "on a flat interface"),
        // Where nothing is stored beside it, too.
        (
            constant(on.phase_values()[0]),
            "where the phase field is constant",
        ),
        (constant(-1.0), "at u = -1"),
        (constant(1.0), "at u = 1"),
    ] {
        let mut derivatives = alone.gradient(&u)?;
        derivatives.extend(alone.product(&u)?);
        if derivatives.iter().any(|value| !value.is_finite()) {
            let name = term.identity().name;
            return Err(Error::TermDerivative { name, place });
        }
    }
    Ok(())
}

/// Tests the derivatives of a term.
pub(crate) fn check<const D: usize>(
    term: &dyn EnergyTerm<D>,
    u: &Tensor<D>,
    on: &Domain<D>,
    extensions: &Extensions,
) -> Result<TermCheck, Error> {
    let mut alone = Alone::new(term, on, whole_energy, extensions)?;
    let wave = on.sample(|x| {
        x.iter()
            .zip(1..)
            .map(|(x, k)| (7.0 * x + f64::from(k)).sin())
            .sum()
    });
    let motion = on.slope(u) * wave * (0.3 * on.eps());
    let device = on.device();
    let along = device.values(motion.clone())?;
    let sum = |x: &[f64]| x.iter().zip(&along).map(|(a, b)| a * b).sum::<f64>();
    let gradient = sum(&alone.gradient(u)?);
    let hessian = sum(&alone.product(&motion)?);
    let steps = halvings(0.25, 10);
    let values = steps
        .iter()
        .chain(&[0.0])
        .map(|&t| alone.value(&(u.clone() + motion.clone() * t)));
    let values: Vec<f64> = values.collect::<Result<_, _>>()?;
    let value = |t: f64| {
        let known = steps.iter().position(|step| step.to_bits() == t.to_bits());
        values[known.unwrap_or(steps.len())]
    };
    let rest = |derivatives: &[f64]| remainder(value, derivatives, &steps, device.epsilon());
    let energy = term.energy(u, on)?;
    Ok(TermCheck {
        name: term.identity().name,
        energy: energy.map(|energy| device.scalar(energy)).transpose()?,
        gradient: rest(&[gradient]),
        hessian: rest(&[gradient, hessian]),
    })
}
