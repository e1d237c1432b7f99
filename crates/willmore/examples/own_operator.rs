//! A step of mean curvature flow of one's own inside: an explicit step of the Allen-Cahn equation. Its inverse in the pure phases and its calibration are measured.

use std::sync::Arc;

use burn::tensor::Tensor;
use willmore::prelude::*;

/// `v = u + tautilde (Laplace u + 2 a^2 (u - u^3))`, whose profile `tanh(a d)` is that of this project for `a = 3 / (4 eps)`. Made of the operations of a
/// domain, it works on the whole grid and on bricks.
pub struct AllenCahn {
    domain: Domain<2>,
}

impl AllenCahn {
    /// The step for flows with these scales.
    pub fn on(grid: Grid<2>, scales: &Scales, device: &ComputeDevice) -> Self {
        let scales = DomainScales {
            eps: scales.eps,
            mcf_step: scales.mcf_step,
            response: 1.0,
        };
        Self {
            domain: Domain::new(grid.into(), [-1.0, 1.0], scales, device),
        }
    }
}

impl MeanCurvatureStep<2> for AllenCahn {
    fn apply(&self, u: Tensor<2>) -> Tensor<2> {
        let on = self.domain.at(&u.device());
        let a = 0.75 / on.eps();
        let reaction = (u.clone() - u.clone().powi_scalar(3)) * (2.0 * a * a);
        u.clone() + (on.laplacian(&u) + reaction) * on.mcf_step()
    }

    fn identity(&self) -> Identity {
        let (eps, step) = (self.domain.eps(), self.domain.mcf_step());
        Identity::new("Allen-Cahn step", json!({ "eps": eps, "tautilde": step }))
    }

    fn brick_side(&self) -> Option<usize> {
        Some(16)
    }

    fn on(&self, nodes: &Nodes<2>) -> Result<Arc<dyn MeanCurvatureStep<2>>, StepFailure> {
        let domain = self.domain.on(nodes);
        Ok(Arc::new(Self { domain }))
    }
}

/// Flows with the step inside: `eps = 3 h`, and a step that is short enough to be explicit.
///
/// # Errors
/// If no device is compiled in.
pub fn flow() -> Result<Willmore<2>, Box<dyn std::error::Error>> {
    let grid = Grid::per_unit(128, 1.0)?;
    let inner = 0.2 * grid.spacing().powi(2);
    let device = ComputeDevice::default_compiled()?;
    let flow = Willmore::on(grid).eps_over_h(3.0).mcf_step(inner);
    let step = AllenCahn::on(grid, &flow.scales(), &device);
    Ok(flow.operator(step).device(&device))
}

/// Runs the example; a test does, too.
///
/// # Errors
/// Those of the flow.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut flow = flow()?
        .until(Stop::Time(2e-4))
        .start(&Ball::new([0.0; 2], 0.2)?)?;
    while let Some(record) = flow.step()? {
        let time = record.time;
        let radius = (zero_set_volume(&flow.current()) / std::f64::consts::PI).sqrt();
        let exact = exact::willmore_radius(0.2, time, 2);
        println!("t = {time:.2e}: radius {radius:.5}, exact {exact:.5}");
        assert!((radius - exact).abs() < 0.002);
    }
    Ok(())
}
