//! The gradient of a function of the result of a time step with respect to the phase field before it.
//!
//! The step makes `e(u_0, u) = 1/2 |u - u_0|^2 + ...` stationary, so that `H du = du_0` with its Hessian `H` at the result: the gradient of
//! `J(u)` with respect to `u_0` is `H^-1 grad J`, found by conjugate gradients with Hessian-vector products.

use std::sync::Arc;

use burn::tensor::Tensor;
use geometry::{Grid, phase_field, shapes::Ellipse};
use model::{MeanCurvatureOperator, Ratios, Shipped};
use operators::ComputeDevice;
use solver::{MinimizingMovement, NewtonParams, Objective, minimize};

type Fallible<T> = Result<T, Box<dyn std::error::Error>>;

/// `H x = b` by conjugate gradients, with the Hessian at the point that was evaluated last.
fn solve(
    energy: &mut MinimizingMovement<2>,
    b: Tensor<2>,
    device: &ComputeDevice,
) -> Fallible<Tensor<2>> {
    let dot = |a: &Tensor<2>, b: &Tensor<2>| device.scalar((a.clone() * b.clone()).sum());
    let (mut x, mut residual, mut direction) = (b.zeros_like(), b.clone(), b);
    let mut square = dot(&residual, &residual)?;
    let enough = 1e-20 * square;
    while square > enough {
        let product = energy.hessian_vector_product(&direction)?;
        let length = square / dot(&direction, &product)?;
        x = x + direction.clone() * length;
        residual = residual - product * length;
        let next = dot(&residual, &residual)?;
        direction = residual.clone() + direction * (next / square);
        square = next;
    }
    Ok(x)
}

fn main() -> Fallible<()> {
    let device = ComputeDevice::default_compiled()?;
    let grid = Grid::<2>::per_unit(64, 0.75)?;
    let (eps, mcf_step) = (2.0 * grid.spacing(), grid.spacing().powi(2));
    let network = Shipped::Paper.find(Ratios::of_run(2, 17, grid.spacing(), eps, mcf_step))?;
    let operator = Arc::new(MeanCurvatureOperator::<2>::new(&network, &device)?);
    let mut energy = MinimizingMovement::new(operator, grid.cells(), &device)?;
    let params = NewtonParams {
        tolerance: 1e-8,
        cg_tolerance: 1e-3,
        ..NewtonParams::default()
    };
    // A short step: c = tau / tautilde^2 = 2.
    let step = |energy: &mut MinimizingMovement<2>, start: &Tensor<2>| {
        energy.set(start, 2.0)?;
        minimize(energy, start, start, params, &device).map(|(result, _)| result)
    };

    // J(u) = sum of u^2 over the upper half, of the result of a step from an ellipse.
    let upper = grid.shape()[0] / 2;
    let ones = Tensor::<2>::ones([upper, 2 * upper], (device.device(), device.dtype()));
    let mask = Tensor::cat(vec![ones.zeros_like(), ones], 0);
    let j = |u: &Tensor<2>| device.scalar((u.clone().powi_scalar(2) * mask.clone()).sum());
    let ellipse = phase_field(grid, &Ellipse::new([0.2, 0.15])?, eps)?;
    let start = device.tensor::<2>(ellipse.values(), grid.shape());
    let result = step(&mut energy, &start)?;
    energy.evaluate(&result)?;
    let gradient = solve(&mut energy, result.clone() * mask.clone() * 2.0, &device)?;

    // Against a difference quotient along a bump.
    let bump = start.clone().powi_scalar(2).neg() + 1.0;
    let slope = device.scalar((gradient * bump.clone()).sum())?;
    let width = 1e-3;
    let [forth, back] =
        [width, -width].map(|d| step(&mut energy, &(start.clone() + bump.clone() * d)));
    let quotient = (j(&forth?)? - j(&back?)?) / (2.0 * width);
    println!("dJ along the bump: {slope:.6} by the adjoint, {quotient:.6} by differences");
    assert!((slope / quotient - 1.0).abs() < 1e-3);
    Ok(())
}
