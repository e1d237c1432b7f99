//! Finite-element steps of mean curvature flow as Burn graphs.

use std::sync::Arc;

use burn::backend::Dispatch;
use burn::tensor::Tensor;
use geometry::{Field, Grid, Nodes};
use linearize::Extensions;
use mean_curvature::{
    Accuracy, Calibration, Identity, MeanCurvatureStep, PhaseInverse, PhaseInverses, StepFailure,
    StepScales,
};
use operators::{ComputeDevice, SpectralFilter, spectral_filter};
use serde_json::json;

use crate::finite_elements::TimeDiscretization;
use crate::ops::{FemOps, Operation, register};
use crate::planar::ElementsOnPlanes;
use crate::{Error, FiniteElements, LinearSolver, Statistics, Tolerances};

/// A finite-element step of mean curvature flow: `v[u]` of Franken, Rumpf and Wirth's nested scheme.
///
/// Cheap to clone; clones share matrices, tolerances and statistics. Tensors may live on any device: the work is done in `f64` on the
/// host.
///
/// ```
/// use fem::FiniteElementStep;
/// use geometry::{Grid, measure, phase_field, shapes::Ball};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// // A disc of radius 0.25 shrinks to sqrt(r^2 - 2 t) under mean curvature flow.
/// let grid = Grid::<2>::per_unit(96, 1.0)?;
/// let (eps, step) = (2.0 * grid.spacing(), grid.spacing().powi(2));
/// let disc = phase_field(grid, &Ball::new([0.0, 0.0], 0.25)?, eps)?;
/// let implicit = FiniteElementStep::implicit(&grid, eps, step)?;
/// let mut u = disc.clone();
/// for _ in 0..16 {
///     u = implicit.step(&u)?;
/// }
/// let radius = f64::sqrt(0.25_f64.powi(2) - 2.0 * 16.0 * step);
/// let exact = phase_field(grid, &Ball::new([0.0, 0.0], radius)?, eps)?;
/// let error = measure::l2_distance(&u, &exact)?;
/// assert!(error < 0.1 * measure::l2_distance(&disc, &exact)?);
/// # Ok(())
/// # }
/// ```
#[derive(Clone)]
pub struct FiniteElementStep<const D: usize> {
    discretization: TimeDiscretization,
    grid: Grid<D>,
    eps: f64,
    step: f64,
    elements: Arc<FiniteElements<D>>,
    /// Under which they are registered.
    number: u64,
}

impl<const D: usize> FiniteElementStep<D> {
    /// The implicit step of the paper: the minimizer of `eps |u - v|^2 + 2 tautilde P_eps[v]`, by Newton's method.
    ///
    /// # Errors
    /// As [`FiniteElements::new`].
    pub fn implicit(grid: &Grid<D>, eps: f64, step: f64) -> Result<Self, Error> {
        Self::new(
            TimeDiscretization::Implicit,
            grid,
            eps,
            step,
            LinearSolver::default(),
        )
    }

    /// The implicit step with another solver for its linear systems.
    ///
    /// # Errors
    /// As [`FiniteElements::new`].
    pub fn implicit_with(
        grid: &Grid<D>,
        eps: f64,
        step: f64,
        solver: LinearSolver,
    ) -> Result<Self, Error> {
        Self::new(TimeDiscretization::Implicit, grid, eps, step, solver)
    }

    /// The semi-implicit step `(v - u)/tautilde = lap v - Psi'(u)/(2 eps^2)`: one circulant system, solved exactly. The explicit
    /// term is interpolated at the nodes, `M Psi'(u)`, as codes for this scheme do.
    ///
    /// # Errors
    /// As [`FiniteElements::new`].
    pub fn semi_implicit(grid: &Grid<D>, eps: f64, step: f64) -> Result<Self, Error> {
        Self::new(
            TimeDiscretization::SemiImplicit,
            grid,
            eps,
            step,
            LinearSolver::default(),
        )
    }

    fn new(
        discretization: TimeDiscretization,
        grid: &Grid<D>,
        eps: f64,
        step: f64,
        solver: LinearSolver,
    ) -> Result<Self, Error> {
        let elements = Arc::new(FiniteElements::new(
            grid.cells(),
            grid.spacing(),
            eps,
            step,
            solver,
        )?);
        Ok(Self {
            discretization,
            grid: *grid,
            eps,
            step,
            number: register(&elements),
            elements,
        })
    }

    /// The matrices and solvers.
    pub fn elements(&self) -> &FiniteElements<D> {
        &self.elements
    }

    /// Work of the inner solvers so far.
    pub fn statistics(&self) -> Statistics {
        self.elements.statistics()
    }

    /// One step of mean curvature flow.
    ///
    /// # Errors
    /// As [`FiniteElements::implicit_step`], values that are not finite.
    ///
    /// # Panics
    /// If `u` lives on another grid, wherever its origin is.
    pub fn step(&self, u: &Field<D>) -> Result<Field<D>, Error> {
        let size = |grid: &Grid<D>| (grid.cells(), grid.spacing().to_bits());
        assert_eq!(
            size(u.grid()),
            size(&self.grid),
            "the phase field lives on another grid than the elements"
        );
        let values = match self.discretization {
            TimeDiscretization::Implicit => self.elements.implicit_step(u.values())?,
            TimeDiscretization::SemiImplicit => self.elements.semi_implicit_step(u.values()),
        };
        Ok(Field::from_values(*u.grid(), values)?)
    }

