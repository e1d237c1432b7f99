//! Scales of a flow, and settings of the minimization.

use geometry::{Grid, positive, require};
use mean_curvature::Factors;
use model::Ratios;
use serde::{Deserialize, Serialize};

use crate::Error;

/// Scales of a flow.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FlowParams {
    /// Interface width `eps`.
    pub eps: f64,
    /// Inner time step `tautilde` of the mean curvature flow.
    pub mcf_step: f64,
    /// Settings of the minimization.
    pub newton: NewtonParams,
    /// What the energy is divided by, term by term: [`Factors::PAPER`] for the scheme of the paper, those of the step's
    /// calibration for a flow with the speed of Willmore flow. Mean curvature flow does not look at it.
    #[serde(default)]
    pub calibration: Factors,
}

impl FlowParams {
    /// The scheme of the paper with these scales, and the default minimization.
    pub fn paper(eps: f64, mcf_step: f64) -> Self {
        let newton = NewtonParams::default();
        Self {
            eps,
            mcf_step,
            newton,
            calibration: Factors::PAPER,
        }
    }

    /// The network ratios that a grid needs with these scales.
    pub fn ratios<const D: usize>(&self, grid: &Grid<D>, width: usize) -> Ratios {
        Ratios::of_run(D, width, grid.spacing(), self.eps, self.mcf_step)
    }

    pub(crate) fn validate(&self) -> Result<(), Error> {
        self.newton.validate()?;
        for (name, value) in [
            ("eps", self.eps),
            ("tautilde", self.mcf_step),
            ("calibration.energy", self.calibration.energy),
            ("calibration.metric", self.calibration.metric),
        ] {
            positive(name, value)?;
        }
        Ok(())
    }

    /// `c tautilde^2 / eps`: the energy per area or volume that weighs as much as `1/2 (V[u] - u)^2`. A step weighs
    /// this by `tau m / (c tautilde^2)`, and energies by `tau m / eps`.
    pub fn energy_unit(&self) -> f64 {
        self.calibration.energy * self.mcf_step * self.mcf_step / self.eps
    }

    /// `tau m / (c tautilde^2)`, the weight of the curvature against the motion in a time step of size `tau`.
    pub fn stiffness(&self, tau: f64) -> f64 {
        tau / (self.calibration.speed() * self.mcf_step * self.mcf_step)
    }
}

/// Which variant of Newton's method minimizes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NewtonVariant {
    /// Preconditioned Newton-CG with profile-preserving updates and cleanup.
    #[default]
    Preconditioned,
    /// Plain Newton-CG with Armijo line search along straight lines.
    Paper,
}

/// Settings of the minimization.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NewtonParams {
    /// The variant of Newton's method.
    #[serde(rename = "method")]
    pub variant: NewtonVariant,
    /// Stop when the Newton decrement says that the minimizer is nearer than this fraction of the motion
    /// `u - u_k` (root mean squares).
    pub tolerance: f64,
    /// Reduction of the residual in each linear solve, in the norm of the preconditioner.
    pub cg_tolerance: f64,
    /// Linear solves end sooner where the residual says that they are nearer to their solution than this fraction of the motion.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub linear_accuracy: Option<f64>,
    /// Limit of linear iterations per Newton step.
    pub cg_iterations: usize,
    /// Limit of Newton steps.
    pub newton_iterations: usize,
    /// Linear iterations of one cleanup.
    pub cleanup_iterations: usize,
    /// Precision of the linear solves.
    pub precision: Precision,
}

impl Default for NewtonParams {
    fn default() -> Self {
        Self {
            variant: NewtonVariant::Preconditioned,
            tolerance: 0.02,
            cg_tolerance: 0.1,
            linear_accuracy: None,
            cg_iterations: 600,
            newton_iterations: 60,
            cleanup_iterations: 4,
            precision: Precision::default(),
        }
    }
}

impl NewtonParams {
    /// For steps of second order, whose minimizations are short and begin near their ends: few linear solves that leave all the same, since
    /// what the minimizations leave enters the [estimated error](crate::StepEstimates), and adds up where steps are long.
    pub fn second_order() -> Self {
        Self {
            tolerance: 0.03,
            cg_tolerance: 0.1,
            linear_accuracy: Some(0.003),
            newton_iterations: 20,
            ..Self::default()
        }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`Error::Geometry`] naming the first bad one.
    pub fn validate(&self) -> Result<(), Error> {
        for (name, value) in [
            ("tolerance", self.tolerance),
            ("cg_tolerance", self.cg_tolerance),
            ("linear_accuracy", self.linear_accuracy.unwrap_or(0.5)),
        ] {
            require(name, value, "between 0 and 1", |v| v > 0.0 && v < 1.0)?;
        }
        for (name, value) in [
            ("cg_iterations", self.cg_iterations),
            ("newton_iterations", self.newton_iterations),
        ] {
            require(name, value as f64, "at least 1", |v| v >= 1.0)?;
        }
        Ok(())
    }
}

/// Precision of the linear solves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// Hessian-vector products and vectors of conjugate gradients in single precision, if the step allows it: half the cost, and
    /// the same iterations. Energies, gradients and phase fields keep the precision of the device.
    #[default]
    Single,
    /// Everything in the precision of the device.
    Device,
}
