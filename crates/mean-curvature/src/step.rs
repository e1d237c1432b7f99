//! What a solver asks of a step of mean curvature flow.

use std::sync::Arc;

use burn::tensor::Tensor;
use geometry::{Grid, Nodes};
use operators::ComputeDevice;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::{Calibration, Error, Factors, measured};

/// Why a step of mean curvature flow failed.
pub type StepFailure = Box<dyn std::error::Error + Send + Sync>;

/// A symmetric positive definite approximation of `(M + c (J - 1)^T M (J - 1))^-1` in the pure phases, in the precision of what it is
/// applied to. `M` is the [mass](MeanCurvatureStep::mass), `J` the derivative of the step.
pub type PhaseInverse<const D: usize> = Arc<dyn Fn(&Tensor<D>) -> Tensor<D> + Send + Sync>;

/// The [`PhaseInverse`] for every stiffness `c`.
pub type PhaseInverses<const D: usize> = Arc<dyn Fn(f64) -> PhaseInverse<D> + Send + Sync>;

/// A step of mean curvature flow, `v[u]`, as the energy of Willmore flow sees it.
///
/// `apply` and `identity` are all that most steps write. What else a flow needs is measured:
///
/// - the [inverses in the pure phases](Self::phase_inverses), from the response to an impulse there,
/// - the [calibration](Self::calibrate), from flat interfaces and how the step responds to bending them.
///
/// ```
/// use burn::tensor::Tensor;
/// use mean_curvature::{Identity, MeanCurvatureStep};
/// use operators::circular_convolution;
///
/// /// `v = u + reaction (u - u^3)` after smoothing, the splitting of the Allen-Cahn equation.
/// struct Splitting { kernel: Tensor<2>, reaction: f64 }
///
/// impl MeanCurvatureStep<2> for Splitting {
///     fn apply(&self, u: Tensor<2>) -> Tensor<2> {
///         let kernel = self.kernel.clone().to_device(&u.device());
///         let u = circular_convolution(u, kernel, false);
///         let cube = u.clone() * u.clone() * u.clone();
///         u.clone() + (u - cube) * self.reaction
///     }
///
///     fn identity(&self) -> Identity {
///         Identity::new("splitting", serde_json::json!({ "reaction": self.reaction }))
///     }
/// }
/// ```
pub trait MeanCurvatureStep<const D: usize>: Send + Sync {
    /// `v[u]` as a Burn graph, on whatever device `u` lives (including Burn's capture device).
    fn apply(&self, u: Tensor<D>) -> Tensor<D>;

    /// What a result depends on; a run is resumed with a step of the same identity only.
    fn identity(&self) -> Identity;

    /// The matrix `M` of the inner product in which the energy measures motions, as a Burn graph: `<a, b> = h^D a . mass(b)`.
    /// The identity unless the step brings a mass matrix, which is symmetric and the same everywhere.
    fn mass(&self, x: Tensor<D>) -> Tensor<D> {
        x
    }

    /// Rules and handlers of the custom operations in these graphs: by default of those of [`operators`].
    fn extensions(&self) -> linearize::Extensions {
        operators::extensions()
    }

    /// Whether Hessian-vector products may be computed in single precision.
    fn allows_single_precision(&self) -> bool {
        false
    }

    /// Says how accurate derivatives of the step have to be; a step that solves systems adapts its tolerances.
    fn set_accuracy(&self, _accuracy: &Accuracy) {}

    /// The failure behind values that are not finite, if the step had one since the last call.
    fn failure(&self) -> Option<StepFailure> {
        None
    }

    /// Refuses a grid or scales that do not fit it.
    ///
    /// # Errors
    /// With the numbers that differ.
    fn check(&self, _scales: &StepScales) -> Result<(), StepFailure> {
        Ok(())
    }

    /// The values near -1 and 1 that it keeps, `v[z] = z`.
    fn phase_values(&self) -> [f64; 2] {
        [-1.0, 1.0]
    }

    /// The side in cells of the [bricks](geometry::Bricks) on which it can work, if it can: a power of two from 8 on, no less than
    /// it reaches.
    fn brick_side(&self) -> Option<usize> {
        None
    }

    /// The same step for values stored at these nodes, whose spacing is that of its own: on bricks, or on a whole grid of another size.
    /// A step on bricks can be put on others, too.
    ///
    /// # Errors
    /// [`Error::WholeGridOnly`] unless the step says how.
    fn on(&self, _nodes: &Nodes<D>) -> Result<Arc<dyn MeanCurvatureStep<D>>, StepFailure> {
        let step = self.identity().name;
        Err(Box::new(Error::WholeGridOnly { step }))
    }

    /// The same step on the grid of half as many cells, where minimizations may begin, if there is one. `factors` are those of the flow;
    /// [`Factors::PAPER`] stay as they are.
    ///
    /// # Errors
    /// If that step cannot be made.
    fn coarser(&self, _factors: Factors) -> Result<Option<Coarser<D>>, StepFailure> {
        Ok(None)
    }