    /// `w = eps / (2 tautilde^2) |v[u] - u|^2`, the approximate Willmore energy of a phase field, in the norm of the mass
    /// matrix. With the implicit step it is the paper's `w_tautilde^eps`.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn willmore_energy(&self, u: &Field<D>) -> Result<f64, Error> {
        let v = self.step(u)?;
        let pairs = v.values().iter().zip(u.values());
        let motion: Vec<f64> = pairs.map(|(v, u)| v - u).collect();
        let mass = self.elements.mass(&motion);
        let square: f64 = motion.iter().zip(mass).map(|(a, b)| a * b).sum();
        Ok(self.eps / (2.0 * self.step * self.step) * square * self.grid.cell_volume())
    }

    /// What the step makes of the Willmore energy, from its flat interfaces (`docs/calibration.md`).
    ///
    /// # Errors
    /// [`mean_curvature::Error::Calibration`] if the step has no flat interface at rest.
    pub fn calibrate(&self) -> Result<Calibration, mean_curvature::Error> {
        let h = self.grid.spacing();
        let (eps, step) = (self.eps / h, self.step / (h * h));
        let on_planes =
            |normal: &[isize]| ElementsOnPlanes::new(self.discretization, eps, step, normal);
        mean_curvature::calibrate(mean_curvature::normals(D), on_planes)
    }

    /// The derivative of the step at `u` in direction `p`, given `v = v[u]`, as a Burn graph: `A(v)^-1 M p` for the implicit
    /// step.
    pub fn derivative(&self, u: Tensor<D>, v: Tensor<D>, p: Tensor<D>) -> Tensor<D> {
        match self.discretization {
            TimeDiscretization::Implicit => {
                let (v, right) = (v.into_dispatch(), self.mass(p).into_dispatch());
                self.run(Operation::LinearizedSolve(v, right))
            }
            TimeDiscretization::SemiImplicit => {
                let r = self.elements.reaction();
                let slope = (u.clone() * u) * (-3.0 * r) + (1.0 + r);
                self.heat_solve(self.mass(slope * p))
            }
        }
    }

    fn run(&self, operation: Operation<Dispatch>) -> Tensor<D> {
        Tensor::from_dispatch(<Dispatch as FemOps>::fem(operation, self.number))
    }

    fn heat_solve(&self, x: Tensor<D>) -> Tensor<D> {
        self.run(Operation::HeatSolve(x.into_dispatch()))
    }
}

impl<const D: usize> MeanCurvatureStep<D> for FiniteElementStep<D> {
    fn apply(&self, u: Tensor<D>) -> Tensor<D> {
        match self.discretization {
            TimeDiscretization::Implicit => self.run(Operation::ImplicitStep(u.into_dispatch())),
            TimeDiscretization::SemiImplicit => {
                let r = self.elements.reaction();
                let cubic = u.clone() * u.clone() * u.clone();
                self.heat_solve(self.mass(u * (1.0 + r) - cubic * r))
            }
        }
    }

    fn mass(&self, x: Tensor<D>) -> Tensor<D> {
        self.run(Operation::Mass(x.into_dispatch()))
    }

    fn extensions(&self) -> Extensions {
        crate::extensions()
    }

    fn identity(&self) -> Identity {
        let name = match self.discretization {
            TimeDiscretization::Implicit => "implicit finite elements",
            TimeDiscretization::SemiImplicit => "semi-implicit finite elements",
        };
        let solver = format!("{:?}", self.elements.solver());
        Identity::new(
            name,
            json!({ "eps": self.eps, "step": self.step, "solver": solver }),
        )
    }

    fn phase_inverses(
        &self,
        _nodes: &Nodes<D>,
        _device: &ComputeDevice,
    ) -> Result<PhaseInverses<D>, StepFailure> {
        let (step, shape) = (self.clone(), self.grid.shape());
        Ok(Arc::new(move |stiffness| {
            let inverse = SpectralFilter::from_symbol(&shape, |theta| {
                let (mass, derivative) = step.elements.phase_symbols(step.discretization, theta);
                1.0 / (mass * (1.0 + stiffness * (1.0 - derivative).powi(2)))
            });
            Arc::new(move |r: &Tensor<D>| spectral_filter(r.clone(), &inverse)) as PhaseInverse<D>
        }))
    }

    /// From the element matrices on planes, exactly.
    fn calibrate(
        &self,
        _scales: &StepScales,
        _device: &ComputeDevice,
    ) -> Result<Calibration, StepFailure> {
        Ok(FiniteElementStep::calibrate(self)?)
    }

    /// A product with the Hessian contains `c (J - 1)^T M (J - 1) p`; where `J` is near 1, errors of `J p` come out `c` times
    /// larger than what the outer iteration looks at.
    fn set_accuracy(&self, accuracy: &Accuracy) {
        let amplification = 1.0 + accuracy.stiffness;
        self.elements.set_tolerances(Tolerances {
            linear: (1e-2 * accuracy.cg_tolerance / amplification).clamp(1e-12, 1e-6),
            newton: (1e-2 * accuracy.tolerance / amplification).clamp(1e-13, 1e-8),
            ..self.elements.tolerances()
        });
    }

    fn failure(&self) -> Option<StepFailure> {
        self.elements
            .take_failure()
            .map(|error| Box::new(error) as StepFailure)
    }
}
