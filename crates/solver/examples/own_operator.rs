//! Willmore flow with a step of mean curvature flow of one's own: an explicit step of the Allen-Cahn equation.

use burn::tensor::Tensor;
use geometry::{Grid, exact::willmore_radius, phase_field, shapes::Ball};
use mean_curvature::{Identity, MeanCurvatureStep};
use operators::ComputeDevice;
use serde_json::json;
use solver::{FlowParams, Problem, Stepper};

/// `v = u + tautilde (Laplace u + 2 a^2 (u - u^3))`, whose profile `tanh(a d)` is that of this project for `a = 3 / (4 eps)`.
struct AllenCahn {
    spacing: f64,
    step: f64,
    a: f64,
}

/// The values at the next nodes along an axis, periodically; with `back`, at those before.
fn shifted(u: &Tensor<2>, axis: usize, back: bool) -> Tensor<2> {
    let n = u.dims()[axis];
    let at = if back { n - 1 } else { 1 };
    let parts = vec![
        u.clone().narrow(axis, at, n - at),
        u.clone().narrow(axis, 0, at),
    ];
    Tensor::cat(parts, axis)
}

impl MeanCurvatureStep<2> for AllenCahn {
    fn apply(&self, u: Tensor<2>) -> Tensor<2> {
        let neighbours = [(0, false), (0, true), (1, false), (1, true)];
        let sum = neighbours
            .map(|(axis, back)| shifted(&u, axis, back))
            .into_iter();
        let laplacian = sum.reduce(|a, b| a + b).expect("there are four") - u.clone() * 4.0;
        let reaction = u.clone() - u.clone().powi_scalar(3);
        u + laplacian * (self.step / self.spacing.powi(2))
            + reaction * (2.0 * self.step * self.a.powi(2))
    }

    fn extensions(&self) -> linearize::Extensions {
        linearize::Extensions::new()
    }

    fn identity(&self) -> Identity {
        let parameters = json!({ "spacing": self.spacing, "step": self.step, "a": self.a });
        Identity::new("explicit Allen-Cahn", parameters)
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let grid = Grid::<2>::per_unit(128, 1.0)?;
    let params = FlowParams::paper(3.0 * grid.spacing(), 0.2 * grid.spacing().powi(2));
    let own = AllenCahn {
        spacing: grid.spacing(),
        step: params.mcf_step,
        a: 0.75 / params.eps,
    };
    let disc = phase_field(grid, &Ball::<2>::new([0.0, 0.0], 0.2)?, params.eps)?;
    let problem = Problem::new(own, &grid, params, &ComputeDevice::default_compiled()?)?;
    let start = problem.start(&disc)?;
    let mut flow = Stepper::new(problem, start);
    for _ in 0..4 {
        let step = flow.step(2.0_f64.powi(-14))?;
        let radius =
            (geometry::measure::zero_set_volume(&flow.field()?) / std::f64::consts::PI).sqrt();
        let exact = willmore_radius(0.2, step.time, 2);
        println!(
            "t = {:.2e}: radius {radius:.5}, exact {exact:.5}",
            step.time
        );
        assert!((radius - exact).abs() < 0.002);
    }
    Ok(())
}