    /// Approximate inverses of the energy's Hessian where `u` is constant, one for every stiffness `c`: on the whole grid
    /// `1 / (m (1 + c |1 - J|^2))` in Fourier space. By default `J` and `m` are [measured](crate::measured).
    ///
    /// # Errors
    /// [`Error::NoResponse`], or what the step itself raises.
    fn phase_inverses(
        &self,
        nodes: &Nodes<D>,
        device: &ComputeDevice,
    ) -> Result<PhaseInverses<D>, StepFailure> {
        Ok(measured::phase_inverses(&self, nodes, device)?)
    }

    /// What the step makes of the Willmore energy; by default [measured](crate::measured).
    ///
    /// # Errors
    /// [`Error::Calibration`] if the step has no flat interface at rest, [`Error::BoxTooSmall`], or what the step itself raises.
    fn calibrate(
        &self,
        scales: &StepScales,
        device: &ComputeDevice,
    ) -> Result<Calibration, StepFailure> {
        Ok(measured::calibrate(&self, scales, device)?)
    }
}

/// A reference to a step is one, so that a default of the trait, whose step may have no size known here, can hand it on as `dyn`.
/// Every method is passed on: a default among them would be compiled for references to references without end.
impl<const D: usize, S: MeanCurvatureStep<D> + ?Sized> MeanCurvatureStep<D> for &S {
    fn apply(&self, u: Tensor<D>) -> Tensor<D> {
        (**self).apply(u)
    }

    fn identity(&self) -> Identity {
        (**self).identity()
    }

    fn mass(&self, x: Tensor<D>) -> Tensor<D> {
        (**self).mass(x)
    }

    fn extensions(&self) -> linearize::Extensions {
        (**self).extensions()
    }

    fn allows_single_precision(&self) -> bool {
        (**self).allows_single_precision()
    }

    fn set_accuracy(&self, accuracy: &Accuracy) {
        (**self).set_accuracy(accuracy);
    }

    fn failure(&self) -> Option<StepFailure> {
        (**self).failure()
    }

    fn check(&self, scales: &StepScales) -> Result<(), StepFailure> {
        (**self).check(scales)
    }

    fn phase_values(&self) -> [f64; 2] {
        (**self).phase_values()
    }

    fn brick_side(&self) -> Option<usize> {
        (**self).brick_side()
    }

    fn on(&self, nodes: &Nodes<D>) -> Result<Arc<dyn MeanCurvatureStep<D>>, StepFailure> {
        (**self).on(nodes)
    }

    fn coarser(&self, factors: Factors) -> Result<Option<Coarser<D>>, StepFailure> {
        (**self).coarser(factors)
    }

    fn phase_inverses(
        &self,
        nodes: &Nodes<D>,
        device: &ComputeDevice,
    ) -> Result<PhaseInverses<D>, StepFailure> {
        (**self).phase_inverses(nodes, device)
    }

    fn calibrate(
        &self,
        scales: &StepScales,
        device: &ComputeDevice,
    ) -> Result<Calibration, StepFailure> {
        (**self).calibrate(scales, device)
    }
}

/// The name of something that a result depends on, and its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// What it is, in words that messages can use.
    pub name: String,
    /// All that tells it from others of this name.
    pub parameters: Value,
}

impl Identity {
    /// A name and parameters.
    pub fn new(name: impl Into<String>, parameters: Value) -> Self {
        Self {
            name: name.into(),
            parameters,
        }
    }
}

/// What the outer iteration asks of an inner solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// The stiffness `c`: the factor by which the energy magnifies errors of the step.
    pub stiffness: f64,
    /// Accuracy of the minimizer, relative to the motion.
    pub tolerance: f64,
    /// Reduction of the residual in the outer linear solves.
    pub cg_tolerance: f64,
}

/// A step on the grid of half as many cells, and the factors of its calibration.
pub struct Coarser<const D: usize> {
    /// The step.
    pub step: Arc<dyn MeanCurvatureStep<D>>,
    /// By which the terms of the energy are divided there.
    pub factors: Factors,
}

/// The scales of a step on a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepScales {
    /// Cells along a side of the periodic box.
    pub cells: usize,
    /// Distance `h` of neighbouring nodes.
    pub spacing: f64,
    /// Interface width `eps`.
    pub eps: f64,
    /// The time `tautilde` that the step takes.
    pub mcf_step: f64,
}

impl StepScales {
    /// Those of a step on this grid.
    pub fn on<const D: usize>(grid: &Grid<D>, eps: f64, mcf_step: f64) -> Self {
        Self {
            cells: grid.cells(),
            spacing: grid.spacing(),
            eps,
            mcf_step,
        }
    }
}
