//! Truncated, preconditioned conjugate gradients.

use burn::tensor::{DType, Tensor};
use operators::{ComputeDevice, add_scaled, inner_product, scaled, scaled_as};

use crate::Error;

/// The function `1/2 p . H p + g . p` of a motion `p`.
pub(crate) struct Quadratic<'a, const D: usize> {
    pub gradient: &'a Tensor<D>,
    /// `H p`, in its own precision.
    pub product: &'a mut dyn FnMut(&Tensor<D>) -> Result<Tensor<D>, Error>,
    pub dtype: DType,
    /// As [`crate::Objective::unit`].
    pub unit: f64,
}

/// An approximate solution of `H p = -g`.
pub(crate) struct CgSolution<const D: usize> {
    pub direction: Tensor<D>,
    /// `g . p`, negative for a descent direction.
    pub slope: f64,
    pub iterations: usize,
    /// Whether a direction of negative curvature was met; the direction so far (or the first one) is used.
    pub negative_curvature: bool,
}

/// A solution with its residual.
pub(crate) struct Solved<const D: usize> {
    pub solution: CgSolution<D>,
    /// `-g - H p`, in the precision of the products.
    pub residual: Tensor<D>,
}

/// Tolerance and iteration limit of one solve.
#[derive(Clone, Copy)]
pub(crate) struct CgLimits {
    /// Reduction of the residual in the norm of the preconditioner.
    pub tolerance: f64,
    /// The square of that norm below which the residual need not go in any case.
    pub least: f64,
    pub iterations: usize,
}

/// Longest step along a conjugate direction, times the unit of the objective. The preconditioner is below `1 / unit` and the
/// curvature above it where the energy is convex, so steps are near 1 there.
const LONGEST_STEP: f64 = 1e10;

/// The inner product `sum_i a_i b_i`, read back to the host.
pub(crate) fn dot<const D: usize>(
    a: &Tensor<D>,
    b: &Tensor<D>,
    device: &ComputeDevice,
) -> Result<f64, Error> {
    Ok(device.scalar(inner_product(a, b))?)
}

/// Solves `H p = -g` until the residual's norm `sqrt(r . M r)` is reduced, a direction of
/// negative curvature appears (Steihaug), or the limit is reached: the direction is one of descent in any case. Vectors have the precision of the Hessian-vector products.
pub(crate) fn conjugate_gradients<const D: usize>(
    quadratic: Quadratic<'_, D>,
    precondition: &dyn Fn(&Tensor<D>) -> Tensor<D>,
    limits: CgLimits,
    device: &ComputeDevice,
) -> Result<Solved<D>, Error> {
    let Quadratic {
        gradient,
        product,
        dtype,
        unit,
    } = quadratic;
    let mut residual = scaled_as(gradient, -1.0, dtype);
    let z = precondition(&residual);
    let mut rz = dot(&residual, &z, device)?;
    let target = (limits.tolerance * limits.tolerance * rz).max(limits.least);
    let mut direction = z;
    let mut solution: Option<Tensor<D>> = None;
    let mut iterations = 0;
    let mut negative_curvature = false;
    while iterations < limits.iterations {
        let image = product(&direction)?;
        iterations += 1;
        let curvature = dot(&direction, &image, device)?;
        // `rz / curvature` is the step: beyond this length it is rounding noise that made the curvature positive. NaN
        // leaves through the same door; the caller checks the slope.
        if curvature.is_nan() || curvature * LONGEST_STEP <= rz * unit {
            negative_curvature = true;
            break;
        }
        let alpha = rz / curvature;
        solution = Some(match solution {
            Some(p) => add_scaled(p, &direction, alpha),
            None => scaled(&direction, alpha),
        });
        residual = add_scaled(residual, &image, -alpha);
        let z = precondition(&residual);
        let next = dot(&residual, &z, device)?;
        if next.abs() <= target {
            break;
        }
        let beta = next / rz;
        rz = next;
        direction = add_scaled(z, &direction, beta);
    }
    // Negative curvature at once: the preconditioned steepest descent is still a descent direction. It carries the unit of
    // the energy, which conjugate gradients divide out otherwise.
    let direction = solution.unwrap_or_else(|| direction * unit.recip());
    let direction = scaled_as(&direction, 1.0, gradient.dtype());
    let slope = dot(gradient, &direction, device)?;
    let solution = CgSolution {
        direction,
        slope,
        iterations,
        negative_curvature,
    };
    Ok(Solved { solution, residual })
}
